//! The sections `[tool]`, `[stock]` and `[[fixture]]`.

use job::{Block, Fixture, HolderPart, JobError, RADIUS_MAX_MM, Setup, TOOL_SIZE_MAX_MM, ToolBody};
use toml::de::DeValue;

use crate::section::Section;

/// Most parts of a holder, and most fixtures.
const PARTS_MAX: usize = 100;
/// Largest coordinate of a box, mm: ten times the range of the machine's positions.
const PLACE_MAX_MM: f64 = 20_000.0;
const BOX: &str =
    "give [least, most] for each of x, y and z, in mm, e.g. box_mm = [[-50, 50], [-40, 40], [-20, 0]]";
const HOLDER: &str = "{ diameter_mm = 40, length_mm = 60 }";

/// The ball's radius, mm, and the tool above it.
pub(super) fn tool(tool: &Section<'_>) -> Result<(f64, ToolBody), JobError> {
    tool.only(
        &["kind", "radius_mm", "shank_mm", "neck_mm", "length_mm", "holder"],
        &[],
    )?;
    tool.choice("kind", &[("ball", ())])?;
    let radius_mm = tool.number_within(
        "radius_mm",
        0.0,
        RADIUS_MAX_MM,
        "the ball's radius in mm (half its diameter), e.g. 10",
    )?;
    let size = |key: &str, want: &str| {
        let given = tool.has(key);
        given
            .then(|| tool.number_within(key, 0.0, TOOL_SIZE_MAX_MM, want))
            .transpose()
    };
    let body = ToolBody {
        shank_mm: size("shank_mm", "the diameter of the shank in mm, e.g. 6")?,
        neck_mm: size(
            "neck_mm",
            "the length from the ball's tip to the beginning of the shank in mm, e.g. 20",
        )?,
        length_mm: size(
            "length_mm",
            "the length from the ball's tip to the holder's face in mm, e.g. 50",
        )?,
        holder: if tool.has("holder") {
            holder(tool)?
        } else {
            Vec::new()
        },
    };
    if let Some(neck_mm) = body.neck_mm.filter(|neck_mm| *neck_mm < radius_mm) {
        let what = format!("`neck_mm` must be at least the ball's radius of {radius_mm} mm, not {neck_mm}");
        let remedy = "give the length from the ball's tip to the beginning of the shank, or leave it out";
        return Err(tool.error("neck_mm", what, remedy));
    }
    let below_mm = body.neck_mm.unwrap_or(radius_mm);
    if let Some(length_mm) = body.length_mm.filter(|length_mm| *length_mm <= below_mm) {
        let (what, key) = match body.neck_mm {
            Some(neck_mm) => (format!("neck of {neck_mm} mm"), "neck_mm"),
            None => (format!("ball's radius of {radius_mm} mm"), "radius_mm"),
        };
        let what = format!("`length_mm` must be above the {what}, not {length_mm}");
        let remedy =
            format!("give the length from the ball's tip to the holder's face in mm, or correct {key}");
        return Err(tool.error("length_mm", what, remedy));
    }
    if !body.holder.is_empty() && body.length_mm.is_none() {
        let what = "`holder` needs `length_mm`: where the holder begins";
        let remedy = "add length_mm = ..., the length from the ball's tip to the holder's face in mm";
        return Err(tool.error("holder", what, remedy));
    }
    Ok((radius_mm, body))
}

/// The holder's parts, from its face upwards.
fn holder(tool: &Section<'_>) -> Result<Vec<HolderPart>, JobError> {
    let parts = tool.tables("holder", HOLDER)?;
    if parts.is_empty() || parts.len() > PARTS_MAX {
        let what = format!("`holder` must have 1 to {PARTS_MAX} parts, not {}", parts.len());
        return Err(tool.error(
            "holder",
            what,
            format!("write holder = {HOLDER}, or leave it out"),
        ));
    }
    parts.iter().map(holder_part).collect()
}

