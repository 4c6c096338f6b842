//! Files that are given as input, and text out of them on its way to a terminal.

use std::borrow::Cow;
use std::fmt::Write;
use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// Reads a regular file of at most `most_bytes`. Devices and pipes are refused: some have no end, and some never begin.
///
/// # Errors
/// [`ErrorKind::FileTooLarge`] above `most_bytes`, [`ErrorKind::IsADirectory`], [`ErrorKind::InvalidInput`] for what is no regular file, or
/// the file cannot be read.
pub fn read_regular(path: &Path, most_bytes: u64) -> Result<Vec<u8>> {
    let metadata = std::fs::metadata(path)?;
    if metadata.is_dir() {
        return Err(ErrorKind::IsADirectory.into());
    }
    if !metadata.is_file() {
        return Err(Error::new(ErrorKind::InvalidInput, "it is not a regular file"));
    }
    let too_large = || {
        let size = format!("it is larger than {:.1} MB", most_bytes as f64 / 1e6);
        Err(Error::new(ErrorKind::FileTooLarge, size))
    };
    if metadata.len() > most_bytes {
        return too_large();
    }
    // Files in /proc and files that grow are longer than they say.
    let mut bytes = Vec::new();
    File::open(path)?.take(most_bytes + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most_bytes {
        return too_large();
    }
    Ok(bytes)
}

/// Whether a terminal would obey the character instead of showing it, or show others in another order.
fn obeyed(c: char) -> bool {
    let turns = matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    (c.is_control() && !matches!(c, '\n' | '\t')) || turns
}

/// The text with control characters, other than line ends and tabs, as escapes such as `\u001b`, which JSON reads back.
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.chars().any(obeyed) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        if obeyed(c) {
            let _ = write!(out, "\\u{:04x}", u32::from(c));
        } else {
            out.push(c);
        }
    }
    Cow::Owned(out)
}

/// The text on one line: also line ends and tabs are escapes.
#[must_use]
pub fn one_line(text: &str) -> String {
    printable(text).replace('\n', "\\u000a").replace('\t', "\\u0009")
}

/// The text with other characters of the same length in bytes for control characters, so that places in it stay what they are.
pub(crate) fn masked(text: &str) -> String {
    let mask = |c: char| match c.len_utf8() {
        // A carriage return before a line end is part of it.
        _ if !obeyed(c) || c == '\r' => c,
        1 => '?',
        2 => '\u{bf}',
        _ => '\u{fffd}',
    };
    text.replace("\r\n", " \n")
        .chars()
        .map(mask)
        .collect::<String>()
        .replace('\r', "?")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_shown_not_sent() {
        let hostile = "a\u{1b}[2J\u{7}\tb\r\nc\u{9b}31m\u{7f}d\u{202e}e\u{2069}";
        let shown = printable(hostile);
        assert_eq!(
            shown,
            "a\\u001b[2J\\u0007\tb\\u000d\nc\\u009b31m\\u007fd\\u202ee\\u2069"
        );
        assert!(matches!(printable("plain: ä µ ±\n\t"), Cow::Borrowed(_)));
        assert_eq!(one_line("a\nb"), "a\\u000ab");
        let masked = masked(hostile);
        assert_eq!(masked.len(), hostile.len());
        assert!(!masked.chars().any(obeyed), "{masked:?}");
        assert_eq!(masked.find('d'), hostile.find('d'));
        assert_eq!(masked.matches('\n').count(), 1);
        // As JSON the escapes mean the characters.
        assert!(shown.contains("\\u001b"));
    }

    #[test]
    fn only_regular_files_of_their_size() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        std::fs::write(&path, [7; 100]).unwrap();
        assert_eq!(read_regular(&path, 100).unwrap(), [7; 100]);
        let kind = |path: &Path, most: u64| read_regular(path, most).unwrap_err().kind();
        assert_eq!(kind(&path, 99), ErrorKind::FileTooLarge);
        assert_eq!(kind(folder.path(), 99), ErrorKind::IsADirectory);
        assert_eq!(kind(&folder.path().join("none"), 99), ErrorKind::NotFound);
        for device in ["/dev/zero", "/dev/null"] {
            assert_eq!(kind(Path::new(device), 99), ErrorKind::InvalidInput);
        }
        // Their size is 0 until they are read.
        assert_eq!(kind(Path::new("/proc/self/status"), 9), ErrorKind::FileTooLarge);
    }
}
