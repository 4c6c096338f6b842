//! The reader of CAD files, in this process; a panic of the library that knows the formats is a finding, too. See `tests/fuzz`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let _ = cad_reader::read_bytes("fuzz", "", data.to_vec()).map(|model| fuzz_targets::reader::examine(&model));
});
