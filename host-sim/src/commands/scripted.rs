//! `simulate` and `run` with a script of operator commands.

use std::path::Path;

use protocol::message::Status;
use serde_json::{Map, Value, json};

use super::out::say;
use super::{Failure, Result, WantedTrace, begun, completed};
use job::Job;
use machine::Machine;
use machine::prepare::Prepared;
use machine::remote::script::Schedule;
use machine::remote::{self, Session};
use machine::script::{self, Played, Script};
use verify::motion::{PeakMeter, Peaks, limits};

/// The result of a script on the core in this process.
pub(super) struct Scripted {
    pub(super) script: Script,
    schedule: Schedule,
    played: Played,
    passes: u32,
    axes: Option<Peaks>,
}

fn read(path: &Path, prepared: &Prepared) -> Result<Script> {
    let script = Script::load(path)?;
    if prepared.header.axes.is_none() && script.overrides() {
        return Err(Failure::input(
            format!(
                "{}: the job has no limits, so its feed is constant and cannot be overridden",
                path.display()
            ),
            "give `velocity_max_mm_s`, `acceleration_max_mm_s2` or `jerk_max_mm_s3` in [machine], or leave `override` out of the script",
        ));
    }
    Ok(script)
}

/// Runs the script in this process, and writes the samples in which the tool moves.
pub(super) fn play(
    job: &Job,
    prepared: &Prepared,
    path: &Path,
    wanted: Option<WantedTrace<'_>>,
) -> Result<Scripted> {
    let script = read(path, prepared)?;
    let (mut file, output) = begun(wanted, job)?;
    let mut written = Ok(());
    let mut machine = Machine::load(prepared).map_err(|fault| inspect::load_error(job, fault))?;
    let has_limits = job.machine.has_limits();
    let mut gauge = PeakMeter::new(&job.machine);
    let (mut ends, mut passes, mut begun) = (Vec::new(), 0, false);
    let played = script::play(
        &mut machine,
        &script,
        |sample, period, moves| {
            if !std::mem::replace(&mut begun, true) {
                gauge.start_at_rest(sample.cl_nm);
            }
            gauge.add(period.into(), sample.cl_nm);
            if moves {
                passes = sample.pass + 1;
                if let (Some(file), Ok(())) = (&mut file, &written) {
                    written = file.write(&inspect::plain(prepared, sample));
                }
            }
        },
        |period| ends.push(period),
    );
    gauge.end_at_rest();
    completed(written, file, output, wanted)?;
    Ok(Scripted {
        script,
        schedule: Schedule::of(&played, ends),
        played,
        passes,
        axes: has_limits.then(|| gauge.peaks()),
    })
}

impl Scripted {
    fn json(&self) -> Map<String, Value> {
        let played = &self.played;
        let limits = self.axes.map(|[velocity, acceleration, jerk]| {
            json!({ "velocity": velocity.share, "acceleration": acceleration.share, "jerk": jerk.share })
        });
        let fault = played.fault.map(|fault| {
            let (message, remedy) = explain::fault(fault);
            json!({ "code": fault.kind.code(), "name": fault.kind.name(), "message": message, "remedy": remedy })
        });
        let value = json!({
            "approach": "surface", "passes": self.passes, "samples": played.samples, "ticks": played.periods,
            "state": played.state.name(), "digest": format!("{:016x}", played.digest), "limits": limits, "fault": fault,
        });
        match value {
            Value::Object(map) => map,
            _ => Map::new(),
        }
    }

    fn print(&self) {
        let played = &self.played;
        say!(
            "  script       {} ticks with a command",
            self.script.steps().len()
        );
        say!("  ticks        {}, ended {}", played.periods, played.state.name());
        say!(
            "  last run     {} samples, {} passes",
            played.samples,
            self.passes
        );
        for ((name, _), peak) in limits::ORDERS.iter().zip(self.axes.iter().flatten()) {
            let share = 100.0 * peak.share.unwrap_or(0.0);
            say!("  {name:<12} {share:.1} % of its limit at most");
        }
        say!("  digest       {:016x}", played.digest);
    }

    fn verdict(&self) -> Result<()> {
        let mut failures: Vec<String> = self.axes.iter().flat_map(limits::failures).collect();
        failures.extend(self.played.fault.map(|fault| explain::fault(fault).0));
        if failures.is_empty() {
            Ok(())
        } else {
            Err(Failure::Failed(Some(failures.join("; "))))
        }
    }

    /// The outcome of `simulate`.
    pub(super) fn output(&self, job: &Job, as_json: bool) -> Result<()> {
        if as_json {
            say!("{}", Value::Object(self.json()));
        } else {
            say!("{}", job.origin.name());
            self.print();
        }
        self.verdict()
    }

    /// Runs the script on a board with the job loaded, and compares the digests.
    pub(super) fn run(&self, job: &Job, session: &mut Session, as_json: bool) -> Result<()> {
        let status = remote::script::play(session, &self.script, &self.schedule)?;
        let same = self.agrees(&status);
        let board = session.capabilities().description.board.as_str();
        if as_json {
            let mut keys = self.json();
            keys.insert("board".to_owned(), json!(board));
            keys.insert(
                "board_digest".to_owned(),
                json!(format!("{:016x}", status.digest)),
            );
            keys.insert("deadline_misses".to_owned(), json!(status.deadline_misses));
            keys.insert("same".to_owned(), json!(same));
            say!("{}", Value::Object(keys));
        } else {
            say!("{} on {board}", job.origin.name());
            self.print();
            let verdict = if same {
                "bit for bit the same"
            } else {
                "NOT the same"
            };
            say!(
                "  compared     {} samples with the simulation: {verdict}",
                status.samples
            );
        }
        if same {
            return self.verdict();
        }
        Err(Failure::Failed(Some(format!(
            "the board ended {} with {} samples and digest {:016x}, the simulation {} with {} and {:016x}",
            status.state.name(),
            status.samples,
            status.digest,
            self.played.state.name(),
            self.played.samples,
            self.played.digest
        ))))
    }

    fn agrees(&self, status: &Status) -> bool {
        let played = &self.played;
        let code = status.fault.map(|fault| fault.code);
        (status.digest, status.samples, status.state) == (played.digest, played.samples, played.state)
            && code == played.fault.map(|fault| fault.kind.code())
            && status.deadline_misses == 0
    }
}
