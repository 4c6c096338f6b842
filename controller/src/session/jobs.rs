//! Jobs that the board keeps: stored from the loaded one, started by name or by the start button.

use interp_core::{RunStart, command::Command, sample::State};
use protocol::{
    digest::Digest,
    message::{
        Activity, InputLines, JobName, Reason, Reply, SpindleOrder, StoredJob, StoredJobInfo, job_mark,
    },
};

use super::{Session, kept::has_spindle, requests::no_run};
use crate::{jobs::JobPlace, machine::Machine, safety::Order, storage::StorageError};

/// Words that are copied at once.
const CHUNK: usize = 16;

/// Periods between two looks at the start button.
const BUTTON_PERIODS: u32 = 20;

/// The start button. It acts when it is pressed after it was seen released, so one that is stuck, or shorted, never starts anything.
#[derive(Clone, Copy, Debug)]
pub(super) struct Button {
    /// Time of the last look, periods since power-up.
    looked: u32,
    /// The button was released at the last look.
    was_released: bool,
    /// The button has started the run that is under way, and no host was heard since.
    pub(super) runs_alone: bool,
}

impl Button {
    pub(super) const NONE: Self = Self {
        looked: 0,
        was_released: false,
        runs_alone: false,
    };

    /// Whether it is time for another look.
    const fn is_due(&self, now: u32) -> bool {
        now.wrapping_sub(self.looked) >= BUTTON_PERIODS
    }

    /// Whether it was pressed since the last look.
    const fn look(&mut self, now: u32, is_pressed: bool) -> bool {
        self.looked = now;
        let acts = is_pressed && self.was_released;
        self.was_released = !is_pressed;
        acts
    }
}

impl Session {
    /// Spindle and coolant of the loaded job.
    #[inline(never)]
    pub(super) fn order_spindle(
        &mut self,
        machine: &mut impl Machine,
        order: SpindleOrder,
    ) -> Result<(), Reason> {
        machine.order(Order::Spindle(order))?;
        self.spindle = order;
        Ok(())
    }

    /// Keeps the loaded job.
    #[inline(never)]
    pub(super) fn store_job(
        &mut self,
        machine: &mut impl Machine,
        name: &JobName,
        begins_anywhere: bool,
    ) -> Result<(), Reason> {
        no_run(machine)?;
        if self.is_outdated {
            return Err(Reason::OtherProfile);
        }
        if name.is_empty() {
            return Err(Reason::NoStoredJob);
        }
        let mut digest = Digest::new();
        each_chunk(machine, |_, chunk| {
            digest.words(chunk);
            Ok(())
        })?;
        self.begin_storing(machine, name, digest.value(), begins_anywhere)?;
        let failed = |StorageError| Reason::Storage;
        each_chunk(machine, |machine, chunk| {
            machine.jobs().write(chunk).map_err(failed)
        })?;
        machine.jobs().finish().map_err(failed)
    }

    /// Writes the head. A function of its own, as others here: the stack does not hold all of them at a time.
    #[inline(never)]
    fn begin_storing(
        &self,
        machine: &mut impl Machine,
        name: &JobName,
        digest: u64,
        begins_anywhere: bool,
    ) -> Result<(), Reason> {
        let state = machine.status().state;
        let (header, words) = machine.loaded().ok_or(Reason::WrongState { state })?;
        let job = StoredJob {
            name: name.clone(),
            header,
            words,
            digest,
            spindle: self.spindle,
            begins_anywhere,
            offsets: offsets_of(machine),
        };
        let room = machine.jobs().room();
        if words > room {
            return Err(Reason::NoRoom { words: room });
        }
        machine.jobs().begin(&job).map_err(|StorageError| Reason::Storage)
    }

    /// Loads a stored job as a host would, and starts it; without a name the one that was stored last.
    #[inline(never)]
    pub(super) fn start_job(
        &mut self,
        machine: &mut impl Machine,
        name: Option<&JobName>,
        resumes: bool,
    ) -> Result<(), Reason> {
        let (start, spindle) = self.load_stored(machine, name, resumes)?;
        self.job_end(machine)?;
        if has_spindle(machine) {
            self.order_spindle(machine, spindle)?;
        }
        self.operate(machine, Command::Start, start)
    }

    /// Loads a stored job up to its end. Returns where it starts, and its spindle.
    #[inline(never)]
    fn load_stored(
        &mut self,
        machine: &mut impl Machine,
        name: Option<&JobName>,
        resumes: bool,
    ) -> Result<(RunStart, SpindleOrder), Reason> {
        no_run(machine)?;
        let place = machine.jobs().find(name.map(|name| name.as_str()));
        let place = place.ok_or(Reason::NoStoredJob)?;
        let start = if resumes {
            let mark = mark_of(machine, &place).ok_or(Reason::NoStoredJob)?;
            self.resumed(machine, mark)?
        } else {
            RunStart::FIRST
        };
        let spindle = self.begin_stored(machine, &place)?;
        self.load_words(machine, &place)?;
        Ok((start, spindle))
    }

