//! The job store: accepts words in order, and releases the job only when it is complete and checked.

use crate::fault::{Fault, FaultKind, Result};
use crate::job::check::check_header;
use crate::job::links::Link;
use crate::job::region::{EDGE_WORDS, EDGES_A_RECORD, FirstLine, RegionCheck, RegionWords, ScanLine};
use crate::job::stations::{SPANS_MAX as FRONT_SPANS_MAX, Stations};
use crate::job::stream::{RecordCopy, Rows, RowsNeeded};
use crate::job::{AxisLimits, Header, SurfaceKind, WIDTH_MAX, WIDTH_MIN, width_words};
use crate::surface::{
    POLYNOMIAL_WORDS, PolynomialRecord, RATIONAL_WORDS, REVOLVED_WORDS, RationalRecord, RevolvedRecord,
    split_patch,
};

/// Progress of loading and checking.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LoadStage {
    Empty,
    /// Words received and records checked so far.
    Loading {
        received: u32,
        checked: u32,
    },
    Sealed,
}

/// State of the job in the store. The caller owns the store and passes it with every call. The surface can be read only
/// once the job is sealed.
#[derive(Clone, Debug)]
pub(crate) struct Program {
    stage: LoadStage,
    header: Header,
    /// Length of the job, words.
    length: u32,
    region: RegionCheck,
    rows: Rows,
}

/// Words per record of a kind of surface.
pub(crate) const fn record_words(kind: SurfaceKind) -> usize {
    match kind {
        SurfaceKind::Polynomial => POLYNOMIAL_WORDS,
        SurfaceKind::Rational => RATIONAL_WORDS,
        SurfaceKind::RevolvedAlongProfile | SurfaceKind::RevolvedAroundAxis => REVOLVED_WORDS,
    }
}

/// Patches of a header, and words that it implies for a job that is stored as a whole.
pub(crate) fn extent(header: &Header) -> (u32, u64) {
    let patches = u32::from(header.path_spans) * u32::from(header.side_spans);
    let words = u64::from(patches) * record_words(header.kind) as u64;
    let widths = width_words(header.path_spans, header.side_spans);
    (patches, words + u64::from(widths) + tail_words(header) as u64)
}

/// Words of a header's region and its links.
pub(crate) const fn tail_words(header: &Header) -> usize {
    region_words(header) + header.links as usize
}

/// Words of a header's region.
const fn region_words(header: &Header) -> usize {
    EDGE_WORDS * header.edges as usize
}

/// Records of the checks of a region at load.
#[must_use]
pub fn region_checks(header: &Header) -> u32 {
    u32::from(header.edges).div_ceil(EDGES_A_RECORD)
}

/// Words of the store that a job takes after its data, for the stations of passes of constant scallop height; none where it crosses more patches than there
/// may be stations for.
#[must_use]
pub fn front_words(header: &Header) -> Option<usize> {
    if !header.spacing.is_constant() {
        return Some(0);
    }
    (header.path_spans <= FRONT_SPANS_MAX).then(|| Stations::most(header.path_spans).words(header.edges > 0))
}

impl Program {
    pub(crate) const fn new() -> Self {
        const HEADER: Header = Header {
            kind: SurfaceKind::Polynomial,
            pattern: crate::job::Pattern::Zig,
            spacing: crate::job::Spacing::Exact,
            tool_side: crate::job::ToolSide::Plus,
            path_spans: 0,
            side_spans: 0,
            ball_radius_mm: 0.0,
            feed_mm_s: 0.0,
            scallop_mm: 0.0,
            period_s: 0.0,
            edges: 0,
            links: 0,
            window: 0,
            strips: 0,
            axes: None,
        };
        Self {
            stage: LoadStage::Empty,
            header: HEADER,
            length: 0,
            region: RegionCheck::START,
            rows: Rows::NONE,
        }
    }

    pub(crate) fn begin(&mut self, header: &Header, words: u32, capacity: usize) -> Result<()> {
        check_header(header)?;
        let rows = Rows::new(header, words, capacity);
        let (needed, stored) = if header.window > 0 {
            (rows.words(), rows.least_words())
        } else {
            let (_, needed) = extent(header);
            (needed, needed + front_words(header).unwrap_or(0) as u64)
        };
        if stored > capacity as u64 {
            #[allow(clippy::cast_precision_loss, reason = "a report; at most 2^27")]
            return Err(Fault::new(FaultKind::TooManyPatches, stored as f32));
        }
        if u64::from(words) != needed || rows.count() == 0 {
            return Err(bad_length(words));
        }
        self.stage = LoadStage::Loading {
            received: 0,
            checked: 0,
        };
        self.header = *header;
        self.length = words;
        self.region = RegionCheck::START;
        self.rows = rows;
        Ok(())
    }

