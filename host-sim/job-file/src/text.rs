//! The text of a job file. A path that leads to another kind of file yields an error that names the kind and the remedy.

use std::io::ErrorKind;
use std::path::Path;

use job::{JobError, read_regular};

/// Largest job file, bytes: many times what the board's store takes; its poles are read in about a second.
const BYTES_MAX: u64 = 4_000_000;

/// Magic bytes of files often given instead of a job file: bytes, message, remedy.
const MAGIC_BYTES: [(&[u8], &str, &str); 6] = [
    (
        b"ISO-10303-21",
        "is a STEP file, not a job file",
        "make a job of one of its faces: cargo sim import FILE -o JOB",
    ),
    (
        b"3D Geometry File Format",
        "is a 3DM file, not a job file",
        "make a job of one of its faces: cargo sim import FILE -o JOB",
    ),
    (
        b"\xff\xfe",
        "is UTF-16 text; a job file is UTF-8",
        "save it as UTF-8",
    ),
    (
        b"\xfe\xff",
        "is UTF-16 text; a job file is UTF-8",
        "save it as UTF-8",
    ),
    (
        b"\x7fELF",
        "is a program, not a job file",
        "give the path of a job file; samples are in jobs/",
    ),
    (
        b"%PDF",
        "is a PDF, not a job file",
        "give the path of a job file; samples are in jobs/",
    ),
];

/// Reads the text of a job file.
pub(super) fn read(path: &Path) -> Result<String, JobError> {
    let name = path.display().to_string();
    let error = |what: String, remedy: &str| JobError::of_file(&name, what, remedy);
    let bytes = read_regular(path, BYTES_MAX).map_err(|cause| match cause.kind() {
        ErrorKind::NotFound => error(
            "there is no such file".to_owned(),
            "give the path of a job file; samples are in jobs/, and `cargo sim new` writes a first one",
        ),
        ErrorKind::IsADirectory => error(
            "is a folder, not a job file".to_owned(),
            "give the path of a job file (.toml) in it",
        ),
        ErrorKind::InvalidInput => error(
            "is a device or a pipe, not a job file".to_owned(),
            "write the job into a file first",
        ),
        ErrorKind::FileTooLarge => error(
            format!("is larger than {} MB, the most that a job file may have", BYTES_MAX / 1_000_000),
            "the board's store holds some hundred patches: approximate the surface with fewer poles (`cargo sim import` does so with a \
             larger --tolerance), or cut it into several jobs",
        ),
        _ => error(
            format!("cannot read the job file: {cause}"),
            "give the path of a job file that you may read",
        ),
    })?;
    if let Some((_, what, remedy)) = MAGIC_BYTES.iter().find(|(first, _, _)| bytes.starts_with(first)) {
        return Err(error((*what).to_owned(), remedy));
    }
    if bytes.contains(&0) {
        return Err(error(
            "is not text: it contains bytes of value 0".to_owned(),
            "give the path of a job file; samples are in jobs/",
        ));
    }
    let text = String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let bytes = error.as_bytes();
        let what = format!("the byte 0x{:02x} is not UTF-8 text", bytes[at]);
        let remedy = "save the file as UTF-8, or write this character without its accent";
        let text = String::from_utf8_lossy(bytes);
        // The replacement character takes three bytes.
        JobError::at(&name, &text, at..at + 3, what, remedy.to_owned())
    })?;
    if text.trim_start_matches('\u{feff}').trim().is_empty() {
        return Err(error(
            "the file is empty".to_owned(),
            "write a job into it: `cargo sim new --force -o FILE` writes a first one",
        ));
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use job::Job;

    const TORUS: &str = include_str!("../../../jobs/torus.toml");

    /// Result of loading a file with these bytes.
    fn loaded(bytes: &[u8]) -> Result<Job, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a job.toml");
        std::fs::write(&path, bytes).unwrap();
        crate::load(&path).map_err(|error| {
            assert!(!error.remedy().is_empty());
            let place = error.line_and_column();
            format!("{place:?} {}", error.what())
        })
    }

    #[test]
    fn byte_order_marks_and_crlf_are_accepted() {
        let plain = crate::parse("x", TORUS).unwrap();
        let dos = TORUS.replace('\n', "\r\n");
        for text in [dos.clone(), format!("\u{feff}{TORUS}"), format!("\u{feff}{dos}")] {
            let job = loaded(text.as_bytes()).unwrap();
            assert_eq!(
                (&job.surface, job.feed_mm_min),
                (&plain.surface, plain.feed_mm_min)
            );
        }
        // Lines and columns are counted correctly after a byte order mark and with CR LF line ends.
        let wrong = format!("\u{feff}{}", dos.replace("\"zigzag\"", "\"zag\""));
        let line = TORUS
            .lines()
            .position(|line| line.starts_with("pattern"))
            .unwrap()
            + 1;
        let said = loaded(wrong.as_bytes()).unwrap_err();
        assert!(
            said.starts_with(&format!("Some(({line}, 11)) `pattern` cannot be")),
            "{said}"
        );
    }

    #[test]
    fn what_has_no_end_is_not_read() {
        let said = |path: &std::path::Path| crate::load(path).unwrap_err().what().to_owned();
        for device in ["/dev/zero", "/dev/null"] {
            assert_eq!(said(device.as_ref()), "is a device or a pipe, not a job file");
        }
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        assert!(
            std::process::Command::new("mkfifo")
                .arg(&pipe)
                .status()
                .unwrap()
                .success()
        );
        assert_eq!(said(&pipe), "is a device or a pipe, not a job file");
        let large = format!("{TORUS}\n# {}", "x".repeat(4_000_000));
        let refused = loaded(large.as_bytes()).unwrap_err();
        assert!(refused.contains("is larger than 4 MB"), "{refused}");
        let full = format!("{TORUS}\n# {}", "x".repeat(4_000_000 - TORUS.len() - 3));
        assert!(loaded(full.as_bytes()).is_ok());
    }

    /// A terminal would obey the line that the message shows.
    #[test]
    fn control_characters_of_a_job_are_not_in_its_messages() {
        let hostile = TORUS.replace("pattern = ", "\"pat\u{9b}31m\u{7f}\" = ");
        for text in [
            hostile,
            TORUS.replace("kind = \"", "kind = \"\u{1b}[2J"),
            format!("x\u{1b}]0;t\u{7} = 1\n{TORUS}"),
        ] {
            let error = crate::parse("job\u{1b}[1m.toml", &text).unwrap_err();
            let report = miette::Report::new(error);
            let mut shown = String::new();
            miette::NarratableReportHandler::new()
                .render_report(&mut shown, report.as_ref())
                .unwrap();
            let said = format!("{shown}{report}");
            assert!(!said.chars().any(|c| c.is_control() && c != '\n'), "{said:?}");
        }
    }

    #[test]
    fn other_kinds_of_files_are_recognised() {
        for (bytes, what) in [
            (&b""[..], "None the file is empty"),
            (b" \r\n\t\n", "None the file is empty"),
            (b"\xef\xbb\xbf\n", "None the file is empty"),
            (b"ISO-10303-21;\nHEADER;\n", "None is a STEP file"),
            (b"\xff\xfe[\0s\0", "None is UTF-16 text"),
            (b"abc\0def", "None is not text"),
            (
                b"[surface]\n# caf\xe9\n",
                "Some((2, 6)) the byte 0xe9 is not UTF-8 text",
            ),
            (
                b"# only a comment\n",
                "Some((2, 1)) the section `[surface]` is missing",
            ),
        ] {
            let said = loaded(bytes).unwrap_err();
            assert!(said.starts_with(what), "{said}");
        }
    }
}
