//! Readers of CAD files, one per format, and their common guard: every file yields a model or an error.

use std::path::Path;

use cad::{CadError, Model};

use crate::format::Reader;
use crate::{iges, rhino, step};

/// Stack of the thread of a reader, bytes: nested entities are read by recursion.
const STACK_BYTES: usize = 64 << 20;

fn readers() -> [Box<dyn Reader>; 3] {
    [Box::new(step::Step), Box::new(iges::Iges), Box::new(rhino::Rhino)]
}

/// Reads a CAD file; the format is detected by its content, not by the extension.
///
/// # Errors
/// The file cannot be read, has an unknown format, is invalid, or contains no faces; with its name and, if known, the line.
pub fn read(path: &Path) -> Result<Model, CadError> {
    let file = path.display().to_string();
    let bytes = std::fs::read(path).map_err(|cause| {
        CadError::new(
            &file,
            format!("cannot read the CAD file: {cause}"),
            "give the path of a STEP, IGES or 3DM file; samples are in jobs/cad/",
        )
    })?;
    let ending = path
        .extension()
        .map(|ending| ending.to_string_lossy().to_lowercase())
        .unwrap_or_default();
    read_bytes(&file, &ending, bytes)
}

/// Reads the bytes of a file. `file`: its name in errors; `ending`: its extension, lower case, named in the warning where the format is another one.
///
/// # Errors
/// As [`read`].
pub fn read_bytes(file: &str, ending: &str, bytes: Vec<u8>) -> Result<Model, CadError> {
    let known = readers();
    let named = known.iter().position(|reader| reader.endings().contains(&ending));
    let recognised = known.iter().position(|reader| reader.recognises(&bytes));
    let Some(chosen) = recognised else {
        let what = match named {
            Some(named) => format!("this is no {} file: its header differs", known[named].format()),
            None => "this is neither a STEP, an IGES nor a 3DM file".to_owned(),
        };
        return Err(CadError::new(
            file,
            what,
            "export the part again as STEP (AP203, AP214 or AP242), IGES or 3DM",
        ));
    };
    let reader = readers().into_iter().nth(chosen);
    let Some(reader) = reader else {
        return Err(CadError::new(file, "there is no reader", "report this"));
    };
    let format = reader.format();
    reader.check(file, &bytes)?;
    let mut model = guarded(file, reader, bytes)?;
    if let Some(named) = named.filter(|named| *named != chosen) {
        model.warnings.insert(
            0,
            format!(
                "{file} has the extension of a {} file, but is a {format} file; it was read as {format}",
                known[named].format()
            ),
        );
    }
    if model.faces.is_empty() {
        let reason = model
            .warnings
            .first()
            .map_or(String::new(), |first| format!(" ({first})"));
        let what = format!("this {format} file contains no surface that can be read{reason}");
        return Err(CadError::new(
            file,
            what,
            "export the part as surfaces or solids, not as a mesh, a drawing or curves",
        ));
    }
    for (index, face) in model.faces.iter_mut().enumerate() {
        face.number = index + 1;
    }
    Ok(model)
}

/// Runs a reader in a thread with a large stack; a panic becomes an error. The caller limits the time.
fn guarded(file: &str, reader: Box<dyn Reader>, bytes: Vec<u8>) -> Result<Model, CadError> {
    let (format, name) = (reader.format(), file.to_owned());
    let broken = |what: String| {
        CadError::new(
            file,
            what,
            "export the part again, alone, or in another format (STEP is read best)",
        )
    };
    let thread = std::thread::Builder::new()
        .stack_size(STACK_BYTES)
        .spawn(move || reader.read(&name, bytes))
        .map_err(|cause| broken(format!("cannot start the reader: {cause}")))?;
    thread
        .join()
        .unwrap_or_else(|_| Err(broken(format!("the {format} reader failed on this file"))))
}
