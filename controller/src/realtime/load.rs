//! Loading of a job, and the loaded job.

use interp_core::{
    fault::Result,
    job::{Header, stream::RecordCopy},
    sample::RunStart,
};

use super::{RealTime, run::RunRecord};

impl<S: AsRef<[i32]> + AsMut<[i32]>> RealTime<S> {
    /// Begins to load a job; a queued command was for the previous job and is dropped.
    ///
    /// # Errors
    /// Those of [`interp_core::Interpolator::load_begin`]; nothing changes then.
    pub fn load_begin(&mut self, header: &Header, words: u32) -> Result<()> {
        self.interpolator.load_begin(header, words)?;
        self.control.command = None;
        self.control.spindle.clear();
        Ok(())
    }

    /// Writes words of the job that is being loaded: [`interp_core::Interpolator::load_words`].
    ///
    /// # Errors
    /// Those of the interpolator.
    pub fn load_words(&mut self, offset: u32, words: &[i32]) -> Result<()> {
        self.interpolator.load_words(offset, words)
    }

    /// Words received, and up to which there is room now: [`interp_core::Interpolator::load_room`].
    #[must_use]
    pub fn load_room(&self) -> [u32; 2] {
        self.interpolator.load_room()
    }

    /// Copies the next record of a streamed job, to be checked: [`interp_core::Interpolator::load_copy`].
    ///
    /// # Errors
    /// Those of the interpolator.
    pub fn load_copy(&self, record: u32) -> Result<RecordCopy> {
        self.interpolator.load_copy(record)
    }

    /// Accepts or rejects a record of a streamed job by its check: [`interp_core::Interpolator::load_accept`], [`interp_core::Interpolator::load_reject`].
    ///
    /// # Errors
    /// Those of the interpolator.
    pub fn load_judged(&mut self, record: u32, checked: Result<()>) -> Result<()> {
        if let Err(fault) = checked {
            self.interpolator.load_reject(fault);
            return checked;
        }
        self.interpolator.load_accept(record)
    }

    /// Number of records, each of which [`Self::load_check`] has to check.
    #[must_use]
    pub fn load_records(&self) -> u32 {
        self.interpolator.load_records()
    }

    /// Checks one record, in order from 0: [`interp_core::Interpolator::load_check`].
    ///
    /// # Errors
    /// Those of the interpolator.
    pub fn load_check(&mut self, record: u32) -> Result<()> {
        self.interpolator.load_check(record)
    }

    /// Seals the job: ready, with the counters of a run that has not begun.
    ///
    /// # Errors
    /// Those of [`interp_core::Interpolator::load_finish`].
    pub fn load_finish(&mut self) -> Result<()> {
        self.interpolator.load_finish()?;
        [_, self.control.room] = self.interpolator.load_room();
        self.control.command = None;
        self.control.run = RunRecord::NEW;
        self.control.from_home = true;
        Ok(())
    }

    /// Header and words of the loaded job; none where none is loaded, or it is streamed.
    #[must_use]
    pub fn loaded(&self) -> Option<(&Header, &[i32])> {
        self.interpolator.loaded()
    }

    /// Copies words of the loaded job from an offset on; returns their number.
    pub fn loaded_words(&self, offset: u32, words: &mut [i32]) -> usize {
        let loaded = self.loaded().map_or(&[][..], |(_, loaded)| loaded);
        copy_words(loaded, offset, words)
    }

    /// The place on the pass that the tool is on, to begin another run with: [`interp_core::Interpolator::place`].
    #[must_use]
    pub fn place(&self) -> Option<RunStart> {
        self.interpolator.place()
    }
}

/// Copies words from an offset on; returns their number.
fn copy_words(from: &[i32], offset: u32, to: &mut [i32]) -> usize {
    let from = from.get(offset as usize..).unwrap_or(&[]);
    let mut count = 0;
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
        count += 1;
    }
    count
}
