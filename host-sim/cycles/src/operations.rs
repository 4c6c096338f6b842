//! Arithmetic operations of a sample (steps 2 to 4), counted from the instructions that the firmware executes in QEMU. Which
//! instruction counts as what: [`cycle_plugin::operations`].

use std::collections::BTreeMap;

use super::figures::STEPS_2_TO_4_STAGES;
use super::measure::Ticks;
use cycle_plugin::record::Record;

pub use cycle_plugin::operations::Operations;

/// How the operations are counted, for a reader of the figures.
pub const CONVENTION: &str = "\
counted from the executed instructions: VADD, VSUB; VMUL, MUL, SMULL; VDIV, SDIV; VSQRT; a multiply-accumulate (SMMLA, MLA) as
one of each; an integer ADD or SUB where an operand is an arithmetic result; ADDS with ADC as one. Comparisons, negations,
conversions, shifts and address arithmetic are not counted. Sines are polynomials: their operations are among + - and x.";

/// The operations of a job's samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// Of the most frequent sample: one in the middle of a pass.
    pub operations: Operations,
    /// Samples with exactly these operations.
    pub samples: u32,
    /// Samples with others: the first ones of a pass or patch, and steps that need quadrature.
    pub others: u32,
}

/// Operations of steps 2 to 4 in a tick.
#[must_use]
pub fn of_tick(record: &Record) -> Operations {
    STEPS_2_TO_4_STAGES
        .iter()
        .map(|stage| record.operations[*stage as usize])
        .fold(Operations::default(), Operations::plus)
}

/// Whether the tick has a sample of a pass: on a link and at rest steps 2 to 4 are not executed.
fn has_sample(record: &Record) -> bool {
    STEPS_2_TO_4_STAGES
        .iter()
        .any(|stage| record.stages[*stage as usize].nominal > 0)
}

/// The operations of a job's samples; none without a sample.
#[must_use]
pub fn count(ticks: &Ticks) -> Option<Count> {
    let mut counts: BTreeMap<Operations, u32> = BTreeMap::new();
    for record in ticks.records.iter().filter(|record| has_sample(record)) {
        *counts.entry(of_tick(record)).or_default() += 1;
    }
    let all: u32 = counts.values().sum();
    let (operations, samples) = counts.into_iter().max_by_key(|(_, samples)| *samples)?;
    Some(Count {
        operations,
        samples,
        others: all - samples,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use cycle_plugin::plan::Stage;

    fn tick(stages: &[(Stage, Operations)]) -> Record {
        let mut record = Record::default();
        for (stage, operations) in stages {
            record.operations[*stage as usize] = *operations;
            record.stages[*stage as usize].nominal = 10;
        }
        record
    }

    #[test]
    fn the_most_frequent_sample_is_taken_with_steps_2_to_4_alone() {
        let usual = [
            (Stage::Step, Operations::new(1, 2, 0, 0)),
            (Stage::Offset, Operations::new(3, 4, 1, 1)),
            (Stage::PatchChange, Operations::new(100, 100, 100, 100)),
        ];
        let rare = [(Stage::Surface, Operations::new(90, 0, 0, 0))];
        // On a link most ticks have no sample.
        let link = tick(&[(Stage::Feed, Operations::new(7, 7, 0, 0))]);
        let records = vec![tick(&usual), link, link, tick(&rare), tick(&usual), link];
        let ticks = Ticks {
            records,
            ..Ticks::default()
        };
        let want = Count {
            operations: Operations::new(4, 6, 1, 1),
            samples: 2,
            others: 1,
        };
        assert_eq!(count(&ticks), Some(want));
        let links = Ticks {
            records: vec![link],
            ..Ticks::default()
        };
        assert_eq!(count(&links), None);
        assert_eq!(count(&Ticks::default()), None);
    }
}
