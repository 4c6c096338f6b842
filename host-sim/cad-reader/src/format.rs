//! What a reader of one format does; see `readers.rs` for the order of its calls.

use cad::{CadError, Model};

/// Reads one format.
pub(crate) trait Reader: Send {
    /// Name of the format.
    fn format(&self) -> &'static str;

    /// File extensions, lower case.
    fn endings(&self) -> &'static [&'static str];

    /// Whether these first bytes of a file are of the format.
    fn recognises(&self, head: &[u8]) -> bool;

    /// Checks before parsing: truncation, invalid numbers. `file`: name of the file.
    ///
    /// # Errors
    /// The first error, with its line.
    fn check(&self, file: &str, bytes: &[u8]) -> Result<(), CadError>;

    /// The faces, in mm, at their positions in the assembly.
    ///
    /// # Errors
    /// The file is invalid in this format.
    fn read(&self, file: &str, bytes: Vec<u8>) -> Result<Model, CadError>;
}
