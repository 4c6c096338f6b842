use super::*;
use crate::job::Spacing;
use std::vec;
use std::vec::Vec;

/// Even and odd by f64, without the clipper's integers: edges to the right of a point, half open like the lines.
fn is_inside(loops: &[Vec<[i32; 2]>], [path, side]: [f64; 2]) -> bool {
    let mut inside = false;
    for points in loops {
        for (k, a) in points.iter().enumerate() {
            let b = points[(k + 1) % points.len()];
            let ([a_path, a_side], [b_path, b_side]) = (a.map(f64::from), b.map(f64::from));
            if (a_side <= side) != (b_side <= side) {
                let at = a_path + (side - a_side) / (b_side - a_side) * (b_path - a_path);
                inside ^= at > path;
            }
        }
    }
    inside
}

struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, end: i32) -> i32 {
        (self.next() % end as u64) as i32
    }
}

fn header(path_spans: u16, side_spans: u16, edges: usize) -> Header {
    Header {
        path_spans,
        side_spans,
        edges: edges as u16,
        ..Header::default()
    }
}

/// The words of a region of one cell, with lines from its least side to its greatest.
fn words(loops: &[Vec<[i32; 2]>], least: i32) -> Vec<i32> {
    let mut edges: Vec<Edge> = Vec::new();
    for points in loops {
        for (k, a) in points.iter().enumerate() {
            edges.extend(Edge::between(*a, points[(k + 1) % points.len()]));
        }
    }
    edges.sort();
    let first = edges[0].side[0];
    let last = edges.iter().map(|edge| edge.side[1]).max().unwrap() - 1;
    let mut words = vec![edges.len() as i32, first, last, least];
    words.extend(edges.iter().flat_map(|edge| edge.to_words()));
    words
}

/// Moves a line to a side; its crossings in pairs.
fn cross(line: &mut ScanLine, region: &CellWords<'_>, side: i32, path_end: i32) -> Vec<[i32; 2]> {
    line.go_on(side, false);
    let mut portions = 0;
    while !line.is_done() {
        line.work(region, path_end).unwrap();
        portions += 1;
        assert!(portions < 200);
    }
    (0..line.intervals())
        .map(|index| line.interval(index).unwrap())
        .collect()
}

/// Random loops, some with slivers of one unit, horizontal and vertical edges; lines through vertices and beside them. Every probe that is more than the
/// rounding away from a crossing is inside or outside as f64 has it.
#[test]
fn lines_are_cut_as_the_even_odd_rule_says() {
    let mut random = Random(0x1234_5678_9abc_def1);
    let (mut lines, mut probes, mut met) = (0, 0, 0);
    for case in 0..300 {
        let (path_spans, side_spans) = (1 + random.below(6) as u16, 1 + random.below(6) as u16);
        let (path_end, side_end) = (end_of(path_spans), end_of(side_spans));
        // Coarse grids make vertices on one line, and edges of constant path or side.
        let grid = [1, 1, 1 << 10, 1 << 18, 1 << 20][case % 5];
        let mut loops = Vec::new();
        for _ in 0..1 + random.below(3) {
            let points = 3 + random.below(9);
            let mut one: Vec<[i32; 2]> = Vec::new();
            for _ in 0..points {
                let near = one.last().copied().filter(|_| random.below(4) == 0);
                one.push(match near {
                    Some([path, side]) => [
                        (path + random.below(3) - 1).clamp(0, path_end),
                        (side + random.below(3) - 1).clamp(0, side_end),
                    ],
                    None => [
                        random.below(path_end / grid + 1) * grid,
                        random.below(side_end / grid + 1) * grid,
                    ],
                });
            }
            loops.push(one);
        }
        if !loops.iter().flatten().any(|point| point[1] != loops[0][0][1]) {
            continue;
        }
        let words = words(&loops, 1);
        let region = RegionWords::new(&words).cell(0).unwrap();
        let mut sides: Vec<i32> = loops
            .iter()
            .flatten()
            .flat_map(|point| [point[1] - 1, point[1], point[1] + 1])
            .collect();
        sides.extend((0..20).map(|_| random.below(side_end)));
        sides.sort_unstable();
        sides.dedup();
        let mut line = ScanLine::START;
        for side in sides {
            if side < 0 {
                continue;
            }
            let intervals = cross(&mut line, &region, side, path_end);
            lines += 1;
            met += intervals.len();
            assert!(intervals.iter().flatten().is_sorted());
            let mut at: Vec<f64> = (0..6).map(|_| f64::from(random.below(path_end))).collect();
            at.extend(
                intervals
                    .iter()
                    .flatten()
                    .flat_map(|end| [f64::from(*end) - 1.6, f64::from(*end) + 1.6]),
            );
            for path in at {
                if intervals
                    .iter()
                    .flatten()
                    .any(|end| (f64::from(*end) - path).abs() < 1.5)
                {
                    continue;
                }
                // Slivers that are left out are shorter than the rounding of their two ends.
                let place = [path, f64::from(side)];
                let beside = [-1.1, 1.1].map(|off| is_inside(&loops, [path + off, f64::from(side)]));
                let want = is_inside(&loops, place);
                if beside != [want; 2] {
                    continue;
                }
                let is_in = intervals
                    .iter()
                    .any(|[from, to]| f64::from(*from) < path && path < f64::from(*to));
                assert_eq!(
                    is_in, want,
                    "case {case}, side {side}, path {path}: {intervals:?}"
                );
                probes += 1;
            }
        }
    }
    assert!(
        lines > 5000 && probes > 40_000 && met > 5000,
        "{lines} {probes} {met}"
    );
}

