//! A fault with its location on the surface.

use interp_core::Fault;
use job::Job;
use machine::Machine;
use machine::prepare::Prepared;

/// A fault with its location.
#[derive(Clone, Copy, Debug)]
pub struct FaultAt {
    /// The fault.
    pub fault: Fault,
    /// Number of samples before the fault.
    pub tick: u64,
    /// Pass, from 0.
    pub pass: u32,
    /// (u, v).
    pub parameters: [f64; 2],
}

impl FaultAt {
    /// The fault that stopped this machine after `samples` samples.
    #[must_use]
    pub fn of(fault: Fault, machine: &Machine, samples: u64, prepared: &Prepared) -> Self {
        let (pass, path, side) = machine.place();
        Self {
            fault,
            tick: samples,
            pass,
            parameters: prepared.parameters(path, side),
        }
    }

    /// The fault, its location and the remedy, in two lines.
    #[must_use]
    pub fn sentence(&self) -> String {
        let remedy = explain::fault(self.fault).1;
        let place = explain::fault_at(self.fault, self.tick, self.pass, self.parameters);
        let code = self.fault.kind.code();
        format!("{place}\n  help: {remedy}; more: cargo sim explain {code}")
    }

    /// As [`Self::sentence`], with the line of the job file that causes the fault.
    #[must_use]
    pub fn sentence_of(&self, job: &Job) -> String {
        let line = job.origin.quote(explain::key(self.fault.kind));
        line.map_or_else(
            || self.sentence(),
            |line| format!("{}\n  at {line}", self.sentence()),
        )
    }
}