    /// Whether the job is loaded while it runs.
    pub(crate) const fn is_streamed(&self) -> bool {
        self.header.window > 0
    }

    /// Words that have been received, and up to which the store has room now.
    pub(crate) fn room(&self) -> [u32; 2] {
        match self.stage {
            LoadStage::Empty => [0; 2],
            _ if self.is_streamed() => [self.rows.received(), self.rows.limit().min(self.length)],
            LoadStage::Loading { received, .. } => [received, self.length],
            LoadStage::Sealed => [self.length; 2],
        }
    }

    /// The run is on a pass in this row: those before it may be overwritten.
    pub(crate) fn release(&mut self, row: u16) {
        self.rows.release(row);
    }

    /// Whether the rows are there that the planning of a pass needs; see [`Rows::ask`].
    ///
    /// # Errors
    /// As there.
    pub(crate) fn ask(&mut self, store: &[i32], needed: &RowsNeeded) -> Result<bool> {
        self.rows.ask(store, needed)
    }

    /// See [`Rows::asked`].
    pub(crate) const fn asked(&self) -> Option<RowsNeeded> {
        self.rows.asked()
    }

    /// The run begins anew.
    ///
    /// # Errors
    /// [`FaultKind::WrongState`] where the first rows are overwritten.
    pub(crate) fn rewind(&mut self) -> Result<()> {
        self.rows.rewind()
    }

    /// Whether [`Self::rewind`] would succeed.
    pub(crate) const fn can_rewind(&self) -> bool {
        self.rows.can_rewind()
    }

    pub(crate) fn clear(&mut self) {
        self.stage = LoadStage::Empty;
    }

    pub(crate) fn write(&mut self, store: &mut [i32], offset: u32, words: &[i32]) -> Result<()> {
        if self.is_streamed() && self.stage != LoadStage::Empty {
            let most = self.length;
            return self.rows.write(store, offset, words, most).map_err(bad_length);
        }
        let LoadStage::Loading { received, .. } = self.stage else {
            return Err(bad_length(offset));
        };
        let end = u32::try_from(words.len())
            .ok()
            .and_then(|length| offset.checked_add(length));
        let Some(end) = end.filter(|end| *end <= self.length && offset <= received) else {
            return Err(bad_length(offset));
        };
        let Some(slots) = store.get_mut(offset as usize..end as usize) else {
            return Err(bad_length(end));
        };
        for (slot, word) in slots.iter_mut().zip(words) {
            *slot = *word;
        }
        self.stage = LoadStage::Loading {
            received: received.max(end),
            checked: 0,
        };
        Ok(())
    }

    /// Records: patches and portions of edges, which come in the order of their words.
    pub(crate) fn records(&self) -> u32 {
        self.patches() + region_checks(&self.header)
    }

    fn patches(&self) -> u32 {
        self.rows.count().saturating_mul(self.header.path_spans.into())
    }

    /// The first patch and the first portion of edges among the records.
    fn firsts(&self) -> [u32; 2] {
        if self.is_streamed() {
            [region_checks(&self.header), 0]
        } else {
            [0, self.patches()]
        }
    }

    /// Copies a record of a streamed job, to be checked.
    ///
    /// # Errors
    /// [`FaultKind::BadLength`] where it is not the next one, or not there yet.
    pub(crate) fn copy(&self, store: &[i32], record: u32) -> Result<RecordCopy> {
        let patch = self.patch_of(record).filter(|patch| self.rows.is_next(*patch));
        let Some(patch) = patch.filter(|_| self.is_streamed() && self.stage != LoadStage::Empty) else {
            return Err(bad_length(record));
        };
        let job = self.view(store);
        let spans = usize::from(self.header.path_spans.max(1));
        let (index, first) = (patch as usize, patch as usize - patch as usize % spans);
        let words = |index| match self.header.kind {
            SurfaceKind::Polynomial => job.record::<POLYNOMIAL_WORDS>(index).map(<[i32; _]>::as_slice),
            SurfaceKind::Rational => job.record::<RATIONAL_WORDS>(index).map(<[i32; _]>::as_slice),
            SurfaceKind::RevolvedAlongProfile | SurfaceKind::RevolvedAroundAxis => None,
        };
        match (words(index), words(first)) {
            (Some(words), Some(first)) => Ok(RecordCopy::new(record, words, first)),
            _ => Err(bad_length(record)),
        }
    }

    /// The patch of a record, if it is one.
    fn patch_of(&self, record: u32) -> Option<u32> {
        let [first, _] = self.firsts();
        record.checked_sub(first).filter(|patch| *patch < self.patches())
    }

