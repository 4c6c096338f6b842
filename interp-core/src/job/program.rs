//! The job store: accepts words in order, and releases the job only when it is complete and checked.

use crate::command::OVERRIDE_MAX;
use crate::fault::{Fault, FaultKind, Result};
use crate::job::links::Link;
use crate::job::region::{
    EDGE_WORDS, EDGES_A_RECORD, FirstLine, REGION_SPANS_MAX, RegionCheck, RegionWords, ScanLine,
};
use crate::job::stations::{SPANS_MAX as FRONT_SPANS_MAX, Stations};
use crate::job::stream::{DIGEST_WORDS, RecordCopy, Rows, WINDOW_MIN};
use crate::job::{
    AxisLimits, CELLS_MAX, Header, OVERRUN_MAX_MM, SPANS_MAX, STEP_MAX_MM, SurfaceKind, width_words,
};
use crate::math::number::nm_to_mm;
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

/// Patches of a header, and words that it implies.
pub(crate) fn extent(header: &Header) -> (u32, u64) {
    let patches = u32::from(header.path_spans) * u32::from(header.side_spans);
    let words = u64::from(patches) * record_words(header.kind) as u64;
    let digests = if header.window > 0 {
        DIGEST_WORDS as u64 * u64::from(header.side_spans)
    } else {
        0
    };
    let words = words + digests;
    (
        patches,
        words
            + u64::from(width_words(header.path_spans, header.side_spans))
            + region_words(header) as u64
            + u64::from(header.links),
    )
}

/// Words of a header's region.
const fn region_words(header: &Header) -> usize {
    EDGE_WORDS * header.edges as usize
}

/// Words of the store that a job takes behind its data, for the stations of passes of constant scallop height; none where it crosses more patches than there
/// may be stations for.
#[must_use]
pub fn front_words(header: &Header) -> Option<usize> {
    if !header.spacing.is_constant() {
        return Some(0);
    }
    (header.path_spans <= FRONT_SPANS_MAX).then(|| Stations::most(header.path_spans).words())
}

fn check_header(header: &Header) -> Result<()> {
    let spans_max = match header.kind {
        SurfaceKind::Polynomial | SurfaceKind::Rational => SPANS_MAX,
        SurfaceKind::RevolvedAlongProfile | SurfaceKind::RevolvedAroundAxis => 1,
    };
    for spans in [header.path_spans, header.side_spans] {
        if !(1..=spans_max).contains(&spans) {
            return Err(Fault::new(FaultKind::BadHeader, f32::from(spans)));
        }
    }
    let spans = header.path_spans.max(header.side_spans);
    if header.edges > 0 && (header.spacing.is_constant() || spans > REGION_SPANS_MAX) {
        return Err(Fault::new(FaultKind::BadHeader, f32::from(header.edges)));
    }
    if header.links > 0 && (header.spacing.is_constant() || header.axes.is_none()) {
        return Err(Fault::new(FaultKind::BadHeader, f32::from(header.links)));
    }
    if front_words(header).is_none() {
        return Err(Fault::new(FaultKind::BadHeader, f32::from(header.path_spans)));
    }
    if header.window > 0 {
        check_streamed(header)?;
    }
    let ranges = [
        (header.ball_radius_mm, f32::MIN_POSITIVE, 1000.0),
        (header.feed_mm_s, 1e-3, 10_000.0),
        (header.scallop_mm, f32::MIN_POSITIVE, header.ball_radius_mm),
        (header.period_s, 1e-5, 0.1),
    ];
    for (value, least, most) in ranges {
        // Positive comparisons, so that a NaN is rejected.
        if !(value >= least && value <= most) {
            return Err(Fault::new(FaultKind::BadHeader, value));
        }
    }
    header
        .axes
        .as_ref()
        .map_or(Ok(()), |axes| check_axes(header, axes))
}

/// A job that is loaded while it runs: straight passes over a grid, without turns, because the tool has to be able to wait at the end of each pass.
fn check_streamed(header: &Header) -> Result<()> {
    let is_grid = matches!(header.kind, SurfaceKind::Polynomial | SurfaceKind::Rational);
    let turns = header.axes.is_some_and(|axes| axes.overrun_mm > 0.0);
    if !is_grid
        || header.edges > 0
        || header.links > 0
        || header.spacing.is_constant()
        || turns
        || header.window < WINDOW_MIN
    {
        return Err(Fault::new(FaultKind::BadHeader, f32::from(header.window)));
    }
    Ok(())
}

