//! 3DM (openNURBS archives of Rhino).

use crate::format::Reader;
use crate::ir::{self, Stated};
use cad::CadError;
use cad::Model;

/// The reader of 3DM files.
pub(crate) struct Rhino;

/// The archive is binary: its text says nothing.
struct Nothing;

impl Stated for Nothing {}

/// Least size of an archive: header and first chunk, bytes.
const HEAD_BYTES: usize = 32;

impl Reader for Rhino {
    fn format(&self) -> &'static str {
        "3DM"
    }

    fn endings(&self) -> &'static [&'static str] {
        &["3dm"]
    }

    fn recognises(&self, head: &[u8]) -> bool {
        head.starts_with(b"3D Geometry File Format ")
    }

    fn check(&self, file: &str, bytes: &[u8]) -> Result<(), CadError> {
        if bytes.len() > HEAD_BYTES {
            return Ok(());
        }
        let what = format!("the archive ends after {} bytes", bytes.len());
        Err(CadError::new(file, what, "the file is truncated; save it again"))
    }

    fn read(&self, file: &str, bytes: Vec<u8>) -> Result<Model, CadError> {
        ir::decode(file, &cadmpeg_codec_rhino::RhinoCodec, bytes, &Nothing)
    }
}
