//! The text of a job of many faces.

use std::fmt::Write;
use std::path::Path;

use crate::face::FacePlan;
use crate::order::FaceOrder;
use crate::planner::{JobFolder, Planner};
use crate::setup::PartSetup;
use crate::sums::percent;

impl Planner<'_> {
    /// One job file with all faces that have a job: the common keys, then a section for each face in the order of machining. `output`: the path of that file, for its
    /// first comment.
    #[must_use]
    pub fn text(
        &self,
        setup: &PartSetup,
        folder: &JobFolder,
        output: &Path,
        order: &FaceOrder,
        plans: &[FacePlan],
    ) -> String {
        let faces: Vec<&FacePlan> = order.faces.iter().map(|index| &plans[*index]).collect();
        let mut out = self.head(setup, folder, output, &faces);
        for plan in faces {
            let share = plan
                .reach
                .as_ref()
                .map_or(0.0, |reach| percent(reach.region_mm2, reach.area_mm2));
            let chosen = plan.job.as_ref().map_or("u", |job| job.passes.along.name());
            let along = self.cut.along.as_deref().unwrap_or(chosen);
            let _ = write!(
                out,
                "\n[[face]]\nface = {}\ntolerance_mm = {}\nparameters = {:?}\nalong = {along:?}\nside = {:?}    # {share:.1} % of the face\n",
                plan.number,
                self.cut.tolerance_mm,
                plan.parameters.name(),
                plan.side,
            );
        }
        out
    }

    /// The keys that all faces have in common, with a first comment.
    fn head(&self, setup: &PartSetup, folder: &JobFolder, output: &Path, faces: &[&FacePlan]) -> String {
        let path = folder.source.as_deref().unwrap_or_default();
        let radius_mm = self.cut.radius_mm;
        let mut out = format!(
            "# {} faces of {}, each with the region that a ball of radius {radius_mm} mm reaches, in this order. One alone: {}#{}\n\n\
             # What must not be cut, and what the faces are of.\n[part]\npath = {path:?}\n",
            faces.len(),
            job::one_line(self.file),
            output.file_name().unwrap_or_default().to_string_lossy(),
            faces.first().map_or(1, |plan| plan.number),
        );
        let rotate_deg = setup.side.rotate_deg();
        if rotate_deg != [0.0; 3] || setup.translate_mm != [0.0; 3] {
            let _ = write!(
                out,
                "\n[placement]\nrotate_deg = {rotate_deg:?}    # of the whole part\ntranslate_mm = {:?}\n",
                setup.translate_mm
            );
        }
        let home = setup.home_mm();
        let _ = write!(
            out,
            "\n[tool]\nkind = \"ball\"\nradius_mm = {radius_mm}\n\n\
             [cut]                       # of every face, unless its section says otherwise\n\
             feed_mm_min = {}            # of the cutter contact along the surface\n\
             scallop_mm = {}             # scallop height limit between passes\n\
             pattern = \"{}\"\n\n\
             [machine]\n{}\
             home_mm = [{:.3}, {:.3}, {:.3}]    # where the ball's centre stands before and after the faces\n",
            self.cut.feed_mm_min(),
            setup.scallop_mm,
            self.cut.pattern.as_deref().unwrap_or("zigzag"),
            cad::LIMITS,
            home.x,
            home.y,
            home.z,
        );
        out
    }
}
