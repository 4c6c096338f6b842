//! 3DM (openNURBS archives of Rhino).

use cadmpeg_ir::report::loss::LossNote;

use crate::format::Reader;
use crate::ir::{self, Decoded, Lost, Stated};
use crate::rhino_objects;
use cad::CadError;
use cad::Model;

/// The reader of 3DM files.
pub(crate) struct Rhino;

/// The bytes of an archive: there is no text to compare with, but the types of the objects.
struct Archive<'b>(&'b [u8]);

impl Stated for Archive<'_> {
    fn lost(&self, decoded: &Decoded) -> Lost {
        rhino_objects::lost(self.0, decoded)
    }

    fn told(&self, loss: &LossNote, losses: &[LossNote]) -> Option<String> {
        rhino_objects::told(loss, losses)
    }

    fn leaves_out_hidden(&self) -> bool {
        true
    }

    fn why_empty(&self, decoded: &Decoded) -> Option<(String, &'static str)> {
        if rhino_objects::has_no_unit(decoded) {
            return Some((
                "the document has no unit of length, so that nothing of it is read".to_owned(),
                "set the document's units (File > Properties > Units) and save it again",
            ));
        }
        let lost = self.lost(decoded);
        (lost.count > 0).then(|| {
            (
                format!("no surface of this 3DM file is read; it has {}", lost.kinds),
                "convert SubDs and meshes to NURBS surfaces (ToNURBS), explode blocks (Explode), and save it again, or export the part as STEP",
            )
        })
    }
}

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
        ir::decode(file, &cadmpeg_codec_rhino::RhinoCodec, &bytes, &Archive(&bytes))
    }
}
