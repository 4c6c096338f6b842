//! The way of the ball's centre over a whole run, links included, as chords in a tree of boxes.

use glam::DVec3;
use job::units::MM_PER_NM;

/// Most samples of a chord.
const SAMPLES_MAX: usize = 64;
/// Samples deviate from their chord by at most this, mm.
pub(super) const CHORD_MM: f64 = 0.25e-3;
/// Depth of a tree over 2^31 chords, plus one: bounds the traversal stack.
const DEPTH_MAX: usize = 33;

/// Every position of the ball's centre in a run, and whether it is in contact.
#[derive(Clone, Debug, Default)]
pub struct Motion {
    centres_nm: Vec<[i32; 3]>,
    /// First ticks of the stretches off the surface and in contact, alternately; the first stretch is off the surface.
    turns: Vec<u32>,
    /// First ticks of the stretches between passes and on passes, alternately: as above, but turns in contact belong to the stretches between passes.
    passes: Vec<u32>,
    /// Ticks before which the motion jumps: nothing is between these samples and those before.
    jumps: Vec<u32>,
}

impl Motion {
    /// Adds the next sample. `jumps`: the tool does not move here from the sample before.
    pub fn add(&mut self, cl_nm: [i32; 3], in_contact: bool, jumps: bool) {
        let at = u32::try_from(self.centres_nm.len()).unwrap_or(u32::MAX);
        if (self.turns.len() % 2 == 1) != in_contact {
            self.turns.push(at);
            self.passes.push(at);
        }
        if jumps {
            self.jumps.push(at);
        }
        self.centres_nm.push(cl_nm);
    }

    /// Takes stretches off the surface as in contact, as in a turn along the boundary. `in_contact`: for each of them, in order.
    pub fn join(&mut self, in_contact: impl Iterator<Item = bool>) {
        let count = u32::try_from(self.centres_nm.len()).unwrap_or(u32::MAX);
        let starts = [0].into_iter().chain(self.turns.iter().copied());
        let ends = self.turns.iter().copied().chain([count]);
        let off: Vec<[u32; 2]> = starts
            .zip(ends)
            .step_by(2)
            .map(|(start, end)| [start, end])
            .filter(|[start, end]| start < end)
            .collect();
        for ([start, end], _) in off.into_iter().zip(in_contact).filter(|(_, joins)| *joins) {
            // Without its two ends the contact goes on; at the motion's own ends there is but one.
            if start > 0 && end < count {
                self.turns.retain(|turn| *turn != start && *turn != end);
            }
        }
    }

    /// The ways off the surface, as chords, mm.
    #[must_use]
    pub fn links(&self) -> Vec<Vec<DVec3>> {
        let mut links: Vec<Vec<DVec3>> = Vec::new();
        let mut last = None;
        for chord in chords(self, f64::INFINITY)
            .iter()
            .filter(|chord| !chord.in_contact)
        {
            match links.last_mut().filter(|_| last == Some(chord.samples[0])) {
                Some(link) => link.push(chord.ends[1]),
                None => links.push(chord.ends.to_vec()),
            }
            last = Some(chord.samples[1]);
        }
        links
    }

    /// Number of samples.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.centres_nm.len()
    }

    /// Position of a sample, mm.
    #[must_use]
    pub fn centre(&self, index: usize) -> DVec3 {
        DVec3::from(self.centres_nm[index].map(f64::from)) * MM_PER_NM
    }
}

/// A straight part of the way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chord {
    /// Its ends, mm.
    pub(super) ends: [DVec3; 2],
    /// Samples at its ends.
    pub(super) samples: [u32; 2],
    /// Whether the ball is in contact on it.
    pub(super) in_contact: bool,
}

impl Chord {
    /// Share of the way at which it is nearest to a point, seen from above.
    pub(super) fn nearest(&self, point: DVec3) -> f64 {
        let (way, off) = (
            (self.ends[1] - self.ends[0]).truncate(),
            (point - self.ends[0]).truncate(),
        );
        let squared = way.length_squared();
        if squared > 0.0 {
            (off.dot(way) / squared).clamp(0.0, 1.0)
        } else {
            0.0
        }
    }

    /// Share of the way at which it is nearest to a point.
    pub(super) fn nearest_in_space(&self, point: DVec3) -> f64 {
        let (way, off) = (self.ends[1] - self.ends[0], point - self.ends[0]);
        let squared = way.length_squared();
        if squared > 0.0 {
            (off.dot(way) / squared).clamp(0.0, 1.0)
        } else {
            0.0
        }
    }

    pub(super) fn at(&self, share: f64) -> DVec3 {
        self.ends[0].lerp(self.ends[1], share)
    }

    /// The sample nearest to a share of the way.
    pub(super) fn sample(&self, share: f64) -> usize {
        let [from, to] = self.samples.map(f64::from);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between two indices"
        )]
        let index = (from + share * (to - from)).round() as usize;
        index
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) low: DVec3,
    pub(super) high: DVec3,
}

