//! `cargo sim`: see the library's documentation.

use std::process::ExitCode;

fn main() -> ExitCode {
    host_sim::commands::main()
}
