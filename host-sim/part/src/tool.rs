//! The tool: a ball, and cylinders above it.

use job::{Job, ToolBody};

/// Cylinders of a cone.
const STEPS: usize = 4;

/// A part of the tool that touches, or the rule of its own surface that a place breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Reason {
    /// The surface is steeper than allowed, or looks down.
    Steep,
    /// A derivative of the surface nearly vanishes, or the two are nearly parallel: the board would not know the normal.
    Degenerate,
    /// The surface is more concave than the ball.
    Fit,
    /// The ball would cut another place of the part.
    Ball,
    /// The shank, or the stem above the ball.
    Shank,
    /// The holder.
    Holder,
}

impl Reason {
    /// All of them, in the order in which they are looked at.
    pub const ALL: [Self; 6] = [
        Self::Steep,
        Self::Degenerate,
        Self::Fit,
        Self::Ball,
        Self::Shank,
        Self::Holder,
    ];

    /// In a word.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Steep => "steep",
            Self::Degenerate => "degenerate",
            Self::Fit => "fit",
            Self::Ball => "ball",
            Self::Shank => "shank",
            Self::Holder => "holder",
        }
    }
}

/// A cylinder around the tool's axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    /// What it is of.
    pub part: Reason,
    /// Heights of its ends above the ball's centre, mm.
    pub z: [f64; 2],
    /// Its radius, mm.
    pub radius: f64,
}

/// The tool, its axis along z.
#[derive(Clone, Debug, PartialEq)]
pub struct Tool {
    /// Radius of the ball, mm.
    pub radius: f64,
    /// What is above the ball's centre.
    pub columns: Vec<Column>,
}

impl Tool {
    /// The tool of a job.
    #[must_use]
    pub fn of(job: &Job) -> Self {
        Self::new(job.radius_mm, &job.body)
    }

    /// A ball with a body; the body's last part has no end.
    #[must_use]
    pub fn new(radius: f64, body: &ToolBody) -> Self {
        let shank = body.shank_mm.map_or(radius, |diameter| 0.5 * diameter);
        let from = body.neck_mm.unwrap_or(radius) - radius;
        let face = body.length_mm.map_or(f64::INFINITY, |length| length - radius);
        let mut columns = Vec::new();
        let mut add = |part: Reason, z: [f64; 2], radius: f64| columns.push(Column { part, z, radius });
        if from > 0.0 {
            add(Reason::Shank, [0.0, from], radius);
        }
        let top = if body.holder.is_empty() {
            f64::INFINITY
        } else {
            face
        };
        add(Reason::Shank, [from, top], shank);
        let mut z = face;
        for part in &body.holder {
            let [low, high] = part.diameter_mm.map(|diameter| 0.5 * diameter);
            let steps = if low == high { 1 } else { STEPS };
            for step in 0..steps {
                let share = |step: usize| step as f64 / steps as f64;
                let at = |share: f64| z + share * part.length_mm;
                let radius = |share: f64| low + share * (high - low);
                let widest = radius(share(step)).max(radius(share(step + 1)));
                add(Reason::Holder, [at(share(step)), at(share(step + 1))], widest);
            }
            z += part.length_mm;
        }
        if let Some(last) = body.holder.last() {
            add(Reason::Holder, [z, f64::INFINITY], 0.5 * last.diameter_mm[1]);
        }
        Self { radius, columns }
    }

    /// This tool with every part at least as thick as the ball and all parts below it: where it is clear, it is clear straight above.
    #[must_use]
    pub fn wide(&self) -> Self {
        let mut radius = self.radius;
        let columns = self.columns.iter().map(|column| {
            radius = radius.max(column.radius);
            Column { radius, ..*column }
        });
        Self {
            radius: self.radius,
            columns: columns.collect(),
        }
    }

    /// This tool with another ball; parts of the ball's diameter follow it.
    #[must_use]
    pub fn with_radius(&self, radius: f64) -> Self {
        let columns = self.columns.iter().map(|column| Column {
            radius: if column.radius == self.radius {
                radius
            } else {
                column.radius
            },
            ..*column
        });
        Self {
            radius,
            columns: columns.collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use job::HolderPart;

    use super::*;

    /// A thin shank, and a holder that narrows from 50 to 30 mm and widens to 40.
    #[test]
    fn a_wide_tool_does_not_narrow_upwards() {
        let part = |diameter: f64, length_mm: f64| HolderPart {
            diameter_mm: [diameter, diameter],
            length_mm,
        };
        let body = ToolBody {
            shank_mm: Some(4.0),
            length_mm: Some(40.0),
            holder: vec![part(50.0, 20.0), part(30.0, 60.0), part(60.0, 5.0)],
            ..ToolBody::default()
        };
        let radii = |tool: &Tool| -> Vec<f64> { tool.columns.iter().map(|column| column.radius).collect() };
        let tool = Tool::new(3.0, &body);
        assert_eq!(radii(&tool), [2.0, 25.0, 15.0, 30.0, 30.0]);
        assert_eq!(radii(&tool.wide()), [3.0, 25.0, 25.0, 30.0, 30.0]);
    }
}
