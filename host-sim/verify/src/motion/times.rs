//! How a run spends its time: at the feed, in ramps, in turns and links between passes, standing.
//!
//! ```text
//! samples ──► state, feed, displacement ──► a part for each period       equal positions in a row ──► stands
//!                                           links: turn (in contact) or retract, by their height, at the end of the run
//! ```

use crate::EmittedSample;
use glam::DVec3;
use job::units::MM_PER_NM;

/// Positions this near to each other, nm, on every axis, are one place: a link of up to 2 nm is left out by the machine.
const PLACE_NM: i32 = 2;
/// Share of the programmed feed from which a period counts as at the feed.
const AT_FEED: f64 = 0.99;
/// Standing in contact longer than this marks the part, s.
const STAND_MAX_S: f64 = 0.020;
/// Stands in contact that are stored.
const STANDS_MAX: usize = 1000;
/// Least straight rise after which a link is off the surface, nm; the surface faces up there.
const LIFT_NM: i32 = 10_000;
/// Greatest move to a side during a straight rise, nm.
const ASIDE_NM: i32 = 1000;
/// A link that comes this near to the highest point of the run, nm, is a retract: the safe height is above the whole surface.
const SAFE_NM: i32 = 1000;

/// Where the tool stands in contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StandPlace {
    /// At the first contact of a pass.
    Start,
    /// At the last contact of a pass.
    End,
    /// On a pass, between its ends.
    Within,
    /// On a pass that is one point: a pole.
    Pole,
    /// Between two passes, on the boundary.
    Turn,
}

impl StandPlace {
    /// The cause, as far as samples show it.
    #[must_use]
    pub fn cause(self) -> &'static str {
        match self {
            Self::Start => "before the pass starts: its plan is not ready",
            Self::End => "at the end of the pass: the next pass is not planned yet",
            Self::Within => "on the pass: the feed falls to zero",
            Self::Pole => "the pass is a pole, where every side line leaves with a speed of its own",
            Self::Turn => "on the boundary between two passes",
        }
    }

    /// The name in JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::End => "end",
            Self::Within => "within",
            Self::Pole => "pole",
            Self::Turn => "turn",
        }
    }
}

/// The tool stands in contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stand {
    /// Tick of the first sample at the place.
    pub tick: u64,
    /// Duration, s.
    pub time_s: f64,
    /// Pass on which, or after which, it stands.
    pub pass: u32,
    /// Position of the centre, mm.
    pub centre_mm: DVec3,
    /// Where.
    pub place: StandPlace,
}

/// A link between passes, or from and to home.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkTime {
    /// Pass before it; 0 also for the approach from home.
    pub pass: u32,
    /// Time, standing included, s.
    pub time_s: f64,
    /// Part of that time at standstill, s.
    pub standing_s: f64,
    /// Positions at the start and at the end of the link, mm.
    pub ends_mm: [DVec3; 2],
    /// Highest z of the link, mm.
    pub top_mm: f64,
    /// Whether it stays in contact, along the boundary.
    pub turn: bool,
}

/// The time of a run and its parts, s. The parts add up to the whole.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JobTimes {
    /// From the first sample to the last.
    pub whole_s: f64,
    /// On passes at 99 % of the programmed feed or more.
    pub at_feed_s: f64,
    /// On passes below that.
    pub ramps_s: f64,
    /// Between passes along the boundary, in contact.
    pub turns_s: f64,
    /// Approach, retract, traverse, plunge, return.
    pub links_s: f64,
    /// Standing, in contact or not.
    pub standing_s: f64,
    /// The longest stand in contact, s.
    pub standing_max_s: f64,
    /// Standing in contact longer than this is listed, s: 20 ms, and the time for which a rest between two motions looks like a stand.
    pub stand_max_s: f64,
    /// Longer stands in contact, in the order of ticks; at most 1000.
    pub stands: Vec<Stand>,
    /// The links, in order.
    pub links: Vec<LinkTime>,
}

