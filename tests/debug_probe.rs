//! The parts of flashing and logging that need no probe: images, decoding of the log, messages if no probe is connected. Builds
//! the probe program, which takes minutes the first time.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use boards::{SKR_PRO, STM32F405};
use cycles::image::chip;
use host_sim::probe::{Event, Image, Line, ProbeError, Problem, Program, Request, Target};
use integration_tests::{dome, upload};
use machine::remote::Session;
use machine::remote::qemu::Qemu;

use crate::images;

/// A selector that matches no probe, so that probes connected to the test host are not used.
const NOWHERE: &str = "0000:0000:nowhere";

fn program() -> &'static Program {
    static PROGRAM: OnceLock<Program> = OnceLock::new();
    PROGRAM.get_or_init(|| Program::find().unwrap())
}

fn chip_image() -> &'static Path {
    static IMAGE: OnceLock<PathBuf> = OnceLock::new();
    IMAGE.get_or_init(|| chip().unwrap())
}

/// The image as a binary by `objcopy`, from the first byte of flash on.
fn flat(image: &Path) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let binary = folder.path().join("image.bin");
    let made = Command::new("arm-none-eabi-objcopy")
        .args(["-O", "binary"])
        .args([image, &binary])
        .status()
        .unwrap();
    assert!(made.success());
    std::fs::read(binary).unwrap()
}

#[test]
fn the_image_for_the_chip_is_what_binutils_makes_of_it() {
    let path = chip_image();
    let image = Image::load(path).unwrap();
    assert_eq!(image.board.as_deref(), Some(STM32F405.id));
    assert!(
        image
            .rtt
            .is_some_and(|at| (0x2000_0000..0x2002_0000).contains(&at))
    );
    image.check_for(&STM32F405).unwrap();
    assert!(image.check_for(&SKR_PRO).unwrap_err().contains("stm32f405"));
    let flat = flat(path);
    assert_eq!(image.reach_bytes(), Ok(u32::try_from(flat.len()).unwrap()));
    let mut ours = vec![0; flat.len()];
    for (address, data) in &image.segments {
        let from = (*address - boards::FLASH_BEGIN) as usize;
        ours[from..from + data.len()].copy_from_slice(data);
    }
    assert!(ours == flat, "the bytes differ");
}

#[test]
fn the_image_for_qemu_is_for_no_chip() {
    let image = Image::load(images::for_qemu()).unwrap();
    assert_eq!(
        (image.board.as_deref(), image.rtt),
        (Some("qemu-netduinoplus2"), None)
    );
    for board in boards::BOARDS {
        let why = image.check_for(board).unwrap_err();
        assert!(why.contains("qemu-netduinoplus2"), "{why}");
    }
}

