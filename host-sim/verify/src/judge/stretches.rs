//! The samples in contact, in the form of samples on passes: a stretch in contact is a pass.

use glam::DVec3;
use job::Job;
use job::units::NM_PER_MM;
use oracle::{PassSample, SampleCheck};

use super::Sample;
use crate::reach::{ContactPlace, ContactSide};
use crate::survey::SampleObserver;

/// Reports the samples in contact. Each is reported when the next one has shown whether the stretch continues.
pub(super) struct Stretches<'a, 'b> {
    each: Option<&'a mut SampleObserver<'b>>,
    feed_mm_s: f64,
    period_s: f64,
    radius_mm: f64,
    pending: Option<(PassSample, SampleCheck)>,
    /// Number of stretches so far.
    pub(super) count: u32,
    /// The side of the ball.
    pub(super) contact: ContactSide,
}

fn nanometres(mm: DVec3) -> [i32; 3] {
    #[allow(clippy::cast_possible_truncation, reason = "positions are within two metres")]
    (mm * NM_PER_MM).round().to_array().map(|nm| nm as i32)
}

impl<'a, 'b> Stretches<'a, 'b> {
    pub(super) fn new(each: Option<&'a mut SampleObserver<'b>>, job: &Job, radius_mm: f64) -> Self {
        Self {
            each,
            feed_mm_s: job.feed_mm_s(),
            period_s: job.machine.period_s(),
            radius_mm,
            pending: None,
            count: 0,
            contact: ContactSide::default(),
        }
    }

    /// A sample in contact; `first`: of its stretch; `step_mm`: the contact's way from the sample before.
    pub(super) fn add(&mut self, sample: &Sample, first: bool, step_mm: Option<f64>) {
        let Sample {
            index: sample,
            nearest,
            centre_mm,
        } = *sample;
        self.emit(first);
        self.count += u32::from(first);
        let [u, v] = nearest.uv;
        let pass = self.count.saturating_sub(1);
        let at = ContactPlace {
            sample,
            pass,
            uv: [u, v],
            place_mm: nearest.point_mm,
        };
        self.contact.add(at, centre_mm);
        let ripple = |step: f64| 100.0 * (step / (self.feed_mm_s * self.period_s) - 1.0);
        self.pending = Some((
            PassSample {
                tick: sample as u64,
                pass,
                u,
                v,
                cc_nm: nanometres(nearest.point_mm),
                cl_nm: nanometres(centre_mm),
                feed_mm_s: step_mm.map_or(0.0, |step| step / self.period_s),
                interval: f64::INFINITY,
                first_of_pass: first,
                last_of_pass: false,
            },
            SampleCheck {
                arc_mm: step_mm,
                ripple_pct: step_mm.map(ripple),
                position_nm: Some(NM_PER_MM * (nearest.distance_mm - self.radius_mm).abs()),
            },
        ));
    }

    fn emit(&mut self, last: bool) {
        if let (Some((sample, check)), Some(each)) = (self.pending.take(), &mut self.each) {
            let sample = PassSample {
                last_of_pass: last,
                ..sample
            };
            each(&sample, &check);
        }
    }

    /// After the last sample.
    pub(super) fn finish(mut self) -> Self {
        self.emit(true);
        self
    }
}