/// A place at which the tool is.
#[derive(Clone, Copy, Debug)]
struct Place {
    cl_nm: [i32; 3],
    tick: u64,
    /// Periods since the first sample here.
    periods: u64,
    pass: u32,
    /// Link to which the first sample belongs.
    link: Option<usize>,
    /// Whether the first sample, any sample, and the last one are on a pass.
    first_on_pass: bool,
    any_on_pass: bool,
    last_on_pass: bool,
    /// Whether the pass moves the tool before, and after.
    pass_moved: bool,
}

#[derive(Clone, Copy, Debug)]
struct OpenLink {
    pass: u32,
    /// From home, before the first pass.
    approach: bool,
    from_nm: [i32; 3],
    last_nm: [i32; 3],
    top_nm: i32,
    periods: u64,
    standing: u64,
    /// It goes straight up.
    lifts: bool,
}

/// Accumulates the times of a run, sample by sample.
#[derive(Clone, Debug)]
pub struct TimeMeter {
    period_s: f64,
    feed_mm_s: f64,
    stand_max_s: f64,
    periods: [u64; 3],
    place: Option<Place>,
    stands: Vec<(Stand, Option<usize>)>,
    links: Vec<OpenLink>,
    in_link: bool,
    top_nm: i32,
    /// Pass of the last sample on a pass, and whether the pass has moved the tool.
    current: Option<(u32, bool)>,
}

/// Indices of the parts.
const AT_FEED_PART: usize = 0;
const RAMP_PART: usize = 1;
const STANDING_PART: usize = 2;

impl TimeMeter {
    /// A meter of a run with this period at this programmed feed of the contact. `jerk_mm_s3`: the least jerk limit of the axes, if there are any.
    #[must_use]
    pub fn new(period_s: f64, feed_mm_s: f64, jerk_mm_s3: Option<f64>) -> Self {
        // With jerk J a motion from rest leaves a place of width x after (6 x / J)^(1/3); one more comes to rest before it.
        let rest_s = jerk_mm_s3.map_or(0.0, |jerk| {
            2.0 * (6.0 * f64::from(PLACE_NM) * MM_PER_NM / jerk).cbrt()
        });
        Self {
            period_s,
            feed_mm_s,
            stand_max_s: STAND_MAX_S + rest_s,
            periods: [0; 3],
            place: None,
            stands: Vec::new(),
            links: Vec::new(),
            in_link: false,
            top_nm: i32::MIN,
            current: None,
        }
    }

    /// The sample of the next period.
    pub fn add(&mut self, sample: &EmittedSample) {
        let on_pass = sample.parameters.is_some();
        let before_nm = self.place.map_or(sample.cl_nm, |place| place.cl_nm);
        let stands = self.place.is_some_and(|place| {
            place
                .cl_nm
                .iter()
                .zip(sample.cl_nm)
                .all(|(a, b)| a.abs_diff(b) <= PLACE_NM.unsigned_abs())
        });
        self.top_nm = self.top_nm.max(sample.cl_nm[2]);
        if on_pass {
            self.in_link = false;
            let same_pass = self.current.is_some_and(|(pass, _)| pass == sample.pass);
            let moved = same_pass && (!stands || self.current.is_some_and(|(_, moved)| moved));
            self.current = Some((sample.pass, moved));
        } else if !std::mem::replace(&mut self.in_link, true) {
            self.links.push(OpenLink {
                pass: sample.pass,
                approach: self.current.is_none(),
                from_nm: before_nm,
                last_nm: sample.cl_nm,
                top_nm: sample.cl_nm[2],
                periods: 0,
                standing: 0,
                lifts: false,
            });
        }
        if let Some(link) = self.links.last_mut().filter(|_| !on_pass) {
            link.periods += 1;
            link.standing += u64::from(stands);
            link.top_nm = link.top_nm.max(sample.cl_nm[2]);
            link.last_nm = sample.cl_nm;
            link.lifts |= aside_nm(sample.cl_nm, link.from_nm) <= ASIDE_NM.unsigned_abs()
                && sample.cl_nm[2] - link.from_nm[2] > LIFT_NM;
        }
        let part = if stands {
            Some(STANDING_PART)
        } else if !on_pass {
            None
        } else if f64::from(sample.feed_mm_s) >= AT_FEED * self.feed_mm_s {
            Some(AT_FEED_PART)
        } else {
            Some(RAMP_PART)
        };
        if let Some(part) = part {
            self.periods[part] += 1;
        }
        self.stay_or_move(sample, stands, on_pass);
    }

