//! Programs for machines that exist: a job as G-code for LinuxCNC or Grbl.
//!
//! ```text
//! job ─► oracle ─► PassPath ─► linear.rs or arcs.rs (approach/) ─► Cut ─┐
//!                          └─► links.rs: retract, step-over ────────────┴─► gcode.rs: blocks ─► text
//! ```
//!
//! The programmed point is the centre of the ball. Cuts are those of the approach; between passes the tool is lifted
//! (`zig`) or steps over along the surface's boundary (`zigzag`). Lines and arcs, with the third axis
//! in proportion, are what the interpreters of both know; neither knows cubics in space, and LinuxCNC's NURBS stay in a plane.

mod links;

use crate::gcode::{Blocks, Cut, FeedMode};
use crate::{ApproachError, Arcs, ConstantCl, Kind, Nodes, PassPath, even_chords, passes};
use job::{Job, Pattern};
use oracle::Oracle;

/// Whose G-code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Dialect {
    /// LinuxCNC 2.8 or later.
    Linuxcnc,
    /// Grbl 1.1.
    Grbl,
}

/// How a program is to be.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Whose G-code.
    pub dialect: Dialect,
    /// The approach.
    pub kind: Kind,
    /// What F words mean.
    pub feed_mode: FeedMode,
    /// How far above the highest centre, or the place to cut, the tool moves rapidly, mm.
    pub clearance_mm: f64,
    /// Speed of the spindle, rpm; where there is none, the program does not touch the spindle.
    pub spindle_rpm: Option<f64>,
}

/// A program.
#[derive(Clone, Debug)]
pub struct Exported {
    /// Its text.
    pub text: String,
    /// Passes.
    pub passes: usize,
    /// Cuts on the passes.
    pub cuts: usize,
    /// Time of these cuts, s.
    pub cutting_time_s: f64,
    /// Height at which the tool crosses the part, mm.
    pub safe_z_mm: f64,
}

/// Why there is no program.
#[derive(Clone, Debug, PartialEq)]
pub enum ExportError {
    /// The approach has none.
    Approach(ApproachError),
    /// The approach is not one that other machines can follow.
    SurfaceNeedsTheCore,
    /// The surface faces down, so the tool could not be lifted off it.
    FacesDown {
        /// u of the place.
        u: f64,
        /// v of the place.
        v: f64,
    },
}

impl<E: Into<ApproachError>> From<E> for ExportError {
    fn from(error: E) -> Self {
        Self::Approach(error.into())
    }
}

/// A normal may point down by this much by rounding alone.
const LEVEL: f64 = 1e-9;

/// A pass with its cuts.
struct Path {
    begin_mm: [f64; 3],
    highest_mm: f64,
    side: f64,
    end: f64,
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
                let (u, v) = pass.oracle.swapped(node.at.path, pass.side);
                return Err(ExportError::FacesDown { u, v });
            }
        }
        let at = |end: usize| pass.at(pass.ends[end]).map(|at| at.contact.cl_mm);
        let (begin_mm, end_mm) = (at(0)?, at(1)?);
        Ok(Self {
            begin_mm,
            // A pass that is one point has no places.
            highest_mm: highest_mm.max(begin_mm[2]).max(end_mm[2]),
            side: pass.side,
            end: pass.ends[1],
            cuts,
        })
    }
}

/// The program of a job; `done` is called after each pass.
///
/// # Errors
/// See [`ExportError`].
pub fn export(job: &Job, options: &Options, done: &dyn Fn()) -> Result<Exported, ExportError> {
    let oracle = Oracle::new(job)?;
    let mut paths = Vec::new();
    for pass in passes(&oracle)? {
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
        match before.filter(|_| job.pattern == Pattern::Zigzag) {
            Some(before) => {
                let over = links::step_over(&oracle, before.end, [before.side, path.side], job)?;
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
    Ok(Exported {
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
    // Grbl takes 80 characters a line.
    let title: String = title.chars().take(30).collect();
    blocks.comment(&format!("{title}: {passes} passes, {}", options.kind.name()));
    blocks.comment(&format!(
        "ball of {} mm radius, of which the centre is programmed",
        job.radius_mm
    ));
    let what = match options.kind {
        Kind::ConstantCl => "feed of the centre",
        _ => "feed of the contact",
    };
    blocks.comment(&format!(
        "{what} {} mm/min, tolerance {} mm",
        job.feed_mm_min, job.chord_mm
    ));
    blocks.line("G17G21G40G90");
    if options.dialect == Dialect::Linuxcnc {
        // Blends corners within the tolerance again; without a naive CAM detector, which would join cuts of different feeds.
        blocks.line(&format!("G64P{}Q0", job.chord_mm));
    }
    match options.spindle_rpm {
        Some(rpm) => blocks.line(&format!("S{rpm}M3")),
        None => blocks.comment("the spindle is not switched on here"),
    }
    blocks.line(options.feed_mode.word());
}
