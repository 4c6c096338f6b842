//! The text of a job file. A path that leads to another kind of file yields an error that names the kind and the remedy.

use std::io::ErrorKind;
use std::path::Path;

use job::JobError;

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
    let bytes = std::fs::read(path).map_err(|cause| match cause.kind() {
        ErrorKind::NotFound => error(
            "there is no such file".to_owned(),
            "give the path of a job file; samples are in jobs/, and `cargo sim new` writes a first one",
        ),
        ErrorKind::IsADirectory => error(
            "is a folder, not a job file".to_owned(),
            "give the path of a job file (.toml) in it",
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
