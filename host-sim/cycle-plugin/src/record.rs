//! One record a tick, and one for each planning, written by the plugin and read by the host. An idle tick equal to the preceding one is omitted.

use crate::cost::Cycles;
use crate::operations::Operations;
use crate::plan::{STAGES, Stage};

/// Words of a record.
const WORDS: usize = 5 + (2 + 4) * STAGES;

/// Bytes of a record, little endian.
pub const RECORD_BYTES: usize = 4 * WORDS;

/// A tick of the sample task, or a portion of the planning task.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Record {
    /// Of the planning task.
    pub is_planning: bool,
    /// Instructions of the task.
    pub instructions: u32,
    /// Instructions outside the sample task since the preceding tick; 0 in a record of the planning task.
    pub elsewhere: u32,
    /// Instructions unknown to the decoder since the start; must be 0.
    pub unknown: u32,
    /// Lowest stack address written since the start.
    pub stack_low: u32,
    /// Cycles of each stage.
    pub stages: [Cycles; STAGES],
    /// Arithmetic operations of each stage.
    pub operations: [Operations; STAGES],
}

impl Record {
    /// Whether no stage took cycles but entry and exit, pulses and the rest of the task.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        let always = [Stage::Rest, Stage::Exception, Stage::Pulses];
        Stage::ALL
            .into_iter()
            .filter(|stage| !always.contains(stage))
            .all(|stage| self.stages[stage as usize].nominal == 0)
    }

    /// The record's bytes in the file.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let head = [
            u32::from(self.is_planning),
            self.instructions,
            self.elsewhere,
            self.unknown,
            self.stack_low,
        ];
        let cycles = self
            .stages
            .iter()
            .flat_map(|cycles| [cycles.nominal, cycles.pessimistic]);
        let operations = self
            .operations
            .iter()
            .flat_map(|operations| operations.to_array());
        head.into_iter()
            .chain(cycles)
            .chain(operations)
            .flat_map(u32::to_le_bytes)
            .collect()
    }

    /// The complete records of a file.
    #[must_use]
    pub fn read_all(bytes: &[u8]) -> Vec<Self> {
        bytes.chunks_exact(RECORD_BYTES).map(Self::from_bytes).collect()
    }

    fn from_bytes(bytes: &[u8]) -> Self {
        let mut words = bytes
            .chunks_exact(4)
            .map(|word| word.try_into().map_or(0, u32::from_le_bytes));
        let mut next = || words.next().unwrap_or(0);
        let mut record = Self {
            is_planning: next() != 0,
            instructions: next(),
            elsewhere: next(),
            unknown: next(),
            stack_low: next(),
            ..Self::default()
        };
        for cycles in &mut record.stages {
            cycles.nominal = next();
            cycles.pessimistic = next();
        }
        for operations in &mut record.operations {
            *operations = Operations::new(next(), next(), next(), next());
        }
        record
    }
}
