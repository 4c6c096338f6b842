//! Random sequences of inputs, orders, requests and late ticks, against a reference model of the safety rules.

use controller::{
    machine::{Event, Instruction},
    realtime::{RealTime, TickInput},
    safety::{DEBOUNCE_TICKS, Order},
};
use integration_tests::dome;
use interp_core::{fault::FaultKind, sample::State};
use proptest::prelude::*;
use protocol::message::{Clock, Configuration, FaultReport, InputLines, LinkTimeoutAction, Report, Status};

use super::WORDS;

/// An event at the real-time half.
#[derive(Clone, Copy, Debug)]
enum Deed {
    /// Raw inputs, and the number of ticks for which they are set.
    Inputs(u16, u8),
    Order(Order),
    Command(Instruction),
    Heard,
    /// A tick with the given numbers of missed ticks and of cycles.
    Late(u32, u32),
}

const BUDGET: u32 = 16_800;

fn any_deed() -> impl Strategy<Value = Deed> {
    use interp_core::Command as Wish;
    let line = prop_oneof![
        4 => Just(0_u16),
        1 => (0_u16..11).prop_map(|bit| 1 << bit),
        1 => any::<u16>(),
    ];
    let configuration =
        (any::<bool>(), any::<bool>(), 0_u32..60).prop_map(|(required, hold, ticks)| Configuration {
            homing_required: required,
            on_link_timeout: if hold {
                LinkTimeoutAction::Hold
            } else {
                LinkTimeoutAction::Finish
            },
            link_timeout_ticks: ticks,
        });
    let wishes = [
        Wish::Start,
        Wish::Start,
        Wish::Start,
        Wish::Hold,
        Wish::Resume,
        Wish::Stop,
        Wish::Abort,
    ];
    prop_oneof![
        4 => (line, 0_u8..40).prop_map(|(lines, ticks)| Deed::Inputs(lines, ticks)),
        3 => any::<bool>().prop_map(|on| Deed::Order(Order::Drives { on })),
        2 => Just(Deed::Order(Order::SetHome { home_nm: [1, 2, 3] })),
        2 => Just(Deed::Order(Order::Acknowledge)),
        1 => configuration.prop_map(|configuration| Deed::Order(Order::Configure(configuration))),
        6 => prop::sample::select(wishes.to_vec()).prop_map(|wish| Deed::Command(Instruction::Command(wish))),
        1 => prop::sample::select(&[Clock::Free, Clock::Lockstep][..]).prop_map(|clock| Deed::Command(Instruction::Clock(clock))),
        1 => (0_u32..50).prop_map(|ticks| Deed::Command(Instruction::Run { ticks })),
        1 => (0_u8..=200).prop_map(|percent| Deed::Command(Instruction::Override { percent })),
        1 => Just(Deed::Heard),
        1 => (0_u32..3, 0_u32..2 * BUDGET).prop_map(|(missed, cycles)| Deed::Late(missed, cycles)),
    ]
}

/// Reference model of the rules, with a debounce counter for each input.
#[derive(Default)]
struct Rules {
    counts: [u32; 16],
    steady: u16,
    latched: u16,
    homed: bool,
    drives: bool,
}

impl Rules {
    fn tick(&mut self, raw: u16) {
        // Without a profile there is neither a door nor a contact of the spindle.
        let raw = raw & !0x3000;
        for bit in 0..16 {
            let (mask, set) = (1 << bit, raw >> bit & 1 != 0);
            let differs = set != (self.steady & mask != 0);
            self.counts[bit] = if differs { self.counts[bit] + 1 } else { 0 };
            if self.counts[bit] >= DEBOUNCE_TICKS || (bit == 0 && set) {
                self.steady = if set {
                    self.steady | mask
                } else {
                    self.steady & !mask
                };
                self.counts[bit] = 0;
            }
        }
        let stops = self.steady & 0x8781;
        self.latched |= stops;
        if stops != 0 {
            (self.homed, self.drives) = (false, false);
        }
    }

    fn may_start(&self, homing_required: bool) -> bool {
        self.steady | self.latched == 0 && self.drives && (self.homed || !homing_required)
    }
}

struct Bench {
    half: RealTime<[i32; WORDS]>,
    rules: Rules,
    raw: u16,
    events: Vec<Event>,
}

impl Bench {
    fn new() -> Self {
        let (header, words) = dome();
        let mut half = RealTime::new();
        half.set_tick_budget(BUDGET);
        half.load_begin(&header, 54).unwrap();
        half.load_words(0, &words).unwrap();
        half.load_check(0).unwrap();
        half.load_finish().unwrap();
        Self {
            half,
            rules: Rules::default(),
            raw: 0,
            events: Vec::new(),
        }
    }

