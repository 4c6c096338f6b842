//! Jobs and the journal in the chip's flash: written by the image's own driver, with a supply that fails in words and in erases.

use std::collections::BTreeMap;
use std::time::Duration;

use boards::SKR_PRO;
use interp_core::State;
use machine::prepare::{Prepared, prepare};
use machine::remote::{RemoteError, Session, drive};
use protocol::digest::job_digest;
use protocol::message::{JobName, Reason, Request, job_mark};

use super::emulated::{CYCLES_US, Emulated};
use super::settings::session;

/// Operations between two failures of the supply: those of two rounds or so, and no multiple of a job's, so that each failure is at another place.
const BETWEEN_CUTS: &str = "379";
/// The supply fails in every third erase, too.
const BETWEEN_ERASES: &str = "3";
/// Most runs of a job that is stored; their number changes, so that failures come at all operations.
const RUNS: u32 = 13;
/// Failures of the supply in `./check`; `ISOFEED_CASES` of a campaign.
const CUTS: u32 = 12;

/// A job whose words no other number gives.
fn job(number: u32) -> Prepared {
    let height = 50 + number;
    let text = format!(
        "[surface]\nkind = \"ruled\"\nrail0_mm = [[0, 0, 5, 0], [0, 0, 0, 0], [0, 0, 0, {height}]]\nrail1_mm = [[0, 0, 5, 0], [0, 0, 0, 2], [0, 0, 0, {height}]]\n[tool]\nkind = \"ball\"\nradius_mm = 5\n[cut]\nfeed_mm_min = 600\nscallop_mm = 0.05\nalong = \"u\"\nside = \"up\"\n[machine]\nvelocity_max_mm_s = [100, 100, 50]\nacceleration_max_mm_s2 = [1000, 1000, 500]\njerk_max_mm_s3 = [20000, 20000, 10000]\ntravel_mm = [[0, 300], [0, 200], [0, 900]]\nhome_mm = [5, 5, {}]\n",
        height + 20
    );
    prepare(&job_file::parse("job.toml", &text).unwrap()).unwrap()
}

fn mark(job: &Prepared) -> u64 {
    job_mark(&job.header, job_digest(&job.words))
}

/// What the board keeps.
#[derive(Clone, Debug, Default, PartialEq)]
struct Kept {
    jobs: BTreeMap<String, u64>,
    /// Job and profile of the last run, which is not finished: how far it came is up to the time.
    journal: Option<(u64, u32)>,
}

impl Kept {
    fn of(link: &mut Session) -> Self {
        let (jobs, _) = link.stored_jobs().unwrap();
        let journal = link.journal().unwrap().map(|journal| {
            assert!(!journal.is_finished, "{journal:?}");
            (journal.job, journal.profile)
        });
        let count = jobs.len();
        let jobs: BTreeMap<_, _> = jobs
            .into_iter()
            .map(|job| (job.name.to_string(), job.mark))
            .collect();
        assert_eq!(jobs.len(), count, "two jobs of one name");
        Self { jobs, journal }
    }
}

/// An operation, and its effect on the kept jobs and journal.
struct Operation<'a> {
    what: &'static str,
    does: &'a dyn Fn(&mut Session) -> Result<(), RemoteError>,
    changes: &'a dyn Fn(&mut Kept),
}

struct Bench {
    emulated: Emulated,
    sessions: u32,
    cuts: BTreeMap<&'static str, u32>,
    kept: Kept,
}

impl Bench {
    fn open(&mut self) -> Session {
        self.sessions += 1;
        session(&self.emulated, self.sessions)
    }

    /// Does it. After a failure of the supply everything is as before it or as after it, and each job is whole.
    fn operate(&mut self, link: Session, operation: &Operation<'_>) -> Session {
        let mut link = link;
        let mut after = self.kept.clone();
        (operation.changes)(&mut after);
        match (operation.does)(&mut link) {
            Ok(()) => {
                self.kept = Kept::of(&mut link);
                assert_eq!(self.kept, after, "{}", operation.what);
            }
            Err(RemoteError::Refused { .. } | RemoteError::Silent(_)) => {
                *self.cuts.entry(operation.what).or_default() += 1;
                // One program at a time has the port.
                drop(link);
                link = self.open();
                let found = Kept::of(&mut link);
                assert!(
                    found == self.kept || found == after,
                    "{}: {found:x?}, neither {:x?} nor {after:x?}",
                    operation.what,
                    self.kept
                );
                self.kept = found;
                self.are_whole(&mut link);
            }
            Err(other) => panic!("{}: {other}", operation.what),
        }
        link
    }

