//! Export of a job as G-code for LinuxCNC or Grbl.
//!
//! ```text
//! job ─► oracle ─► PassPath ─► linear.rs or arcs.rs (approach/) ─► Cut ─┐
//!                          └─► links.rs: home, retract, step-over ──────┴─► way.rs: is it clear? ─► gcode.rs: blocks ─► text
//! ```
//!
//! The programmed point is the ball centre. The cuts are those of the approach; between passes the tool retracts (`zig`) or steps over
//! along the boundary of the surface (`zigzag`). Both interpreters support lines and helical arcs; neither supports cubics in space, and
//! LinuxCNC's NURBS are planar.
//!
//! Safe height, home, plunge and spindle are the job's. A program that would leave the travel, or touch stock or fixtures on its links, is refused.

mod head;
mod links;
mod way;

use crate::gcode::{Blocks, Cut, FeedMode};
use crate::{ApproachError, Arcs, ConstantCl, Kind, Nodes, PassPath, even_chords, job_passes, side_curves};
use glam::DVec3;
use job::{Job, JobError, Pattern, Spindle};
use links::Heights;
use machine::prepare;
use oracle::Oracle;
use way::Writer;

/// G-code dialect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Dialect {
    /// LinuxCNC 2.8 or later.
    Linuxcnc,
    /// Grbl 1.1.
    Grbl,
}

/// Options of an export.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// G-code dialect.
    pub dialect: Dialect,
    /// The approach.
    pub kind: Kind,
    /// Unit of the F words.
    pub feed_mode: FeedMode,
    /// Dwell after the spindle is switched on, s.
    pub run_up_s: f64,
}

/// An exported program.
#[derive(Clone, Debug)]
pub struct ExportedProgram {
    /// Text.
    pub text: String,
    /// Number of passes.
    pub passes: usize,
    /// Number of cuts on the passes.
    pub cuts: usize,
    /// Duration of these cuts, s.
    pub cutting_time_s: f64,
    /// Safe height, mm.
    pub safe_z_mm: f64,
    /// What the job asks for and the program does not do: a sentence each.
    pub notes: Vec<String>,
}

/// Failure of an export.
#[derive(Debug)]
pub enum ExportError {
    /// The approach failed.
    Approach(ApproachError),
    /// The program would not be safe, or not within the travel.
    Refused(JobError),
    /// G-code cannot represent the approach.
    SurfaceNeedsTheCore,
    /// The surface faces down, so that the tool cannot retract.
    FacesDown {
        /// Parameter u.
        u: f64,
        /// Parameter v.
        v: f64,
    },
}

impl<E: Into<ApproachError>> From<E> for ExportError {
    fn from(error: E) -> Self {
        Self::Approach(error.into())
    }
}

/// Rounding tolerance of the z of a normal below 0.
const LEVEL: f64 = 1e-9;

/// A pass with its cuts.
struct Path {
    begin_mm: DVec3,
    highest_mm: f64,
    end_mm: DVec3,
    /// Path and side parameter of start and end.
    ends: [[f64; 2]; 2],
    /// The pass is a point with more than one normal: the tool stands at its start alone.
    is_tip: bool,
    cuts: Vec<Cut>,
}

impl Path {
    fn new(kind: Kind, job: &Job, pass: &PassPath<'_>) -> Result<Self, ExportError> {
        let lines = |chords: Vec<crate::Chord>| chords.iter().map(|chord| chord.cut()).collect();
        let cuts: Vec<Cut> = match kind {
            Kind::ConstantCl => lines(ConstantCl::new(job).chords(pass)?),
            Kind::Linear => lines(even_chords(pass, job.chord_mm, job.feed_mm_s())?),
            Kind::Curve => Arcs::new(job).cuts(pass)?,
            Kind::Surface => return Err(ExportError::SurfaceNeedsTheCore),
        };
        let mut highest_mm = f64::NEG_INFINITY;
        for node in Nodes::new(pass)?.0 {
            highest_mm = highest_mm.max(node.cl_mm()[2]);
            if node.at.contact.normal[2] < -LEVEL {
                let (u, v) = pass.oracle.swapped(node.at.path, pass.side_at(node.at.path));
                return Err(ExportError::FacesDown { u, v });
            }
        }
        let at = |end: usize| pass.at(pass.ends[end]).map(|at| at.contact.cl_mm);
        let (begin_mm, end_mm) = (at(0)?, at(1)?);
        let is_tip = pass.is_tip(begin_mm)?;
        let end_mm = if is_tip { begin_mm } else { end_mm };
        Ok(Self {
            begin_mm,
            // A degenerate pass has no points.
            highest_mm: highest_mm.max(begin_mm[2]).max(end_mm[2]),
            end_mm,
            ends: pass.ends.map(|path| [path, pass.side_at(path)]),
            is_tip,
            cuts,
        })
    }
}