    /// Seals a record of a streamed job whose copy is sound.
    ///
    /// # Errors
    /// As [`Self::copy`]; [`FaultKind::BadHeader`] for a width of a span or a strip, with the first record.
    pub(crate) fn accept(&mut self, store: &[i32], record: u32) -> Result<()> {
        let patch = self.patch_of(record);
        if patch == Some(0) {
            self.view(store).check_widths()?;
            self.rows.check_strips(store, self.header.side_spans)?;
        }
        match patch {
            Some(patch) if self.rows.accept(patch) => Ok(()),
            _ => Err(bad_length(record)),
        }
    }

    /// A record of a streamed job is not sound: a run does not go on to its row.
    pub(crate) const fn reject(&mut self, fault: Fault) {
        self.rows.reject(fault);
    }

    /// The words, also of a job that is not sealed.
    const fn view<'a>(&'a self, store: &'a [i32]) -> Job<'a> {
        Job {
            header: &self.header,
            store,
            length: self.length as usize,
            rows: &self.rows,
        }
    }

    /// The first line of a region, once the job is sealed.
    pub(crate) const fn first_line(&self) -> &FirstLine {
        self.region.first_line()
    }

    /// Checks a record. `line`: one that is free while a job is loaded.
    pub(crate) fn check(&mut self, store: &[i32], record: u32, line: &mut ScanLine) -> Result<()> {
        let LoadStage::Loading { received, checked } = self.stage else {
            return self.check_streamed(store, record);
        };
        if self.patch_of(record).is_some() && self.is_streamed() {
            return self.check_streamed(store, record);
        }
        let is_there = if self.is_streamed() {
            self.rows.has_head()
        } else {
            received == self.length
        };
        if !is_there || record > checked || record >= self.records() {
            return Err(bad_length(received));
        }
        let is_sound = match self.patch_of(record) {
            Some(patch) => self.check_patch(store, patch)?,
            // Once each, in order: the first line is found on the way.
            None => record < checked || self.check_edges(store, record, line),
        };
        self.stage = LoadStage::Loading {
            received,
            checked: if is_sound { checked.max(record + 1) } else { 0 },
        };
        if is_sound { Ok(()) } else { Err(bad_patch(record)) }
    }

    /// A patch of a streamed job.
    fn check_streamed(&mut self, store: &[i32], record: u32) -> Result<()> {
        self.copy(store, record)?.check()?;
        self.accept(store, record)
    }

    /// Whether a patch of a job that is stored as a whole is sound.
    fn check_patch(&self, store: &[i32], patch: u32) -> Result<bool> {
        let job = self.view(store);
        if patch == 0 {
            job.check_widths()?;
        }
        let index = patch as usize;
        let result = match self.header.kind {
            SurfaceKind::Polynomial => job.record(index).map(PolynomialRecord::check),
            SurfaceKind::Rational => job.record(index).map(RationalRecord::check),
            SurfaceKind::RevolvedAlongProfile | SurfaceKind::RevolvedAroundAxis => {
                job.record(index).map(RevolvedRecord::check)
            }
        };
        Ok(matches!(result, Some(Ok(()))) && job.is_alike(index))
    }

    /// Whether a portion of edges is sound.
    fn check_edges(&mut self, store: &[i32], record: u32, line: &mut ScanLine) -> bool {
        let [_, first] = self.firsts();
        let portion = record.saturating_sub(first);
        if portion == 0 {
            self.region.begin();
        }
        let job = Job {
            header: &self.header,
            store,
            length: self.length as usize,
            rows: &self.rows,
        };
        job.region()
            .is_some_and(|region| self.region.check(&self.header, &region, portion, line))
    }

    pub(crate) fn seal(&mut self) -> Result<()> {
        match self.stage {
            LoadStage::Loading { checked, .. } if self.is_streamed() => {
                if checked < region_checks(&self.header) || !self.rows.can_begin() {
                    return Err(bad_length(self.rows.received()));
                }
                self.stage = LoadStage::Sealed;
                Ok(())
            }
            LoadStage::Loading { received, checked }
                if received == self.length && checked == self.records() =>
            {
                self.stage = LoadStage::Sealed;
                Ok(())
            }
            LoadStage::Loading { received, .. } => Err(bad_length(received)),
            LoadStage::Empty | LoadStage::Sealed => Err(bad_length(0)),
        }
    }

    pub(crate) const fn header(&self) -> &Header {
        &self.header
    }

    /// The sealed job, and the words after it.
    ///
    /// # Errors
    /// As [`Self::job`].
    pub(crate) fn job_and_rest<'a>(&'a self, store: &'a mut [i32]) -> Result<(Job<'a>, &'a mut [i32])> {
        self.job(store)?;
        let length = (self.length as usize).min(store.len());
        let split = store.split_at_mut_checked(length);
        let (store, rest) = split.ok_or(const { Fault::new(FaultKind::WrongState, 0.0) })?;
        Ok((self.view(store), rest))
    }

    /// The sealed job.
    ///
    /// # Errors
    /// [`FaultKind::WrongState`] where no job is sealed.
    pub(crate) fn job<'a>(&'a self, store: &'a [i32]) -> Result<Job<'a>> {
        if self.stage == LoadStage::Sealed {
            Ok(self.view(store))
        } else {
            Err(Fault::new(FaultKind::WrongState, 0.0))
        }
    }
}

