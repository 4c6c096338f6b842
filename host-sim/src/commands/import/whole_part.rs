//! `import --part`: a job for each face of a part that the tool reaches, in order, with a summary and a page.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::ValueEnum;
use job::{Along, FaceReach, Region, SurfaceSpec};
use patches::placement::Rotation;
use serde_json::{Value, json};

use super::super::out::say;
use super::super::{Failure, Result, progress, region_words, whole};
use super::page::{PartRow, part_page};
use super::{Arguments, relative};
use cad::{CadError, Face, JobOptions, MachinableFace, Model, Options, Placement, machinable, write_job};
use part::{Part, Request, Tool, placed_part};

/// Default scallop height, mm, as in a job of a face.
const SCALLOP_MM: f64 = 0.01;
/// Default of what is the machine's range: a part that reaches farther is moved to the origin, mm.
const RANGE_MM: f64 = 2000.0;
/// How far the surface of a face goes on beyond it, in step-overs: as for a job.
const STEP_OVERS_AROUND: f64 = job_file::STEP_OVERS_AROUND;
/// Places a side of a face at which the best side of a part is looked for.
const LOOKS: usize = 16;

/// The side of the part that looks up on the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Up {
    /// The file's +z.
    #[value(name = "+z")]
    PlusZ,
    /// Its -z.
    #[value(name = "-z")]
    MinusZ,
    /// Its +x.
    #[value(name = "+x")]
    PlusX,
    /// Its -x.
    #[value(name = "-x")]
    MinusX,
    /// Its +y.
    #[value(name = "+y")]
    PlusY,
    /// Its -y.
    #[value(name = "-y")]
    MinusY,
    /// The one of the six of which most can be reached.
    Auto,
}

impl Up {
    const SIX: [Self; 6] = [
        Self::PlusZ,
        Self::MinusZ,
        Self::PlusX,
        Self::MinusX,
        Self::PlusY,
        Self::MinusY,
    ];

    /// Rotations about x, y and z that turn it up.
    fn rotate_deg(self) -> [f64; 3] {
        match self {
            Self::PlusZ | Self::Auto => [0.0, 0.0, 0.0],
            Self::MinusZ => [180.0, 0.0, 0.0],
            Self::PlusX => [0.0, -90.0, 0.0],
            Self::MinusX => [0.0, 90.0, 0.0],
            Self::PlusY => [90.0, 0.0, 0.0],
            Self::MinusY => [-90.0, 0.0, 0.0],
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::PlusZ => "+z",
            Self::MinusZ => "-z",
            Self::PlusX => "+x",
            Self::MinusX => "-x",
            Self::PlusY => "+y",
            Self::MinusY => "-y",
            Self::Auto => "auto",
        }
    }
}

/// How a part lies on the machine.
struct Setup {
    up: Up,
    translate_mm: [f64; 3],
    placement: Placement,
    part: Arc<Part>,
    scallop_mm: f64,
}

impl Setup {
    fn new(up: Up, model: &Arc<Model>, scallop_mm: f64) -> Self {
        let linear = Rotation::of_degrees(up.rotate_deg()).0;
        let rows = |by: [f64; 3]| Placement {
            rows: std::array::from_fn(|i| [linear[i][0], linear[i][1], linear[i][2], by[i]]),
        };
        let placement = rows([0.0; 3]);
        let mut setup = Self {
            up,
            translate_mm: [0.0; 3],
            placement,
            part: placed_part(model, &placement),
            scallop_mm,
        };
        let block = setup.part.block();
        if block.low.abs().max(block.high.abs()).max_element() > RANGE_MM {
            setup.translate_mm = (-0.5 * (block.low + block.high)).round().to_array();
            setup.placement = rows(setup.translate_mm);
            setup.part = placed_part(model, &setup.placement);
        }
        setup
    }
}

/// Where the jobs go: a file with all of them, or a folder with one for each face.
struct Output<'a> {
    path: &'a Path,
    is_file: bool,
}

impl<'a> Output<'a> {
    fn new(path: &'a Path) -> Self {
        Self {
            path,
            is_file: path.extension().is_some_and(|extension| extension == "toml"),
        }
    }

    fn folder(&self) -> PathBuf {
        match self.path.parent().filter(|_| self.is_file) {
            Some(parent) if parent.as_os_str().is_empty() => PathBuf::from("."),
            Some(parent) => parent.to_owned(),
            None => self.path.to_owned(),
        }
    }

