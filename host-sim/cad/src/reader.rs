//! The reader of CAD files: a separate program (`host-sim/cad-reader`), built for the first file and ended at a time limit, so that every
//! file yields a model or an error in bounded time.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant, SystemTime};

use serde::{Deserialize, Serialize};

use super::orientation::turn_outwards;
use super::sweeps::with_seam;
use super::{CadError, Face, Solid};
use programs::{Part, Unavailable};

/// Largest file, bytes; reading takes about 30 times the size of the file in memory.
const BYTES_MAX: u64 = 64 << 20;
/// Time that the reader may take: twice what the reader of a checkout, which is not optimised, takes for the largest file (2 s for each MB
/// of STEP).
const TIME_MAX: Duration = Duration::from_secs(300);
/// What a file holds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Model {
    /// The faces, numbered from 1 in the order of the file.
    pub faces: Vec<Face>,
    /// Which of them bound a solid.
    #[serde(default)]
    pub solids: Vec<Solid>,
    /// Number of faces that are left out, because their surfaces could not be read.
    #[serde(default)]
    pub left_out: usize,
    /// Entities that could not be read, as sentences.
    pub warnings: Vec<String>,
}

/// Reads a CAD file; the format is detected by its content. The first call builds the reader, which takes minutes, and says so.
///
/// # Errors
/// The file cannot be read, has an unknown format, is invalid, or contains no faces; with its name and, if known, the line.
pub fn read(path: &Path) -> Result<Model, CadError> {
    let file = path.display().to_string();
    check(&file, path)?;
    static READER: OnceLock<Result<PathBuf, Unavailable>> = OnceLock::new();
    let reader = READER.get_or_init(|| {
        if programs::needs_build(Part::CadReader) {
            eprintln!("building the reader of CAD files (once, some minutes)");
        }
        programs::find(Part::CadReader)
    });
    match reader {
        Ok(reader) => run(&file, path, reader),
        Err(error) => Err(CadError::new(
            &file,
            format!("there is no reader of CAD files: {error}"),
            error.remedy(),
        )),
    }
}

/// The model of a file, read once by this process as long as the file does not change: a job asks for its face, its part and its original.
///
/// # Errors
/// As [`read`].
pub fn read_once(path: &Path) -> Result<Arc<Model>, CadError> {
    type Last = Option<(PathBuf, SystemTime, u64, Arc<Model>)>;
    static LAST: Mutex<Last> = Mutex::new(None);
    let state = std::fs::metadata(path)
        .and_then(|data| Ok((data.modified()?, data.len())))
        .ok();
    // A job names the file from its own folder.
    let whole = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    // Held while it reads: the faces of a part are asked for on all cores.
    let mut last = LAST.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if let (Some((file, modified, length, model)), Some(now)) = (last.as_ref(), state)
        && (file, *modified, *length) == (&whole, now.0, now.1)
    {
        return Ok(Arc::clone(model));
    }
    let model = Arc::new(read(path)?);
    *last = state.map(|(modified, length)| (whole, modified, length, Arc::clone(&model)));
    Ok(model)
}

/// Checks that need no parsing.
fn check(file: &str, path: &Path) -> Result<(), CadError> {
    let unreadable = |cause: String| {
        CadError::new(
            file,
            format!("cannot read the CAD file: {cause}"),
            "give the path of a STEP, IGES or 3DM file; samples are in jobs/cad/",
        )
    };
    let readable = |cause: std::io::Error| unreadable(cause.to_string());
    let metadata = std::fs::metadata(path).map_err(readable)?;
    // Before it is opened: a pipe without a writer would wait for one.
    if !metadata.is_file() {
        return Err(unreadable("it is not a regular file".to_owned()));
    }
    std::fs::File::open(path).map_err(readable)?;
    if metadata.len() > BYTES_MAX {
        return Err(CadError::new(
            file,
            format!("the file is larger than {} MB", BYTES_MAX >> 20),
            "export the part alone, without the rest of its assembly",
        ));
    }
    if metadata.len() == 0 {
        return Err(CadError::new(file, "the file is empty", "export the part again"));
    }
    Ok(())
}

/// Runs the reader with a time limit.
fn run(file: &str, path: &Path, reader: &Path) -> Result<Model, CadError> {
    let broken = |what: String| {
        CadError::new(
            file,
            what,
            "export the part again, alone, or in another format (STEP is read best)",
        )
    };
    let failed = |cause: std::io::Error| broken(format!("the reader of CAD files does not run: {cause}"));
    let mut child = Command::new(reader)
        .arg(path)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .map_err(failed)?;
    let mut output = child
        .stdout
        .take()
        .ok_or_else(|| broken("the reader has no output".to_owned()))?;
    let listener = std::thread::spawn(move || {
        let mut text = Vec::new();
        output.read_to_end(&mut text).map(|_| text)
    });
    let deadline = Instant::now() + TIME_MAX;
    while !listener.is_finished() && Instant::now() < deadline {
        std::thread::sleep(Duration::from_millis(2));
    }
    let in_time = listener.is_finished();
    if !in_time {
        let _ = child.kill();
    }
    let status = child.wait().map_err(failed)?;
    if !in_time {
        return Err(broken(format!(
            "reading it takes longer than {} s",
            TIME_MAX.as_secs()
        )));
    }
    let text = listener
        .join()
        .unwrap_or_else(|_| Err(std::io::ErrorKind::Other.into()))
        .map_err(failed)?;
    let mut model = serde_json::from_slice::<Result<Model, CadError>>(&text)
        .unwrap_or_else(|_| Err(broken(format!("the reader failed on this file ({status})"))))?;
    model.faces.iter_mut().for_each(with_seam);
    turn_outwards(&mut model.faces, &model.solids);
    Ok(model)
}
