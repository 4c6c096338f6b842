/* The interpolator for C; link with libc_api.a, and on Linux with -lpthread -ldl -lm. See c_api.rs. */
#ifndef ISOFEED_H
#define ISOFEED_H

#include <stddef.h>
#include <stdint.h>

typedef struct isofeed isofeed;

typedef struct {
    uint16_t path_spans, side_spans;
    float ball_radius_mm, feed_mm_s, scallop_mm, period_s;
} isofeed_header;

typedef struct {
    uint32_t tick, pass, state;
    float feed_mm_s;
    int32_t cc_nm[3], cl_nm[3];
} isofeed_sample;

enum { ISOFEED_NONE, ISOFEED_START, ISOFEED_HOLD, ISOFEED_RESUME, ISOFEED_ABORT, ISOFEED_STOP, ISOFEED_PAUSE };
enum {
    ISOFEED_IDLE, ISOFEED_READY, ISOFEED_RUNNING, ISOFEED_HOLDING, ISOFEED_HELD,
    ISOFEED_STOPPING, ISOFEED_FINISHED, ISOFEED_FAULTED, ISOFEED_LINKING
};
enum { ISOFEED_PATCH_WORDS = 52 };

isofeed *isofeed_new(void);
void isofeed_free(isofeed *machine);
/* All of these: 0 on success, a fault's code above 0, -1 for a wrong argument. */
int32_t isofeed_patch(const double coefficients[3][4][4], int32_t words[ISOFEED_PATCH_WORDS]);
int32_t isofeed_load(isofeed *machine, const isofeed_header *header, const int32_t *words, size_t count);
int32_t isofeed_tick(isofeed *machine, uint8_t command, uint8_t override_percent, isofeed_sample *sample);
/* Once after each tick and before the next: 1 where there was something to plan, 0 where not, -1 for a wrong argument. */
int32_t isofeed_plan(isofeed *machine);

#endif
