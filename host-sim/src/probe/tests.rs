//! Hand-made images, and a program with output defined by the test.

use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use super::{Event, Image, ProbeError, Problem, Program, Request, Work, remedy, sentence};

const LOAD: u32 = 1;
const ARM: u16 = 40;

/// An ELF file for this machine with these program headers: type, virtual and physical address, what lies there.
fn elf(machine: u16, parts: &[(u32, u32, u32, &[u8])]) -> Vec<u8> {
    let mut file = b"\x7fELF\x01\x01\x01\0\0\0\0\0\0\0\0\0".to_vec();
    let half = |file: &mut Vec<u8>, value: u16| file.extend(value.to_le_bytes());
    let word = |file: &mut Vec<u8>, value: u32| file.extend(value.to_le_bytes());
    half(&mut file, 2);
    half(&mut file, machine);
    for value in [1, 0, 52, 0, 0] {
        word(&mut file, value);
    }
    for value in [52, 32, parts.len() as u16, 40, 0, 0] {
        half(&mut file, value);
    }
    let mut offset = 52 + 32 * parts.len() as u32;
    for (kind, virtual_address, physical_address, data) in parts {
        let length = data.len() as u32;
        for value in [
            *kind,
            offset,
            *virtual_address,
            *physical_address,
            length,
            length + 16,
            5,
            4,
        ] {
            word(&mut file, value);
        }
        offset += length;
    }
    for (.., data) in parts {
        file.extend(*data);
    }
    file
}

fn image(parts: &[(u32, u32, u32, &[u8])]) -> Result<Image, String> {
    Image::parse(&elf(ARM, parts))
}

/// Stack at the end of RAM, start at 0x0800_0008: 12 bytes of a program.
const START: [u8; 12] = [0, 0, 2, 0x20, 9, 0, 0, 8, 0xFE, 0xE7, 0, 0];

#[test]
fn segments_are_at_their_load_addresses() {
    // Variables have an address in RAM and initial values in flash; zero-initialised data has no bytes.
    let data = [1, 2, 3, 4];
    let made = image(&[
        (LOAD, 0x2000_0000, 0x0800_000C, &data),
        (LOAD, 0x0800_0000, 0x0800_0000, &START),
        (LOAD, 0x2000_0010, 0x2000_0010, &[]),
        (4, 0x0900_0000, 0x0900_0000, &data),
    ])
    .unwrap();
    assert_eq!(
        made.segments,
        [(0x0800_0000, START.to_vec()), (0x0800_000C, data.to_vec())]
    );
    assert_eq!((made.bytes(), made.reach_bytes()), (16, Ok(16)));
    assert_eq!((made.board, made.rtt), (None, None));
}

#[test]
fn invalid_images_are_refused() {
    let part = |address: u32, data: &'static [u8]| image(&[(LOAD, address, address, data)]);
    for (made, says) in [
        (Image::parse(b"no elf"), "no ELF file"),
        (Image::parse(&elf(62, &[(LOAD, 0, 0, &[1])])), "another processor"),
        (image(&[]), "nothing to write"),
        (part(0x0800_0000, &[]), "nothing to write"),
        (
            image(&[(LOAD, 0, 0x0800_0000, &START), (LOAD, 0, 0x0800_000B, &[1])]),
            "overlap",
        ),
    ] {
        let why = made.unwrap_err();
        assert!(why.contains(says), "{says}: {why}");
    }
    let mut cut = elf(ARM, &[(LOAD, 0, 0x0800_0000, &START)]);
    cut.truncate(cut.len() - 1);
    assert!(Image::parse(&cut).unwrap_err().contains("beyond the file's end"));
    for address in [0x07FF_FFFF, 0, 0x2000_0000 - 0x1800_0001] {
        let reach = part(address, &[1, 2]).unwrap().reach_bytes();
        assert!(reach.unwrap_err().contains("no flash"), "{address:#x}");
    }
    // RAM is above flash: the image reaches too far.
    let reach = part(0x2000_0000, &[1]).unwrap().reach_bytes().unwrap();
    assert!(reach > boards::STM32F405.chip.flash_bytes);
}

/// The name of the board is set directly: a symbol table by hand would be long.
#[test]
fn an_image_has_to_be_the_boards_and_start() {
    let with = |address: u32, data: &[u8], board: Option<&str>| {
        let mut made = image(&[(LOAD, address, address, data)]).unwrap();
        made.board = board.map(str::to_owned);
        made.check_for(&boards::SKR_PRO)
    };
    let mine = Some("skr-pro");
    assert_eq!(with(0x0800_0000, &START, mine), Ok(()));
    let edited = |index: usize, byte: u8| {
        let mut start = START;
        start[index] = byte;
        start
    };
    let large = [&START[..], &vec![0xFF; 1 << 20]].concat();
    for (address, data, board, says) in [
        (0x0800_0000, &START[..], None, "no image of this firmware"),
        (0x0800_0000, &START, Some("stm32f405"), "for the board stm32f405"),
        (
            0x0800_0000,
            &START,
            Some("qemu-netduinoplus2"),
            "for the board qemu",
        ),
        (0x0800_8000, &START, mine, "for a loader"),
        (0x0800_0000, &START[..7], mine, "for a loader"),
        // A stack outside RAM, a start in RAM, a start that is no Thumb code.
        (0x0800_0000, &edited(3, 0x30), mine, "stack at 0x30020000"),
        (0x0800_0000, &edited(7, 0x20), mine, "start at 0x20000009"),
        (0x0800_0000, &edited(4, 8), mine, "start at 0x08000008"),
        (0x0800_0000, &large, mine, "1048588 bytes"),
    ] {
        let why = with(address, data, board).unwrap_err();
        assert!(why.contains(says), "{says}: {why}");
    }
}

