//! Explanations of all faults of the core.

use interp_core::FaultKind;

use super::{Entry, Family};

/// The explanation of a fault. The exhaustive match guarantees that every fault has one.
pub(super) fn entry(kind: FaultKind) -> Entry {
    let [meaning, value, why, remedy, example] = words(kind);
    Entry {
        family: Family::Fault,
        code: kind.code(),
        name: kind.name(),
        meaning,
        value,
        why,
        remedy,
        example,
    }
}

/// Meaning, value, cause, remedy, example.
fn words(kind: FaultKind) -> [&'static str; 5] {
    match kind {
        FaultKind::BallDoesNotFit => [
            "The ball does not fit the surface here: it would cut into it (local gouge).",
            "The ball's radius times the surface's principal curvature towards the tool. It must stay below 1.",
            "The surface is concave towards the tool, and one of its principal radii of curvature is not larger than the ball's, in any direction to the pass.",
            "Take a smaller ball, or machine this region with another tool. If the tool is on the wrong side of the surface, change `side`.",
            "jobs/torus.toml is a groove of 8 mm radius. With `radius_mm = 9` in [tool] the fault comes at its first sample, with the value 1.125 = 9/8.",
        ],
        FaultKind::DegenerateSurface => [
            "The surface has no normal here, or folds over, so that the tool would change to the other side; or its tangent plane jumps, so that the tool centre would.",
            "The sine of the angle between the surface's two parameter directions, |S_u x S_v| / (|S_u| |S_v|); 0 where it folds between two samples, and where the tangent plane jumps.",
            "The two parameter lines are tangent to each other, or one derivative vanishes where the boundary is not exactly one point; or the normal turned by more than 120 degrees from one sample to the next; or, with axis limits, a pass crosses a knot where the surface has an edge (a crease).",
            "End the surface before this point, or reparametrise the surface. A boundary that is exactly one point, like the pole of a sphere, is allowed. Where the tangent plane jumps, cut the surface into two faces at the knot.",
            "A bicubic patch with a corner pole on the line through the two adjacent poles: S_u and S_v are parallel there.",
        ],
        FaultKind::ParameterBackwards => [
            "The step of the path parameter for one period is inaccurate, or would run backwards.",
            "The ratio of the step's higher-order terms to its first-order term. At -1 and below the step would run backwards.",
            "The speed of the parametrisation changes much within one period's arc: the feed is very high for the size of the surface's features.",
            "Lower the feed or the sampling period, or parametrise the surface more evenly.",
            "jobs/sphere_cap.toml with `along = \"v\"` and `feed_mm_min = 500000`: 8 mm per period on circles around the pole.",
        ],
        FaultKind::OutOfRange => [
            "A tool centre is outside the range of positions.",
            "The coordinate in metres. Positions are nanometres in 32 bits: from -2.147 m to 2.147 m.",
            "The surface is within the range, but the ball's centre, offset by its radius, is not.",
            "Move the part nearer to the origin, for example with `[placement]` and `place = \"centre\"`.",
            "A level surface at z = 2145 mm, with a ball of radius 5 mm above it: the centre would be at 2.150 m.",
        ],
        FaultKind::TooManyPatches => [
            "The surface data of the job exceed the machine's store, or of a streamed job the rows that have to be there at once.",
            "The 32-bit words of the job, or of these rows.",
            "Each span between knots, in u and in v, becomes a patch of 52 words, or 68 if it is rational. More than 309 (237 rational) are streamed, which takes room for three rows, with a region for up to six, beside its words and those of the links.",
            "Use fewer knots, give the other direction with `along`, or cut the part into several jobs.",
            "A surface of 150 x 150 bicubic patches: three rows of 150 are 450 patches, where about 309 fit.",
        ],
        FaultKind::PatchTooShort => [
            "The arc of one period is longer than a whole patch; of a straight pass within axis limits, a patch between two others is shorter than 0.1 um.",
            "The rest of the arc beyond the patch, or the length of the patch, mm.",
            "Knots are closer together than the arc of one period: 0.01 mm at 600 mm/min and 1 ms.",
            "Lower the feed, remove knots with such a small spacing, or give axis limits: within them a straight pass is slow over short patches.",
            "jobs/freeform.toml at `feed_mm_min = 600000` and `period_us = 2000`: 20 mm per period, longer than its patches.",
        ],
        FaultKind::IntervalTooSmall => [
            "The path interval is so small that the next pass would coincide with this one.",
            "The interval as a fraction of a patch.",
            "The scallop height limit or the ball is tiny relative to the surface, or the side parameter has an extreme speed at a point of the pass.",
            "Take a larger scallop height or a larger ball, or parametrise the surface more evenly across the passes.",
            "The job of `cargo sim new`, 60 mm wide, with `along = \"u\"`, `radius_mm = 0.000001` and `scallop_mm = 1e-12`: an interval of 4e-11 of the patch.",
        ],
        FaultKind::BadHeader => [
            "A value in the job's header is not finite or out of its range.",
            "The value.",
            "The host checks the same ranges and names the line of the job file; a header that the core refuses therefore comes from other software, or is damaged.",
            "See the ranges in the comments of `cargo sim new`: ball radius up to 1000 mm, feed up to 600000 mm/min, scallop height below the ball's radius, period 10 to 100000 us.",
            "An upload with a feed of 0 by a custom host.",
        ],
        FaultKind::BadPatch => [
            "A patch's coefficients are outside the range in which its polynomials cannot overflow, its weights vary more than 4 : 1, or a boundary that is flagged as a point is not a point. Or the edges of the region are not in order, lie outside of the surface, are not closed, or are too many on one line.",
            "The index of the patch, or after the patches of eight edges of the region; in a run the pass before the line that meets too many edges.",
            "The host scales every patch so that it passes the same check; a patch that the core refuses therefore comes from other software, or from a defect of the host tool.",
            "If the job came from `cargo sim`, please report it.",
            "An upload by a custom host, with coefficients near 2^31.",
        ],
        FaultKind::BadLength => [
            "The job's data are incomplete, or their length does not agree with the header.",
            "The wrong number of words, or the wrong offset.",
            "The upload was interrupted, or the spans in the header differ from those of the data.",
            "Load the job again.",
            "A header of 2 x 3 patches with the words of five.",
        ],
        FaultKind::WrongState => [
            "The machine's state does not allow the request.",
            "The code of the state: see `State` in the documentation of `interp-core`.",
            "A job was loaded while another one runs, or a run started without a job.",
            "Abort the run first, or wait for its end.",
            "A second host that uploads while the first one's job runs.",
        ],
        FaultKind::DeadlineMissed => [
            "The sample timer ticked before the previous tick, or the planning that follows it, was complete. The tool decelerates along its path to standstill.",
            "The number of missed deadlines.",
            "The processor was blocked for a whole period: by a debugger's breakpoint, or a defect of the firmware. The worst-case tick takes 4 % of the period, the planning 22 %.",
            "Run without a debugger. If the fault recurs, please report the job with the firmware's log (`cargo sim run` reports the tick).",
            "A breakpoint in the firmware while a job runs on the board's own clock.",
        ],
        FaultKind::TickOverBudget => [
            "A tick took more than a fifth of the period. The tool decelerates along its path to standstill.",
            "The processor cycles of the tick.",
            "The worst-case tick found takes 4.0 % of the period (13.8 % where it is a fault already), and the pulses of three axes at 400 kHz add 9 %. Either the search did not find this case, or other interrupts took the rest.",
            "Please report the job; a lower feed makes the costliest ticks rarer. `cargo sim budget JOB` counts the cycles of each stage.",
            "An interrupt handler of 40000 cycles with a higher priority than the sample task.",
        ],
        FaultKind::StepRate => [
            "The demanded steps of an axis exceed the capacity of a period. The tool decelerates along its path to standstill; the excess steps follow later, and none is lost.",
            "The steps demanded in the period.",
            "The axis is too fast for its steps per mm: a period of 1000 slots has a capacity of 500 steps with pulses of one slot, 500 / n with pulses of n slots.",
            "Lower the feed or the axis's velocity limit, set the drive to coarser microsteps (and `steps_per_mm` with it), or take a shorter `pulse_us`.",
            "`steps_per_mm = [40000, 40000, 40000]` in [machine] with a feed of 900 mm/min: 600 steps in a millisecond.",
        ],
        FaultKind::StepOutput => [
            "The board could not output its step pulses in time. The tool decelerates along its path to standstill; its position is lost, and the machine must be homed.",
            "The slots (us at a period of 1000) that had passed when the direction pins were set, if that was too late; 0 if the DMA has stopped.",
            "The processor was blocked for 16 us or more at the beginning of a period in which an axis reverses, or the DMA had a bus error: a defect of the firmware, or a debugger.",
            "Run without a debugger. If the fault recurs, please report the job with the firmware's log.",
            "An interrupt handler of 20 us with a higher priority than the sample task.",
        ],
        FaultKind::SoftLimit => [
            "An axis would leave its travel. The tool has not moved there: each pass and each leg of a link is checked before it begins.",
            "The distance of the tool centre outside the travel, mm.",
            "The part is too near the end of an axis, or `travel_mm` in [machine] is not that of the machine.",
            "Move the part with `[placement]`, or correct `travel_mm`.",
            "jobs/plate.toml with `travel_mm = [[0, 50], [0, 100], [0, 100]]`: the plate is 80 mm long.",
        ],
        FaultKind::LinkBlocked => [
            "The tool cannot move between passes clear of the surface.",
            "The distance of the tool centre above the safe height, mm; 0 where the surface does not face up.",
            "With the pattern `zig`, and at start and end of every job, the tool leaves the surface straight up. It can do so only where the surface faces up, and only if the safe height is above all of it.",
            "Turn the part so that it faces up (`[placement]`), or raise `safe_z_mm` in [machine].",
            "A cylinder that is machined around its axis by more than half a turn: a pass ends on its underside.",
        ],
        FaultKind::EmergencyStop => [
            "The emergency stop is pressed, or was pressed and has not been acknowledged. The drives were disabled in that tick, so the tool stopped without control, and the home position is lost.",
            "1, the input's bit.",
            "The button was pressed, or its wire is broken: boards read an open circuit as pressed.",
            "Make the machine safe and release the button. Then `cargo sim operate --port DEV acknowledge`, `on`, and `home`; a machine without switches: place the axes, and `home X,Y,Z`.",
            "The button, pressed while a job runs.",
        ],
        FaultKind::LimitSwitch => [
            "An axis reached the end of its travel. The tool decelerated along its path; the position remains valid.",
            "The limit switches, as bits: x- 2, x+ 4, y- 8, y+ 16, z- 32, z+ 64.",
            "The job does not fit the travel from the declared home position, or a switch or its wire is defective.",
            "Jog the axis off its switch, from x- by `cargo sim operate --port DEV jog x+2`. A board without a machine profile: `off`, move the axis by hand, `on`, and declare home again. Compare `machine.travel_mm` with the machine.",
            "Home declared at the wrong end of x.",
        ],
        FaultKind::DriveFault => [
            "A drive reports a fault, or reported one that has not been acknowledged. All drives were disabled in that tick, and the home position is lost.",
            "The drive faults, as bits: x 128, y 256, z 512, one for all 1024.",
            "Overload, overtemperature, undervoltage, or a motor's wire; see the drive's own display.",
            "Find the cause at the drive. Then `cargo sim operate --port DEV acknowledge`, `on`, and `home`; a machine without switches: place the axes, and `home X,Y,Z`.",
            "A servo drive whose following error is too large.",
        ],
        FaultKind::NotHomed => [
            "The machine is not homed: the position of its axes is unknown, so no run starts.",
            "0.",
            "Home has not been declared since power-up, since the drives were off, or since an emergency stop or a drive fault.",
            "`cargo sim operate --port DEV on`, then `home`; a machine without switches: position the axes and declare where they stand, in mm: `home X,Y,Z`, or `cargo sim run JOB --port DEV --home X,Y,Z`. For a board without axes: `homing_required = false` in [machine].",
            "`cargo sim run JOB --port DEV` right after power-up.",
        ],
        FaultKind::SpindleSpeed => [
            "The spindle's contact did not report its speed within `at_speed_ms`. The spindle is off; the tool has not moved, or is held where the pause left it, and the run is over.",
            "The speed ordered, turns a minute.",
            "The drive needs longer, reports a fault of its own, or the contact's wire is broken.",
            "Look at the drive. Measure the time to the highest speed, and set `at_speed_ms` in [spindle] of the profile above it. `cargo sim operate --port DEV abort` acknowledges; then run again, or `run --resume`.",
            "A spindle whose drive was not switched on.",
        ],
        FaultKind::DoorOpen => [
            "The safety door is open, so no run starts or resumes and the spindle stays off.",
            "4096, the input's bit.",
            "The door is open, or the wire of its contact is broken; or the profile names the wrong contact in [door].",
            "Close the door: `cargo sim operate --port DEV status` no longer names it. Then `resume`, or start again.",
            "`resume` while the door, whose opening paused the run, is still open.",
        ],
    }
}