    fn page(&self) -> PathBuf {
        if self.is_file {
            self.path.with_extension("html")
        } else {
            self.path.join("part.html")
        }
    }

    fn summary(&self) -> PathBuf {
        if self.is_file {
            self.path.with_extension("json")
        } else {
            self.path.join("summary.json")
        }
    }

    /// The job of a face, the `place`-th to be machined.
    fn job(&self, place: usize, face: usize) -> PathBuf {
        if self.is_file {
            PathBuf::from(format!("{}#{face}", self.path.display()))
        } else {
            self.path.join(format!("{place:03}-face-{face}.toml"))
        }
    }
}

/// What becomes of a face.
struct Outcome {
    number: usize,
    /// Area and reach; `None` if the face is not known.
    reach: Option<FaceReach>,
    /// Why it has no job.
    refused: Option<String>,
    region: Option<(Region, SurfaceSpec)>,
    job: Option<PathBuf>,
    /// Highest z of the region, mm.
    top_mm: f64,
    text: String,
    /// Direction of the passes and side of the tool, as in job files, and the time of the passes about, s.
    along: &'static str,
    side: &'static str,
    passes_s: f64,
}

/// The request for the region of a face with this surface.
struct Asked<'a> {
    part: &'a Part,
    tool: &'a Tool,
    scallop_mm: f64,
    setup: &'a Setup,
}

impl Asked<'_> {
    fn reach(&self, face: &Face, made: &MachinableFace, side: usize) -> FaceReach {
        let placed = face.placed(&self.setup.placement);
        let spec = made.spec();
        let [[u0, u1], [v0, v1]] = spec.domain();
        let whole = vec![vec![[u0, v0], [u1, v0], [u1, v1], [u0, v1]]];
        // In the coordinates of the file the surface is placed by its poles.
        let surface = oracle::Surface::new(&moved(&spec, &self.setup.placement));
        let request = Request {
            surface: &surface,
            trimmed: made.trimmed.as_ref().unwrap_or(&whole),
            face: placed.as_ref().unwrap_or(face),
            placement: &Placement::IDENTITY,
            sign: face.sense,
            tool: self.tool,
            scallop_mm: self.scallop_mm,
            steepest_deg: job_file::STEEPEST_DEG,
            touch_mm: job_file::PART_TOLERANCE_MM,
            part: Some((self.part, self.part.index(face.number))),
        };
        let found = request.reach(side);
        FaceReach {
            area_mm2: found.area_mm2,
            reachable_mm2: found.reachable_mm2,
            unreachable_mm2: found
                .unreachable_mm2
                .iter()
                .map(|(reason, area)| (reason.name().to_owned(), *area))
                .collect(),
            ..FaceReach::default()
        }
    }
}

/// A surface by its poles, transformed.
fn moved(spec: &SurfaceSpec, by: &Placement) -> SurfaceSpec {
    let SurfaceSpec::Nurbs(nurbs) = spec else {
        return spec.clone();
    };
    let mut nurbs = nurbs.clone();
    for pole in nurbs.poles_mm.iter_mut().flatten() {
        let [x, y, z, weight] = *pole;
        let [x, y, z] = by.point([x, y, z].into()).to_array();
        *pole = [x, y, z, weight];
    }
    SurfaceSpec::Nurbs(nurbs)
}

/// Writes a job for each face, the summary and the page.
///
/// # Errors
/// No tool is given; the folder cannot be written.
pub(super) fn command(arguments: &Arguments, file: &str, model: &Arc<Model>, output: &Path) -> Result<()> {
    let output = Output::new(output);
    let Some(radius_mm) = arguments.radius_mm else {
        return Err(Failure::input(
            "no tool is given",
            "give the ball's radius in mm with --tool R",
        ));
    };
    let scallop_mm = arguments.scallop_mm.unwrap_or(SCALLOP_MM.min(0.1 * radius_mm));
    let options = Options {
        tolerance_mm: arguments.tolerance,
        untrimmed: false,
        around_mm: STEP_OVERS_AROUND * (8.0 * radius_mm * scallop_mm).sqrt(),
    };
    let tool = Tool::new(radius_mm, &job::ToolBody::default());
    let wanted = |face: &&Face| arguments.faces.is_empty() || arguments.faces.contains(&face.number);
    let faces: Vec<&Face> = model.faces.iter().filter(wanted).collect();
    let made: Vec<std::result::Result<MachinableFace, CadError>> = faces
        .iter()
        .map(|face| machinable(file, face, &options))
        .collect();
    let setup = match arguments.up {
        Up::Auto => best_side(model, &faces, &made, &tool, scallop_mm),
        up => Setup::new(up, model, scallop_mm),
    };
    let asked = Asked {
        part: &setup.part,
        tool: &tool,
        scallop_mm,
        setup: &setup,
    };
    let folder = output.folder();
    if output.is_file {
        for path in [output.path.to_owned(), output.page(), output.summary()] {
            whole::check(&path, arguments.force)?;
        }
    } else {
        whole::check_folder(&folder, &["summary.json", "part.html"], arguments.force)?;
    }
    std::fs::create_dir_all(&folder).map_err(|error| super::super::cannot_write(&folder, &error))?;
    let bar = progress(faces.len() as u64, "regions");
    let mut outcomes = Vec::new();
    for (face, made) in faces.iter().zip(&made) {
        outcomes.push(outcome(arguments, file, face, made.as_ref(), &asked, &folder));
        bar.inc(1);
    }
    bar.finish_and_clear();
    write(arguments, file, model, &output, &setup, outcomes)
}

