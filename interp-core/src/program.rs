//! A job in the machine: raw words go in, and only a complete, checked job comes out.

use crate::arith::centred;
use crate::fault::{Fault, FaultKind, Result};
use crate::job::{Header, SPANS_MAX, SurfaceKind};
use crate::sample::Place;
use crate::schedule::width_words;
use crate::surface::{
    CirclePass, Contact, POLYNOMIAL_WORDS, PassLine, PolynomialPass, PolynomialRecord, ProfilePass,
    RATIONAL_WORDS, REVOLVED_WORDS, RationalPass, RationalRecord, RevolvedRecord,
};

/// Which part of the checks a job has passed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Empty,
    /// Words received and records checked so far.
    Loading {
        received: u32,
        checked: u32,
    },
    Sealed,
}

/// The job's store. Its surface can be read only once the job is sealed.
#[derive(Debug)]
pub(crate) struct Program<const WORDS: usize> {
    stage: Stage,
    header: Header,
    /// Words that the job has.
    length: u32,
    words: [i32; WORDS],
}

/// A surface on one pass.
#[derive(Clone, Copy, Debug)]
#[allow(
    clippy::large_enum_variant,
    reason = "one lives in the interpolator for ever; nothing is allocated"
)]
pub(crate) enum PassSurface {
    Polynomial(PolynomialPass),
    Rational(RationalPass),
    Profile(ProfilePass),
    Circle(CirclePass),
}

impl PassSurface {
    /// Its units are 2^-shift nm.
    pub(crate) fn shift(&self) -> u8 {
        match self {
            Self::Polynomial(pass) => pass.shift,
            Self::Rational(pass) => pass.shift,
            Self::Profile(pass) => pass.shift,
            Self::Circle(pass) => pass.shift,
        }
    }

    /// The pass is a single point.
    pub(crate) fn is_point(&self) -> bool {
        match self {
            Self::Polynomial(pass) => pass.is_point(),
            Self::Rational(pass) => pass.is_point(),
            Self::Profile(_) => false,
            Self::Circle(pass) => pass.is_point(),
        }
    }

    /// The contact at a fraction of the patch, in the direction of travel, and the origin it is relative to, nm.
    #[inline(always)]
    pub(crate) fn contact(&self, fraction: u64) -> Result<(Contact, [i32; 3])> {
        let w = centred(fraction);
        match self {
            Self::Polynomial(pass) => Ok((pass.contact(w)?, pass.origin_nm)),
            Self::Rational(pass) => Ok((pass.contact(w)?, pass.origin_nm)),
            Self::Profile(pass) => Ok((pass.contact(w)?, [0, 0, pass.height_origin_nm])),
            Self::Circle(pass) => Ok((pass.contact(fraction), [0, 0, pass.height_origin_nm])),
        }
    }
}

/// Words of one record of a kind of surface.
const fn record_words(kind: SurfaceKind) -> usize {
    match kind {
        SurfaceKind::Polynomial => POLYNOMIAL_WORDS,
        SurfaceKind::Rational => RATIONAL_WORDS,
        SurfaceKind::RevolvedAlongProfile | SurfaceKind::RevolvedAroundAxis => REVOLVED_WORDS,
    }
}

/// Records and words that a header implies.
pub(crate) fn extent(header: &Header) -> (u32, u64) {
    let records = u32::from(header.path_spans) * u32::from(header.side_spans);
    let words = u64::from(records) * record_words(header.kind) as u64;
    (
        records,
        words + u64::from(width_words(header.path_spans, header.side_spans)),
    )
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
    let ranges = [
        (header.ball_radius_mm, f32::MIN_POSITIVE, 1000.0),
        (header.feed_mm_s, 1e-3, 10_000.0),
        (header.scallop_mm, f32::MIN_POSITIVE, header.ball_radius_mm),
        (header.period_s, 1e-5, 0.1),
    ];
    for (value, least, most) in ranges {
        // Not the negated comparisons: a NaN must not pass.
        if !(value >= least && value <= most) {
            return Err(Fault::new(FaultKind::BadHeader, value));
        }
    }
    Ok(())
}

impl<const WORDS: usize> Program<WORDS> {
    pub(crate) const fn new() -> Self {
        const HEADER: Header = Header {
            kind: SurfaceKind::Polynomial,
            pattern: crate::job::Pattern::Zig,
            tool_side: crate::job::ToolSide::Plus,
            path_spans: 0,
            side_spans: 0,
            ball_radius_mm: 0.0,
            feed_mm_s: 0.0,
            scallop_mm: 0.0,
            period_s: 0.0,
        };
        Self {
            stage: Stage::Empty,
            header: HEADER,
            length: 0,
            words: [0; WORDS],
        }
    }

    pub(crate) fn begin(&mut self, header: &Header, words: u32) -> Result<()> {
        check_header(header)?;
        let (_, needed) = extent(header);
        if needed > WORDS as u64 {
            #[allow(clippy::cast_precision_loss, reason = "a report; at most 2^27")]
            return Err(Fault::new(FaultKind::TooManyPatches, needed as f32));
        }
        if u64::from(words) != needed {
            return Err(bad_length(words));
        }
        self.stage = Stage::Loading {
            received: 0,
            checked: 0,
        };
        self.header = *header;
        self.length = words;
        Ok(())
    }

    pub(crate) fn clear(&mut self) {
        self.stage = Stage::Empty;
    }