/// A board that a card has written has its loader at flash's begin, and the image behind it.
#[test]
fn the_chip_may_hold_an_image_behind_the_boards_loader() {
    let in_chip = |address: u32, start: u32, board: &boards::Board, name: &str| {
        let mut data = START;
        data[4..8].copy_from_slice(&(start | 1).to_le_bytes());
        let mut made = image(&[(LOAD, address, address, &data)]).unwrap();
        made.board = Some(name.to_owned());
        made.check_in_chip(board)
    };
    let skr_pro = |address, start| in_chip(address, start, &boards::SKR_PRO, "skr-pro");
    assert_eq!(skr_pro(0x0800_0000, 0x0800_0008), Ok(()));
    assert_eq!(skr_pro(0x0800_8000, 0x0800_8008), Ok(()));
    for (outcome, says) in [
        (skr_pro(0x0800_4000, 0x0800_4008), "no vector table at 0x08008000"),
        // It would start the loader.
        (skr_pro(0x0800_8000, 0x0800_0008), "start at 0x08000009"),
        (
            in_chip(0x0800_8000, 0x0800_8008, &boards::SKR_PRO, "stm32f405"),
            "for the board stm32f405",
        ),
        // A board without a loader.
        (
            in_chip(0x0800_8000, 0x0800_8008, &boards::STM32F405, "stm32f405"),
            "is it for a loader",
        ),
    ] {
        let why = outcome.unwrap_err();
        assert!(why.contains(says), "{says}: {why}");
    }
}

fn problems() -> Vec<Problem> {
    let text = || "text".to_owned();
    vec![
        Problem::BadSelector(text()),
        Problem::NoProbe,
        Problem::SeveralProbes(vec![text(), text()]),
        Problem::NotAllowed(text()),
        Problem::NotOpened(text()),
        Problem::UnknownChip(text()),
        Problem::NoChip(text()),
        Problem::OtherChip(0x419),
        Problem::TooLarge {
            flash_bytes: 1,
            image_bytes: 2,
        },
        Problem::NotWritten(text()),
        Problem::Differs(0x0800_1234),
        Problem::BadImage(text()),
        Problem::NoLog(text()),
        Problem::Gone(text()),
    ]
}

/// A shell script as the program.
fn says(folder: &Path, script: &str) -> Program {
    let path = folder.join("program");
    std::fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    Program::at(&path)
}

const FIND: Request = Request::Find { probe: None };

#[test]
fn problems_come_back_as_they_were_sent() {
    let folder = tempfile::tempdir().unwrap();
    for problem in problems() {
        let line = serde_json::to_string(&Event::Failed(problem.clone())).unwrap();
        let program = says(folder.path(), &format!("echo '{line}'\nexit 1"));
        match program.run(&FIND, None, |_| panic!("no event")) {
            Err(ProbeError::Problem(back)) => assert_eq!(back, problem),
            other => panic!("{other:?}"),
        }
        assert!(sentence(&problem).len() > 20 && remedy(&problem).len() > 20);
    }
}

#[test]
fn events_arrive_in_their_order_and_the_request_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let program = says(
        folder.path(),
        r#"echo '{"probe":{"name":"'$(printf %s "$1" | tr -d '{}"')'"}}'
           echo '{"progress":{"work":"erase","done":1,"total":2}}'
           echo '"lost"'
           echo '"done"'
           echo 'further output is not read'"#,
    );
    let mut events = Vec::new();
    program
        .run(&FIND, None, |event| events.push(event.clone()))
        .unwrap();
    let name = "find:probe:null".to_owned();
    let progress = Event::Progress {
        work: Work::Erase,
        done: 1,
        total: 2,
    };
    assert_eq!(events, [Event::Probe { name }, progress, Event::Lost]);
}

#[test]
fn a_failing_program_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    for (script, words) in [
        (
            "echo panicked >&2; exit 101",
            "ended before it was done: panicked",
        ),
        ("echo '{}'", "wrote invalid output"),
    ] {
        let result = says(folder.path(), script).run(&FIND, None, |_| {});
        let text = result.unwrap_err().to_string();
        assert!(text.contains(words), "{text}");
    }
    let result = Program::at(&folder.path().join("nothing")).run(&FIND, None, |_| {});
    assert!(result.unwrap_err().to_string().contains("does not run"));
}