/// The side of which most can be reached.
fn best_side(
    model: &Arc<Model>,
    faces: &[&Face],
    made: &[std::result::Result<MachinableFace, CadError>],
    tool: &Tool,
    scallop_mm: f64,
) -> Setup {
    let tried = Up::SIX.map(|up| {
        let setup = Setup::new(up, model, scallop_mm);
        let asked = Asked {
            part: &setup.part,
            tool,
            scallop_mm,
            setup: &setup,
        };
        let known = faces
            .iter()
            .zip(made)
            .filter_map(|(face, made)| Some((face, made.as_ref().ok()?)));
        let reached: f64 = known
            .map(|(face, made)| asked.reach(face, made, LOOKS).reachable_mm2)
            .sum();
        (reached, up)
    });
    let best = tried.into_iter().fold(
        (-1.0, Up::PlusZ),
        |best, one| if one.0 > best.0 { one } else { best },
    );
    Setup::new(best.1, model, scallop_mm)
}

/// What becomes of a face; its job is not written yet.
fn outcome(
    arguments: &Arguments,
    file: &str,
    face: &Face,
    made: std::result::Result<&MachinableFace, &CadError>,
    asked: &Asked<'_>,
    folder: &Path,
) -> Outcome {
    let mut outcome = Outcome {
        number: face.number,
        reach: None,
        refused: None,
        region: None,
        job: None,
        top_mm: f64::NEG_INFINITY,
        text: String::new(),
        along: "u",
        side: if face.sense > 0.0 { "+" } else { "-" },
        passes_s: 0.0,
    };
    let made = match made {
        Ok(made) => made,
        Err(error) => {
            outcome.refused = Some(error.what.clone());
            return outcome;
        }
    };
    let reach = asked.reach(face, made, 64);
    if reach.reachable_mm2 == 0.0 {
        outcome.reach = Some(reach);
        return outcome;
    }
    outcome.reach = Some(reach);
    // In the folder: paths are relative to it, and the region is kept there.
    let path = folder.join("face.toml");
    let written = write_job(
        file,
        face,
        made,
        &JobOptions {
            radius_mm: arguments.radius_mm,
            feed_mm_min: arguments.feed_mm_min,
            scallop_mm: Some(asked.scallop_mm),
            along: Some(
                arguments
                    .along
                    .clone()
                    .unwrap_or_else(|| outcome.along.to_owned()),
            ),
            side: Some(outcome.side.to_owned()),
            pattern: arguments.pattern.clone(),
            in_part: true,
            rotate_deg: asked.setup.up.rotate_deg(),
            translate_mm: asked.setup.translate_mm,
            source: relative(&arguments.file, &path).map(|source| (source, arguments.tolerance)),
        },
    );
    let read = written.map_err(|error| error.to_string()).and_then(|written| {
        let job = job_file::parse_with(&path.display().to_string(), &written.text, &part::Faces);
        job.map(|job| (job, written.text))
            .map_err(|error| error.what().to_owned())
    });
    match read {
        Ok((job, text)) => {
            if let Some(reach) = job.origin.reach() {
                outcome.reach = Some(reach.clone());
            }
            if let Some(region) = job.region {
                let surface = oracle::Surface::new(&job.surface);
                let heights = region
                    .loops
                    .iter()
                    .flatten()
                    .map(|[u, v]| surface.at(*u, *v).point.z);
                outcome.top_mm = heights.fold(f64::NEG_INFINITY, f64::max);
                let step_over_mm = (8.0 * job.radius_mm * job.scallop_mm).sqrt();
                let efforts = [Along::U, Along::V]
                    .map(|along| effort_s(&surface, &region, along, step_over_mm, job.feed_mm_min / 60.0));
                outcome.along = if efforts[1] < efforts[0] { "v" } else { "u" };
                outcome.passes_s = efforts[0].min(efforts[1]);
                outcome.region = Some((region, job.surface));
                outcome.text = match &arguments.along {
                    Some(_) => text,
                    None => text.replacen("along = \"u\"", &format!("along = \"{}\"", outcome.along), 1),
                };
            }
        }
        Err(why) => outcome.refused = Some(why),
    }
    outcome
}