    fn stay_or_move(&mut self, sample: &EmittedSample, stands: bool, on_pass: bool) {
        if let (true, Some(place)) = (stands, &mut self.place) {
            place.periods += 1;
            place.any_on_pass |= on_pass;
            place.last_on_pass = on_pass;
            if on_pass {
                place.pass = sample.pass;
            }
            return;
        }
        self.leave();
        self.place = Some(Place {
            cl_nm: sample.cl_nm,
            tick: sample.tick,
            periods: 0,
            pass: sample.pass,
            link: (!on_pass).then(|| self.links.len() - 1),
            first_on_pass: on_pass,
            any_on_pass: on_pass,
            last_on_pass: on_pass,
            pass_moved: on_pass && self.current.is_some_and(|(_, moved)| moved),
        });
    }

    /// The tool leaves its place.
    fn leave(&mut self) {
        let Some(place) = self.place else {
            return;
        };
        let time_s = self.seconds(place.periods);
        // A stand on a link counts if the link turns out to be in contact; after a lift only where the link began, if it comes back there.
        let link = place.link.filter(|_| !place.any_on_pass);
        let lifted = link.map(|link| self.links[link]).filter(|link| link.lifts);
        let is_off = lifted.is_some_and(|link| {
            aside_nm(place.cl_nm, link.from_nm) > PLACE_NM.unsigned_abs()
                || place.cl_nm[2] - link.from_nm[2] > PLACE_NM
        });
        let link = link.filter(|_| lifted.is_none());
        if place.periods == 0 || is_off || (self.stands.len() >= STANDS_MAX && time_s <= self.longest()) {
            return;
        }
        let kind = match (place.first_on_pass, place.last_on_pass, place.any_on_pass) {
            (_, _, false) => StandPlace::Turn,
            (false, ..) => StandPlace::Start,
            (true, false, _) => StandPlace::End,
            (true, true, _) if !place.pass_moved => StandPlace::Pole,
            _ => StandPlace::Within,
        };
        let stand = Stand {
            tick: place.tick,
            time_s,
            pass: place.pass,
            centre_mm: millimetres(place.cl_nm),
            place: kind,
        };
        if time_s > self.stand_max_s || time_s > self.longest() {
            self.stands.push((stand, link));
        }
    }

    fn longest(&self) -> f64 {
        let contact = self.stands.iter().filter(|(_, link)| link.is_none());
        contact.map(|(stand, _)| stand.time_s).fold(0.0, f64::max)
    }

    #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
    fn seconds(&self, periods: u64) -> f64 {
        periods as f64 * self.period_s
    }

    /// The times, after the run's last sample.
    #[must_use]
    pub fn finish(mut self) -> JobTimes {
        self.leave();
        let last = self.links.len().saturating_sub(1);
        let ends_at_home = self.in_link;
        let mut links = Vec::with_capacity(self.links.len());
        for (index, link) in self.links.iter().enumerate() {
            let outer = link.approach || (ends_at_home && index == last);
            links.push(LinkTime {
                pass: link.pass,
                time_s: self.seconds(link.periods),
                standing_s: self.seconds(link.standing),
                ends_mm: [link.from_nm, link.last_nm].map(millimetres),
                top_mm: f64::from(link.top_nm) * MM_PER_NM,
                turn: !outer && !link.lifts && link.top_nm < self.top_nm - SAFE_NM,
            });
        }
        let moving = |turn: bool| -> f64 {
            let of_kind = links.iter().filter(|link| link.turn == turn);
            // An empty sum is -0.0.
            of_kind.map(|link| link.time_s - link.standing_s).sum::<f64>() + 0.0
        };
        let in_contact = |(_, link): &&(Stand, Option<usize>)| link.is_none_or(|link| links[link].turn);
        let contacts = || self.stands.iter().filter(in_contact).map(|(stand, _)| *stand);
        let [at_feed_s, ramps_s, standing_s] = self.periods.map(|periods| self.seconds(periods));
        let (turns_s, links_s) = (moving(true), moving(false));
        JobTimes {
            whole_s: at_feed_s + ramps_s + standing_s + turns_s + links_s,
            at_feed_s,
            ramps_s,
            turns_s,
            links_s,
            standing_s,
            standing_max_s: contacts().map(|stand| stand.time_s).fold(0.0, f64::max),
            stand_max_s: self.stand_max_s,
            stands: contacts()
                .filter(|stand| stand.time_s > self.stand_max_s)
                .collect(),
            links,
        }
    }
}

