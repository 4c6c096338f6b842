//! Jobs that a board keeps.

use heapless::String;
use interp_core::job::Header;
use serde::{Deserialize, Serialize};

use crate::{records::HeaderFields, spindle::SpindleOrder};

/// Longest name of a stored job, bytes.
pub const JOB_NAME_MAX: usize = 24;

/// Name of a stored job.
pub type JobName = String<JOB_NAME_MAX>;

/// A job that a board keeps, apart from its words.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StoredJob {
    /// Name of the job.
    pub name: JobName,
    /// The job without the surface's data.
    #[serde(with = "HeaderFields")]
    pub header: Header,
    /// Data words.
    pub words: u32,
    /// [`crate::digest::job_digest`] of the data words.
    #[serde(with = "postcard::fixint::le")]
    pub digest: u64,
    /// Spindle and coolant of its runs.
    pub spindle: SpindleOrder,
    /// Runs begin where the axes stand, not at the job's home.
    pub begins_anywhere: bool,
    /// [`crate::message::Offsets::digest`] of the offsets that placed the job. Of a job that an earlier firmware has stored these bytes are blank flash, which is the digest of no offsets.
    #[serde(with = "postcard::fixint::le")]
    pub offsets: u32,
}

/// Bytes of a [`StoredJob`], at most.
pub const STORED_JOB_BYTES_MAX: usize = 244;

impl StoredJob {
    /// Writes the job; `None` if it is longer than [`STORED_JOB_BYTES_MAX`], which no header within its bounds is.
    #[must_use]
    pub fn write<'a>(&self, bytes: &'a mut [u8; STORED_JOB_BYTES_MAX]) -> Option<&'a [u8]> {
        postcard::to_slice(self, bytes).ok().map(|written| &*written)
    }

    /// Reads what [`Self::write`] has written.
    #[must_use]
    pub fn read(bytes: &[u8]) -> Option<Self> {
        // Field by field, in their order: of the whole at once the compiler keeps three copies on the stack.
        let (name, bytes) = postcard::take_from_bytes(bytes).ok()?;
        let (Fields(header), bytes) = postcard::take_from_bytes(bytes).ok()?;
        let (words, bytes) = postcard::take_from_bytes(bytes).ok()?;
        let (digest, bytes) = bytes.split_first_chunk()?;
        let (spindle, bytes) = postcard::take_from_bytes(bytes).ok()?;
        let (begins_anywhere, bytes) = postcard::take_from_bytes(bytes).ok()?;
        let (offsets, _) = bytes.split_first_chunk()?;
        Some(Self {
            name,
            header,
            words,
            digest: u64::from_le_bytes(*digest),
            spindle,
            begins_anywhere,
            offsets: u32::from_le_bytes(*offsets),
        })
    }
}

/// A header alone.
#[derive(Deserialize)]
struct Fields(#[serde(with = "HeaderFields")] Header);

/// What a board tells of a stored job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StoredJobInfo {
    /// Its name.
    pub name: JobName,
    /// Data words.
    pub words: u32,
    /// [`crate::message::job_mark`].
    #[serde(with = "postcard::fixint::le")]
    pub mark: u64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spindle::Turning;
    use interp_core::job::AxisLimits;

    #[test]
    fn the_longest_job_is_read_as_it_was_written() {
        let axes = AxisLimits {
            velocity_mm_s: [f32::MAX; 3],
            acceleration_mm_s2: [f32::MAX; 3],
            jerk_mm_s3: [f32::MAX; 3],
            chord_mm: f32::MAX,
            overrun_mm: f32::MAX,
            travel_nm: [[i32::MIN, i32::MAX]; 3],
            home_nm: [i32::MIN; 3],
            plunge_mm: f32::MAX,
            end_nm: Some([i32::MIN; 3]),
            end_height_nm: i32::MIN,
            safe_z_nm: i32::MIN,
        };
        let job = StoredJob {
            name: JobName::try_from("abcdefghijklmnopqrstuvwx").unwrap(),
            header: Header {
                path_spans: u16::MAX,
                side_spans: u16::MAX,
                axes: Some(axes),
                ..Header::default()
            },
            words: u32::MAX,
            digest: u64::MAX,
            spindle: SpindleOrder {
                turning: Turning::Counterclockwise,
                rpm: u32::MAX,
                coolant: true,
            },
            begins_anywhere: true,
            offsets: 7,
        };
        let mut bytes = [0; STORED_JOB_BYTES_MAX];
        let length = job.write(&mut bytes).unwrap().len();
        assert_eq!(StoredJob::read(&bytes), Some(job.clone()));
        // Without its offsets, as an earlier firmware has stored it in blank flash.
        bytes[length - 4..].fill(0xff);
        let offsets = u32::MAX;
        assert_eq!(StoredJob::read(&bytes), Some(StoredJob { offsets, ..job }));
    }
}
