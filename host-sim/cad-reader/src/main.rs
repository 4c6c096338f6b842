//! Reads a CAD file for `cargo sim import`, in a separate process: `cad-reader FILE` writes `Result<Model, CadError>` as JSON to its
//! standard output.
//!
//! Apart from `cad` because the library that knows the formats (`cadmpeg`) is twenty times as large as the rest of the tool together: it is built when
//! the first CAD file is read, and a file that hangs a reader, or eats memory, does so here.
//!
//! ```text
//! main.rs ─► readers.rs   by the file's first bytes ─► step.rs, iges.rs, rhino.rs   what can be checked before the whole file is read
//!                           step_records.rs, step_units.rs, iges_entries.rs ◄─┤   what the text says, for the cross-check
//!                                                            iges_spline.rs ◄─┤   entities 114 as 128
//!                                                                             └─► ir.rs, ir_*.rs   cadmpeg's model -> cad::Face
//! ```

mod format;
mod iges;
mod iges_entries;
mod iges_spline;
mod ir;
mod ir_boundary;
mod ir_geometry;
mod ir_index;
mod readers;
mod rhino;
mod step;
mod step_records;
mod step_units;

use std::io::{BufWriter, Write, stdout};
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let Some(file) = std::env::args_os().nth(1) else {
        eprintln!("usage: cad-reader FILE (called by `cargo sim import`)");
        return ExitCode::from(2);
    };
    let read = readers::read(Path::new(&file));
    let mut out = BufWriter::new(stdout().lock());
    match serde_json::to_writer(&mut out, &read)
        .map_err(std::io::Error::from)
        .and_then(|()| out.flush())
    {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("cannot write the faces: {error}");
            ExitCode::FAILURE
        }
    }
}
