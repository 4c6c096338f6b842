//! Conditions for the start of a run: drives, home, position, door, spindle.
//!
//! **Start position.** A job with axis limits starts at its home. The start is refused where the axes stand elsewhere, because
//! no path would lead to its first sample. Restarted without a new declaration of the home, it starts where it ended: at its home, or
//! where it was aborted, and the approach is planned from there.
//! **Without a home.** Where none is required and none was declared, the axes count as standing at the job's home.
//! **After a job without limits** the axes' position is unknown: no links led from pass to pass.

use interp_core::{RunStart, command::Command};
use protocol::message::{InputLines, Reason};

use super::{RealTime, run::RunRecord};
use crate::{
    manual::{Allowed, Change, Motion},
    safety::{Order, may_start},
};

impl<S: AsRef<[i32]> + AsMut<[i32]>> RealTime<S> {
    /// Executes the host's order for drives and home.
    ///
    /// # Errors
    /// The reason of the refusal; nothing has changed.
    pub fn order(&mut self, order: Order) -> Result<(), Reason> {
        let state = self.interpolator.state();
        let keeps = matches!(
            order,
            Order::Move(_) | Order::Acknowledge | Order::Turn { .. } | Order::Coolant { .. }
        );
        if self.control.manual.is_active() && !keeps {
            return Err(Reason::Moving);
        }
        self.control.safety.obey(order, state)?;
        match order {
            Order::SetHome { home_nm } => {
                self.set_position(home_nm);
                self.control.manual.declared();
            }
            Order::Drives { on: false } => {
                self.control.spindle.off();
                if !self.control.safety.status().homed {
                    self.lose_position();
                }
            }
            Order::Move(motion) => self.begin_motion(motion)?,
            Order::SetUp(setup) => {
                if !self.control.manual.keeps_position(setup.as_ref()) {
                    self.control.safety.set_homed(None);
                    self.lose_position();
                }
                self.control.safety.set_up(setup.as_ref());
                self.control
                    .spindle
                    .set_up(setup.and_then(|setup| setup.spindle()));
                self.control.manual.set_up(setup);
                self.control.levels = setup.map_or(0, |setup| setup.levels());
                if let Some(steps) = &mut self.steps {
                    steps.set_low_pulses(setup.map_or(0, |setup| setup.step_inverted()));
                }
            }
            Order::Spindle(order) => self.control.spindle.order(order)?,
            Order::Turn { turning, rpm } => self.turn(turning, rpm)?,
            Order::Coolant { on } => self.switch_coolant(on)?,
            Order::BeginAt(start) => {
                let begins_anywhere = self.interpolator.has_limits() && !self.interpolator.is_streamed();
                if !start.is_first() && !begins_anywhere {
                    return Err(Reason::WholeOnly);
                }
                self.interpolator.begin_at(start);
            }
            Order::Drives { .. } | Order::Configure(_) | Order::Acknowledge => {}
        }
        Ok(())
    }

    /// Whether a run may start.
    ///
    /// # Errors
    /// The reason of the refusal: an input asserted or latched, the drives off, the machine not homed, or not at the start position; a job without limits on
    /// drives; a streamed job whose first rows are gone.
    pub fn may_start(&self) -> Result<(), Reason> {
        self.may_start_from(self.interpolator.home_nm(), self.control.from_home)?;
        if self.interpolator.can_start() {
            Ok(())
        } else {
            Err(Reason::RowsGone)
        }
    }

    /// Whether a run of a job may start that is loaded next; `home_nm`: the job's home, none where it has no limits.
    ///
    /// # Errors
    /// As [`Self::may_start`].
    pub fn may_start_next(&self, home_nm: Option<[i32; 3]>) -> Result<(), Reason> {
        self.may_start_from(home_nm, true)
    }

    /// Whether inputs, drives and position let a run start at this home, or, where it need not, from where the axes stand.
    fn may_start_from(&self, home_nm: Option<[i32; 3]>, from_home: bool) -> Result<(), Reason> {
        if self.control.manual.is_active() {
            return Err(Reason::Moving);
        }
        let status = self.control.safety.status();
        may_start(&status)?;
        let has_axes = self.control.has_drives && status.configuration.homing_required;
        let stands_nm = self.interpolator.stands_nm();
        match home_nm {
            None if has_axes => Err(Reason::NoLimits),
            Some(home_nm) if status.homed && from_home && stands_nm != Some(home_nm) => {
                Err(Reason::NotAtHome { home_nm, stands_nm })
            }
            _ => Ok(()),
        }
    }

    /// Whether a start waits for its period: in lockstep for credit, on a free clock for the spindle.
    #[must_use]
    pub fn start_waits(&self) -> bool {
        self.control.command == Some(Command::Start)
    }

    /// Executes a start: resets the record of the run, or refuses the start for a reason that
    /// arose after the link's check.
    #[cold]
    #[inline(never)]
    pub(super) fn begin(&mut self) -> Option<Command> {
        if self.may_start().is_err() {
            self.interpolator.begin_at(RunStart::FIRST);
            return None;
        }
        match self.interpolator.home_nm() {
            Some(home_nm) => {
                let unknown = self.control.from_home || self.interpolator.stands_nm().is_none();
                if unknown && !self.control.safety.status().homed {
                    self.set_position(home_nm);
                }
            }
            None => self.lose_position(),
        }
        self.control.from_home = false;
        self.control.run = RunRecord::NEW;
        self.control.safety.begin_run();
        Some(Command::Start)
    }

