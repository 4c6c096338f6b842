//! Settings that the board keeps and puts in force: profile, offsets, settings of the drives.

use interp_core::{
    fault::{Fault, FaultKind},
    steps::{StepConfig, StepConfigError},
};
use protocol::message::{Configuration, Excess, Offsets, Profile, ProfileLimit, Reason, StepSettings};

use super::{Session, requests::no_run};
use crate::{machine::Machine, manual::Setup, safety::Order, storage::StorageError};

impl Session {
    /// Puts the profile that the board keeps in force: at power-up, and after a change.
    ///
    /// # Errors
    /// A run is under way.
    pub(crate) fn enforce_profile(&mut self, machine: &mut impl Machine) -> Result<(), Reason> {
        self.profile = supervise(machine)?;
        set_up(machine)?;
        let own = own_steps(machine);
        self.set_steps(machine, own)
    }

    /// Keeps another profile, or none.
    #[inline(never)]
    pub(super) fn set_profile(
        &mut self,
        machine: &mut impl Machine,
        profile: Option<&Profile>,
    ) -> Result<(), Reason> {
        no_run(machine)?;
        let period_s = period_s(machine);
        if profile.is_some_and(|profile| !profile.is_valid() || !profile.has_room_for_steps(period_s)) {
            return Err(Reason::BadProfile);
        }
        self.forget_places(machine);
        machine
            .keep_profile(profile)
            .map_err(|StorageError| Reason::Storage)?;
        self.is_outdated = true;
        self.upload = None;
        self.enforce_profile(machine)
    }

    /// Keeps other work offsets. The loaded job was placed by the earlier ones, so it is outdated.
    #[inline(never)]
    pub(super) fn set_offsets(
        &mut self,
        machine: &mut impl Machine,
        offsets: &Offsets,
    ) -> Result<(), Reason> {
        no_run(machine)?;
        self.forget_places(machine);
        machine
            .keep_offsets(offsets)
            .map_err(|StorageError| Reason::Storage)?;
        self.is_outdated = true;
        self.upload = None;
        Ok(())
    }

    pub(super) fn set_steps(&mut self, machine: &mut impl Machine, config: StepConfig) -> Result<(), Reason> {
        set_steps(machine, config)?;
        self.steps = Some(config);
        Ok(())
    }
}

/// Puts the supervision of the kept profile in force; returns the profile's digest, 0 where there is none.
fn supervise(machine: &mut impl Machine) -> Result<u32, Reason> {
    let (configuration, digest) = match machine.profile() {
        Some(profile) => (profile.configuration, profile.digest()),
        None => (Configuration::DEFAULT, 0),
    };
    machine.order(Order::Configure(configuration))?;
    Ok(digest)
}

/// Whether the machine has a spindle that the board switches.
pub(super) fn has_spindle(machine: &impl Machine) -> bool {
    machine.profile().is_some_and(|profile| profile.spindle.is_some())
}

/// Puts the kept profile's part for motion outside a job in force.
#[inline(never)]
fn set_up(machine: &mut impl Machine) -> Result<(), Reason> {
    let period_s = period_s(machine);
    let setup = machine.profile().map(|profile| Setup::new(profile, period_s));
    machine.order(Order::SetUp(setup))
}

/// Length of a period, s.
#[inline(never)]
fn period_s(machine: &mut impl Machine) -> f32 {
    #[allow(clippy::cast_precision_loss, reason = "a period is below 2^24 us")]
    let period_us = machine.description().period_us as f32;
    period_us * 1e-6
}

/// The settings of the drives of a job that has none: the profile's, or the board's own.
#[inline(never)]
pub(super) fn own_steps(machine: &mut impl Machine) -> StepConfig {
    match machine.profile() {
        Some(profile) => profile.steps.into(),
        None => machine.own_steps(),
    }
}

pub(super) const fn beyond(excess: Excess) -> Reason {
    Reason::BeyondProfile { excess }
}

/// Whether these settings differ from the profile's, if the board keeps one.
pub(super) fn has_other_steps(machine: &impl Machine, settings: StepSettings) -> bool {
    machine.profile().is_some_and(|profile| profile.steps != settings)
}

/// A job may require homing where the profile does not, but may not waive it where the profile requires it.
pub(super) fn configure(machine: &mut impl Machine, configuration: Configuration) -> Result<(), Reason> {
    let must_home = machine
        .profile()
        .is_some_and(|profile| profile.configuration.homing_required);
    if must_home && !configuration.homing_required {
        return Err(beyond(Excess::of(ProfileLimit::Homing)));
    }
    machine.order(Order::Configure(configuration))
}

/// Validated here, outside the tick; applied between two ticks.
fn set_steps(machine: &mut impl Machine, config: StepConfig) -> Result<(), Reason> {
    no_run(machine)?;
    let refused = |value: f32, record| Reason::Job {
        fault: Fault::new(FaultKind::BadHeader, value).into(),
        record,
    };
    let checked = config.check().map_err(|error| match error {
        #[allow(clippy::cast_precision_loss, reason = "a value to be read by a person")]
        StepConfigError::StepsPerMm { axis, steps, mm } => {
            refused(steps as f32 / mm as f32, Some(axis.into()))
        }
        StepConfigError::PulseSlots(slots) => refused(slots.into(), None),
        StepConfigError::SetupSlots(slots) => refused(slots.into(), None),
    })?;
    machine
        .set_steps(&checked)
        .map_err(|fault| refused(fault.value, None))
}
