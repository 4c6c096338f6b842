//! The images for the boards, unchanged, on models of their chip (`host-sim/chip`): from the reset to the last pulse, with `cargo sim run` at the
//! other end of a pseudo-terminal. Needs Debian's `libunicorn2`; builds the images, the program that executes them and the tool.
//!
//! All times are the chip's own: on a busy machine these tests take longer, and their figures stay the same. `BLESS=1` rewrites the golden
//! files.

mod attached;
mod card;
mod disturbed;
mod emulated;
mod guide;
mod jobs;
mod levels;
mod machine;
mod power;
mod pulses;
mod settings;

use std::path::Path;

use boards::{Board, SKR_PRO, STM32F405};

use emulated::{CYCLES_US, Emulated, Job, PERIOD, RESET_CYCLES_US, REST_US, sim, workspace};

#[test]
fn the_images_boot_as_their_registers_say() {
    for board in [&STM32F405, &SKR_PRO] {
        let ended = Emulated::recorded(board, &["--ms", "80"]).wait();
        ended.no_complaint();
        assert_eq!(ended.report["hclk_hz"], 168e6);
        assert!(ended.number("periods") > 50 && ended.report["watchdog_gap_max_ms"].as_f64().unwrap() < 1.01);
        let rest = ended.rest_after(0, REST_US * RESET_CYCLES_US);
        assert!(rest > 0, "the outputs were set");
        let lines: Vec<_> = ended.report["registers"]
            .as_array()
            .unwrap()
            .iter()
            .map(|line| line.as_str().unwrap())
            .collect();
        let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("golden/chip_{}.txt", board.id));
        let text = lines.join("\n") + "\n";
        if std::env::var_os("BLESS").is_some() {
            std::fs::write(&golden, &text).unwrap();
        }
        assert_eq!(
            text,
            std::fs::read_to_string(&golden).unwrap(),
            "{}: BLESS=1 writes it",
            board.id
        );
    }
}

/// The stack bound derived from each image fits into the RAM that is left: the images have drivers that the one for QEMU has not.
#[test]
fn the_stack_fits() {
    for board in [&STM32F405, &SKR_PRO] {
        let image = emulated::image(board);
        let analysis = cycles::graph::analyse(&image).unwrap();
        assert_eq!(analysis.unresolved, [""; 0], "not followed");
        let room = cycles::image::sizes(&image).unwrap().stack_room;
        let needed = u64::from(analysis.stack_bytes());
        println!("{}: {needed} of {room} bytes of stack", board.id);
        assert!(needed < room, "{needed} of {room}: {:?}", analysis.contexts);
    }
}

#[test]
fn without_a_crystal_everything_stays_at_rest() {
    let ended = Emulated::recorded(&SKR_PRO, &["--ms", "200", "--no-crystal"]).wait();
    ended.no_complaint();
    assert_eq!(
        (ended.report["hclk_hz"].as_f64(), ended.number("periods")),
        (Some(16e6), 0)
    );
    ended.rest_after(0, REST_US * RESET_CYCLES_US);
    let changed = ended
        .edges
        .iter()
        .filter(|edge| edge.at > REST_US * RESET_CYCLES_US)
        .count();
    assert_eq!(changed, 0);
}

