//! A board with a machine around it: carriages that follow the pulses, limit switches, a probe plate.

use controller::in_process::Board;
use integration_tests::{HELLO, Host};
use interp_core::steps::StepConfig;
use protocol::message::{Activity, InputLines, MotionStatus, Offsets, Reason, Reply, Request, Status};

use super::STEP_NM;

const WORDS: usize = 64;
const MM: i32 = 1_000_000;

/// Where the switches trip, nm: 2 mm beyond the travel.
const SWITCHES_NM: [[i32; 2]; 3] = [[-2 * MM, 302 * MM], [-2 * MM, 202 * MM], [-82 * MM, 2 * MM]];

/// Height of the probe plate, nm.
pub(super) const PLATE_NM: i32 = -47_100_000;

/// What is wrong with the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Fault {
    Nothing,
    /// An input is always asserted, or never.
    Stuck(InputLines),
    Never(InputLines),
    /// Two plugs are swapped.
    Swapped(InputLines, InputLines),
    /// The switches close when they are pressed.
    Opposite,
    /// A contact bounces for so long.
    Bounce {
        ticks: u32,
    },
    /// An axis turns the other way.
    Reversed(usize),
}

pub(super) struct Rig {
    host: Host,
    board: Board<WORDS>,
    /// Where the carriages were at power-up, nm.
    start_nm: [i32; 3],
    /// Steps as of the last ticks: the pulses lag.
    steps: [[i32; 3]; 3],
    pub(super) fault: Fault,
    /// Inputs that somebody presses.
    pub(super) pressed: InputLines,
    /// Switches pressed by the carriages, and for how long.
    touched: InputLines,
    ticks: u32,
}

impl Rig {
    /// A board without a profile.
    pub(super) fn new(start_nm: [i32; 3]) -> Self {
        Self::with(Board::new(), start_nm)
    }

    fn with(mut board: Board<WORDS>, start_nm: [i32; 3]) -> Self {
        board
            .real_time()
            .set_step_pins(StepConfig::DEFAULT.check().unwrap(), [0, 1, 2]);
        let mut rig = Self {
            host: Host::default(),
            board,
            start_nm,
            steps: [[0; 3]; 3],
            fault: Fault::Nothing,
            pressed: InputLines::NONE,
            touched: InputLines::NONE,
            ticks: 0,
        };
        rig.board.receive(&rig.host.next(&HELLO));
        rig.board.take_sent();
        rig
    }

    /// A board with the profile, its drives on.
    pub(super) fn homable(start_nm: [i32; 3]) -> Self {
        let mut rig = Self::new(start_nm);
        rig.ask(&Request::SetProfile(Some(super::profile()))).unwrap();
        rig.ask(&Request::Drives { on: true }).unwrap();
        // The inputs are debounced.
        rig.rest(10);
        rig
    }

    pub(super) fn power_cycle(self) -> Self {
        Self::with(self.board.power_cycle(), self.start_nm)
    }

    /// Where the carriages are, in machine coordinates, nm.
    pub(super) fn stands_nm(&self) -> [i32; 3] {
        let mut at = self.start_nm;
        for (axis, (at, steps)) in at.iter_mut().zip(self.steps[2]).enumerate() {
            let sign = if self.fault == Fault::Reversed(axis) {
                -1
            } else {
                1
            };
            *at += sign * steps * STEP_NM;
        }
        at
    }

    /// Inputs as the machine asserts them.
    fn inputs(&mut self) -> InputLines {
        let at = self.stands_nm();
        let mut touched = InputLines::NONE;
        for (axis, (at, [lower, upper])) in (0..).zip(at.into_iter().zip(SWITCHES_NM)) {
            if at <= lower {
                touched = touched.or(InputLines::limit(axis, false));
            }
            if at >= upper {
                touched = touched.or(InputLines::limit(axis, true));
            }
        }
        if at[2] <= PLATE_NM {
            touched = touched.or(InputLines::PROBE);
        }
        self.ticks = if touched == self.touched {
            self.ticks + 1
        } else {
            0
        };
        self.touched = touched;
        let seen = match self.fault {
            Fault::Nothing | Fault::Reversed(_) => touched,
            Fault::Stuck(input) => touched.or(input),
            Fault::Never(input) => touched.without(input),
            Fault::Opposite => InputLines(touched.0 ^ InputLines::LIMITS.0),
            Fault::Bounce { ticks } if self.ticks < ticks && self.ticks % 3 == 1 => InputLines::NONE,
            Fault::Bounce { .. } => touched,
            Fault::Swapped(one, other) => {
                let rest = touched.without(one.or(other));
                let one_is = if touched.has(one) { other } else { InputLines::NONE };
                let other_is = if touched.has(other) { one } else { InputLines::NONE };
                rest.or(one_is).or(other_is)
            }
        };
        seen.or(self.pressed)
    }

    fn tick(&mut self) {
        let inputs = self.inputs();
        self.board.simulate(inputs);
        self.board.tick();
        let [a, b, _] = self.steps;
        self.steps = [self.board.carriages(), a, b];
    }

    pub(super) fn rest(&mut self, ticks: u32) {
        (0..ticks).for_each(|_| self.tick());
    }

    fn answer(&mut self, request: &Request) -> Reply {
        self.board.receive(&self.host.next(request));
        self.tick();
        let mut replies = self.host.read(&self.board.take_sent());
        assert_eq!(replies.len(), 1);
        replies.remove(0)
    }

    pub(super) fn ask(&mut self, request: &Request) -> Result<(), Reason> {
        match self.answer(request) {
            Reply::Ack { .. } => Ok(()),
            Reply::Nak { reason, .. } => Err(reason),
            other => panic!("{other:?}"),
        }
    }

    pub(super) fn status(&mut self) -> Status {
        match self.answer(&Request::Status) {
            Reply::Status { status, .. } => status,
            other => panic!("{other:?}"),
        }
    }

    pub(super) fn motion(&mut self) -> MotionStatus {
        match self.answer(&Request::Motion) {
            Reply::Motion { motion, .. } => motion,
            other => panic!("{other:?}"),
        }
    }

    pub(super) fn offsets(&mut self) -> Offsets {
        match self.answer(&Request::Offsets) {
            Reply::Offsets { offsets, .. } => offsets,
            other => panic!("{other:?}"),
        }
    }

    /// Lets time pass until the axes rest, asking now and then.
    pub(super) fn until_rest(&mut self) -> MotionStatus {
        self.until_rest_within(120_000)
    }

    pub(super) fn until_rest_within(&mut self, ticks: u32) -> MotionStatus {
        for _ in 0..ticks / 100 {
            self.rest(100);
            let motion = self.motion();
            if motion.activity == Activity::Rest {
                self.rest(5);
                return motion;
            }
        }
        panic!("still {:?}", self.motion());
    }
}