    fn tick(&mut self, missed: u32, cycles: u32) -> Result<(), TestCaseError> {
        let before = self.half.status();
        let input = TickInput {
            missed,
            cycles,
            lines: InputLines(self.raw),
        };
        self.half.tick(input, &mut self.events);
        self.rules.tick(self.raw);
        let after = self.half.status();
        self.follows_the_rules(&after)?;
        if after.state.is_under_way() && !before.state.is_under_way() {
            prop_assert!(self.rules.may_start(before.safety.configuration.homing_required));
        }
        let cut = self.rules.steady & 0x8781 != 0;
        if cut && before.state.is_under_way() {
            prop_assert_eq!((after.state, after.samples), (State::Faulted, before.samples));
            let kind = after.fault.and_then(FaultReport::kind);
            prop_assert!(
                before.fault.is_some()
                    || matches!(kind, Some(FaultKind::EmergencyStop | FaultKind::DriveFault))
            );
        }
        if self.rules.steady & 0x7e != 0 && after.state.is_under_way() {
            prop_assert_eq!(after.state, State::Stopping);
        }
        // The end of a run is reported exactly once.
        if before.state.is_under_way() && !after.state.is_under_way() {
            let reported = self
                .events
                .iter()
                .filter(|event| matches!(event, Event::Halted(_)));
            prop_assert!(reported.count() == 1, "{:?}", after.state);
        }
        self.events.clear();
        prop_assert_eq!(
            self.half.feeds_watchdog(missed, cycles),
            missed == 0 && cycles <= BUDGET
        );
        Ok(())
    }

    fn follows_the_rules(&self, status: &Status) -> Result<(), TestCaseError> {
        let safety = status.safety;
        let Rules {
            steady,
            latched,
            homed,
            drives,
            ..
        } = self.rules;
        prop_assert_eq!(
            (safety.lines.0, safety.latched.0, safety.homed, safety.drives_on),
            (steady, latched, homed, drives)
        );
        prop_assert_eq!(self.half.drives_on(), drives);
        prop_assert_eq!(self.half.home_nm(), homed.then_some([1, 2, 3]));
        prop_assert!(!drives || latched == 0);
        prop_assert!(!status.state.is_under_way() || drives);
        Ok(())
    }

    fn order(&mut self, order: Order) -> Result<(), TestCaseError> {
        let status = self.half.status();
        let (under_way, stops) = (status.state.is_under_way(), self.rules.steady & 0x8781);
        let rules = &mut self.rules;
        let allowed = match order {
            Order::Acknowledge => stops == 0,
            Order::Configure(_) | Order::Drives { on: false } => !under_way,
            Order::Drives { on: true } => !under_way && stops | rules.latched == 0,
            Order::SetHome { .. } => !under_way && rules.drives,
            Order::SetUp(_)
            | Order::Move(_)
            | Order::Spindle(_)
            | Order::Turn { .. }
            | Order::Coolant { .. }
            | Order::BeginAt(_) => {
                unreachable!("not tried here")
            }
        };
        prop_assert_eq!(self.half.order(order).is_ok(), allowed, "{:?}", order);
        if allowed {
            match order {
                Order::Acknowledge => rules.latched = 0,
                Order::Configure(_) => {}
                Order::Drives { on } => (rules.drives, rules.homed) = (on, on && rules.homed),
                Order::SetHome { .. } => rules.homed = true,
                _ => {}
            }
        }
        self.follows_the_rules(&self.half.status())
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    /// The latch never clears while its input is asserted, the drives are never on while an input is latched, a run starts only if it is safe
    /// and continues only with the drives on, and a late tick does not reload the watchdog.
    #[test]
    fn any_order_of_anything_keeps_the_rules(deeds in prop::collection::vec(any_deed(), 0..80), begun: bool) {
        let mut bench = Bench::new();
        if begun {
            bench.order(Order::Drives { on: true })?;
            bench.order(Order::SetHome { home_nm: [1, 2, 3] })?;
            bench.half.obey(Instruction::Report(Report::Digests), &mut bench.events);
            bench.half.obey(Instruction::Command(interp_core::Command::Start), &mut bench.events);
        }
        for deed in deeds {
            match deed {
                Deed::Inputs(raw, ticks) => {
                    bench.raw = raw;
                    for _ in 0..ticks {
                        bench.tick(0, 0)?;
                    }
                }
                Deed::Order(order) => bench.order(order)?,
                Deed::Command(command) => {
                    // The link refuses a change of the clock during a run, so it is not tried here.
                    let under_way = bench.half.status().state.is_under_way();
                    if !(under_way && matches!(command, Instruction::Clock(_))) {
                        bench.half.obey(command, &mut bench.events);
                        bench.events.clear();
                    }
                }
                Deed::Heard => bench.half.heard(),
                Deed::Late(missed, cycles) => bench.tick(missed, cycles)?,
            }
        }
    }
}