/// Runs a sample job over the line: every sample equal to the host's, no byte lost, no tick late.
fn runs(board: &'static Board, name: &str, changes: &[(&str, &str)], home: &str, seed: &str) {
    let emulated = Emulated::start(board, &["--seed", seed]);
    // A job without limits is for a bench without axes.
    let bench = [("[cut]", "[machine]\nhoming_required = false\n\n[cut]")];
    let bench: &[_] = if name == "torus.toml" { &bench } else { &[] };
    let job = Job::sample(name, &[bench, changes].concat());
    let (done, said) = emulated.run(&job.path, home);
    let ended = emulated.end();
    assert!(
        done && said.contains("bit for bit the same"),
        "{said}\n{:#}",
        ended.report["notes"]
    );
    ended.no_complaint();
    ended.no_byte_lost();
    assert_eq!(ended.number("resets"), 0);
    let (tick, receive) = (&ended.report["tim2"], &ended.report["usart1"]);
    println!(
        "{}, {name}: {tick}; {receive}; {}; {} cycles",
        board.id, ended.report["exti0"], ended.report["byte_wait_max_cycles"]
    );
    // Only the receive interrupt and a critical section of the idle task delay a tick; the planning is over long before. Before the run that may be the check of
    // a record of the job.
    let latency = |name: &str| tick[name].as_u64().unwrap();
    assert!(latency("latency_moving_max_cycles") < 10 * CYCLES_US, "{tick}");
    assert!(latency("latency_max_cycles") < 50 * CYCLES_US, "{tick}");
    // The planning waits for the tick that pends it, and takes a quarter of the period at most, with the bytes that are received meanwhile.
    let planning = &ended.report["exti0"];
    assert!(planning["count"].as_u64().unwrap() > 100, "{planning}");
    assert!(
        planning["longest_cycles"].as_u64().unwrap() < PERIOD / 4,
        "{planning}"
    );
}

/// One board runs the shorter job whole; the others are in a quarter of their passes: `whole_jobs_on_both_boards` runs all of both.
const COARSE: [(&str, &str); 2] = [
    ("scallop_mm = 0.005 ", "scallop_mm = 0.08 "),
    ("scallop_mm = 0.05 ", "scallop_mm = 0.8 "),
];

#[test]
fn torus_on_the_stm32f405() {
    runs(&STM32F405, "torus.toml", &[], "0,0,60", "1");
}

#[test]
fn coarse_torus_on_the_skr_pro() {
    runs(&SKR_PRO, "torus.toml", &COARSE[..1], "0,0,60", "2");
}

#[test]
fn coarse_plate_machine_on_the_stm32f405() {
    runs(&STM32F405, "plate_machine.toml", &COARSE[1..], "40,30,40", "3");
}

#[test]
fn coarse_plate_machine_on_the_skr_pro() {
    runs(&SKR_PRO, "plate_machine.toml", &COARSE[1..], "40,30,40", "4");
}

#[test]
#[ignore = "half a minute on each image"]
fn whole_jobs_on_both_boards() {
    runs(&SKR_PRO, "torus.toml", &[], "0,0,60", "2");
    runs(&STM32F405, "plate_machine.toml", &[], "40,30,40", "3");
    runs(&SKR_PRO, "plate_machine.toml", &[], "40,30,40", "4");
}

/// The operator's script in lockstep, with a coarser plate and a quarter of the ticks; `the_whole_script` runs it unchanged.
#[test]
fn the_operators_script() {
    let job = Job::sample("plate_machine.toml", &[("scallop_mm = 0.05 ", "scallop_mm = 2 ")]);
    let text = std::fs::read_to_string(workspace().join("jobs/operator.txt")).unwrap();
    let faster: Vec<_> = text
        .lines()
        .map(
            |line| match line.strip_prefix("tick ").and_then(|rest| rest.split_once(':')) {
                Some((tick, action)) => format!("tick {}:{action}", tick.parse::<u32>().unwrap() / 4),
                None => line.to_owned(),
            },
        )
        .collect();
    let script = job.path.with_file_name("script.txt");
    std::fs::write(&script, faster.join("\n")).unwrap();
    scripted("stm32f405", &job, &script);
}

#[test]
#[ignore = "half a minute on each image"]
fn the_whole_script() {
    let job = Job::sample("plate_machine.toml", &[]);
    for board in ["stm32f405", "skr-pro"] {
        scripted(board, &job, &workspace().join("jobs/operator.txt"));
    }
}

fn scripted(board: &str, job: &Job, script: &Path) {
    let (done, said) = sim([
        "run",
        job.path.to_str().unwrap(),
        "--chip",
        board,
        "--fast",
        "--script",
        script.to_str().unwrap(),
    ]);
    assert!(done && said.contains("the same"), "{said}");
}
