//! Sums over the faces of a part.

use crate::face::FacePlan;

/// Sums of the areas of all faces whose reach is known, mm2.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sums {
    /// Area of the faces.
    pub area_mm2: f64,
    /// Area that the tool reaches.
    pub reachable_mm2: f64,
    /// Reachable area within the regions of jobs.
    pub region_mm2: f64,
    /// Area that the tool does not reach, by the name of the rule that it breaks first.
    pub unreachable_mm2: Vec<(String, f64)>,
    /// Number of faces whose reach is not known.
    pub unknown: usize,
}

impl Sums {
    /// The sums over these faces.
    #[must_use]
    pub fn of(plans: &[FacePlan]) -> Self {
        let mut sums = Self::default();
        for plan in plans {
            let Some(reach) = &plan.reach else {
                sums.unknown += 1;
                continue;
            };
            sums.area_mm2 += reach.area_mm2;
            sums.reachable_mm2 += reach.reachable_mm2;
            sums.region_mm2 += if plan.job.is_some() { reach.region_mm2 } else { 0.0 };
            for (reason, area_mm2) in &reach.unreachable_mm2 {
                match sums.unreachable_mm2.iter_mut().find(|(name, _)| name == reason) {
                    Some((_, sum_mm2)) => *sum_mm2 += area_mm2,
                    None => sums.unreachable_mm2.push((reason.clone(), *area_mm2)),
                }
            }
        }
        sums
    }
}

/// A part as a percentage of a whole; 0 of an empty whole.
#[must_use]
pub fn percent(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { 100.0 * part / whole } else { 0.0 }
}