fn holder_part(part: &Section<'_>) -> Result<HolderPart, JobError> {
    part.only(&["diameter_mm", "length_mm"], &[])?;
    let want = "a diameter in mm, e.g. 40, or [lower, upper] for a cone, e.g. [20, 40]";
    let diameter_mm = match part.value("diameter_mm")?.get() {
        DeValue::Array(_) => {
            let ends: [f64; 2] = part.numbers("diameter_mm")?;
            let fits = |mm: &f64| *mm > 0.0 && *mm <= TOOL_SIZE_MAX_MM;
            if let Some(wrong) = ends.iter().find(|mm| !fits(mm)) {
                let what = format!(
                    "a diameter of `diameter_mm` must be above 0 and at most {TOOL_SIZE_MAX_MM}, not {wrong}"
                );
                return Err(part.error("diameter_mm", what, format!("give {want}")));
            }
            ends
        }
        _ => [part.number_within("diameter_mm", 0.0, TOOL_SIZE_MAX_MM, want)?; 2],
    };
    let want = "the length of this part of the holder in mm, e.g. 60";
    Ok(HolderPart {
        diameter_mm,
        length_mm: part.number_within("length_mm", 0.0, TOOL_SIZE_MAX_MM, want)?,
    })
}

/// Stock and fixtures.
pub(super) fn read(document: &Section<'_>) -> Result<Setup, JobError> {
    let stock = document.optional_section("stock")?;
    let stock = stock.map(|section| {
        section.only(&["box_mm"], &[])?;
        block(&section)
    });
    let fixtures = document.sections("fixture")?;
    if let Some(one) = fixtures.get(PARTS_MAX) {
        let what = format!("a job has at most {PARTS_MAX} fixtures");
        return Err(one.error("box_mm", what, "make one box around several of them"));
    }
    let fixture = |(number, section): (usize, &Section<'_>)| {
        section.only(&["name", "box_mm"], &[])?;
        let name = if section.has("name") {
            section.text("name")?
        } else {
            number.to_string()
        };
        Ok(Fixture {
            name,
            block: block(section)?,
        })
    };
    Ok(Setup {
        stock: stock.transpose()?,
        fixtures: (1..).zip(&fixtures).map(fixture).collect::<Result<_, _>>()?,
    })
}

/// A box.
fn block(section: &Section<'_>) -> Result<Block, JobError> {
    let ranges: [[f64; 2]; 3] = section.matrix("box_mm")?;
    for ([low, high], axis) in ranges.iter().zip(["x", "y", "z"]) {
        if low >= high {
            let what = format!("the range of {axis} in `box_mm` must ascend, not run from {low} to {high}");
            return Err(section.error("box_mm", what, BOX));
        }
        if let Some(far) = [low, high].into_iter().find(|mm| mm.abs() > PLACE_MAX_MM) {
            let what =
                format!("`box_mm` must be within {PLACE_MAX_MM} mm of the origin; {axis} reaches {far}");
            return Err(section.error("box_mm", what, BOX));
        }
    }
    Ok(Block {
        low_mm: ranges.map(|[low, _]| low),
        high_mm: ranges.map(|[_, high]| high),
    })
}

#[cfg(test)]
mod tests {
    use job::{Block, HolderPart};

    const TORUS: &str = include_str!("../../../jobs/torus.toml");

    fn with(tool: &str, rest: &str) -> Result<job::Job, job::JobError> {
        let text = TORUS.replace("[tool]", &format!("[tool]\n{tool}"));
        crate::parse("a.toml", &format!("{text}\n{rest}"))
    }

    #[test]
    fn a_tool_and_what_stands_around_it_are_read() {
        let job = with(
            "shank_mm = 8\nneck_mm = 12\nlength_mm = 40.5\nholder = [{ diameter_mm = 30, length_mm = 20 }, { diameter_mm = [30, 50], \
             length_mm = 10 }]",
            "[stock]\nbox_mm = [[-50, 50], [-40, 40], [-20, 0.5]]\n[[fixture]]\nname = \"vice\"\nbox_mm = [[0, 1], [0, 2], [0, 3]]\n\
             [[fixture]]\nbox_mm = [[5, 6], [0, 2], [0, 3]]\n",
        )
        .unwrap();
        let body = &job.body;
        assert_eq!(
            (body.shank_mm, body.neck_mm, body.length_mm),
            (Some(8.0), Some(12.0), Some(40.5))
        );
        let part = |diameter_mm, length_mm| HolderPart {
            diameter_mm,
            length_mm,
        };
        assert_eq!(body.holder, [part([30.0; 2], 20.0), part([30.0, 50.0], 10.0)]);
        let low_mm = [-50.0, -40.0, -20.0];
        let high_mm = [50.0, 40.0, 0.5];
        assert_eq!(job.setup.stock, Some(Block { low_mm, high_mm }));
        let names: Vec<_> = job.setup.fixtures.iter().map(|f| f.name.as_str()).collect();
        assert_eq!(names, ["vice", "2"]);
        assert_eq!(job.setup.fixtures[1].block.high_mm, [6.0, 2.0, 3.0]);
        let one = with(
            "length_mm = 40\nholder = { diameter_mm = 30, length_mm = 20 }",
            "",
        )
        .unwrap();
        assert_eq!(one.body.holder, [part([30.0; 2], 20.0)]);
        let plain = with("", "").unwrap();
        assert_eq!(
            (plain.body, plain.setup),
            (job::ToolBody::default(), job::Setup::default())
        );
    }

