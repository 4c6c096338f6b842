//! `budget`: cycles of each stage of the sample task on the Cortex-M4F, and of the planning task.

mod worst;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Map, Value, json};

use super::out::{say, say_part};
use super::{Failure, Result, along, cannot_write, load, load_without_links, output_file, progress, spinner};
use cycles::figures::{Figure, Histogram, Model, STEPS_2_TO_4, figures, histogram};
use cycles::graph::{self, Analysis, EXCEPTION_BYTES};
use cycles::image::{self, Sizes};
use cycles::measure::{MeasurementSetup, Ticks};
use cycles::operations::{self, Count, Operations};
use cycles::session::MeasurementSession;
use cycles::{self, BudgetError, PERIOD_CYCLES, TICKS, chart, golden};
use machine::remote::qemu;
use study::operations::PaperRow;

/// The file of --report.
const CHART: &str = "budget.svg";
/// Width of a bin of the printed histogram, cycles.
const BIN_CYCLES: u32 = 50;

/// Counts the cycles of each stage of the sample task, and of the planning task, for each kind of surface, with the firmware in QEMU.
///
/// Example: cargo sim budget --report out
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Job files to count instead of the golden table's.
    jobs: Vec<PathBuf>,
    /// Ticks per job [default: 20000; 10000 for jobs of the golden table with limits].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    ticks: Option<u32>,
    /// Writes a chart (SVG) into this folder.
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Searches for the worst-case tick over this many jobs, random and adversarial, and writes the job that causes it.
    #[arg(long, value_name = "JOBS", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true, conflicts_with_all = ["jobs", "ticks", "report", "check", "bless"])]
    search: Option<u32>,
    /// Seed of the search, which is deterministic.
    #[arg(long, default_value_t = 1, requires = "search")]
    seed: u64,
    /// The jobs of the search have axis limits.
    #[arg(long, requires = "search")]
    limits: bool,
    /// The jobs of the search have passes of constant scallop height.
    #[arg(long, requires = "search")]
    constant: bool,
    /// The jobs of the search have a region.
    #[arg(long, requires = "search")]
    region: bool,
    /// Output file of the search.
    #[arg(
        long,
        value_name = "FILE",
        default_value = "worst-tick.toml",
        requires = "search"
    )]
    out: PathBuf,
    /// Overwrites existing files of --report and --out.
    #[arg(long)]
    force: bool,
    /// Prints JSON instead of tables.
    #[arg(long)]
    pub(super) json: bool,
    /// Fails if a stage takes over 2 % more cycles than in the golden table.
    #[arg(long, conflicts_with_all = ["jobs", "ticks"])]
    check: bool,
    /// Rewrites the golden table.
    #[arg(long, conflicts_with_all = ["jobs", "check", "ticks"])]
    bless: bool,
}

impl From<BudgetError> for Failure {
    fn from(error: BudgetError) -> Self {
        match error {
            BudgetError::Qemu(error) => error.into(),
            BudgetError::Remote(error) => error.into(),
            other => Self::Failed(Some(other.to_string())),
        }
    }
}

/// A job's name and ticks.
type Counted = (String, Ticks);
/// Direction of each job as text and as JSON, by the name of the job.
type Directions = BTreeMap<String, (String, Map<String, Value>)>;

/// The jobs to count: their names, files and ticks.
fn jobs(arguments: &Arguments) -> Vec<(String, PathBuf, u32)> {
    if arguments.jobs.is_empty() {
        cycles::jobs()
            .into_iter()
            .map(|(name, path, ticks)| (name.to_owned(), path, arguments.ticks.unwrap_or(ticks)))
            .collect()
    } else {
        let name = |path: &PathBuf| path.display().to_string();
        arguments
            .jobs
            .iter()
            .map(|path| (name(path), path.clone(), arguments.ticks.unwrap_or(TICKS)))
            .collect()
    }
}