/// Waits until the log's last line reports this state; the firmware reads the state every 64 periods.
fn wait_for(qemu: &Qemu, state: &str) -> Vec<u8> {
    let begun = Instant::now();
    loop {
        let log = std::fs::read(qemu.log()).unwrap();
        let (lines, _) = decoded(&log);
        if lines.last().is_some_and(|line| line.message.starts_with(state)) {
            return log;
        }
        assert!(begun.elapsed().as_secs() < 600, "no {state}: {lines:?}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// QEMU's log of a job that is loaded, dropped, and loaded again. The frames have the same encoding as the chip's; only the transport
/// differs.
fn recorded() -> Vec<u8> {
    let (qemu, stream) = Qemu::start(images::for_qemu()).unwrap();
    let mut session = Session::open(stream, 1).unwrap();
    let (header, words) = dome();
    let requests = upload(header, &words);
    let mut log = Vec::new();
    for state in ["ready", "idle", "ready"] {
        let count = if state == "idle" { 1 } else { requests.len() };
        for request in &requests[..count] {
            session.command(request).unwrap();
        }
        log = wait_for(&qemu, state);
    }
    log
}

/// The decoded lines, and the number of lost frames.
fn decoded(log: &[u8]) -> (Vec<Line>, usize) {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(log).unwrap();
    let request = Request::Decode {
        image: images::for_qemu().into(),
    };
    let (mut lines, mut lost) = (Vec::new(), 0);
    program()
        .run(
            &request,
            Some(File::open(file.path()).unwrap()),
            |event| match event {
                Event::Line(line) => lines.push(line.clone()),
                Event::Lost => lost += 1,
                other => panic!("{other:?}"),
            },
        )
        .unwrap();
    (lines, lost)
}

#[test]
fn a_recorded_log_is_decoded_and_damage_costs_a_line() {
    let log = recorded();
    let (lines, lost) = decoded(&log);
    assert_eq!(lost, 0);
    let greeting = format!("isofeed {} on qemu-netduinoplus2", env!("CARGO_PKG_VERSION"));
    assert!(lines[0].message.starts_with(&greeting), "{:?}", lines[0]);
    // QEMU's machine has no working TIM1 for steps: that is the only warning, the other lines are information.
    for line in &lines {
        let level = match line.message.as_str() {
            "this board puts no steps out" => "warn",
            _ => "info",
        };
        assert_eq!(line.level.as_deref(), Some(level), "{lines:?}");
    }
    let heads: Vec<_> = lines[1..]
        .iter()
        .map(|line| line.message.split(':').next().unwrap())
        .collect();
    assert_eq!(
        heads,
        [
            "this board puts no steps out",
            "last reset",
            "ready",
            "idle",
            "ready"
        ]
    );
    // Time stamps are the board's own, in s, and increase monotonically.
    let times: Vec<f64> = lines
        .iter()
        .map(|line| line.time.as_ref().unwrap().parse().unwrap())
        .collect();
    assert!(
        times.is_sorted() && times[0] < 0.1 && times[3] < times[4] && times[4] < times[5],
        "{times:?}"
    );

    // If a byte of the second frame is damaged, that line is lost or changed; the other lines stay the same.
    let second = log.iter().skip(1).position(|byte| *byte == 0).unwrap() + 3;
    assert!(log[second] != 0, "a byte of a frame");
    let mut damaged = log.clone();
    damaged[second] ^= 0x55;
    let (after, _) = decoded(&damaged);
    assert!(after.ends_with(&lines[2..]) && after[0] == lines[0], "{after:?}");
    // A reader that connects late starts within a frame.
    let (late, lost) = decoded(&log[second + 2..]);
    assert!(
        late.ends_with(&lines[2..]) && late.len() + lost <= lines.len(),
        "{late:?}"
    );
}

/// Messages if no probe is connected, for each command that requires one, and for invalid selectors.
#[test]
fn without_a_probe_that_is_what_is_said() {
    let image = chip_image();
    let target = |probe: &str| Target {
        probe: Some(probe.to_owned()),
        chip: STM32F405.chip.name.to_owned(),
        device_id: STM32F405.chip.device_id,
        image: image.into(),
    };
    let problem = |request: &Request| match program().run(request, None, |event| panic!("{event:?}")) {
        Err(ProbeError::Problem(problem)) => problem,
        other => panic!("{other:?}"),
    };
    let find = |probe: &str| Request::Find {
        probe: Some(probe.to_owned()),
    };
    for request in [
        find(NOWHERE),
        Request::Flash(target(NOWHERE)),
        Request::Compare(target(NOWHERE)),
        Request::Log(target(NOWHERE)),
    ] {
        assert_eq!(problem(&request), Problem::NoProbe, "{request:?}");
    }
    for selector in ["st-link", "0483", "xyz:1234", ""] {
        assert_eq!(
            problem(&find(selector)),
            Problem::BadSelector(selector.to_owned())
        );
    }
    // An image without an RTT log, or a file that is no image, is refused before the search for a probe.
    for image in [images::for_qemu().into(), "Cargo.toml".into()] {
        let request = Request::Log(Target {
            image,
            ..target(NOWHERE)
        });
        assert!(matches!(problem(&request), Problem::BadImage(_)), "{request:?}");
    }
}