/// What the check at load finds is what the line finds, and every kind of mistake is refused.
#[test]
fn a_region_is_checked_edge_by_edge() {
    let unit = 1 << FRACTION_BITS;
    let star = vec![
        [0, 0],
        [2 * unit, 0],
        [2 * unit, unit],
        [unit, unit / 2],
        [0, unit],
    ];
    let hole = vec![
        [unit / 4, unit / 8],
        [unit / 2, unit / 8],
        [unit / 2, unit / 4],
        [unit / 4, unit / 4],
    ];
    let good = words(&[star, hole], 10);
    // A second cell, checked like the first one.
    let one = good.len();
    let good = [good.clone(), good].concat();
    let header = header(2, 1, good.len() / EDGE_WORDS);
    let check = |words: &[i32]| {
        let region = RegionWords::new(words);
        let mut check = RegionCheck::START;
        check.begin();
        let portions = u32::from(header.edges).div_ceil(EDGES_A_RECORD);
        let mut line = ScanLine::START;
        let is_sound = (0..portions).all(|portion| check.check(&header, &region, portion, &mut line));
        // The line that the check leaves is the first one.
        let mut again = ScanLine::START;
        again.restart(check.first_line());
        is_sound.then(|| {
            again.finish(&region.cell(0).unwrap(), end_of(2)).unwrap();
            assert_eq!(line.interval(0), again.interval(0));
            again
        })
    };
    let line = check(&good).unwrap();
    assert_eq!(line.interval(0), Some([0, 2 * unit]));
    let mut fresh = ScanLine::START;
    let region = RegionWords::new(&good).cell(0).unwrap();
    assert_eq!(usize::from(region.next()), one / EDGE_WORDS);
    assert_eq!(cross(&mut fresh, &region, 0, end_of(2)), vec![[0, 2 * unit]]);
    // From the first line on both are the same.
    let mut line = line;
    for side in [unit / 16, unit / 8, unit / 5, unit / 2, unit - 100] {
        let one = cross(&mut line, &region, side, end_of(2));
        assert_eq!(one, cross(&mut fresh, &region, side, end_of(2)));
        assert_eq!(line.joins(), [true; 2]);
        // The notch's lowest vertex parts nothing yet.
        let is_cut = (unit / 8..unit / 4).contains(&side) || side > unit / 2;
        assert_eq!(one.len(), if is_cut { 2 } else { 1 });
    }
    // Through the hole's lower corners: the hole begins there.
    let mut again = ScanLine::START;
    assert_eq!(
        cross(&mut again, &region, unit / 8, end_of(2)),
        vec![[0, unit / 4], [unit / 2, 2 * unit]]
    );
    let mut mistakes = 0;
    let count = good[0];
    for (at, value) in [
        (0, count + 1),
        (0, count - 1),
        (0, 0),
        (0, -1),
        (1, unit + 1),
        (1, -1),
        (2, unit + 1),
        (2, -1),
        (3, 0),
        (3, 5 * unit),
        (4, 5),
        (5, -1),
        (5, 2 * unit + 1),
        (6, unit + 1),
        (6, 7),
        (one - 2, unit / 2 - 1),
        (one, count + 1),
        (one, count - 1),
        (one + 2, unit + 1),
        (one + 3, 0),
        (one + 4, 5),
        (good.len() - 2, unit / 2 - 1),
    ] {
        let mut words = good.clone();
        words[at] = value;
        mistakes += usize::from(check(&words).is_none());
    }
    assert_eq!(mistakes, 22);
}