/// Most lines that are looked at for the direction of the passes, parts of an interval, and the time that each interval costs beside its length, s.
const LINES_MAX: usize = 4000;
const PARTS: u32 = 8;
const INTERVAL_S: f64 = 0.15;

/// Time of the passes along a parameter about, s: their length at the feed, and some time for each.
fn effort_s(
    surface: &oracle::Surface,
    region: &Region,
    along: Along,
    step_over_mm: f64,
    feed_mm_s: f64,
) -> f64 {
    let swapped = |[u, v]: [f64; 2]| match along {
        Along::U => [u, v],
        Along::V => [v, u],
    };
    // Lengths of the derivatives along the pass and across it.
    let speeds = |path: f64, side: f64| {
        let [u, v] = swapped([path, side]);
        let at = surface.at(u, v);
        swapped([at.u.length(), at.v.length()])
    };
    let edges: Vec<[[f64; 2]; 2]> = region.edges().map(|ends| ends.map(swapped)).collect();
    let sides = || edges.iter().flatten().map(|end| end[1]);
    let (low, high) = (
        sides().fold(f64::INFINITY, f64::min),
        sides().fold(f64::NEG_INFINITY, f64::max),
    );
    let (mut side, mut sum) = (low, 0.0);
    for _ in 0..LINES_MAX {
        let met = |ends: &&[[f64; 2]; 2]| (ends[0][1] <= side) != (ends[1][1] <= side);
        let mut crossings: Vec<f64> = edges
            .iter()
            .filter(met)
            .map(|[a, b]| a[0] + (side - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
            .collect();
        crossings.sort_by(f64::total_cmp);
        let mut widest = 0.0_f64;
        for [from, to] in crossings.as_chunks::<2>().0 {
            for part in 0..PARTS {
                let share = (f64::from(part) + 0.5) / f64::from(PARTS);
                let [speed, across] = speeds(from + share * (to - from), side);
                sum += speed * (to - from) / f64::from(PARTS) / feed_mm_s;
                widest = widest.max(across);
            }
            sum += INTERVAL_S;
        }
        let step = if widest > 0.0 {
            step_over_mm / widest
        } else {
            (high - low) / 100.0
        };
        side += step.max((high - low) / LINES_MAX as f64);
        if side >= high {
            break;
        }
    }
    sum
}

/// Sums over all faces, mm2.
#[derive(Default)]
struct Sums {
    area: f64,
    reachable: f64,
    region: f64,
    unreachable: Vec<(String, f64)>,
    unknown: usize,
}

impl Sums {
    fn of(outcomes: &[Outcome]) -> Self {
        let mut sums = Self::default();
        for outcome in outcomes {
            let Some(reach) = &outcome.reach else {
                sums.unknown += 1;
                continue;
            };
            sums.area += reach.area_mm2;
            sums.reachable += reach.reachable_mm2;
            sums.region += if outcome.job.is_some() {
                reach.region_mm2
            } else {
                0.0
            };
            for (reason, area) in &reach.unreachable_mm2 {
                match sums.unreachable.iter_mut().find(|(name, _)| name == reason) {
                    Some((_, sum)) => *sum += area,
                    None => sums.unreachable.push((reason.clone(), *area)),
                }
            }
        }
        sums
    }

    fn share(part: f64, of: f64) -> f64 {
        if of > 0.0 { 100.0 * part / of } else { 0.0 }
    }
}

/// Writes everything: jobs from the highest to the lowest face.
fn write(
    arguments: &Arguments,
    file: &str,
    model: &Arc<Model>,
    output: &Output<'_>,
    setup: &Setup,
    mut outcomes: Vec<Outcome>,
) -> Result<()> {
    let mut order: Vec<usize> = (0..outcomes.len())
        .filter(|index| outcomes[*index].region.is_some())
        .collect();
    order.sort_by(|a, b| outcomes[*b].top_mm.total_cmp(&outcomes[*a].top_mm));
    for (place, index) in (1..).zip(&order) {
        let outcome = &mut outcomes[*index];
        let path = output.job(place, outcome.number);
        if !output.is_file {
            whole::write(&path, outcome.text.as_bytes(), arguments.force)?;
        }
        outcome.job = Some(path);
    }
    if output.is_file {
        if order.is_empty() {
            return Err(Failure::input(
                format!(
                    "a ball of {} mm reaches no face of {file}",
                    arguments.radius_mm.unwrap_or(0.0)
                ),
                "take a smaller ball, or turn another side up with --up auto",
            ));
        }
        let text = program(arguments, file, output, setup, &order, &outcomes);
        whole::write(output.path, text.as_bytes(), arguments.force)?;
    }
    let sums = Sums::of(&outcomes);
    let page = page(file, model, setup, &outcomes);
    let page_path = output.page();
    whole::write(&page_path, page.as_bytes(), arguments.force)?;
    let summary = summary(arguments, file, setup, &order, &outcomes, &sums, &page_path);
    let text = serde_json::to_string_pretty(&summary).unwrap_or_default();
    whole::write(&output.summary(), text.as_bytes(), arguments.force)?;
    if arguments.json {
        say!("{summary}");
        return Ok(());
    }
    print(file, &page_path, setup, &order, &outcomes, &sums);
    Ok(())
}

/// One file with all faces: what they have in common, from the text of the first one, and a section for each.
fn program(
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
        "# {} faces of {}, each with the region that a ball of {radius_mm} mm reaches, in this order. One alone: {}#{}\n\n\
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
    let block = setup.part.block();
    let middle = 0.5 * (block.low + block.high);
    let _ = write!(
        out,
        "\n[tool]\nkind = \"ball\"\nradius_mm = {radius_mm}\n\n\
         [cut]                       # of every face, unless its section says otherwise\n\
         feed_mm_min = {}            # of the cutter contact along the surface\n\
         scallop_mm = {}             # scallop height limit between passes\n\
         pattern = \"{}\"\n\n\
         [machine]\n{}\
         home_mm = [{:.3}, {:.3}, {:.3}]    # where the ball's centre stands before, between and after the faces\n",
        arguments.feed_mm_min.unwrap_or(cad::FEED_MM_MIN),
        setup.scallop_mm,
        arguments.pattern.as_deref().unwrap_or("zigzag"),
        cad::LIMITS,
        middle.x,
        middle.y,
        block.high.z + radius_mm + job::CLEARANCE_DEFAULT_MM,
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
            "\n[[face]]\nface = {}\ntolerance_mm = {}\nalong = {along:?}\nside = {:?}    # {share:.1} % of the face\n",
            outcome.number, arguments.tolerance, outcome.side,
        );
    }
    out
}

fn summary(
    arguments: &Arguments,
    file: &str,
    setup: &Setup,
    order: &[usize],
    outcomes: &[Outcome],
    sums: &Sums,
    page: &Path,
) -> Value {
    let face = |outcome: &Outcome| {
        json!({
            "face": outcome.number,
            "job": outcome.job.as_ref().map(|path| path.display().to_string()),
            "region": outcome.reach.as_ref().map(region_words::json),
            "error": outcome.refused,
        })
    };
    json!({
        "file": file,
        "up": setup.up.name(),
        "rotate_deg": setup.up.rotate_deg(),
        "translate_mm": setup.translate_mm,
        "radius_mm": arguments.radius_mm,
        "jobs": order.iter().filter_map(|index| outcomes[*index].job.as_ref()).map(|path| path.display().to_string()).collect::<Vec<_>>(),
        "page": page.display().to_string(),
        "area_mm2": sums.area,
        "reachable_mm2": sums.reachable,
        "region_mm2": sums.region,
        "unreachable": sums.unreachable.iter().map(|(reason, area)| json!({ "reason": reason, "area_mm2": area })).collect::<Vec<_>>(),
        "faces_not_known": sums.unknown,
        "faces": outcomes.iter().map(face).collect::<Vec<_>>(),
    })
}

fn print(file: &str, page: &Path, setup: &Setup, order: &[usize], outcomes: &[Outcome], sums: &Sums) {
    say!("{file}, {} up", setup.up.name());
    for index in order {
        let outcome = &outcomes[*index];
        let (Some(job), Some(reach)) = (&outcome.job, &outcome.reach) else {
            continue;
        };
        let name = job.file_name().unwrap_or_default().to_string_lossy();
        say!(
            "  {name:<24} {:>11.2} of {:>11.2} mm2 ({:>6.2} %)",
            reach.region_mm2,
            reach.area_mm2,
            Sums::share(reach.region_mm2, reach.area_mm2)
        );
    }
    for outcome in outcomes {
        if let Some(why) = &outcome.refused {
            say!("  face {} has no job: {why}", outcome.number);
        }
    }
    say!(
        "  reachable    {:.2} of {:.2} mm2 ({:.2} %) of {} faces; {:.3} % of it in {} jobs",
        sums.reachable,
        sums.area,
        Sums::share(sums.reachable, sums.area),
        outcomes.len(),
        Sums::share(sums.region, sums.reachable),
        order.len()
    );
    for (reason, area) in &sums.unreachable {
        say!("  unreachable  {area:.2} mm2: {}", region_words::reason(reason));
    }
    if sums.unknown > 0 {
        say!("  {} faces are not known", sums.unknown);
    }
    let passes_s: f64 = order.iter().map(|index| outcomes[*index].passes_s).sum();
    say!(
        "  passes       about {:.1} min; `verify` tells the time",
        passes_s / 60.0
    );
    say!("  page         {}", page.display());
}

/// The page: what is finished, what is not.
fn page(file: &str, model: &Arc<Model>, setup: &Setup, outcomes: &[Outcome]) -> String {
    let placed: Vec<(usize, Face)> = outcomes
        .iter()
        .enumerate()
        .filter_map(|(index, outcome)| {
            let face = model.faces.get(outcome.number - 1)?;
            Some((index, face.placed(&setup.placement)?))
        })
        .collect();
    let rows: Vec<PartRow<'_>> = placed
        .iter()
        .map(|(index, face)| {
            let outcome = &outcomes[*index];
            let reach = outcome.reach.as_ref();
            let (state, tint) = match (&outcome.job, reach, &outcome.refused) {
                (Some(_), Some(reach), _) => (
                    format!("{:.2} % finished", Sums::share(reach.region_mm2, reach.area_mm2)),
                    [220, 150, 110],
                ),
                (None, _, Some(why)) => (why.clone(), [200, 80, 200]),
                (_, Some(reach), _) => {
                    let worst = reach.unreachable_mm2.iter().max_by(|a, b| a.1.total_cmp(&b.1));
                    match worst {
                        Some((reason, _)) if reason == "steep" => {
                            ("unreachable: steep".to_owned(), [165, 175, 185])
                        }
                        Some((reason, _)) => (format!("unreachable: {reason}"), [210, 80, 70]),
                        None => ("empty".to_owned(), [165, 175, 185]),
                    }
                }
                _ => ("not known".to_owned(), [200, 80, 200]),
            };
            let region = outcome.region.as_ref().map_or_else(Vec::new, |(region, spec)| {
                let surface = oracle::Surface::new(spec);
                let point = |place: &[f64; 2]| surface.at(place[0], place[1]).point.to_array();
                region
                    .loops
                    .iter()
                    .map(|ring| dense(ring).iter().map(point).collect())
                    .collect()
            });
            PartRow {
                face,
                area_mm2: reach.map(|reach| reach.area_mm2),
                state,
                job: outcome.job.as_ref().map(|path| path.display().to_string()),
                region,
                tint,
            }
        })
        .collect();
    let legend = "Green: finished. Orange: the rest of a face with a job. Red: the tool does not reach it. Grey: too steep, or \
                  looks down. Violet: not imported.";
    part_page(file, legend, &rows)
}

/// A ring with places between its vertices: on a curved surface an edge is no line.
fn dense(ring: &[[f64; 2]]) -> Vec<[f64; 2]> {
    const BETWEEN: usize = 8;
    if ring.len() > 20 * BETWEEN {
        return ring.to_vec();
    }
    let next = ring.iter().cycle().skip(1);
    let ends = ring.iter().zip(next);
    ends.flat_map(|(a, b)| {
        (0..BETWEEN).map(move |k| {
            let share = k as f64 / BETWEEN as f64;
            [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]
        })
    })
    .collect()
}
