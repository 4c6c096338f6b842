//! Where `run --resume` goes on: after what the board's journal reports as complete.

use interp_core::RunStart;
use machine::prepare::Prepared;
use machine::remote::Session;
use protocol::digest::job_digest;
use protocol::message::{Journal, job_mark};

use super::{Failure, Result};

/// What hinders a resume, and what to do.
const fn hindrance(journal: Option<&Journal>, job: u64, profile: u32) -> Option<[&'static str; 2]> {
    Some(match journal {
        None => [
            "the board has journalled no run",
            "run the job from its beginning, without --resume",
        ],
        Some(Journal {
            is_finished: true, ..
        }) => [
            "the last run of the board came to its end",
            "run the job from its beginning, without --resume",
        ],
        Some(journal) if journal.job != job => [
            "the run that was cut short was one of another job, or this job was changed since, or placed elsewhere",
            "give the same file and the same --work; a work offset must not have changed",
        ],
        Some(journal) if journal.profile != profile => [
            "the board keeps another machine profile than in the run that was cut short",
            "write the profile of then with cargo sim settings, or run the job from its beginning",
        ],
        Some(_) => return None,
    })
}

/// Where the board is to go on with this job.
pub(super) fn start(session: &mut Session, prepared: &Prepared) -> Result<RunStart> {
    let journal = session.journal()?;
    let profile = session.status()?.profile;
    let job = job_mark(&prepared.header, job_digest(&prepared.words));
    if let Some([what, remedy]) = hindrance(journal.as_ref(), job, profile) {
        return Err(Failure::Failed(Some(format!(
            "there is nothing to resume: {what}\n  help: {remedy}"
        ))));
    }
    Ok(journal.map_or(RunStart::FIRST, |journal| journal.start()))
}

/// The place in words.
pub(super) fn words(start: RunStart) -> String {
    match start.within() {
        None => format!("at the start of pass {}", start.pass),
        Some(path) => {
            let fraction = path.fraction as f64 / (u64::MAX as f64);
            let at = f64::from(path.span) + fraction;
            format!(
                "within pass {}, at path parameter {at:.4} (spans from 0)",
                start.pass
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_same_job_on_the_same_machine_is_resumed() {
        let journal = Journal {
            job: 1,
            profile: 2,
            pass: 3,
            is_finished: false,
            path: interp_core::SpanParameter::NONE,
        };
        let ended = Journal {
            is_finished: true,
            ..journal
        };
        assert_eq!(hindrance(Some(&journal), 1, 2), None);
        for (journal, job, profile) in [
            (None, 1, 2),
            (Some(&ended), 1, 2),
            (Some(&journal), 7, 2),
            (Some(&journal), 1, 7),
        ] {
            assert!(hindrance(journal, job, profile).is_some());
        }
    }
}
