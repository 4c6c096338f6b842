//! Jobs that a board keeps: listed, started, deleted.

use clap::Subcommand;
use protocol::message::{JOB_NAME_MAX, JobName, Request};
use serde_json::json;

use super::out::say;
use super::{Result, attach, run};
use machine::remote::operate::start_stored;

/// Bytes of a data word.
const WORD: u32 = 4;

#[derive(Clone, Debug, Subcommand)]
pub(super) enum Action {
    /// Lists the jobs that the board keeps (stored by `run JOB --store NAME`), and the room that is left.
    Jobs,
    /// Starts a job that the board keeps, under the conditions of any other start, and follows it to its end.
    Start {
        /// Its name.
        #[arg(value_parser = name)]
        name: JobName,
        /// Goes on where the last run of this job was cut short.
        #[arg(long)]
        resume: bool,
    },
    /// Deletes a job that the board keeps.
    Delete {
        /// Its name.
        #[arg(value_parser = name)]
        name: JobName,
    },
}

/// Parses the name of a job.
pub(super) fn name(text: &str) -> std::result::Result<JobName, String> {
    let name = JobName::try_from(text).map_err(|_| format!("a name has at most {JOB_NAME_MAX} bytes"))?;
    if name.is_empty() || name.contains(char::is_control) {
        return Err("a name is expected, such as left-half".to_owned());
    }
    Ok(name)
}

pub(super) fn command(action: &Action, port: &str, as_json: bool) -> Result<()> {
    let mut session = run::open_port(port)?;
    match action {
        Action::Jobs => {
            let (jobs, room) = session.stored_jobs()?;
            if as_json {
                let jobs: Vec<_> = jobs
                    .iter()
                    .map(|job| json!({ "name": job.name.as_str(), "bytes": job.words * WORD, "mark": format!("{:016x}", job.mark) }))
                    .collect();
                say!("{}", json!({ "jobs": jobs, "room_bytes": room * WORD }));
                return Ok(());
            }
            for job in &jobs {
                say!("{:<JOB_NAME_MAX$} {:>7} bytes", job.name, job.words * WORD);
            }
            say!("{} jobs, room for one of {} bytes", jobs.len(), room * WORD);
            Ok(())
        }
        Action::Start { name, resume } => {
            start_stored(&mut session, name, *resume)?;
            attach::to_run(&mut session, port, as_json)
        }
        Action::Delete { name } => {
            session.command(&Request::DeleteJob { name: name.clone() })?;
            if as_json {
                say!("{}", json!({ "deleted": name.as_str() }));
            } else {
                say!("{name} is deleted");
            }
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_short_and_printable() {
        assert_eq!(name("left-half").unwrap(), "left-half");
        for wrong in ["", "a\tb", "abcdefghijklmnopqrstuvwxy"] {
            assert!(name(wrong).is_err(), "{wrong}");
        }
    }
}
