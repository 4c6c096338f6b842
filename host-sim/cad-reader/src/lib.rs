//! Reads CAD files for `cargo sim import`, in a separate process: see `main.rs`.
//!
//! Apart from `cad` because the library that knows the formats (`cadmpeg`) is twenty times as large as the rest of the tool together: it is built when
//! the first CAD file is read, and a file that hangs a reader, or eats memory, does so here.
//!
//! ```text
//! readers.rs   by the file's first bytes ─► step.rs, iges.rs, rhino.rs   what can be checked before the whole file is read
//!                           step_records.rs, step_units.rs, iges_entries.rs ◄─┤   what the text says, for the cross-check
//!                                                            iges_spline.rs ◄─┤   entities 114 as 128
//!                                                          rhino_objects.rs ◄─┤   objects of which no surface is read
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
mod rhino_objects;
mod step;
mod step_records;
mod step_units;

pub use readers::{read, read_bytes};