fn millimetres(nm: [i32; 3]) -> DVec3 {
    DVec3::from(nm.map(f64::from)) * MM_PER_NM
}

/// How far a place is from straight above another one, nm, along the farther axis.
fn aside_nm([x, y, _]: [i32; 3], [other_x, other_y, _]: [i32; 3]) -> u32 {
    x.abs_diff(other_x).max(y.abs_diff(other_y))
}

/// A sentence on the stands in contact, if there are any: number, the longest, its place and cause.
#[must_use]
pub fn warning(times: &JobTimes) -> Option<String> {
    let longest = times.stands.iter().max_by(|a, b| a.time_s.total_cmp(&b.time_s))?;
    Some(format!(
        "the tool stands in contact for more than {:.0} ms in {} places, {:.0} ms at tick {}, pass {} ({})",
        1e3 * times.stand_max_s,
        times.stands.len(),
        1e3 * longest.time_s,
        longest.tick,
        longest.pass,
        longest.place.cause()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A run made of pieces, one call for each.
    struct Run {
        meter: TimeMeter,
        tick: u64,
        at_nm: [i32; 3],
    }

    impl Run {
        fn new() -> Self {
            Self {
                meter: TimeMeter::new(1e-3, 10.0, None),
                tick: 0,
                at_nm: [0, 0, 50_000_000],
            }
        }

        /// Periods with this displacement each; `pass`: negative on a link.
        fn go(&mut self, periods: u32, by_nm: [i32; 3], pass: i32, feed: f32) -> &mut Self {
            for k in 0..periods {
                for (at, by) in self.at_nm.iter_mut().zip(by_nm) {
                    *at += by;
                }
                let parameters = (pass >= 0).then(|| [f64::from(k), 0.0]);
                self.meter.add(&EmittedSample {
                    tick: self.tick,
                    state: if pass >= 0 { "running" } else { "link" },
                    pass: if pass >= 0 {
                        pass as u32
                    } else {
                        (-1 - pass) as u32
                    },
                    parameters,
                    cc_nm: [0; 3],
                    cl_nm: self.at_nm,
                    feed_mm_s: feed,
                    interval: 0.1,
                });
                self.tick += 1;
            }
            self
        }
    }

    /// A wait straight above the end of a pass is no stand in contact; a wait on the boundary is one.
    #[test]
    fn a_wait_above_a_pass_is_not_in_contact() {
        for (up_nm, stands) in [(300_000, 0), (0, 1)] {
            let mut run = Run::new();
            run.go(100, [0, 0, -400_000], -1, 0.0)
                .go(100, [10_000, 0, 0], 0, 10.0)
                .go(1, [0, 0, up_nm], -1, 0.0)
                .go(100, [0; 3], -1, 0.0)
                .go(1, [0, 0, -up_nm], -1, 0.0)
                .go(30, [0, 4000, 0], -1, 0.0)
                .go(100, [-10_000, 0, 0], 1, 10.0)
                .go(50, [0, 0, 800_000], -2, 0.0);
            assert_eq!(run.meter.finish().stands.len(), stands, "{up_nm}");
        }
    }

    /// Approach, a pass with ramps, a turn with a stand before it, a pass, retract: the parts are those that were put in.
    #[test]
    fn parts_add_up() {
        let mut run = Run::new();
        run.go(100, [0, 0, -400_000], -1, 0.0)
            .go(40, [5000, 0, 0], 0, 5.0)
            .go(200, [10_000, 0, 0], 0, 10.0)
            .go(40, [5000, 0, 0], 0, 5.0)
            .go(25, [0; 3], -1, 0.0)
            .go(30, [0, 4000, 0], -1, 0.0)
            .go(11, [0; 3], -1, 0.0)
            .go(200, [-10_000, 0, 0], 1, 10.0)
            .go(7, [0; 3], 1, 0.0)
            .go(60, [-10_000, 0, 0], 1, 10.0)
            .go(50, [0, 0, 800_000], -2, 0.0);
        let times = run.meter.finish();
        let near =
            |ours: f64, exact: f64| assert!((ours - exact).abs() < 1e-9, "{ours} for {exact}: {times:?}");
        near(times.at_feed_s, 0.46);
        near(times.ramps_s, 0.08);
        near(times.turns_s, 0.03);
        near(times.links_s, 0.15);
        near(times.standing_s, 0.043);
        near(times.whole_s, 0.763);
        near(times.standing_max_s, 0.025);
        let places: Vec<_> = times
            .stands
            .iter()
            .map(|stand| (stand.place, stand.pass))
            .collect();
        assert_eq!(places, [(StandPlace::End, 0)]);
        assert_eq!(
            times.links.iter().map(|link| link.turn).collect::<Vec<_>>(),
            [false, true, false]
        );
        let reported = warning(&times).unwrap();
        assert!(
            reported.contains("25 ms at tick 379, pass 0 (at the end"),
            "{reported}"
        );
    }

    #[test]
    fn stands_off_the_surface_are_not_in_contact() {
        let mut run = Run::new();
        run.go(300, [0; 3], -1, 0.0)
            .go(100, [0, 0, -400_000], -1, 0.0)
            .go(29, [0; 3], -1, 0.0)
            .go(1, [0; 3], 0, 0.0)
            .go(100, [10_000, 0, 0], 0, 10.0)
            .go(45, [0; 3], 0, 0.0)
            .go(100, [10_000, 0, 0], 0, 10.0)
            .go(50, [0, 0, 800_000], -1, 0.0)
            .go(60, [0; 3], -1, 0.0);
        let times = run.meter.finish();
        let places: Vec<_> = times
            .stands
            .iter()
            .map(|stand| (stand.place, (1e3 * stand.time_s).round()))
            .collect();
        assert_eq!(places, [(StandPlace::Start, 30.0), (StandPlace::Within, 45.0)]);
        assert!((times.standing_max_s - 0.045).abs() < 1e-9);
        assert!(times.links.iter().all(|link| !link.turn));
    }

    /// A run without links; its first pass is one point.
    #[test]
    fn a_pass_on_a_pole_stands() {
        let mut run = Run::new();
        run.go(64, [0; 3], 0, 0.0).go(100, [10_000, 0, 0], 1, 10.0);
        let times = run.meter.finish();
        assert_eq!(times.stands.len(), 1);
        assert_eq!(
            (times.stands[0].place, times.stands[0].pass),
            (StandPlace::Pole, 0)
        );
        assert!((times.standing_max_s - 0.063).abs() < 1e-9 && times.links.is_empty());
    }

    /// With a jerk limit of 2.5 mm/s^3 a rest between two motions keeps the tool within 2 nm for 34 ms: it does not stand there.
    #[test]
    fn a_rest_of_a_slow_machine_is_no_stand() {
        let stands = |periods: u32, jerk_mm_s3: Option<f64>| {
            let mut run = Run::new();
            run.meter = TimeMeter::new(1e-3, 10.0, jerk_mm_s3);
            run.go(100, [10_000, 0, 0], 0, 10.0)
                .go(periods, [0; 3], 1, 0.0)
                .go(100, [10_000, 0, 0], 1, 10.0);
            run.meter.finish().stands.len()
        };
        assert_eq!(
            [
                stands(40, None),
                stands(40, Some(10_000.0)),
                stands(40, Some(2.5)),
                stands(60, Some(2.5))
            ],
            [1, 1, 0, 1]
        );
    }
}