impl Bounds {
    const EMPTY: Self = Self {
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
    };

    fn with(mut self, point: DVec3) -> Self {
        self.low = self.low.min(point);
        self.high = self.high.max(point);
        self
    }

    /// Distance of a point from the box, seen from above.
    pub(super) fn across(&self, point: DVec3) -> f64 {
        let off = (self.low - point).max(point - self.high).max(DVec3::ZERO);
        off.truncate().length()
    }
}

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Bounds,
    /// A leaf's chord, or the second child; the first child follows its parent.
    next: u32,
    leaf: bool,
}

/// Chords of a motion in a tree.
#[derive(Debug)]
pub(super) struct PathTree {
    pub(super) chords: Vec<Chord>,
    nodes: Vec<Node>,
}

impl PathTree {
    /// The tree over chords.
    pub(super) fn new(chords: Vec<Chord>) -> Self {
        let mut order: Vec<u32> = (0..u32::try_from(chords.len()).unwrap_or(u32::MAX)).collect();
        let mut nodes = Vec::with_capacity(2 * chords.len());
        if !chords.is_empty() {
            build(&mut nodes, &mut order, &chords);
        }
        Self { chords, nodes }
    }

    /// The tree over the chords in contact, or over the others.
    pub(super) fn part(&self, in_contact: bool) -> Self {
        let part = |chord: &&Chord| chord.in_contact == in_contact;
        Self::new(self.chords.iter().filter(part).copied().collect())
    }

