//! The text of a job file.

use std::fmt::Write;

use job::{NurbsSpec, one_line};

use super::{FEED_MM_MIN, JobWriter, LIMITS, default_scallop_mm};
use crate::Form;

/// Axis limits of a face by itself, which may be for studying the geometry.
const NO_LIMITS: &str = "# A machine's axis limits, or its profile (--machine FILE): without them the job is for studying the geometry.\n\
     # velocity_max_mm_s = [100, 100, 50]\n\
     # acceleration_max_mm_s2 = [1000, 1000, 500]\n\
     # jerk_max_mm_s3 = [20000, 20000, 10000]\n";
/// Digits of a written coordinate: full precision of f64.
const COLUMN: usize = 100;

impl JobWriter<'_> {
    /// The job file.
    pub(super) fn text(&self) -> String {
        let mut out = String::new();
        self.head(&mut out);
        self.surface(&mut out);
        self.placement(&mut out);
        self.tool_and_cut(&mut out);
        out
    }

    /// What the job is of, and the warnings.
    fn head(&self, out: &mut String) {
        let size = self.measures.size_mm();
        let _ = writeln!(
            out,
            "# Face {} ({}, {}) of {}: {:.3} x {:.3} x {:.3} mm, {} patches{}.",
            self.face.number,
            one_line(&self.face.entity),
            self.face.surface.kind(),
            one_line(self.source),
            size[0],
            size[1],
            size[2],
            self.surface.patches,
            if self.surface.form == Form::Exact {
                ", exact"
            } else {
                ""
            }
        );
        for warning in &self.warnings {
            let _ = writeln!(out, "# Note: {}.", one_line(warning));
        }
        out.push('\n');
    }

    /// The surface: of the file, with the part, where the job has a region; else its poles, with the source of an approximation.
    fn surface(&self, out: &mut String) {
        let number = self.face.number;
        match &self.options.source {
            Some((path, tolerance_mm)) if self.by_region => {
                // Its region is made when the job is read.
                let _ = writeln!(
                    out,
                    "[surface]\nkind = \"file\"\npath = {path:?}\nface = {number}\ntolerance_mm = {tolerance_mm}\nparameters = {:?}      # \"edges\": of four edges of the face where it has them; \"surface\"\n\n\
                     # What must not be cut; the region of the face is what the tool reaches without cutting it.\n\
                     [part]\npath = {path:?}",
                    self.surface.parameters.name(),
                );
            }
            source => {
                write_surface(out, &self.surface.nurbs);
                if let (Form::Fitted { .. }, Some((path, tolerance_mm))) = (&self.surface.form, source) {
                    let _ = writeln!(
                        out,
                        "# What the surface approximates: `cargo sim verify` measures against it\nsource = {path:?}\nsource_face = {number}\ntolerance_mm = {tolerance_mm}",
                    );
                }
            }
        }
    }

    fn placement(&self, out: &mut String) {
        let options = self.options;
        if options.rotate_deg != [0.0; 3] || options.translate_mm != [0.0; 3] {
            let _ = write!(
                out,
                "\n[placement]\nrotate_deg = {:?}    # of the whole part\ntranslate_mm = {:?}\n",
                options.rotate_deg, options.translate_mm
            );
        } else if self.centred {
            out.push_str("\n[placement]\nplace = \"centre\"            # the centre of its box, at translate_mm\ntranslate_mm = [0, 0, 0]\n");
        }
    }

    /// Tool, cut and machine.
    fn tool_and_cut(&self, out: &mut String) {
        let (options, radius_mm) = (self.options, self.radius_mm);
        let [pattern, limits] = if options.in_part {
            ["zigzag", LIMITS]
        } else {
            ["zig", NO_LIMITS]
        };
        let _ = write!(
            out,
            "\n[tool]\nkind = \"ball\"\nradius_mm = {radius_mm}               # {}\n\n\
             [cut]\n\
             feed_mm_min = {}           # of the cutter contact along the surface\n\
             scallop_mm = {}            # scallop height limit between passes\n\
             along = {}                # surface parameter along a pass\n\
             side = {}                # machined side: \"up\", or the sign on S_u x S_v\n\
             pattern = {}              # \"zig\": every pass in the same direction; \"zigzag\": alternating\n\
             chord_mm = 0.005            # chord error limit, for export and the approaches made of chords\n\n\
             [machine]\n\
             period_us = 1000            # sampling period\n{limits}",
            self.concave(),
            options.feed_mm_min.unwrap_or(FEED_MM_MIN),
            options
                .scallop_mm
                .unwrap_or_else(|| default_scallop_mm(radius_mm)),
            quoted(options.along.as_deref().unwrap_or("u")),
            quoted(&self.side),
            quoted(options.pattern.as_deref().unwrap_or(pattern)),
        );
    }

    /// The least concave radii, in words.
    fn concave(&self) -> String {
        let [plus, minus] = self.measures.concave_mm;
        if plus.is_none() && minus.is_none() {
            return "the surface is not concave".to_owned();
        }
        let shown =
            |radius: Option<f64>| radius.map_or("none".to_owned(), |radius| format!("{radius:.4} mm"));
        format!(
            "least concave radius: {} seen from +, {} from -",
            shown(plus),
            shown(minus)
        )
    }
}

/// A TOML string.
fn quoted(text: &str) -> String {
    format!(
        "\"{}\"",
        one_line(&text.replace('\\', "\\\\").replace('"', "\\\""))
    )
}

fn write_surface(out: &mut String, nurbs: &NurbsSpec) {
    let list = |name: &str, numbers: &[f64]| {
        let mut text = format!("{name} = [");
        let mut column = text.len();
        for (index, number) in numbers.iter().enumerate() {
            let word = format!("{number}{}", if index + 1 < numbers.len() { ", " } else { "" });
            if column + word.len() > COLUMN {
                text.push_str("\n    ");
                column = 4;
            }
            column += word.len();
            text.push_str(&word);
        }
        text.push_str("]\n");
        text
    };
    let _ = writeln!(
        out,
        "[surface]\nkind = \"nurbs\"\ndegree = [{}, {}]",
        nurbs.degree[0], nurbs.degree[1]
    );
    out.push_str(&list("knots_u", &nurbs.knots_u));
    out.push_str(&list("knots_v", &nurbs.knots_v));
    let what = if nurbs.rational {
        "[x, y, z, weight]"
    } else {
        "[x, y, z]"
    };
    let _ = writeln!(
        out,
        "# {what}; one block per pole along u, containing the poles along v\npoles_mm = ["
    );
    for row in &nurbs.poles_mm {
        out.push_str("    [\n");
        for [x, y, z, w] in row {
            let weight = if nurbs.rational {
                format!(", {w}")
            } else {
                String::new()
            };
            let _ = writeln!(out, "        [{x}, {y}, {z}{weight}],");
        }
        out.push_str("    ],\n");
    }
    out.push_str("]\n");
}
