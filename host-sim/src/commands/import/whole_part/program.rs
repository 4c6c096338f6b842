//! The text of a job of many faces.

use super::super::{Arguments, relative};
use super::Output;
use super::face::Outcome;
use super::setup::Setup;
use super::summary::Sums;

/// One file with all faces: what they have in common, from the text of the first one, and a section for each.
pub(super) fn program(
    arguments: &Arguments,
    file: &str,
    output: &Output<'_>,
    setup: &Setup,
    order: &[usize],
    outcomes: &[Outcome],
) -> String {
    use std::fmt::Write;

    let path = relative(&arguments.file, output.path).unwrap_or_default();
    let radius_mm = arguments.radius_mm.unwrap_or(0.0);
    let mut out = format!(
        "# {} faces of {}, each with the region that a ball of radius {radius_mm} mm reaches, in this order. One alone: {}#{}\n\n\
         # What must not be cut, and what the faces are of.\n[part]\npath = {path:?}\n",
        order.len(),
        job::one_line(file),
        output.path.file_name().unwrap_or_default().to_string_lossy(),
        order.first().map_or(1, |index| outcomes[*index].number),
    );
    if setup.up.rotate_deg() != [0.0; 3] || setup.translate_mm != [0.0; 3] {
        let _ = write!(
            out,
            "\n[placement]\nrotate_deg = {:?}    # of the whole part\ntranslate_mm = {:?}\n",
            setup.up.rotate_deg(),
            setup.translate_mm
        );
    }
    let home = setup.home_mm(radius_mm);
    let _ = write!(
        out,
        "\n[tool]\nkind = \"ball\"\nradius_mm = {radius_mm}\n\n\
         [cut]                       # of every face, unless its section says otherwise\n\
         feed_mm_min = {}            # of the cutter contact along the surface\n\
         scallop_mm = {}             # scallop height limit between passes\n\
         pattern = \"{}\"\n\n\
         [machine]\n{}\
         home_mm = [{:.3}, {:.3}, {:.3}]    # where the ball's centre stands before and after the faces\n",
        arguments.feed_mm_min.unwrap_or(cad::FEED_MM_MIN),
        setup.scallop_mm,
        arguments.pattern.as_deref().unwrap_or("zigzag"),
        cad::LIMITS,
        home.x,
        home.y,
        home.z,
    );
    for index in order {
        let outcome = &outcomes[*index];
        let share = outcome
            .reach
            .as_ref()
            .map_or(0.0, |reach| Sums::share(reach.region_mm2, reach.area_mm2));
        let along = arguments.along.as_deref().unwrap_or(outcome.along);
        let _ = write!(
            out,
            "\n[[face]]\nface = {}\ntolerance_mm = {}\nparameters = {:?}\nalong = {along:?}\nside = {:?}    # {share:.1} % of the face\n",
            outcome.number,
            arguments.tolerance,
            outcome.parameters.name(),
            outcome.side,
        );
    }
    out
}
