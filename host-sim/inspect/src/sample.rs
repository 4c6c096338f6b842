//! A sample of the core in plain numbers, for the verifier.

use interp_core::{SpanParameter, State};
use machine::prepare::Prepared;
use verify::EmittedSample;

/// Whether a sample is on a pass, and not on a link.
#[must_use]
pub fn is_on_pass(sample: &interp_core::Sample) -> bool {
    sample.state != State::Linking && sample.path != SpanParameter::NONE
}

/// A sample of the core in plain numbers.
#[must_use]
pub fn plain(prepared: &Prepared, sample: &interp_core::Sample) -> EmittedSample {
    EmittedSample {
        tick: sample.tick.into(),
        state: sample.state.name(),
        pass: sample.pass,
        parameters: is_on_pass(sample).then(|| prepared.parameters(sample.path, sample.side)),
        cc_nm: sample.cc_nm,
        cl_nm: sample.cl_nm,
        feed_mm_s: sample.feed_mm_s,
        interval: sample.interval() * prepared.side_unit(sample.side.span),
    }
}