    /// Begins to load a stored job, if it may start. Returns its spindle.
    #[inline(never)]
    fn begin_stored(&mut self, machine: &mut impl Machine, place: &JobPlace) -> Result<SpindleOrder, Reason> {
        let mut found = machine.jobs().job(place);
        // Not moved out of the option: that would be a second copy on the stack.
        let job = found.as_mut().ok_or(Reason::NoStoredJob)?;
        if job.offsets != offsets_of(machine) {
            return Err(Reason::OtherProfile);
        }
        if let Some(axes) = &mut job.header.axes
            && job.begins_anywhere
        {
            axes.home_nm = machine.motion().at_nm;
        }
        // Before the loaded job is replaced.
        machine.may_start_next(job.header.axes.map(|axes| axes.home_nm))?;
        self.job_begin(machine, &job.header, job.words, job.digest)?;
        Ok(job.spindle)
    }

    #[inline(never)]
    fn load_words(&mut self, machine: &mut impl Machine, place: &JobPlace) -> Result<(), Reason> {
        let mut offset = 0;
        loop {
            let mut chunk = [0; CHUNK];
            let words = machine.jobs().read(place, offset, &mut chunk);
            if words.is_empty() {
                return Ok(());
            }
            let upload = self.upload.as_mut().ok_or(Reason::NoUpload)?;
            upload.take(machine, offset, words)?;
            offset += u32::try_from(words.len()).unwrap_or(u32::MAX);
        }
    }

    /// Where the last run goes on, if it was one of this job.
    #[inline(never)]
    fn resumed(&self, machine: &mut impl Machine, mark: u64) -> Result<RunStart, Reason> {
        let journal = machine
            .journal()
            .filter(|journal| journal.job == mark && journal.profile == self.profile && !journal.is_finished);
        Ok(journal.ok_or(Reason::NothingToResume)?.start())
    }

    /// The start button resumes a run that is held, and else starts the job that was stored last, under the same conditions as a start by the host.
    #[inline(never)]
    pub(crate) fn watch_button(&mut self, now: u32, machine: &mut impl Machine) {
        if !self.button.is_due(now) {
            return;
        }
        let status = machine.status();
        // A start that waits for its spindle is not under way yet.
        self.button.runs_alone &=
            status.state.is_under_way() || machine.motion().activity == Activity::SpinUp;
        if self.button.runs_alone {
            // A run that the button has started needs no host.
            machine.heard();
        }
        if !self.button.look(now, status.safety.lines.has(InputLines::START)) {
            return;
        }
        let done = match status.state {
            State::Held => self.operate(machine, Command::Resume, RunStart::FIRST),
            _ if machine.motion().activity != Activity::Rest => Err(Reason::Moving),
            _ => self.start_job(machine, None, false),
        };
        // A refusal is not reported: there may be no host, and one that is there reads the state.
        if done.is_ok() {
            self.button.runs_alone = true;
            machine.heard();
        }
    }
}

/// Digest of the offsets that the board keeps.
#[inline(never)]
fn offsets_of(machine: &mut impl Machine) -> u32 {
    machine.offsets().digest()
}

/// The mark of a stored job.
#[inline(never)]
fn mark_of(machine: &mut impl Machine, place: &JobPlace) -> Option<u64> {
    let found = machine.jobs().job(place);
    found.as_ref().map(|job| job_mark(&job.header, job.digest))
}

/// Goes through the words of the loaded job.
#[inline(never)]
fn each_chunk<M: Machine>(
    machine: &mut M,
    mut each: impl FnMut(&mut M, &[i32]) -> Result<(), Reason>,
) -> Result<(), Reason> {
    let mut offset = 0;
    loop {
        let mut chunk = [0; CHUNK];
        let count = machine.loaded_words(offset, &mut chunk);
        if count == 0 {
            return Ok(());
        }
        each(machine, chunk.get(..count).unwrap_or(&[]))?;
        offset += u32::try_from(count).unwrap_or(u32::MAX);
    }
}

/// Deletes the kept job of this name.
#[inline(never)]
pub(super) fn delete_job(machine: &mut impl Machine, name: &JobName) -> Result<(), Reason> {
    no_run(machine)?;
    match machine.jobs().delete(name) {
        Ok(true) => Ok(()),
        Ok(false) => Err(Reason::NoStoredJob),
        Err(StorageError) => Err(Reason::Storage),
    }
}

/// The answer about a stored job.
#[inline(never)]
pub(super) fn stored_job(number: u16, index: u8, machine: &mut impl Machine) -> Reply {
    let place = machine.jobs().nth(index.into());
    let found = place.and_then(|place| machine.jobs().job(&place));
    Reply::StoredJob {
        number,
        job: found.map(|job| StoredJobInfo {
            mark: job_mark(&job.header, job.digest),
            name: job.name,
            words: job.words,
        }),
        room: machine.jobs().room(),
    }
}
