/* The job of job.rs, from C. */
#include "c_api.h"

#include <stdio.h>
#include <string.h>

int main(void) {
    static const double dome[3][4][4] = {
        {{-40.0}, {80.0}},
        {{-30.0, 60.0}},
        {{-5.0, 36.0, -36.0}, {64.0}, {-64.0}},
    };
    const isofeed_header header = {1, 1, 5.0f, 20.0f, 0.01f, 0.001f};
    const float width = 1.0f; /* one span each way, as wide as the parameter's range */
    int32_t words[2 + ISOFEED_PATCH_WORDS];
    isofeed_sample sample;
    isofeed *machine = isofeed_new();

    memcpy(&words[0], &width, sizeof width);
    memcpy(&words[1], &width, sizeof width);
    int32_t fault = isofeed_patch(dome, &words[2]);
    if (fault == 0) {
        fault = isofeed_load(machine, &header, words, sizeof words / sizeof words[0]);
    }
    if (fault == 0) {
        fault = isofeed_tick(machine, ISOFEED_START, 100, &sample);
        while (fault == 0 && sample.state == ISOFEED_RUNNING) {
            isofeed_plan(machine);
            fault = isofeed_tick(machine, ISOFEED_NONE, 100, &sample);
        }
    }
    isofeed_free(machine);
    if (fault != 0) {
        fprintf(stderr, "fault %d\n", (int)fault);
        return 1;
    }
    printf("%u passes, %u samples, %s\n", (unsigned)sample.pass + 1, (unsigned)sample.tick + 1,
           sample.state == ISOFEED_FINISHED ? "finished" : "not finished");
    return 0;
}