/// Only cells of curved passes go backwards, and not the first, which has none before it.
#[test]
fn a_later_cell_of_curved_passes_may_go_backwards() {
    let unit = 1 << FRACTION_BITS;
    let square = vec![[0, 0], [unit, 0], [unit, unit], [0, unit]];
    let up = words(&[square], 10);
    let mut down = up.clone();
    down.swap(1, 2);
    let second = (up.len() / EDGE_WORDS) as u16;
    let [first_down, second_down] = [[down.clone(), up.clone()].concat(), [up, down].concat()];
    for (words, at, spacing, is_sound) in [
        (&first_down, 0, Spacing::Exact, false),
        (&first_down, 0, Spacing::Constant, false),
        (&second_down, second, Spacing::Exact, false),
        (&second_down, second, Spacing::Constant, true),
    ] {
        let header = Header {
            spacing,
            ..header(1, 1, words.len() / EDGE_WORDS)
        };
        let cell = RegionWords::new(words).cell(at).unwrap();
        assert!(cell.first() > cell.last());
        assert_eq!(cell.is_sound(&header), is_sound, "{at} {spacing:?}");
    }
}

/// A line that is reached from above is joined to the one before where the region reaches down from there along the boundary.
#[test]
fn a_line_is_joined_to_the_one_above_it() {
    let unit = 1 << FRACTION_BITS;
    // Along path 0 the region is open from the middle on.
    let notched = vec![
        [0, 0],
        [unit, 0],
        [unit, unit],
        [0, unit],
        [unit / 8, unit / 2 + 1],
        [0, unit / 2],
    ];
    let words = words(&[notched], 10);
    let cell = RegionWords::new(&words).cell(0).unwrap();
    for (before, joins) in [
        (unit / 2, [true, true]),
        (unit - 1, [false, true]),
        (unit / 8, [true, true]),
        (i32::MIN, [false, false]),
        (i32::MAX, [false, false]),
    ] {
        let mut line = ScanLine::START;
        line.begin(unit / 4, before);
        line.finish(&cell, unit).unwrap();
        assert_eq!(line.joins(), joins, "{before}");
    }
}

/// A line meets at most [`CROSSINGS_MAX`] edges.
#[test]
fn a_comb_with_too_many_teeth_is_refused() {
    let comb = |teeth: i32| {
        let mut loops = Vec::new();
        for tooth in 0..teeth {
            let from = tooth * 1000;
            loops.push(vec![
                [from, 10],
                [from + 500, 10],
                [from + 500, 2000],
                [from, 2000],
            ]);
        }
        words(&loops, 1)
    };
    for (teeth, fits) in [(16, true), (17, false)] {
        let words = comb(teeth);
        let region = RegionWords::new(&words);
        let cell = region.cell(0).unwrap();
        let mut line = ScanLine::START;
        line.go_on(1000, false);
        let mut result = Ok(());
        while result.is_ok() && !line.is_done() {
            result = line.work(&cell, end_of(1));
        }
        assert_eq!(result.is_ok(), fits);
        assert!(!fits || line.intervals() == 16);
        let header = header(1, 1, 1 + 2 * teeth as usize);
        let mut check = RegionCheck::START;
        check.begin();
        let portions = u32::from(header.edges).div_ceil(EDGES_A_RECORD);
        let is_sound = (0..portions).all(|portion| check.check(&header, &region, portion, &mut line));
        assert_eq!(is_sound, fits);
    }
}

/// Places and parameters are the same both ways.
#[test]
fn places() {
    let unit = 1 << FRACTION_BITS;
    for at in [0, 1, unit - 1, unit, unit + 5, 3 * unit] {
        let from = place_from(at);
        assert_eq!(place_of(from), at);
        let to = place_to(at);
        assert_eq!(place_of(to), at);
        assert_eq!(from == to, at % unit != 0 || at == 0);
    }
    assert_eq!(
        place_to(2 * unit),
        SpanParameter {
            span: 1,
            fraction: u64::MAX
        }
    );
}