    /// Begins motion outside a job, from where the axes stand.
    fn begin_motion(&mut self, motion: Motion) -> Result<(), Reason> {
        if motion == Motion::Stop && self.spins_up() {
            self.give_up_start();
            return Ok(());
        }
        let status = self.control.safety.status();
        if !self.control.manual.is_active() {
            let stands_nm = self.interpolator.stands_nm();
            let target_nm = self.steps.as_ref().map(interp_core::Steps::target_nm);
            if let Some(at_nm) = stands_nm.or(target_nm) {
                self.control.manual.place(at_nm);
            }
        }
        let allowed = Allowed {
            lines: status.lines,
            is_homed: status.homed,
            feed_override: status.feed_override,
            spindle_turns: self.control.spindle.turns(),
        };
        self.control.manual.begin(motion, &allowed)?;
        if matches!(motion, Motion::Home { .. }) {
            // Until every axis is homed.
            self.control.safety.set_homed(None);
            self.interpolator.stand_at(None);
        }
        Ok(())
    }

    /// One period of motion outside a job.
    #[cold]
    #[inline(never)]
    pub(super) fn move_manually(&mut self, lines: InputLines) {
        let steady = self.control.safety.status().lines;
        let raw = self.control.safety.raw(lines);
        let change = self.control.manual.tick(raw, steady);
        let at_nm = self.control.manual.at_nm();
        match change {
            Change::None => {
                // Without a home too, once a run has placed the axes.
                if self.control.safety.status().homed || self.interpolator.stands_nm().is_some() {
                    self.interpolator.stand_at(Some(at_nm));
                }
            }
            Change::Placed => {
                if let Some(steps) = &mut self.steps {
                    steps.place(at_nm);
                }
            }
            Change::Homed => {
                self.control.safety.set_homed(Some(at_nm));
                self.interpolator.stand_at(Some(at_nm));
                self.control.from_home = true;
            }
        }
    }

    /// Sets the axes' position for steps and runs.
    fn set_position(&mut self, at_nm: [i32; 3]) {
        self.control.manual.place(at_nm);
        self.interpolator.stand_at(Some(at_nm));
        if let Some(steps) = &mut self.steps {
            steps.place(at_nm);
        }
        self.control.from_home = true;
    }

    /// The axes' position is unknown from here on.
    pub(super) fn lose_position(&mut self) {
        self.control.manual.lose_home();
        self.interpolator.stand_at(None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::realtime::tests::{DRIVES_ON, HOME_NM, order, with_plate};
    use protocol::message::Configuration;

    #[test]
    fn a_home_places_steps_and_tool() {
        let mut half = with_plate(None);
        order(&mut half, DRIVES_ON);
        order(&mut half, Order::SetHome { home_nm: HOME_NM });
        assert_eq!(half.steps().unwrap().position(), [-1, 2, 8000]);
        assert_eq!(half.steps().unwrap().target_nm(), HOME_NM);
        assert_eq!(half.interpolator.stands_nm(), Some(HOME_NM));
        // A refused home leaves the position unchanged.
        half.order(Order::Drives { on: false }).unwrap();
        let home = Order::SetHome { home_nm: [0; 3] };
        assert_eq!(half.order(home), Err(Reason::DrivesOff));
        assert_eq!(half.steps().unwrap().target_nm(), HOME_NM);
        assert_eq!(half.interpolator.stands_nm(), None);
    }

    #[test]
    fn a_run_begins_at_the_jobs_home_only() {
        let mut half = with_plate(Some(HOME_NM));
        order(&mut half, DRIVES_ON);
        let near = [HOME_NM[0] - 1, HOME_NM[1], HOME_NM[2]];
        for (stands_nm, begun) in [(near, None), (HOME_NM, Some(Command::Start))] {
            order(&mut half, Order::SetHome { home_nm: stands_nm });
            let refused = Err(Reason::NotAtHome {
                home_nm: HOME_NM,
                stands_nm: Some(stands_nm),
            });
            let may = if begun.is_some() { Ok(()) } else { refused };
            assert_eq!(half.may_start(), may);
            assert_eq!(half.begin(), begun);
        }
        // Without limits a run starts at any position, but not on drives.
        let mut half = with_plate(None);
        order(&mut half, DRIVES_ON);
        order(&mut half, Order::SetHome { home_nm: near });
        half.set_has_drives(true);
        assert_eq!(half.may_start(), Err(Reason::NoLimits));
        half.set_has_drives(false);
        assert_eq!(half.begin(), Some(Command::Start));
        assert_eq!(half.interpolator.stands_nm(), None);
    }

    #[test]
    fn without_a_home_the_axes_count_as_standing_at_the_jobs() {
        let mut half = with_plate(Some(HOME_NM));
        let free = Configuration {
            homing_required: false,
            ..Configuration::DEFAULT
        };
        order(&mut half, Order::Configure(free));
        order(&mut half, DRIVES_ON);
        assert_eq!(half.begin(), Some(Command::Start));
        assert_eq!(half.steps().unwrap().target_nm(), HOME_NM);
        assert_eq!(half.interpolator.stands_nm(), Some(HOME_NM));
    }
}
