//! The data of the paper's figures: one pass of Example 1's surface, by each approach.

use super::{Case, Cases};
use approach::{
    Approach, ApproachError, Chords, ConstantCl, Curve, Kind, Linear, Measured, Node, Nodes, PassPath,
    Planned, measure_run, passes, planned,
};
use job::{Along, Job, SurfaceSpec};
use verify::speeds::PeriodSpeed;

/// Speeds along one pass.
#[derive(Clone, Debug)]
pub struct SpeedTrack {
    /// The approach.
    pub kind: Kind,
    /// Sampling period, µs.
    pub period_us: f64,
    /// Speeds of the periods, without the last, which is shorter.
    pub speeds: Vec<PeriodSpeed>,
    /// Result of the pass.
    pub measured: Measured,
}

/// Data of all figures.
#[derive(Clone, Debug)]
pub struct Figures {
    /// Figure 3: the pass in its plane.
    pub section: Section,
    /// Lengths of the paths of contact and centre, mm.
    pub lengths_mm: [f64; 2],
    /// Figure 4: existing practice, constant speed of the centre.
    pub constant_cl: SpeedTrack,
    /// Figure 5: path length (mm) and speed (mm/s) of the centre that keeps the contact at the feed.
    pub wanted: Vec<[f64; 2]>,
    /// Figure 7: the linear interpolator with eqn 6 as printed, period 5 ms as in the paper.
    pub linear_printed: SpeedTrack,
    /// Figure 7 with chords within the tolerance, period 5 ms.
    pub linear_held: SpeedTrack,
    /// Figure 7 with chords within the tolerance, period 1 ms.
    pub linear_1_ms: SpeedTrack,
    /// Figure 8: the curve interpolator.
    pub curve: SpeedTrack,
    /// Ends of the cubics of Figure 8: path length (mm), fitted speed of the centre (mm/s).
    pub curve_ends: Vec<[f64; 2]>,
    /// Figure 9: the surface interpolator.
    pub surface: SpeedTrack,
}

/// Contact and centre of a pass in the plane of the pass and the axis.
#[derive(Clone, Debug)]
pub struct Section {
    /// Contact: distance from the axis, height, mm.
    pub cc_mm: Vec<[f64; 2]>,
    /// Centre: distance from the axis, height, mm.
    pub cl_mm: Vec<[f64; 2]>,
}

/// Measures the speeds of one pass.
fn track(
    kind: Kind,
    case: &Case,
    run: impl FnOnce(&mut dyn FnMut(&approach::Motion)) -> Result<Planned, ApproachError>,
) -> Result<SpeedTrack, ApproachError> {
    let mut speeds = Vec::new();
    let measured = measure_run(
        &case.job,
        &mut |motion, speed, _| {
            if !motion.emitted.last_of_pass {
                speeds.extend(speed);
            }
        },
        run,
    )?;
    Ok(SpeedTrack {
        kind,
        period_us: case.job.machine.period_us,
        speeds,
        measured,
    })
}

/// Measures the speeds of one pass of an approach that plans segments.
fn planned_track(
    kind: Kind,
    case: &Case,
    approach: &dyn Approach,
    pass: &PassPath<'_>,
) -> Result<SpeedTrack, ApproachError> {
    track(kind, case, |each| planned(approach, &case.job, &[*pass], each))
}

/// A job that consists of the first two passes of a job on a revolved surface.
fn first_passes(job: &Job, interval: f64) -> Job {
    let mut job = job.clone();
    if let (SurfaceSpec::Revolved { v_rad, .. }, Along::U) = (&mut job.surface, job.along) {
        v_rad[1] = v_rad[0] + interval;
    }
    job
}

impl Figures {
    /// Computes all figures.
    ///
    /// # Errors
    /// None that these jobs cause; those of the approaches.
    pub fn new(cases: &Cases) -> Result<Self, ApproachError> {
        let case = &cases.revolved;
        let slow = case.with_period_us(5000.0);
        let all = passes(&case.oracle)?;
        // All passes of a surface of revolution are congruent.
        let Some(pass) = all.first() else {
            return Err(ApproachError::Fault("the job has no pass".to_owned()));
        };
        let nodes = Nodes::new(pass)?;
        let job = &case.job;
        let cubics = Curve::new(job).cubics(pass, &nodes)?;
        let arc_of = |path: f64| pass.oracle.arc_length(pass.ends[0], path, pass.side);
        let mut curve_ends: Vec<[f64; 2]> = cubics
            .iter()
            .map(|cubic| [arc_of(cubic.path[0]), cubic.speed(0.0)])
            .collect();
        curve_ends.extend(
            cubics
                .last()
                .map(|cubic| [arc_of(cubic.path[1]), cubic.speed(1.0)]),
        );
        let interval = pass.oracle.least_interval(pass.side)?;
        let two = Case {
            job: first_passes(job, interval),
            ..case.clone()
        };
        let linear =
            |case: &Case, rule| planned_track(Kind::Linear, case, &Linear::new(&case.job, rule), pass);
        Ok(Self {
            section: section(&nodes.0),
            lengths_mm: nodes.lengths_mm(),
            constant_cl: planned_track(Kind::ConstantCl, case, &ConstantCl::new(job), pass)?,
            wanted: nodes
                .0
                .iter()
                .map(|node| [node.cc_length_mm, job.feed_mm_s() * node.at.ratio()])
                .collect(),
            linear_printed: linear(&slow, Chords::Equation)?,
            linear_held: linear(&slow, Chords::Held)?,
            linear_1_ms: linear(case, Chords::Held)?,
            curve: planned_track(Kind::Curve, case, &Curve::new(job), pass)?,
            curve_ends,
            surface: first_pass_of_core(&two)?,
        })
    }
}

fn section(nodes: &[Node]) -> Section {
    let in_plane = |at: glam::DVec3| [at.x.hypot(at.y), at.z];
    Section {
        cc_mm: nodes.iter().map(|node| in_plane(node.at.contact.cc_mm)).collect(),
        cl_mm: nodes.iter().map(|node| in_plane(node.cl_mm())).collect(),
    }
}

/// The first pass of the core.
fn first_pass_of_core(case: &Case) -> Result<SpeedTrack, ApproachError> {
    let mut speeds = Vec::new();
    let measured = approach::measure(Kind::Surface, &case.job, |motion, speed, _| {
        if motion.emitted.pass == 0 && !motion.emitted.last_of_pass {
            speeds.extend(speed);
        }
    })?;
    Ok(SpeedTrack {
        kind: Kind::Surface,
        period_us: case.job.machine.period_us,
        speeds,
        measured,
    })
}