    pub(crate) fn write(&mut self, offset: u32, words: &[i32]) -> Result<()> {
        let Stage::Loading { received, .. } = self.stage else {
            return Err(bad_length(offset));
        };
        let end = u32::try_from(words.len())
            .ok()
            .and_then(|length| offset.checked_add(length));
        let Some(end) = end.filter(|end| *end <= self.length && offset <= received) else {
            return Err(bad_length(offset));
        };
        let Some(slots) = self.words.get_mut(offset as usize..end as usize) else {
            return Err(bad_length(end));
        };
        slots.copy_from_slice(words);
        self.stage = Stage::Loading {
            received: received.max(end),
            checked: 0,
        };
        Ok(())
    }

    pub(crate) fn records(&self) -> u32 {
        extent(&self.header).0
    }

    pub(crate) fn check(&mut self, record: u32) -> Result<()> {
        let Stage::Loading { received, checked } = self.stage else {
            return Err(bad_length(0));
        };
        if received != self.length || record > checked || record >= self.records() {
            return Err(bad_length(received));
        }
        if record == 0 {
            self.check_widths()?;
        }
        let index = record as usize;
        let result = match self.header.kind {
            SurfaceKind::Polynomial => self.record(index).map(PolynomialRecord::check),
            SurfaceKind::Rational => self.record(index).map(RationalRecord::check),
            SurfaceKind::RevolvedAlongProfile | SurfaceKind::RevolvedAroundAxis => {
                self.record(index).map(RevolvedRecord::check)
            }
        };
        match result {
            Some(Ok(())) if !self.is_alike(index) => Err(bad_patch(record)),
            Some(Ok(())) => {
                self.stage = Stage::Loading {
                    received,
                    checked: checked.max(record + 1),
                };
                Ok(())
            }
            _ => Err(bad_patch(record)),
        }
    }

    /// Whether a patch's side boundaries collapse like those of the first patch beside the same pass: a pass is a point as a
    /// whole or not at all.
    fn is_alike(&self, index: usize) -> bool {
        let head = |index: usize| match self.header.kind {
            SurfaceKind::Polynomial => self
                .record::<POLYNOMIAL_WORDS>(index)
                .map(PolynomialRecord::side_edges),
            SurfaceKind::Rational => self
                .record::<RATIONAL_WORDS>(index)
                .map(RationalRecord::side_edges),
            SurfaceKind::RevolvedAlongProfile | SurfaceKind::RevolvedAroundAxis => None,
        };
        head(index) == head(index - index % usize::from(self.header.path_spans.max(1)))
    }

    fn check_widths(&self) -> Result<()> {
        let count = width_words(self.header.path_spans, self.header.side_spans) as usize;
        for word in self.words.iter().take(count) {
            let width = f32::from_bits(word.cast_unsigned());
            if !(width > 0.0 && width.is_finite()) {
                return Err(Fault::new(FaultKind::BadHeader, width));
            }
        }
        Ok(())
    }

    pub(crate) fn seal(&mut self) -> Result<()> {
        match self.stage {
            Stage::Loading { received, checked } if received == self.length && checked == self.records() => {
                self.stage = Stage::Sealed;
                Ok(())
            }
            Stage::Loading { received, .. } => Err(bad_length(received)),
            Stage::Empty | Stage::Sealed => Err(bad_length(0)),
        }
    }

    pub(crate) const fn header(&self) -> &Header {
        &self.header
    }

    /// Width of a side span, in units of the side parameter.
    pub(crate) fn side_width(&self, span: u16) -> f32 {
        self.words
            .get(usize::from(span))
            .map_or(1.0, |word| f32::from_bits(word.cast_unsigned()))
    }

    fn record<const N: usize>(&self, index: usize) -> Option<&[i32; N]> {
        let start = width_words(self.header.path_spans, self.header.side_spans) as usize + index * N;
        self.words.get(start..)?.first_chunk::<N>()
    }

    /// The sealed surface's patch at these spans, on a pass at this side fraction.
    ///
    /// # Errors
    /// [`FaultKind::WrongState`] where no job is sealed; what the surface's kind finds wrong.
    pub(crate) fn collapse(&self, path_span: u16, side: Place, at: &PassLine) -> Result<PassSurface> {
        if self.stage != Stage::Sealed {
            return NO_RECORD;
        }
        let index = usize::from(side.span) * usize::from(self.header.path_spans) + usize::from(path_span);
        let pass = match self.header.kind {
            SurfaceKind::Polynomial => self
                .record(index)
                .map(|words| PassSurface::Polynomial(PolynomialPass::collapse(words, at))),
            SurfaceKind::Rational => self
                .record(index)
                .map(|words| PassSurface::Rational(RationalPass::collapse(words, at))),
            SurfaceKind::RevolvedAlongProfile => self
                .record(index)
                .map(|words| PassSurface::Profile(ProfilePass::collapse(words, at, side.fraction))),
            SurfaceKind::RevolvedAroundAxis => match self.record(index) {
                Some(words) => Some(PassSurface::Circle(CirclePass::collapse(words, at)?)),
                None => None,
            },
        };
        pass.map_or(NO_RECORD, Ok)
    }
}

const NO_RECORD: Result<PassSurface> = Err(Fault::new(FaultKind::WrongState, 0.0));

fn bad_patch(record: u32) -> Fault {
    Fault::new(FaultKind::BadPatch, crate::arith::count_to_f32(record))
}

fn bad_length(words: u32) -> Fault {
    Fault::new(FaultKind::BadLength, crate::arith::count_to_f32(words))
}
