//! First and last blocks of a program: what it is, modal words, spindle and coolant.

use super::links::Heights;
use super::{Dialect, Options, spindle};
use crate::Kind;
use crate::gcode::Blocks;
use job::Job;

/// What the job asks for and no exported program does. Each fits into a line of Grbl's, 80 characters.
pub(super) fn notes(job: &Job) -> Vec<String> {
    let turns = format!(
        "overrun_mm = {} is not used: exported programs have no turns",
        job.overrun_mm
    );
    (job.overrun_mm > 0.0).then_some(turns).into_iter().collect()
}

/// The blocks before the first motion.
pub(super) fn write(blocks: &mut Blocks<'_>, job: &Job, options: &Options, heights: &Heights, passes: usize) {
    if options.dialect == Dialect::Linuxcnc {
        blocks.line("%");
    }
    comments(blocks, job, options, heights, passes);
    // Centres of arcs are relative to their start (G91.1): a controller may have been left with absolute ones.
    blocks.line("G17G21G40G90G91.1");
    if options.dialect == Dialect::Linuxcnc {
        // Path blending within the tolerance; naive CAM detector off, because it would join cuts of different feeds.
        blocks.line(&format!("G64P{}Q0", job.chord_mm));
    }
    switch_on(blocks, job, options);
    blocks.line(options.feed_mode.word());
}

fn comments(blocks: &mut Blocks<'_>, job: &Job, options: &Options, heights: &Heights, passes: usize) {
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
    blocks.comment(&match heights.home_mm {
        Some(home) => format!(
            "begins and ends at home: X{:.4} Y{:.4} Z{:.4}",
            home.x, home.y, home.z
        ),
        None => "begins where the tool stands, by Z alone; ends above the last pass".to_owned(),
    });
    blocks.comment(&format!("safe height: Z{:.4}", heights.safe_z_mm));
    for note in notes(job) {
        blocks.comment(&note);
    }
}

/// Spindle, its run-up, coolant.
fn switch_on(blocks: &mut Blocks<'_>, job: &Job, options: &Options) {
    match spindle(job) {
        Some(spindle) => {
            let turns = if spindle.counterclockwise { "M4" } else { "M3" };
            blocks.line(&format!("S{}{turns}", spindle.rpm));
            if options.run_up_s > 0.0 {
                // P is in seconds in both dialects.
                blocks.line(&format!("G4P{}", options.run_up_s));
            }
        }
        None => blocks.comment("the spindle is not switched on by this program"),
    }
    if has_coolant(job) {
        blocks.line("M8");
    }
}

fn has_coolant(job: &Job) -> bool {
    job.machine.spindle.is_some_and(|spindle| spindle.coolant)
}

/// The blocks after the last motion.
pub(super) fn end(blocks: &mut Blocks<'_>, job: &Job, options: &Options) {
    if has_coolant(job) {
        blocks.line("M9");
    }
    if spindle(job).is_some() {
        blocks.line("M5");
    }
    blocks.line("M2");
    if options.dialect == Dialect::Linuxcnc {
        blocks.line("%");
    }
}