/// The program of a job; `done` is called after each pass.
///
/// # Errors
/// See [`ExportError`].
pub fn export(job: &Job, options: &Options, done: &dyn Fn()) -> Result<ExportedProgram, ExportError> {
    let oracle = Oracle::new(job)?;
    let mut paths = Vec::new();
    let curves = side_curves(job)?;
    for pass in job_passes(&oracle, &curves)? {
        paths.push(Path::new(options.kind, job, &pass)?);
        done();
    }
    let heights = heights(job, &paths)?;
    let mut text = String::new();
    let mut writer = Writer::new(Blocks::new(&mut text, options.feed_mode));
    let notes = head::notes(job);
    head::write(&mut writer.blocks, job, options, &heights, paths.len());
    heights.leave_home(&mut writer);
    write_passes(&mut writer, job, &oracle, &paths, &heights)?;
    heights.go_home(&mut writer);
    writer
        .check(job, &oracle, heights.safe_z_mm)
        .map_err(ExportError::Refused)?;
    head::end(&mut writer.blocks, job, options);
    let cuts = || paths.iter().flat_map(|path| &path.cuts);
    Ok(ExportedProgram {
        passes: paths.len(),
        cuts: cuts().count(),
        cutting_time_s: cuts().map(Cut::time_s).sum(),
        safe_z_mm: heights.safe_z_mm,
        notes,
        text,
    })
}

/// The job's safe height and home.
fn heights(job: &Job, paths: &[Path]) -> Result<Heights, ExportError> {
    let safe_z_mm = prepare::safe_z_mm(job);
    let highest_mm = paths
        .iter()
        .map(|path| path.highest_mm)
        .fold(f64::NEG_INFINITY, f64::max);
    if safe_z_mm < highest_mm {
        return Err(ExportError::Refused(job.origin.error(
            "machine.safe_z_mm",
            format!("the safe height, z = {safe_z_mm} mm, is below the highest cut, where the ball's centre is at z = {highest_mm:.4} mm"),
            format!("raise safe_z_mm above {highest_mm:.4} mm, and above clamps and stock"),
        )));
    }
    Ok(Heights {
        safe_z_mm,
        home_mm: job.machine.home_mm.map(DVec3::from),
    })
}

/// The passes, and the links before each of them.
fn write_passes(
    writer: &mut Writer<'_>,
    job: &Job,
    oracle: &Oracle,
    paths: &[Path],
    heights: &Heights,
) -> Result<(), ExportError> {
    let mut before: Option<&Path> = None;
    for path in paths {
        let is_beside = |before: &&Path| {
            let ends = [before.ends[1], path.ends[0]];
            let centres = [before.end_mm, path.begin_mm];
            let may_step = job.pattern == Pattern::Zigzag && !before.is_tip;
            may_step && links::is_beside(ends, centres, job.spacing.is_constant())
        };
        match before.filter(is_beside) {
            Some(before) => {
                let over = links::step_over(oracle, [before.ends[1], path.ends[0]], job)?;
                over.iter().for_each(|cut| writer.cut(cut));
            }
            None => {
                writer.touch(false);
                links::approach(writer, path.begin_mm, heights, before.is_none(), job);
                writer.touch(true);
            }
        }
        path.cuts.iter().for_each(|cut| writer.cut(cut));
        before = Some(path);
    }
    writer.touch(false);
    Ok(())
}

/// The job's spindle where it turns.
fn spindle(job: &Job) -> Option<Spindle> {
    job.machine.spindle.filter(|spindle| spindle.rpm > 0)
}
