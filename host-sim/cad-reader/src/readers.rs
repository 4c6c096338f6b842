//! Readers of CAD files, one a format, and the guard around them: whatever is in a file, there is an answer.

use std::path::Path;

use cad::{CadError, Model};

use crate::{iges, rhino, step};

/// Stack of a reader's thread: files nest, and what is nested is read by recursion.
const STACK_BYTES: usize = 64 << 20;

/// Reads one format.
pub(crate) trait Reader: Send {
    /// The format's name for people.
    fn format(&self) -> &'static str;

    /// Endings of its files, lower case.
    fn endings(&self) -> &'static [&'static str];

    /// Whether a file that begins like this is of the format.
    fn recognises(&self, head: &[u8]) -> bool;

    /// What can be told without reading it all: a file cut short, a number that no file has. `file` is its name.
    ///
    /// # Errors
    /// What is wrong, with the line.
    fn check(&self, file: &str, bytes: &[u8]) -> Result<(), CadError>;

    /// The faces, in mm, where the file's assembly places them.
    ///
    /// # Errors
    /// The file is no sound one of the format.
    fn read(&self, file: &str, bytes: Vec<u8>) -> Result<Model, CadError>;
}

fn readers() -> [Box<dyn Reader>; 3] {
    [Box::new(step::Step), Box::new(iges::Iges), Box::new(rhino::Rhino)]
}

/// Reads a CAD file: by its contents, whatever its name ends in.
///
/// # Errors
/// The file cannot be read, is none of the formats, is broken, or holds no faces; with its name and, where there is one, the line.
pub(crate) fn read(path: &Path) -> Result<Model, CadError> {
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
    let known = readers();
    let named = known
        .iter()
        .position(|reader| reader.endings().contains(&ending.as_str()));
    let told = known.iter().position(|reader| reader.recognises(&bytes));
    let Some(chosen) = told else {
        let what = match named {
            Some(named) => format!(
                "this is no {} file: it does not begin like one",
                known[named].format()
            ),
            None => "this is neither a STEP, an IGES nor a 3DM file".to_owned(),
        };
        return Err(CadError::new(
            &file,
            what,
            "export the part again as STEP (AP203, AP214 or AP242), IGES or 3DM",
        ));
    };
    let reader = readers().into_iter().nth(chosen);
    let Some(reader) = reader else {
        return Err(CadError::new(&file, "there is no reader", "report this"));
    };
    let format = reader.format();
    reader.check(&file, &bytes)?;
    let mut model = guarded(&file, reader, bytes)?;
    if let Some(named) = named.filter(|named| *named != chosen) {
        model.warnings.insert(
            0,
            format!(
                "{file} is named as a {} file, but it is a {format} file; it was read as that",
                known[named].format()
            ),
        );
    }
    if model.faces.is_empty() {
        let reason = model
            .warnings
            .first()
            .map_or(String::new(), |first| format!(" ({first})"));
        let what = format!("this {format} file holds no surface that can be read{reason}");
        return Err(CadError::new(
            &file,
            what,
            "export the part as surfaces or solids, not as a mesh, a drawing or curves",
        ));
    }
    for (index, face) in model.faces.iter_mut().enumerate() {
        face.number = index + 1;
    }
    Ok(model)
}

/// Runs a reader on a thread of its own, whose stack is large: a panic of it becomes an error. Time is the caller's to limit.
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

/// The line that a byte is on, from 1.
pub(crate) fn line_of(bytes: &[u8], at: usize) -> usize {
    bytes[..at.min(bytes.len())]
        .iter()
        .filter(|byte| **byte == b'\n')
        .count()
        + 1
}
