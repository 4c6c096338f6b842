//! `cad-reader FILE` writes `Result<Model, CadError>` as JSON to its standard output.

use std::io::{BufWriter, Write, stdout};
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let Some(file) = std::env::args_os().nth(1) else {
        eprintln!("usage: cad-reader FILE (called by `cargo sim import`)");
        return ExitCode::from(2);
    };
    let read = cad_reader::read(Path::new(&file));
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
