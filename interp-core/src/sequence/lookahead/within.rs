//! A run that begins within a pass: the rest of the pass is looked at after the whole of it, which has given the pass after it.

use super::{Lookahead, PassPlan};
use crate::fault::{Fault, FaultKind, Result};
use crate::feed::turn::Turn;
use crate::math::number::to_f32;
use crate::pass::route::Route;
use crate::pass::step_over::PassMaximum;
use crate::sample::SpanParameter;

/// What a whole pass gives to the passes after it.
#[derive(Clone, Copy, Debug)]
pub(super) struct WholePass {
    interval: f32,
    next: Option<Route>,
    steps_over: bool,
    is_last: bool,
    maximum: PassMaximum,
    patch_mm: f32,
    pass_mm: f32,
    has_bend: bool,
    has_jump: bool,
}

impl Lookahead {
    /// Begins to look at the rest of the pass that it has looked at, from this place on.
    ///
    /// # Errors
    /// [`FaultKind::WrongState`] with the pass, where the place is not on it.
    pub(in crate::sequence) fn begin_within(
        &mut self,
        path: SpanParameter,
        out: &mut PassPlan,
    ) -> Result<()> {
        let mut route = out.route;
        if out.point || !route.is_within(path) {
            return Err(Fault::new(FaultKind::WrongState, to_f32(out.pass.into())));
        }
        self.whole = Some(WholePass {
            interval: out.interval,
            next: out.next,
            steps_over: out.steps_over,
            is_last: out.is_last,
            maximum: self.maximum,
            patch_mm: self.patch_mm,
            pass_mm: self.pass_mm,
            has_bend: self.has_bend,
            has_jump: self.has_jump,
        });
        route.begin_at(path);
        self.begin(out.pass, route, &Turn::NONE, out);
        Ok(())
    }

    /// Ends the look at the rest of a pass: to the passes after it, it is as if the whole had been driven.
    pub(super) fn close_within(&mut self, whole: &WholePass, out: &mut PassPlan) {
        self.whole = None;
        self.maximum = whole.maximum;
        (self.patch_mm, self.pass_mm) = (whole.patch_mm, whole.pass_mm);
        (self.has_bend, self.has_jump) = (whole.has_bend, whole.has_jump);
        out.interval = whole.interval;
        (out.next, out.steps_over, out.is_last) = (whole.next, whole.steps_over, whole.is_last);
        self.finish_short(out);
    }
}