/// Ranges of the axis limits, within which the step of a period fits its integer and no product of the planner overflows.
fn check_axes(header: &Header, axes: &AxisLimits) -> Result<()> {
    let bad = |value| Err(Fault::new(FaultKind::BadHeader, value));
    let all = [
        (axes.velocity_mm_s, 1e-3, 1e5),
        (axes.acceleration_mm_s2, 1e-2, 1e7),
        (axes.jerk_mm_s3, 1e-1, 1e9),
        ([axes.chord_mm; 3], 1e-6, 1e3),
    ];
    for (values, least, most) in all {
        for value in values {
            if !(value >= least && value <= most) {
                return bad(value);
            }
        }
    }
    if !(axes.plunge_mm >= 0.0 && axes.plunge_mm <= 1e3) {
        return bad(axes.plunge_mm);
    }
    if !(axes.overrun_mm >= 0.0 && axes.overrun_mm <= OVERRUN_MAX_MM) {
        return bad(axes.overrun_mm);
    }
    // The feed at the maximum override has to fit the step of a period.
    if OVERRIDE_MAX * header.feed_mm_s * header.period_s > STEP_MAX_MM {
        return bad(header.feed_mm_s);
    }
    if usize::from(header.path_spans) > CELLS_MAX {
        return bad(f32::from(header.path_spans));
    }
    let [x, y, _] = axes.home_nm;
    let end_nm = axes.end_nm.unwrap_or(axes.home_nm);
    let end_height_nm = axes.end_nm.map_or(axes.safe_z_nm, |_| axes.end_height_nm);
    for place in [
        axes.home_nm,
        end_nm,
        [x, y, axes.safe_z_nm],
        [x, y, end_height_nm],
    ] {
        for (place, [least, most]) in place.into_iter().zip(axes.travel_nm) {
            if !(least..=most).contains(&place) {
                return bad(nm_to_mm(place));
            }
        }
    }
    Ok(())
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
        let (_, needed) = extent(header);
        let rows = Rows::new(header, capacity);
        let stored = if header.window > 0 {
            rows.least_words()
        } else {
            needed + front_words(header).unwrap_or(0) as u64
        };
        if stored > capacity as u64 {
            #[allow(clippy::cast_precision_loss, reason = "a report; at most 2^27")]
            return Err(Fault::new(FaultKind::TooManyPatches, stored as f32));
        }
        if u64::from(words) != needed {
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

    /// The rows of the job in the store.
    pub(crate) const fn rows(&self) -> &Rows {
        &self.rows
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
    pub(crate) const fn release(&mut self, row: u16) {
        self.rows.release(row);
    }

    /// The run begins anew.
    ///
    /// # Errors
    /// [`FaultKind::WrongState`] where the first rows are overwritten.
    pub(crate) fn rewind(&mut self) -> Result<()> {
        self.rows.rewind()
    }

    /// Whether [`Self::rewind`] would succeed.
    pub(crate) fn can_rewind(&self) -> bool {
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

    /// Records: patches, then portions of edges.
    pub(crate) fn records(&self) -> u32 {
        self.patches() + u32::from(self.header.edges).div_ceil(EDGES_A_RECORD)
    }

    fn patches(&self) -> u32 {
        extent(&self.header).0
    }

    /// Copies a record of a streamed job, to be checked.
    ///
    /// # Errors
    /// [`FaultKind::BadLength`] where it is not the next one, or not there yet.
    pub(crate) fn copy(&self, store: &[i32], record: u32) -> Result<RecordCopy> {
        let is_there = self.is_streamed() && self.stage != LoadStage::Empty && self.rows.is_next(record);
        let job = self.view(store);
        let spans = usize::from(self.header.path_spans.max(1));
        let (index, first) = (record as usize, record as usize - record as usize % spans);
        let words = |index| match self.header.kind {
            SurfaceKind::Polynomial => job.record::<POLYNOMIAL_WORDS>(index).map(<[i32; _]>::as_slice),
            SurfaceKind::Rational => job.record::<RATIONAL_WORDS>(index).map(<[i32; _]>::as_slice),
            SurfaceKind::RevolvedAlongProfile | SurfaceKind::RevolvedAroundAxis => None,
        };
        match (words(index), words(first)) {
            (Some(words), Some(first)) if is_there => Ok(RecordCopy::new(record, words, first)),
            _ => Err(bad_length(record)),
        }
    }

    /// Seals a record of a streamed job whose copy is sound.
    ///
    /// # Errors
    /// As [`Self::copy`]; [`FaultKind::BadHeader`] for a width of a span, with the first record.
    pub(crate) fn accept(&mut self, store: &[i32], record: u32) -> Result<()> {
        if record == 0 {
            self.view(store).check_widths()?;
        }
        if self.rows.accept(record) {
            Ok(())
        } else {
            Err(bad_length(record))
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
        if self.is_streamed() {
            self.copy(store, record)?.check()?;
            return self.accept(store, record);
        }
        let LoadStage::Loading { received, checked } = self.stage else {
            return Err(bad_length(0));
        };
        if received != self.length || record > checked || record >= self.records() {
            return Err(bad_length(received));
        }
        let job = Job {
            header: &self.header,
            store,
            length: self.length as usize,
            rows: &self.rows,
        };
        if record == 0 {
            job.check_widths()?;
        }
        if let Some(portion) = record.checked_sub(self.patches()) {
            // Once each, in order: the first line is found on the way.
            let is_sound = record < checked
                || job.region().is_some_and(|region| {
                    if portion == 0 {
                        self.region.begin();
                    }
                    self.region.check(&self.header, &region, portion, line)
                });
            self.stage = LoadStage::Loading {
                received,
                checked: if is_sound { checked.max(record + 1) } else { 0 },
            };
            return if is_sound { Ok(()) } else { Err(bad_patch(record)) };
        }
        let index = record as usize;
        let result = match self.header.kind {
            SurfaceKind::Polynomial => job.record(index).map(PolynomialRecord::check),
            SurfaceKind::Rational => job.record(index).map(RationalRecord::check),
            SurfaceKind::RevolvedAlongProfile | SurfaceKind::RevolvedAroundAxis => {
                job.record(index).map(RevolvedRecord::check)
            }
        };
        match result {
            Some(Ok(())) if !job.is_alike(index) => Err(bad_patch(record)),
            Some(Ok(())) => {
                self.stage = LoadStage::Loading {
                    received,
                    checked: checked.max(record + 1),
                };
                Ok(())
            }
            _ => Err(bad_patch(record)),
        }
    }

    pub(crate) fn seal(&mut self) -> Result<()> {
        match self.stage {
            LoadStage::Loading { .. } if self.is_streamed() => {
                if !self.rows.can_begin() {
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

    /// The sealed job, and the words behind it.
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
    /// The words behind the job's.
    pub(crate) fn rest(&self) -> &'a [i32] {
        self.store.get(self.length..).unwrap_or(&[])
    }

    /// The region that is machined; none for the whole surface.
    pub(crate) fn region(&self) -> Option<RegionWords<'a>> {
        if self.header.edges == 0 {
            return None;
        }
        let end = self.length.checked_sub(self.header.links.into())?;
        let from = end.checked_sub(region_words(self.header))?;
        Some(RegionWords::new(self.store.get(from..end)?))
    }

    /// How the tool goes to a pass that is not joined to the one before it on the surface.
    pub(crate) fn link_to(&self, pass: u32, axes: &AxisLimits) -> Link {
        let links = u32::from(self.header.links);
        let word = pass
            .checked_sub(1)
            .filter(|index| *index < links)
            .and_then(|index| {
                let behind = usize::try_from(links - index).ok()?;
                self.store.get(self.length.checked_sub(behind)?).copied()
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
        let start = self.rows.start(row)? + within * N;
        self.store.get(start..)?.first_chunk::<N>()
    }

    /// The record of the patch at these spans; `N` is the number of words of the job's kind.
    ///
    /// # Errors
    /// [`FaultKind::WrongState`] where the job has no such patch.
    pub(crate) fn patch<const N: usize>(&self, path_span: u16, side_span: u16) -> Result<&'a [i32; N]> {
        let start = self.rows.start(side_span.into());
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
            if !(width > 0.0 && width.is_finite()) {
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