fn count(arguments: &Arguments, setup: &MeasurementSetup) -> Result<(Vec<Counted>, Directions)> {
    let jobs = jobs(arguments);
    let bar = progress(jobs.len() as u64, "counting");
    let mut counted = Vec::new();
    let mut directions = Directions::new();
    for (name, path, ticks) in jobs {
        // The jobs of the table as the tests measure them: without words of links, which depend on a map of the surface.
        let (job, prepared) = if arguments.jobs.is_empty() {
            load_without_links(&path)?
        } else {
            load(&path)?
        };
        directions.insert(name.clone(), (along::sentence(&job), along::json(&job)));
        counted.push((name, setup.run(&prepared, ticks)?));
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok((counted, directions))
}

/// The operations of a sample of each job, beside the paper's.
fn print_operations(counts: &[(String, Count)]) {
    let row = |name: &str, operations: Operations, more: &str| {
        let [add, multiply, divide, root] = operations.to_array();
        say!("  {name:<30} {add:>5} {multiply:>5} {divide:>5} {root:>5}  {more}");
    };
    say!(
        "\noperations of a sample, {STEPS_2_TO_4}\n  {:<30} {:>5} {:>5} {:>5} {:>5}  samples with these",
        "",
        "+ -",
        "x",
        "/",
        "sqrt"
    );
    for (name, count) in counts {
        let samples = format!("{} of {}", count.samples, count.samples + count.others);
        row(name, count.operations, &samples);
        if let Some(paper) = study::operations::of_paper(name) {
            let sines = match paper.sines {
                0 => String::new(),
                sines => format!("and {sines} sines, cosines"),
            };
            row("  the paper's Table 1", paper.operations, &sines);
        }
    }
    say!("{}", operations::CONVENTION);
}

fn operations_json(operations: Operations) -> Value {
    json!({
        "add": operations.add,
        "multiply": operations.multiply,
        "divide": operations.divide,
        "square_root": operations.root,
    })
}

/// The paper's row, with its sines.
fn paper_json(row: PaperRow) -> Value {
    let mut value = operations_json(row.operations);
    value["sine"] = row.sines.into();
    value
}

/// What the images say without being run.
struct Images {
    qemu: Sizes,
    chip: Sizes,
    /// Deepest stack of each image.
    qemu_stack: Analysis,
    chip_stack: Analysis,
}

impl Images {
    fn read(qemu: &Path) -> Result<Self> {
        let chip = image::chip()?;
        Ok(Self {
            qemu: image::sizes(qemu)?,
            chip: image::sizes(&chip)?,
            qemu_stack: graph::analyse(qemu)?,
            chip_stack: graph::analyse(&chip)?,
        })
    }

    fn print(&self) {
        say!("Cortex-M4F, {PERIOD_CYCLES} cycles per period; bytes:");
        for (board, sizes, stack) in [
            ("chip", self.chip, &self.chip_stack),
            ("QEMU", self.qemu, &self.qemu_stack),
        ] {
            let contexts = stack
                .contexts
                .iter()
                .map(|context| format!("{} {}", context.name, context.bytes));
            say!(
                "  {board}: flash {}, RAM {} and the job store {}; stack at most {} ({}, {EXCEPTION_BYTES} per exception) of {}",
                sizes.flash,
                sizes.ram,
                sizes.store,
                stack.stack_bytes(),
                contexts.collect::<Vec<_>>().join(", "),
                sizes.stack_room
            );
        }
    }
}

fn json(figures: &[Figure], images: &Images, counts: &[(String, Count)], directions: &Directions) -> Value {
    let rows = figures.iter().map(|figure| {
        let whole = figure.stage == STEPS_2_TO_4;
        let count = counts.iter().find(|(name, _)| whole && *name == figure.surface);
        let paper = study::operations::of_paper(&figure.surface).filter(|_| whole);
        let mut row = json!({
            "surface": figure.surface,
            "stage": figure.stage,
            "model": figure.model.name(),
            "ticks": figure.ticks,
            "cycles_min": figure.min,
            "cycles_mean": figure.mean,
            "cycles_max": figure.max,
            "period_share_pct": figure.period_share_pct(),
            "operations": count.map(|(_, count)| operations_json(count.operations)),
            "operations_paper": paper.map(paper_json),
            "histogram": { "width": figure.histogram.width, "bins": figure.histogram.bins },
            "stack_bytes": figure.stack_bytes,
            "stack_static_bytes": images.qemu_stack.stack_bytes(),
            "flash_bytes": images.qemu.flash,
            "ram_bytes": images.qemu.ram,
            "store_bytes": images.qemu.store,
            "chip_flash_bytes": images.chip.flash,
            "chip_ram_bytes": images.chip.ram,
            "chip_stack_static_bytes": images.chip_stack.stack_bytes(),
        });
        if let (Some(row), Some((_, keys))) = (row.as_object_mut(), directions.get(&figure.surface)) {
            row.extend(keys.clone());
        }
        row
    });
    rows.collect()
}

fn print(name: &str, ticks: &Ticks, figures: &[Figure]) {
    say!(
        "\n{name}: {} ticks, stack {} bytes",
        ticks.records.len(),
        ticks.stack_bytes
    );
    say!(
        "  {:<25} {:>6} |{:^29} |{:^29}  min to max",
        "cycles",
        "ticks",
        "nominal: min, mean, max, %",
        "pessimistic: min, mean, max, %"
    );
    let of = |model| figures.iter().filter(move |figure| figure.model == model);
    for (nominal, pessimistic) in of(Model::Nominal).zip(of(Model::Pessimistic)) {
        say_part!("  {:<25} {:>6}", nominal.stage, nominal.ticks);
        for figure in [nominal, pessimistic] {
            say_part!(
                " | {:>6} {:>8.1} {:>6} {:>5.2}",
                figure.min,
                figure.mean,
                figure.max,
                figure.period_share_pct()
            );
        }
        say!("  {}", pessimistic.histogram.sparkline());
    }
}

fn print_histogram(histogram: &Histogram) {
    let most = histogram.bins.iter().map(|bin| bin.1).max().unwrap_or(1).max(1);
    say!("  whole tick, pessimistic:");
    for (begin, count) in &histogram.bins {
        let bar = "#".repeat((count * 40).div_ceil(most) as usize);
        say!("  {begin:>6}.. {count:>7} {bar}");
    }
}

/// Prints the worst-case tick of each job named.
fn print_worst(arguments: &Arguments, setup: &MeasurementSetup) -> Result<()> {
    for path in &arguments.jobs {
        let (_, prepared) = load(path)?;
        let bar = spinner("searching the worst-case tick");
        let mut session = MeasurementSession::new(setup)?;
        let run = session.run(&prepared, arguments.ticks.unwrap_or(TICKS))?;
        bar.finish_and_clear();
        say_part!(
            "\n{}: {}",
            path.display(),
            worst::describe(&session.worst_tick(&prepared, &run)?)
        );
    }
    Ok(())
}

fn report(arguments: &Arguments, counted: &[Counted]) -> Result<()> {
    let Some(folder) = &arguments.report else {
        return Ok(());
    };
    output_file::write_folder(folder, &[CHART], arguments.force, |made| {
        chart::write(&made.join(CHART), counted)
    })?;
    if !arguments.json {
        say!("\nchart: {}", folder.join(CHART).display());
    }
    Ok(())
}

/// Checks before the work, which takes minutes, that its outputs may be written.
fn check_outputs(arguments: &Arguments) -> Result<()> {
    if arguments.search.is_some() {
        output_file::check(&arguments.out, arguments.force)?;
    }
    let report = arguments.report.as_deref();
    report.map_or(Ok(()), |folder| {
        output_file::prepare_folder(folder, &[CHART], arguments.force)
    })
}

/// The text of the golden table.
fn golden_table(path: &Path) -> Result<String> {
    std::fs::read_to_string(path).map_err(|error| {
        Failure::input(
            format!("cannot read {}: {error}", path.display()),
            "run it in a checkout of the project; cargo sim budget --bless writes the table anew",
        )
    })
}

/// Compares with the golden table, if it is given, or writes it.
fn hold(
    arguments: &Arguments,
    table: Option<&str>,
    figures: &[Figure],
    counts: &[(String, Count)],
) -> Result<()> {
    let operations: Vec<(String, Operations)> = counts
        .iter()
        .map(|(name, count)| (name.clone(), count.operations))
        .collect();
    if arguments.bless {
        let path = golden::path();
        return std::fs::write(&path, golden::table(figures, &operations))
            .map_err(|error| cannot_write(&path, &error));
    }
    let Some(table) = table else { return Ok(()) };
    let differences = golden::differences(table, figures, &operations);
    if differences.is_empty() {
        return Ok(());
    }
    Err(Failure::Failed(Some(format!(
        "stages take more than the golden table allows (old -> new):\n  {}\nif that is meant: cargo sim budget --bless",
        differences.join("\n  ")
    ))))
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    if arguments.bless && programs::checkout().is_none() {
        return Err(Failure::input(
            "--bless writes a file of the project",
            "run it in a checkout",
        ));
    }
    check_outputs(arguments)?;
    let table = arguments
        .check
        .then(|| golden_table(&golden::path()))
        .transpose()?;
    let bar = spinner("building the firmware");
    let image = qemu::firmware()?;
    bar.finish_and_clear();
    let (plan, _) = image::read(&image)?;
    let setup = MeasurementSetup::new(&image, &plan)?;
    if let Some(jobs) = arguments.search {
        return worst::command(&setup, jobs, arguments);
    }
    let (counted, directions) = count(arguments, &setup)?;
    let figures: Vec<Vec<Figure>> = counted.iter().map(|(name, ticks)| figures(name, ticks)).collect();
    let counts: Vec<(String, Count)> = counted
        .iter()
        .filter_map(|(name, ticks)| Some((name.clone(), operations::count(ticks)?)))
        .collect();
    let bar = spinner("reading the images");
    let images = Images::read(&image)?;
    bar.finish_and_clear();
    if arguments.json {
        say!("{}", json(&figures.concat(), &images, &counts, &directions));
    } else {
        images.print();
        for ((name, ticks), figures) in counted.iter().zip(&figures) {
            print(name, ticks, figures);
            say!("  along {}", directions[name].0);
            print_histogram(&histogram(ticks, Model::Pessimistic, BIN_CYCLES));
        }
        print_operations(&counts);
    }
    if !arguments.json {
        print_worst(arguments, &setup)?;
    }
    report(arguments, &counted)?;
    let mut held = figures.concat();
    if arguments.check || arguments.bless {
        let bar = spinner("counting the worst jobs");
        held.extend(golden::worst_ticks(&setup)?);
        bar.finish_and_clear();
    }
    hold(arguments, table.as_deref(), &held, &counts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_table_cannot_be_read() {
        let folder = tempfile::tempdir().unwrap();
        let Err(Failure::Input(report)) = golden_table(&folder.path().join("cycles.txt")) else {
            panic!("a table that is not there is read");
        };
        assert!(report.to_string().starts_with("cannot read "), "{report}");
        assert!(report.help().unwrap().to_string().contains("--bless"));
    }
}