    /// Visits the chords in boxes for which `bound` is above what `floor` is at that moment, those with the largest bounds first.
    pub(super) fn walk(
        &self,
        bound: impl Fn(&Bounds) -> f64,
        floor: impl Fn() -> f64,
        mut visit: impl FnMut(&Chord),
    ) {
        let Some(root) = self.nodes.first() else {
            return;
        };
        let mut stack = [(0_u32, 0.0_f64); 2 * DEPTH_MAX];
        let mut height = 1;
        stack[0] = (0, bound(&root.bounds));
        while height > 0 {
            height -= 1;
            let (index, most) = stack[height];
            if most <= floor() {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.leaf {
                visit(&self.chords[node.next as usize]);
                continue;
            }
            let mut children =
                [index + 1, node.next].map(|child| (child, bound(&self.nodes[child as usize].bounds)));
            if children[0].1 > children[1].1 {
                children.reverse();
            }
            for child in children {
                if height < stack.len() {
                    stack[height] = child;
                    height += 1;
                }
            }
        }
    }
}

/// The chords of a motion: each as long as its samples are within [`CHORD_MM`] of it.
pub(super) fn chords(motion: &Motion, longest_mm: f64) -> Vec<Chord> {
    chords_of(motion, &motion.turns, longest_mm)
}

/// The chords between passes, turns in contact included.
pub(super) fn links(motion: &Motion, longest_mm: f64) -> Vec<Chord> {
    let mut chords = chords_of(motion, &motion.passes, longest_mm);
    chords.retain(|chord| !chord.in_contact);
    chords
}

/// The chords; `turns`: first ticks of stretches in contact and off the surface, in turn.
fn chords_of(motion: &Motion, turns: &[u32], longest_mm: f64) -> Vec<Chord> {
    let mut chords = Vec::new();
    let count = motion.samples();
    let mut turns = turns.iter().copied().peekable();
    let mut jumps = motion.jumps.iter().copied().peekable();
    let (mut from, mut in_contact) = (0, false);
    while from < count {
        let index = |at: u32| at as usize;
        while turns.next_if(|turn| index(*turn) <= from).is_some() {
            in_contact = !in_contact;
        }
        while jumps.next_if(|jump| index(*jump) <= from).is_some() {}
        // The stretch ends with the sample at which the next one begins, or before a jump.
        let turn = turns.peek().map_or(count - 1, |turn| index(*turn));
        let end = jumps.peek().map_or(turn, |jump| turn.min(index(*jump) - 1));
        let mut to = end.min(from + SAMPLES_MAX).max(from);
        while to > from + 1 && !is_straight(motion, from, to, longest_mm) {
            to = from + (to - from) / 2;
        }
        let last = to == from;
        #[allow(clippy::cast_possible_truncation, reason = "a tick is 32 bits")]
        chords.push(Chord {
            ends: [motion.centre(from), motion.centre(to)],
            samples: [from as u32, to as u32],
            in_contact,
        });
        let jumps_next = jumps.peek().is_some_and(|jump| index(*jump) == to + 1);
        from = if last || jumps_next || to + 1 == count {
            to + 1
        } else {
            to
        };
    }
    chords
}

fn is_straight(motion: &Motion, from: usize, to: usize, longest_mm: f64) -> bool {
    let ends = [motion.centre(from), motion.centre(to)];
    let way = ends[1] - ends[0];
    let squared = way.length_squared();
    if squared > longest_mm * longest_mm {
        return false;
    }
    (from + 1..to).all(|index| {
        let off = motion.centre(index) - ends[0];
        let share = if squared > 0.0 {
            (off.dot(way) / squared).clamp(0.0, 1.0)
        } else {
            0.0
        };
        (off - way * share).length_squared() <= CHORD_MM * CHORD_MM
    })
}

/// Builds the nodes over these chords, parents before children, split at the median of the longest side.
fn build(nodes: &mut Vec<Node>, order: &mut [u32], chords: &[Chord]) {
    let middle = |chord: &u32| chords[*chord as usize].at(0.5);
    let mut bounds = Bounds::EMPTY;
    let mut middles = Bounds::EMPTY;
    for chord in order.iter() {
        let [from, to] = chords[*chord as usize].ends;
        bounds = bounds.with(from).with(to);
        middles = middles.with(middle(chord));
    }
    let index = nodes.len();
    nodes.push(Node {
        bounds,
        next: order.first().copied().unwrap_or(0),
        leaf: true,
    });
    if order.len() <= 1 {
        return;
    }
    let sizes = middles.high - middles.low;
    let axis = (0..3).fold(0, |axis, k| if sizes[k] > sizes[axis] { k } else { axis });
    let half = order.len() / 2;
    order.select_nth_unstable_by(half, |a, b| {
        middle(a)[axis].total_cmp(&middle(b)[axis]).then(a.cmp(b))
    });
    let (low, high) = order.split_at_mut(half);
    build(nodes, low, chords);
    #[allow(clippy::cast_possible_truncation, reason = "twice the chords at most")]
    let second = nodes.len() as u32;
    build(nodes, high, chords);
    nodes[index].next = second;
    nodes[index].leaf = false;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_are_joined() {
        let mut motion = Motion::default();
        // Off the surface, in contact, off, in contact, off, in contact, off.
        for (stretch, count) in [5, 7, 3, 8, 4, 6, 9].into_iter().enumerate() {
            for k in 0..count {
                let x = 1000 * (100 * i32::try_from(stretch).unwrap() + k);
                motion.add([x, 0, 0], stretch % 2 == 1, false);
            }
        }
        assert_eq!(motion.turns, [5, 12, 15, 23, 27, 33]);
        motion.join([false, true, false, false].into_iter());
        assert_eq!(motion.turns, [5, 23, 27, 33]);
        // Joined stretches still count as between passes.
        let between = links(&motion, f64::INFINITY);
        for (sample, is_link) in [
            (2, true),
            (8, false),
            (13, true),
            (19, false),
            (25, true),
            (30, false),
            (40, true),
        ] {
            let has = between
                .iter()
                .any(|chord| (chord.samples[0]..=chord.samples[1]).contains(&sample));
            assert_eq!(has, is_link, "{sample}");
        }
        let mut begins_in_contact = Motion::default();
        for in_contact in [true, false, true] {
            begins_in_contact.add([0; 3], in_contact, false);
        }
        begins_in_contact.join([true].into_iter());
        assert_eq!(begins_in_contact.turns, [0]);
    }

    #[test]
    fn chords_hold_every_sample_and_no_jump() {
        let mut motion = Motion::default();
        let mut samples = Vec::new();
        for k in 0..3000_u32 {
            let angle = 1e-3 * f64::from(k);
            // A circle, then a jump, then a line that stands for a while.
            let place = if k < 2000 {
                DVec3::new(20.0 * angle.cos(), 20.0 * angle.sin(), 1.0)
            } else {
                DVec3::new(100.0 + f64::from(k.min(2500)) * 0.01, 0.0, 3.0)
            };
            samples.push(place);
            let cl_nm = (place * 1e6).to_array().map(|nm| nm.round() as i32);
            motion.add(cl_nm, (500..1500).contains(&k), k == 2000);
        }
        let chords = chords(&motion, 5.0);
        assert!(chords.len() < 300, "{}", chords.len());
        for (k, place) in samples.iter().enumerate() {
            let off = |chord: &Chord| {
                let way = chord.ends[1] - chord.ends[0];
                let share = if way.length_squared() > 0.0 {
                    ((*place - chord.ends[0]).dot(way) / way.length_squared()).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                chord.at(share).distance(*place)
            };
            let own = chords
                .iter()
                .filter(|chord| (chord.samples[0]..=chord.samples[1]).contains(&(k as u32)));
            let least = own.map(off).fold(f64::INFINITY, f64::min);
            assert!(least < 1.01 * CHORD_MM, "{k}: {least}");
        }
        assert!(
            chords
                .iter()
                .all(|chord| chord.ends[0].distance(chord.ends[1]) < 5.1)
        );
        for chord in &chords {
            let middle = (chord.samples[0] + chord.samples[1]) / 2;
            assert_eq!(chord.in_contact, (500..1500).contains(&middle), "{chord:?}");
        }
    }
}