/// A job and its store.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Job<'a> {
    pub(crate) header: &'a Header,
    store: &'a [i32],
    /// Words of the job.
    length: usize,
    rows: &'a Rows,
}

impl<'a> Job<'a> {
    /// The words after the job's.
    pub(crate) fn rest(&self) -> &'a [i32] {
        self.store.get(self.length..).unwrap_or(&[])
    }

    /// The region that is machined; none for the whole surface.
    pub(crate) fn region(&self) -> Option<RegionWords<'a>> {
        if self.header.edges == 0 {
            return None;
        }
        let words = self.store.get(self.tail()..)?;
        Some(RegionWords::new(words.get(..region_words(self.header))?))
    }

    /// The first word of the region: before the rows of a streamed job, after those of one that is stored as a whole.
    fn tail(&self) -> usize {
        let (patches, _) = extent(self.header);
        let widths = width_words(self.header.path_spans, self.header.side_spans) as usize;
        if self.header.window > 0 {
            widths
        } else {
            widths + patches as usize * record_words(self.header.kind)
        }
    }

    /// How the tool goes to a pass that is not joined to the one before it on the surface.
    pub(crate) fn link_to(&self, pass: u32, axes: &AxisLimits) -> Link {
        let links = u32::from(self.header.links);
        let word = pass
            .checked_sub(1)
            .filter(|index| *index < links)
            .and_then(|index| {
                let first = self.tail() + region_words(self.header);
                self.store.get(first + index as usize).copied()
            });
        Link::from_word(word.unwrap_or(axes.safe_z_nm), axes)
    }

    /// Width of a side span, in units of the side parameter.
    pub(crate) fn side_width(&self, span: u16) -> f32 {
        self.store
            .get(usize::from(span))
            .map_or(1.0, |word| f32::from_bits(word.cast_unsigned()))
    }

    /// Width of a path span, in units of the path parameter.
    pub(crate) fn path_width(&self, span: u16) -> f32 {
        self.side_width(self.header.side_spans.saturating_add(span))
    }

    fn record<const N: usize>(&self, index: usize) -> Option<&'a [i32; N]> {
        let spans = usize::from(self.header.path_spans);
        let (row, within) = (index.checked_div(spans)?, index.checked_rem(spans)?);
        let start = self.rows.start_of(u32::try_from(row).ok()?)? + within * N;
        self.store.get(start..)?.first_chunk::<N>()
    }

    /// The record of the patch at these spans; `N` is the number of words of the job's kind.
    ///
    /// # Errors
    /// [`FaultKind::WrongState`] where the job has no such patch.
    pub(crate) fn patch<const N: usize>(&self, path_span: u16, side_span: u16) -> Result<&'a [i32; N]> {
        let start = self.rows.start(side_span);
        start
            .and_then(|start| {
                self.store
                    .get(start + usize::from(path_span) * N..)?
                    .first_chunk::<N>()
            })
            .ok_or(const { Fault::new(FaultKind::WrongState, 0.0) })
    }

    /// Whether a patch's side boundaries collapse like those of the first patch of the same row: either a whole pass
    /// is a pole or no part of the pass is.
    fn is_alike(&self, index: usize) -> bool {
        let beside = |index: usize| {
            let words: &[i32] = match self.header.kind {
                SurfaceKind::Polynomial => self.record::<POLYNOMIAL_WORDS>(index)?,
                SurfaceKind::Rational => self.record::<RATIONAL_WORDS>(index)?,
                SurfaceKind::RevolvedAlongProfile | SurfaceKind::RevolvedAroundAxis => return None,
            };
            let (_, _, edges, _) = split_patch(words);
            Some((edges.side_start, edges.side_end))
        };
        beside(index) == beside(index - index % usize::from(self.header.path_spans.max(1)))
    }

    fn check_widths(&self) -> Result<()> {
        let count = width_words(self.header.path_spans, self.header.side_spans) as usize;
        for word in self.store.iter().take(count) {
            let width = f32::from_bits(word.cast_unsigned());
            if !(WIDTH_MIN..=WIDTH_MAX).contains(&width) {
                return Err(Fault::new(FaultKind::BadHeader, width));
            }
        }
        Ok(())
    }
}

pub(crate) fn bad_patch(record: u32) -> Fault {
    Fault::new(FaultKind::BadPatch, crate::math::arith::count_to_f32(record))
}

fn bad_length(words: u32) -> Fault {
    Fault::new(FaultKind::BadLength, crate::math::arith::count_to_f32(words))
}
