//! Export of a job as G-code for LinuxCNC or Grbl.
//!
//! ```text
//! job ─► oracle ─► PassPath ─► linear.rs or arcs.rs (approach/) ─► Cut ─┐
//!                          └─► links.rs: retract, step-over ────────────┴─► gcode.rs: blocks ─► text
//! ```
//!
//! The programmed point is the ball centre. The cuts are those of the approach; between passes the tool retracts (`zig`) or steps over
//! along the boundary of the surface (`zigzag`). Both interpreters support lines and helical arcs; neither supports cubics in space, and
//! LinuxCNC's NURBS are planar.

mod links;

use crate::gcode::{Blocks, Cut, FeedMode};
use crate::{ApproachError, Arcs, ConstantCl, Kind, Nodes, PassPath, even_chords, job_passes, side_curves};
use glam::DVec3;
use job::{Job, Pattern};
use oracle::Oracle;

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
    /// Clearance of rapid moves above the highest CL and above the start of a plunge, mm.
    pub clearance_mm: f64,
    /// Spindle speed, rpm; `None`: the program contains no spindle command.
    pub spindle_rpm: Option<f64>,
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
}

/// Failure of an export.
#[derive(Clone, Debug, PartialEq)]
pub enum ExportError {
    /// The approach failed.
    Approach(ApproachError),
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
    let highest = paths.iter().map(|path| path.highest_mm);
    let safe_z_mm = highest.fold(f64::NEG_INFINITY, f64::max) + options.clearance_mm;
    let mut text = String::new();
    let mut blocks = Blocks::new(&mut text, options.feed_mode);
    head(&mut blocks, job, options, paths.len());
    let mut before: Option<&Path> = None;
    for path in &paths {
        let is_beside = |before: &&Path| {
            let ends = [before.ends[1], path.ends[0]];
            let centres = [before.end_mm, path.begin_mm];
            let may_step = job.pattern == Pattern::Zigzag && !before.is_tip;
            may_step && links::is_beside(ends, centres, job.spacing.is_constant())
        };
        match before.filter(is_beside) {
            Some(before) => {
                let over = links::step_over(&oracle, [before.ends[1], path.ends[0]], job)?;
                over.iter().for_each(|cut| blocks.cut(cut));
            }
            None => links::approach(&mut blocks, path.begin_mm, safe_z_mm, job, options),
        }
        path.cuts.iter().for_each(|cut| blocks.cut(cut));
        before = Some(path);
    }
    links::retract(&mut blocks, safe_z_mm);
    if options.spindle_rpm.is_some() {
        blocks.line("M5");
    }
    blocks.line("M2");
    if options.dialect == Dialect::Linuxcnc {
        blocks.line("%");
    }
    let cuts = || paths.iter().flat_map(|path| &path.cuts);
    Ok(ExportedProgram {
        passes: paths.len(),
        cuts: cuts().count(),
        cutting_time_s: cuts().map(Cut::time_s).sum(),
        safe_z_mm,
        text,
    })
}

fn head(blocks: &mut Blocks<'_>, job: &Job, options: &Options, passes: usize) {
    if options.dialect == Dialect::Linuxcnc {
        blocks.line("%");
    }
    let title = std::path::Path::new(job.origin.name())
        .file_stem()
        .map_or_else(|| "job".to_owned(), |name| name.to_string_lossy().into_owned());
    // Grbl limits lines to 80 characters.
    let title: String = title.chars().take(30).collect();
    blocks.comment(&format!("{title}: {passes} passes, {}", options.kind.name()));
    blocks.comment(&format!(
        "ball of {} mm radius, programmed point: centre",
        job.radius_mm
    ));
    let what = match options.kind {
        Kind::ConstantCl => "CL feed",
        _ => "CC feed",
    };
    blocks.comment(&format!(
        "{what} {} mm/min, tolerance {} mm",
        job.feed_mm_min, job.chord_mm
    ));
    // Centres of arcs are relative to their start (G91.1): a controller may have been left with absolute ones.
    blocks.line("G17G21G40G90G91.1");
    if options.dialect == Dialect::Linuxcnc {
        // Path blending within the tolerance; naive CAM detector off, because it would join cuts of different feeds.
        blocks.line(&format!("G64P{}Q0", job.chord_mm));
    }
    match options.spindle_rpm {
        Some(rpm) => blocks.line(&format!("S{rpm}M3")),
        None => blocks.comment("the spindle is not switched on by this program"),
    }
    blocks.line(options.feed_mode.word());
}