    /// Each job is loaded as it was stored: only the drives hinder its start.
    fn are_whole(&self, link: &mut Session) {
        for name in self.kept.jobs.keys() {
            let start = Request::StartJob {
                name: JobName::try_from(name.as_str()).unwrap(),
                resumes: false,
            };
            let refused = link.command(&start);
            let is_loaded = matches!(
                refused,
                Err(RemoteError::Refused {
                    reason: Reason::DrivesOff,
                    ..
                })
            );
            assert!(is_loaded, "{name}: {refused:?}");
        }
    }
}

fn store(link: &mut Session, job: &Prepared, name: &str) -> Result<(), RemoteError> {
    drive::upload(link, job, |_| {})?;
    link.command(&Request::StoreJob {
        name: JobName::try_from(name).unwrap(),
        begins_anywhere: false,
    })
}

/// Starts a stored job, and ends it at once: the journal has it from its start on.
fn run(link: &mut Session, job: &Prepared, name: &str) -> Result<(), RemoteError> {
    link.command(&Request::Drives { on: true })?;
    link.command(&Request::SetHome {
        home_nm: job.header.axes.unwrap().home_nm,
    })?;
    link.command(&Request::StartJob {
        name: JobName::try_from(name).unwrap(),
        resumes: false,
    })?;
    while !link.status()?.state.is_under_way() {
        std::thread::sleep(Duration::from_millis(1));
    }
    link.command(&Request::Abort)?;
    while link.status()?.state != State::Ready {
        std::thread::sleep(Duration::from_millis(1));
    }
    link.command(&Request::Drives { on: false })
}

#[test]
fn a_supply_that_fails_while_jobs_are_stored_leaves_whole_ones() {
    let arguments = [
        "--cut-flash-every",
        BETWEEN_CUTS,
        "--cut-erase-every",
        BETWEEN_ERASES,
    ];
    let mut bench = Bench {
        emulated: Emulated::start(&SKR_PRO, &arguments),
        sessions: 0,
        cuts: BTreeMap::new(),
        kept: Kept::default(),
    };
    let cuts = std::env::var("ISOFEED_CASES").map_or(CUTS, |cases| cases.parse().unwrap());
    let mut link = bench.open();
    for round in 0.. {
        for (number, name) in [(2 * round, "left"), (2 * round + 1, "right")] {
            let job = job(number);
            link = bench.operate(
                link,
                &Operation {
                    what: "store",
                    does: &|link| store(link, &job, name),
                    changes: &|kept| {
                        kept.jobs.insert(name.to_owned(), mark(&job));
                    },
                },
            );
            if bench.kept.jobs.get(name) != Some(&mark(&job)) {
                continue;
            }
            let profile = link.status().unwrap().profile;
            for _ in 0..number * 5 % RUNS {
                link = bench.operate(
                    link,
                    &Operation {
                        what: "journal",
                        does: &|link| run(link, &job, name),
                        changes: &|kept| {
                            kept.journal = Some((mark(&job), profile));
                        },
                    },
                );
            }
        }
        if round % 3 == 2 {
            for name in ["left", "right"] {
                if !bench.kept.jobs.contains_key(name) {
                    continue;
                }
                link = bench.operate(
                    link,
                    &Operation {
                        what: "delete",
                        does: &|link| {
                            link.command(&Request::DeleteJob {
                                name: JobName::try_from(name).unwrap(),
                            })
                        },
                        changes: &|kept| {
                            kept.jobs.remove(name);
                        },
                    },
                );
            }
        }
        if bench.cuts.values().sum::<u32>() >= cuts {
            break;
        }
    }
    drop(link);
    let ended = bench.emulated.end();
    ended.no_complaint();
    assert!(bench.cuts.len() > 1, "{:?}", bench.cuts);
    println!(
        "{} words; {:?}, {} erases",
        job(0).words.len(),
        bench.cuts,
        ended.report["flash_erased"]
    );
}

/// A job's words are written between the ticks, none of which is delayed.
#[test]
fn words_delay_no_tick() {
    let emulated = Emulated::start(&SKR_PRO, &[]);
    let job = job(1);
    let mut link = session(&emulated, 1);
    for _ in 0..3 {
        store(&mut link, &job, "part").unwrap();
    }
    drop(link);
    let ended = emulated.end();
    ended.no_complaint();
    let written = 3 * job.words.len() as u64;
    assert!(ended.number("flash_operations") >= written, "{written}");
    let latency = ended.report["tim2"]["latency_max_cycles"].as_u64().unwrap();
    println!("{written} words, {latency} cycles");
    assert!(latency < 10 * CYCLES_US, "{latency} cycles");
}