    /// Checks the line of an error, what is wrong, and that there is a remedy.
    fn is_refused(tool: &str, rest: &str, line: &str, what: &str) {
        let error = with(tool, rest).unwrap_err();
        let (at, _) = error.line_and_column().unwrap();
        let text = TORUS.replace("[tool]", &format!("[tool]\n{tool}")) + "\n" + rest;
        let shown = text.lines().nth(at - 1).unwrap();
        assert!(error.what().contains(what), "{tool}{rest}: {error}");
        assert!(shown.contains(line), "{tool}{rest}: line {at} {shown}");
        assert!(!error.remedy().is_empty());
    }

    #[test]
    fn wrong_tools_are_refused_at_their_line() {
        for (tool, line, what) in [
            ("shank_mm = 0", "shank_mm", "`shank_mm` must be above 0"),
            ("shank_mm = \"6\"", "shank_mm", "must be a number"),
            ("shank = 6", "shank = 6", "did you mean `shank_mm`?"),
            ("neck_mm = 4.9", "neck_mm", "at least the ball's radius of 5 mm"),
            (
                "length_mm = 5",
                "length_mm",
                "above the ball's radius of 5 mm, not 5",
            ),
            (
                "neck_mm = 9\nlength_mm = 9",
                "length_mm",
                "above the neck of 9 mm",
            ),
            (
                "holder = { diameter_mm = 40, length_mm = 60 }",
                "holder",
                "`holder` needs `length_mm`",
            ),
            ("holder = []\nlength_mm = 30", "holder", "1 to 100 parts, not 0"),
            (
                "holder = 40\nlength_mm = 30",
                "holder",
                "must be a table, not a number",
            ),
            (
                "length_mm = 30\nholder = { diameter_mm = [40, -1], length_mm = 60 }",
                "holder",
                "must be above 0 and at most 2000, not -1",
            ),
            (
                "length_mm = 30\nholder = { diameter_mm = 40 }",
                "holder",
                "`length_mm` is missing",
            ),
            (
                "length_mm = 30\nholder = [{ diameter = 40, length_mm = 60 }]",
                "holder",
                "unknown key `diameter`",
            ),
        ] {
            is_refused(tool, "", line, what);
        }
    }

    #[test]
    fn wrong_stock_and_fixtures_are_refused_at_their_line() {
        let fixture = |text: &str| format!("[[fixture]]\n{text}\n");
        for (rest, line, what) in [
            ("[stock]\n", "[stock]", "`box_mm` is missing"),
            (
                "[stock]\nbox_mm = [[0, 1], [1, 1], [0, 1]]\n",
                "box_mm",
                "the range of y in `box_mm` must ascend",
            ),
            (
                "[[stock]]\nbox_mm = [[0, 1], [0, 1], [0, 1]]\n",
                "stock",
                "must be a section",
            ),
            (
                "[fixture]\nbox_mm = [[0, 1], [0, 1], [0, 1]]\n",
                "fixture",
                "a list of sections",
            ),
            (
                &fixture("box_mm = [[0, 1], [0, 1]]"),
                "box_mm",
                "must have 3 rows, not 2",
            ),
            (
                &fixture("box_mm = [[0, 1], [0, 1], [0, 1e6]]"),
                "box_mm",
                "within 20000 mm",
            ),
            (&fixture("colour = 1"), "colour", "unknown key `colour`"),
            (&fixture(""), "[[fixture]]", "`box_mm` is missing"),
        ] {
            is_refused("", rest, line, what);
        }
    }
}
