//! Every pulse and direction edge of a run against its samples.

use boards::{Axis, Level, SKR_PRO, STM32F405};

use super::emulated::{CYCLES_US, Emulated, Ended, Job, PERIOD, sim};

/// A step pulse: cycles of its edges, and the level of the direction pin during it.
struct Pulse {
    rise: u64,
    fall: u64,
    direction: bool,
}

fn pulses(ended: &Ended, axis: Axis) -> Vec<Pulse> {
    let lines = ended.board.axis(axis);
    let (steps, turns) = (ended.changes(&lines.step), ended.changes(&lines.direction));
    let mut turn = 0;
    let mut found = Vec::new();
    for pair in steps.windows(2).filter(|pair| pair[0].1 == Some(true)) {
        let (rise, fall) = (pair[0].0, pair[1].0);
        while turn + 1 < turns.len() && turns[turn + 1].0 <= rise {
            turn += 1;
        }
        let direction = turns[turn].1.expect("the direction pin is an output");
        assert!(
            turns.get(turn + 1).is_none_or(|next| next.0 >= fall),
            "{axis:?}: the direction changes within a pulse"
        );
        found.push(Pulse {
            rise,
            fall,
            direction,
        });
    }
    found
}

/// Samples of a job, nm.
fn samples(job: &Job) -> Vec<[i64; 3]> {
    let trace = job.path.with_file_name("trace.csv");
    let (done, said) = sim([
        "simulate",
        job.path.to_str().unwrap(),
        "--trace",
        trace.to_str().unwrap(),
    ]);
    assert!(done, "{said}");
    let text = std::fs::read_to_string(trace).unwrap();
    let mut lines = text.lines();
    let names: Vec<_> = lines.next().unwrap().split(',').collect();
    let columns = ["cl_x_nm", "cl_y_nm", "cl_z_nm"]
        .map(|wanted| names.iter().position(|name| *name == wanted).unwrap());
    let row = |line: &str| {
        let cells: Vec<_> = line.split(',').collect();
        columns.map(|column| cells[column].parse().unwrap())
    };
    lines.map(row).collect()
}

/// Every pulse and direction edge of a run at up to 500 kHz against the samples: after each period the position in steps is that of the sample,
/// within one step, and within half a step at the end. For motion towards plus, a direction pin has the level of the board's table, or the
/// opposite one where the job inverts it.
#[test]
fn pulses_are_the_samples_up_to_500_khz() {
    const STEPS_MM: [i64; 3] = [5000, 400, 640];
    const INVERTED: [bool; 3] = [false, true, false];
    const PULSE_US: u64 = 1;
    const SETUP_US: u64 = 5;
    let job = Job::square(
        40.0,
        6000.0,
        "velocity_max_mm_s = [100, 100, 50]\nacceleration_max_mm_s2 = [2000, 1000, 500]\njerk_max_mm_s3 = [100000, 20000, 10000]\n\
         steps_per_mm = [5000, 400, \"3200/5\"]\npulse_us = 1\ndirection_setup_us = 5\ndirection_inverted = [false, true, false]\n",
    );
    let samples = samples(&job);
    for board in [&STM32F405, &SKR_PRO] {
        let emulated = Emulated::recorded(board, &["--seed", "5"]);
        let (done, said) = emulated.run(&job.path, "0,0,60");
        let ended = emulated.end();
        assert!(done, "{said}");
        ended.no_complaint();
        ended.no_byte_lost();
        let of_axes = Axis::ALL.map(|axis| pulses(&ended, axis));
        let first = of_axes
            .iter()
            .filter_map(|pulses| Some(pulses.first()?.rise))
            .min()
            .unwrap();
        let begin = ended.number("slots_from_cycle");
        let mut shortest = u64::MAX;
        for (axis, pulses) in Axis::ALL.into_iter().zip(&of_axes) {
            let line = board.axis(axis);
            for pulse in pulses {
                assert!(
                    pulse.fall - pulse.rise >= PULSE_US * CYCLES_US,
                    "{axis:?}: a pulse of {} cycles",
                    pulse.fall - pulse.rise
                );
            }
            for pair in pulses.windows(2) {
                assert!(
                    pair[1].rise - pair[0].fall >= PULSE_US * CYCLES_US,
                    "{axis:?}: a pause"
                );
                shortest = shortest.min(pair[1].rise - pair[0].rise);
            }
            for (at, _) in ended
                .changes(&line.direction)
                .into_iter()
                .filter(|(at, _)| *at > begin)
            {
                let next = pulses.partition_point(|pulse| pulse.rise < at);
                assert!(
                    pulses
                        .get(next)
                        .is_none_or(|pulse| pulse.rise - at >= SETUP_US * CYCLES_US),
                    "{axis:?}: set-up"
                );
            }
        }
        assert_eq!(shortest, 2 * CYCLES_US, "500 kHz are reached");
        // A sample's steps are emitted a constant number of periods after the sample. The shift with the least error is chosen, and it
        // must hold for all axes.
        let plus = |axis: Axis| (board.axis(axis).direction.active == Level::High) != INVERTED[axis as usize];
        // Position after each pulse.
        let positions = Axis::ALL.map(|axis| {
            let step = |pulse: &Pulse| if pulse.direction == plus(axis) { 1 } else { -1 };
            let steps = of_axes[axis as usize].iter().map(step);
            let sum = |position: &mut i64, step: i64| {
                *position += step;
                Some(*position)
            };
            steps.scan(0, sum).collect::<Vec<i64>>()
        });
        let taken = |axis: Axis, until: u64| -> i64 {
            let count = of_axes[axis as usize].partition_point(|pulse| pulse.rise < until);
            count
                .checked_sub(1)
                .map_or(0, |last| positions[axis as usize][last])
        };
        let steps_nm = |axis: Axis, tick: usize| {
            (samples[tick][axis as usize] - samples[0][axis as usize]) * STEPS_MM[axis as usize]
        };
        let first_period = (first - begin) / PERIOD;
        let first_moved = (0..samples.len())
            .find(|tick| {
                Axis::ALL
                    .iter()
                    .any(|axis| steps_nm(*axis, *tick).abs() > 500_000)
            })
            .unwrap() as u64;
        let worst = |shift: u64| {
            let mut worst = 0;
            for tick in (first_moved as usize..samples.len())
                .step_by(7)
                .chain([samples.len() - 1])
            {
                let until = begin + (first_period + 1 + tick as u64 + shift - first_moved) * PERIOD;
                for axis in Axis::ALL {
                    worst = worst.max((taken(axis, until) * 1_000_000 - steps_nm(axis, tick)).abs());
                }
            }
            worst
        };
        let (off, shift) = (0..3).map(|shift| (worst(shift), shift)).min().unwrap();
        println!(
            "{}: {off} millionths of a step, shift {shift}; {} pulses",
            board.id,
            of_axes.iter().map(Vec::len).sum::<usize>()
        );
        assert!(
            off <= 1_000_000,
            "{}: {off} millionths of a step off, with a shift of {shift}",
            board.id
        );
        for axis in Axis::ALL {
            let left = (taken(axis, u64::MAX) * 1_000_000 - steps_nm(axis, samples.len() - 1)).abs();
            assert!(
                left <= 510_000,
                "{axis:?}: {left} millionths of a step at the end"
            );
        }
    }
}
