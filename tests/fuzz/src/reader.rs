//! CAD files: whatever they hold, the reader's process ends in time with a model or an error. It runs as the tool runs it; a panic of the library
//! that knows the formats ends it, which the tool reports, but none may come from our code.

use std::io::Read;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use cad::{CadError, Model, outline};
use programs::Part;

/// Time that the reader may take for a file of some kilobytes, also on a busy computer.
const TIME_MAX: Duration = Duration::from_secs(60);
/// Where our own code is, in the message of a panic.
const OURS: &str = "panicked at host-sim/";
/// Faces of a model that are examined.
const FACES: usize = 4;

/// The reader's program.
#[derive(Debug)]
pub struct Reader {
    program: PathBuf,
    folder: tempfile::TempDir,
    /// Files for which the library panicked.
    pub library_panics: u64,
}

impl Reader {
    /// Finds the program, which is built if necessary.
    ///
    /// # Errors
    /// It cannot be built, or there is no place for files; in words.
    pub fn new() -> Result<Self, String> {
        Ok(Self {
            program: programs::find(Part::CadReader).map_err(|error| error.to_string())?,
            folder: tempfile::tempdir().map_err(|error| error.to_string())?,
            library_panics: 0,
        })
    }

    /// Reads the bytes of a file.
    ///
    /// # Panics
    /// A promise is broken.
    pub fn read(&mut self, data: &[u8]) {
        let path = self.folder.path().join("fuzz.cad");
        std::fs::write(&path, data).expect("a file in the temporary folder");
        let mut child = Command::new(&self.program)
            .arg(&path)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the reader starts");
        let (mut out, mut err) = (
            child.stdout.take().expect("piped"),
            child.stderr.take().expect("piped"),
        );
        let said = std::thread::spawn(move || {
            let mut text = String::new();
            let _ = err.read_to_string(&mut text);
            text
        });
        let model = std::thread::spawn(move || {
            let mut bytes = Vec::new();
            let _ = out.read_to_end(&mut bytes);
            bytes
        });
        let deadline = Instant::now() + TIME_MAX;
        let status = loop {
            if let Some(status) = child.try_wait().expect("the reader can be waited for") {
                break status;
            }
            if Instant::now() > deadline {
                let _ = child.kill();
                let _ = child.wait();
                panic!("the reader takes longer than {} s", TIME_MAX.as_secs());
            }
            std::thread::sleep(Duration::from_millis(1));
        };
        let said = said.join().expect("its messages");
        let model = model.join().expect("its model");
        assert!(!said.contains(OURS), "{said}");
        if !status.success() {
            assert!(
                said.contains("panicked at"),
                "the reader ended without a word: {status} {said}"
            );
            self.library_panics += 1;
            return;
        }
        match serde_json::from_slice::<Result<Model, CadError>>(&model).expect("a model or an error") {
            Ok(model) => examine(&model),
            Err(error) => assert!(!error.what.is_empty() && !error.remedy.is_empty(), "{error}"),
        }
    }
}

/// The tool's part: outlines of the first faces.
///
/// # Panics
/// A promise is broken.
pub fn examine(model: &Model) {
    assert!(!model.faces.is_empty());
    for (index, face) in model.faces.iter().enumerate() {
        assert_eq!(face.number, index + 1);
        assert!(face.sense == 1.0 || face.sense == -1.0);
        if index < FACES
            && let Ok(outline) = outline(face)
        {
            let ends = outline.rectangle;
            assert!(
                ends.iter()
                    .all(|[low, high]| low.is_finite() && high.is_finite() && low < high),
                "{ends:?}"
            );
        }
    }
}
