use super::*;
use crate::job::Header;
use crate::job::encode;
use crate::job::program::Program;
use crate::pass::patch::Patch;
use crate::pass::position::PassPosition;
use crate::sample::SpanParameter;
use crate::surface::Edges;
use crate::surface::Surface;
use std::vec::Vec;

/// 2^-23: rounding tolerance of one f32 result.
const ROUNDING: f64 = 1.0 / 8_388_608.0;

/// The step of [`step`], as a fraction.
fn step_of(from: PathSpeed, log_speed_derivative_before: f64, arc: f32) -> Option<f64> {
    step(&from, log_speed_derivative_before as f32, arc).map(|step| step as f64 / 2_f64.powi(64))
}

/// Uniformly distributed over [0, 1), from a fixed seed.
fn random() -> impl FnMut() -> f64 {
    let mut state = 1_u64;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        f64::from((state >> 33) as u32) / 2_f64.powi(31)
    }
}

/// A parametrisation of this speed, and an arc of this part of the patch over which the speed changes by the relative amount `bend`.
fn place_and_arc(bend: f64, speed: f64, part: f64) -> (PathSpeed, f32) {
    let (inverse, arc) = ((1.0 / speed) as f32, (part * speed) as f32);
    let log_speed_derivative = (bend / (f64::from(arc) * f64::from(inverse))) as f32;
    (
        PathSpeed {
            inv_speed: inverse,
            log_speed_derivative,
        },
        arc,
    )
}

/// Mean and greatest relative error of the step over many speeds and arcs, for a curve by its inverse arc length: from
/// speed, logarithmic speed derivative and arc, the exact step and the logarithmic speed derivative one arc before. The roundings average out in the mean.
fn errors(bend: f64, exact: impl Fn(f64, f64, f64) -> (f64, f64)) -> (f64, f64) {
    const COUNT: u32 = 10_000;
    let (mut sum, mut most, mut random) = (0.0, 0_f64, random());
    for _ in 0..COUNT {
        let speed = 10_f64.powf(3.0 + 4.0 * random());
        let (from, arc) = place_and_arc(bend, speed, 1e-3 * (1.0 + random()));
        let (want, before) = exact(
            1.0 / f64::from(from.inv_speed),
            from.log_speed_derivative.into(),
            arc.into(),
        );
        let error = step_of(from, before, arc).unwrap() / want - 1.0;
        (sum, most) = (sum + error, most.max(error.abs()));
    }
    (sum / f64::from(COUNT), most)
}

/// Speed a + b u, b = a p: from s = a u + b u^2/2.
fn linear_speed(a: f64, p: f64, arc: f64) -> (f64, f64) {
    let x = arc * p / a;
    // (sqrt(1 + 2 x) - 1)/p without cancellation.
    let step = 2.0 * arc / a / (1.0 + (1.0 + 2.0 * x).sqrt());
    (step, p / (1.0 - 2.0 * x).sqrt())
}

/// Speed a exp(p u): from s = a (exp(p u) - 1)/p. Its logarithmic speed derivative is constant.
fn exponential_speed(a: f64, p: f64, arc: f64) -> (f64, f64) {
    ((arc * p / a).ln_1p() / p, p)
}

/// With x = b s/a^2, the error of the third-order series is 7/8 x^3 of the step at a linear speed (5/8 from the series, 1/4
/// from p' out of two samples) and 1/4 x^3 at an exponential one; second order would leave 1/2 and 1/3 x^2.
#[test]
fn steps_are_of_third_order() {
    for bend in [1.0 / 150.0, 1.0 / 180.0, 1.0 / 260.0, 1.0 / 520.0] {
        for x in [bend, -bend] {
            let (mean, most) = errors(x, linear_speed);
            let want = 0.875 * x.powi(3);
            assert!(
                (mean - want).abs() < 0.1 * want.abs() + 2e-9,
                "linear {x}: {mean:e}"
            );
            assert!(most < want.abs() * 1.1 + ROUNDING, "linear {x}: {most:e}");
            let (mean, most) = errors(x, exponential_speed);
            let want = 0.25 * x.powi(3);
            assert!(
                (mean - want).abs() < 0.1 * want.abs() + 2e-9,
                "exponential {x}: {mean:e}"
            );
            assert!(most < want.abs() * 1.1 + ROUNDING, "exponential {x}: {most:e}");
        }
    }
}

#[test]
fn steps_at_an_even_speed_are_the_arc_over_the_speed() {
    let (mean, most) = errors(0.0, |a, _, arc| (arc / a, 0.0));
    assert!(mean.abs() < 2e-9 && most < ROUNDING, "{mean:e}, {most:e}");
}

#[test]
fn no_step_where_the_series_is_not_enough() {
    let (from, arc) = place_and_arc(1.0 / 130.0, 23.7, 1e-3);
    let before = from.log_speed_derivative;
    assert!(step(&from, before, arc).is_some());
    // The first step of a patch, and values that no surface produces.
    let nan = f32::NAN;
    let with = |inverse, log_speed_derivative| PathSpeed {
        inv_speed: inverse,
        log_speed_derivative,
    };
    assert_eq!(step(&from, nan, arc), None);
    assert_eq!(step(&from, before, nan), None);
    assert_eq!(step(&with(from.inv_speed, nan), before, arc), None);
    assert_eq!(step(&with(nan, from.log_speed_derivative), before, arc), None);
    assert_eq!(step(&with(f32::INFINITY, 0.0), 0.0, arc), None);
    // The correction is half of the bend: 1/256 at a bend of 1/128, slightly less for the square.
    for (bend, some) in [
        (1.0 / 129.0, true),
        (1.0 / 125.0, false),
        (-1.0 / 130.0, true),
        (-1.0 / 127.0, false),
    ] {
        let (from, arc) = place_and_arc(bend, 23.7, 1e-3);
        assert_eq!(
            step(&from, from.log_speed_derivative, arc).is_some(),
            some,
            "{bend}"
        );
    }
    // The same from the change of the logarithmic speed derivative alone.
    for (change, some) in [(5.9, true), (6.1, false), (-5.9, true), (-6.1, false)]
        .map(|(change, some)| (change / (6.0 * 8.0 + 1.0), some))
    {
        let (from, arc) = place_and_arc(0.0, 23.7, 1e-3);
        let first = arc * from.inv_speed;
        assert_eq!(
            step(&from, change / 256.0 / first, arc).is_some(),
            some,
            "{change}"
        );
    }
    // Beyond 1/256 of the patch, and below the parameter's resolution.
    let even = with(1.0, 0.0);
    assert_eq!(step(&even, 0.0, 1.0 / 256.0), None);
    assert_eq!(step(&even, 0.0, 0.999 / 256.0).map(|step| step >> 56), Some(0));
    assert_eq!(step(&even, 0.0, 2_f32.powi(-33)), None);
    assert_eq!(step(&even, 0.0, 2_f32.powi(-32)), Some(1 << 32));
}

/// For all inputs, NaN and infinity included, a step is forwards and within 1/256 of the first-order step.
#[test]
fn a_step_never_runs_backwards() {
    let mut random = random();
    let mut taken = 0;
    for _ in 0..1_000_000 {
        let mut value = |low: f64, high: f64| {
            let sign = if random() < 0.2 { -1.0 } else { 1.0 };
            let value = match random() {
                r if r < 0.01 => f64::NAN,
                r if r < 0.02 => f64::INFINITY,
                r if r < 0.03 => 0.0,
                _ => 10_f64.powf(low + (high - low) * random()),
            };
            (sign * value) as f32
        };
        let from = PathSpeed {
            inv_speed: value(-9.0, -3.0),
            log_speed_derivative: value(-3.0, 5.0),
        };
        let (before, arc) = (value(-3.0, 5.0), value(0.0, 6.0));
        if let Some(step) = step_of(from, before.into(), arc) {
            let first = f64::from(arc) * f64::from(from.inv_speed);
            assert!(
                step > 0.0 && (step / first - 1.0).abs() < 1.0 / 255.0,
                "{from:?}, {before}, {arc}"
            );
            taken += 1;
        }
    }
    assert!(taken > 10_000, "{taken}");
}

/// On a speed a + b u, the error after the correction is the third power of the starting error; plain Newton would leave the second.
#[test]
fn a_guess_is_corrected_to_second_order() {
    let (a, b) = (2.0_f64, 3.0_f64);
    let arc = |u: f64| u * (a + 0.5 * b * u);
    for want in [0.05, 0.2, 0.7] {
        for miss in [1.0 / 16.0, -1.0 / 16.0, 1.0 / 40.0, -1.0 / 40.0] {
            let guess = want * (1.0 + miss);
            let end = a + b * guess;
            let there = PathSpeed {
                inv_speed: (1.0 / end) as f32,
                log_speed_derivative: (b / end) as f32,
            };
            let more = path_of((arc(want) - arc(guess)) as f32, &there);
            let (error, slope) = ((guess + f64::from(more)) / want - 1.0, b / end);
            let plain = 0.5 * slope * want * miss * miss;
            let bound = (slope * want).powi(2) * miss.abs().powi(3);
            assert!(
                error.abs() < 0.6 * bound + 4.0 * ROUNDING,
                "{want}, {miss}: {error:e}"
            );
            assert!(
                error.abs() < 0.2 * plain + 4.0 * ROUNDING,
                "{want}, {miss}: {error:e}"
            );
        }
    }
    // No starting error, no correction.
    let there = PathSpeed {
        inv_speed: 0.5,
        log_speed_derivative: 3.0,
    };
    assert_eq!(path_of(0.0, &there), 0.0);
}

/// A path line in mm by its coefficients, lowest power first: x(u), y(u), z(u).
type Curve = [[f64; 4]; 3];

/// The line as the pass at the start of a patch 20 mm wide, and units per mm. Loaded as the machine loads it.
fn surface_on(line: &Curve) -> (Surface, f64) {
    let mut c = line.map(|axis| axis.map(|value| [value, 0.0, 0.0, 0.0]));
    c[1][0][1] = 20.0;
    let c = c.map(|axis| encode::substitute(&axis, [0.0, 1.0], [0.0, 1.0]));
    let one = encode::width(1.0).unwrap();
    let record = encode::polynomial(&c, Edges::default()).unwrap().to_words();
    let words: Vec<i32> = [one, one].into_iter().chain(record).collect();
    let header = Header {
        path_spans: 1,
        side_spans: 1,
        ball_radius_mm: 1.0,
        feed_mm_s: 10.0,
        scallop_mm: 0.01,
        period_s: 1e-3,
        edges: 0,
        links: 0,
        window: 0,
        strips: 0,
        axes: None,
        ..Header::default()
    };
    let mut store = [0; 54];
    let mut program = Program::new();
    program.begin(&header, 54, store.len()).unwrap();
    program.write(&mut store, 0, &words).unwrap();
    program
        .check(&store, 0, &mut crate::job::region::ScanLine::START.clone())
        .unwrap();
    program.seal().unwrap();
    let mut patch = Patch::NONE;
    let job = program.job(&store).unwrap();
    let line = PassPosition {
        side: SpanParameter::default(),
        reversed: false,
        span: 0,
    };
    patch.collapse(&job, &line).unwrap();
    (patch.surface, patch.per_mm.into())
}

/// |S'| of a line, mm.
fn speed(line: &Curve, u: f64) -> f64 {
    let squares = line.map(|[_, c1, c2, c3]| (c1 + u * (2.0 * c2 + u * 3.0 * c3)).powi(2));
    squares.iter().sum::<f64>().sqrt()
}

/// Arc of a line from `u` over `length`, mm: Simpson's rule with 2000 intervals.
fn arc_length(line: &Curve, u: f64, length: f64) -> f64 {
    let h = length / 2000.0;
    let weighted = |k: u32| {
        let weight = if k == 0 || k == 2000 {
            1.0
        } else {
            f64::from(2 + 2 * (k % 2))
        };
        weight * speed(line, u + h * f64::from(k))
    };
    (0..=2000).map(weighted).sum::<f64>() * h / 3.0
}

fn fraction(u: f64) -> u64 {
    (u * 2_f64.powi(64)) as u64
}

/// Space curves, with curvatures typical of a part.
const CURVED: Curve = [
    [0.0, 20.0, -6.0, 3.0],
    [0.0, 2.0, 5.0, -4.0],
    [1.0, 3.0, -8.0, 6.0],
];
/// Straight along x, with the speed 30 - 20 u.
const SLOWING: Curve = [[0.0, 30.0, -10.0, 0.0], [0.0; 4], [0.0; 4]];

/// The arc of a line in units by [`arc_over`], relative to the exact one, less 1.
fn arc_error(line: &Curve, u: f64, length: f64) -> f64 {
    let (surface, per_mm) = surface_on(line);
    let (from, to) = (fraction(u), fraction(u).saturating_add(fraction(length)));
    let (start, end) = (surface.path_at(from), surface.path_at(to));
    let mut path_at = |fraction| surface.path_at(fraction);
    let covered = arc_over(&mut path_at, from, &start, &end, (length as f32, APART)).unwrap();
    f64::from(covered) / (arc_length(line, u, length) * per_mm) - 1.0
}

#[test]
fn arcs_over_a_speed_that_is_a_polynomial_are_exact() {
    let rising: Curve = [[0.0, 5.0, 4.0, 8.0], [0.0; 4], [0.0; 4]];
    for line in [rising, SLOWING] {
        for (u, length) in [(0.0, 1.0), (0.25, 0.5), (0.0, 0.125), (0.9, 0.1)] {
            let error = arc_error(&line, u, length);
            assert!(error.abs() < 4.0 * ROUNDING, "{u}, {length}: {error:e}");
        }
    }
}

/// A derivative of a line's speed by central differences.
fn derivative(line: &Curve, u: f64, order: u32) -> f64 {
    const H: f64 = 0.01;
    let mut binomial = 1.0;
    let mut sum = 0.0;
    for k in 0..=order {
        let place = u + H * (0.5 * f64::from(order) - f64::from(k));
        sum += binomial * speed(line, place);
        binomial *= -f64::from(order - k) / f64::from(k + 1);
    }
    sum / H.powi(order as i32)
}

/// On a space curve the error of each rule equals its error term, from the speed's derivatives; the three-point rule is used where required.
#[test]
fn arcs_over_a_curve_leave_what_the_rules_error_terms_say() {
    let mut rules = [0, 0];
    for u in [0.0, 0.3, 0.49] {
        for length in [0.5, 0.25, 0.125, 0.0625, 0.03] {
            let (first, last) = (speed(&CURVED, u), speed(&CURVED, u + length));
            let [rise, fall] = [u, u + length].map(|u| length * derivative(&CURVED, u, 1));
            let jerk = last - first - 0.5 * (rise + fall);
            let two = (rise - fall).abs() + 64.0 * jerk.abs() <= f64::from(SMOOTH) * (first + last);
            rules[usize::from(two)] += 1;
            let (order, divisor) = if two { (4, 720.0) } else { (6, 604_800.0) };
            let most = (0..=40)
                .map(|k| derivative(&CURVED, u + length * f64::from(k) / 40.0, order).abs())
                .fold(0.0, f64::max);
            let bound = most * length.powi(order as i32 + 1) / divisor / arc_length(&CURVED, u, length);
            let error = arc_error(&CURVED, u, length);
            assert!(
                error.abs() < 1.01 * bound + 4.0 * ROUNDING,
                "{u}, {length}: {error:e} of {bound:e}"
            );
        }
    }
    assert!(rules.into_iter().all(|count| count >= 3), "{rules:?}");
}

/// Solves for an arc in mm.
fn solved(line: &Curve, u: f64, arc_mm: f64) -> Result<Reach> {
    let (surface, per_mm) = surface_on(line);
    let start = surface.path_at(fraction(u));
    let path_at = |fraction| surface.path_at(fraction);
    solve(
        path_at,
        [fraction(u), u64::MAX],
        &start,
        || None,
        ((arc_mm * per_mm) as f32, &Parts::WHOLE),
    )
}

/// The arc between the start and the returned end is the requested one: to f32 resolution for a short arc, and with an error of
/// the fourth power of its part of the patch for a long arc.
#[test]
fn a_solved_arc_is_as_long_as_asked() {
    for line in [CURVED, SLOWING] {
        for u in [0.0, 0.1, 0.33, 0.5, 0.75] {
            for k in 0..40 {
                let arc = 1e-3 * 5e3_f64.powf(f64::from(k) / 39.0);
                let room = arc_length(&line, u, 1.0 - u);
                let reach = solved(&line, u, arc).unwrap();
                if let Reach::Within(to) = reach {
                    let length = to as f64 / 2_f64.powi(64) - u;
                    let error = arc_length(&line, u, length) / arc - 1.0;
                    let bound = 0.02 * length.powi(4) + 6.0 * ROUNDING;
                    assert!(error.abs() < bound, "{arc} from {u}: {error:e}");
                }
                assert_eq!(matches!(reach, Reach::Within(_)), arc < room, "{arc} of {room}");
            }
        }
    }
}

/// Slightly or far beyond the end, by the series and where the first-order step is long: the result is the arc
/// up to the end, in units.
#[test]
fn an_arc_beyond_the_patch_says_what_was_left_of_it() {
    let (_, per_mm) = surface_on(&SLOWING);
    for room in [1e-3, 0.03, 0.2, 0.6, 1.0] {
        let u = 1.0 - room;
        let left = 30.0 * room - 10.0 * room * (1.0 + u);
        // Only whether the arc is longer matters.
        for more in [1.000_002, 1.02, 1.2, 1.9] {
            let reach = solved(&SLOWING, u, left * more);
            let Ok(Reach::Beyond(covered)) = reach else {
                panic!("{room}, {more}: {reach:?}");
            };
            let error = f64::from(covered) / (left * per_mm) - 1.0;
            assert!(error.abs() < 4.0 * ROUNDING, "{room}, {more}: {error:e}");
        }
        // A step of less than most of the patch ends on the patch.
        let reach = solved(&SLOWING, u, left * 0.9999);
        assert!(
            room > 0.25 || matches!(reach, Ok(Reach::Within(_))),
            "{room}: {reach:?}"
        );
    }
}

/// The relative correction of the first-order step is x (x - 1)/2, with x the arc times the logarithmic speed derivative over the speed.
#[test]
fn an_arc_over_which_the_speed_falls_too_much_is_refused() {
    // x = 5.05 u - 5 u^2/2 nearly stops: at u = 0.8 its speed is 1.05, its logarithmic speed derivative -1/0.21.
    let line: Curve = [[0.0, 5.05, -2.5, 0.0], [0.0; 4], [0.0; 4]];
    let (speed, log_speed_derivative) = (1.05, -5.0 / 1.05);
    let correction = |arc: f64| {
        let x = arc / speed * log_speed_derivative;
        0.5 * x * (x - 1.0)
    };
    // 1/2 at x = -0.618: 0.1363 mm, where the starting value is still before the end.
    for arc in [0.1366, 0.137, 0.1375] {
        let fault = solved(&line, 0.8, arc).unwrap_err();
        assert_eq!(fault.kind, FaultKind::ParameterBackwards);
        let want = correction(arc);
        assert!(
            (f64::from(fault.value) / want - 1.0).abs() < 1e-4,
            "{arc}: {fault:?} for {want}"
        );
    }
    // A starting value beyond the end needs no tolerance: the arc up to the end decides.
    assert!(matches!(solved(&line, 0.9, 0.0376), Ok(Reach::Beyond(_))));
}

/// A start with nearly zero speed: the first-order step is ten patches, the arc ends after a twelfth of one, and Newton's
/// method must not be used from there.
#[test]
fn an_arc_over_which_the_speed_rises_too_much_is_refused() {
    let line: Curve = [[0.0, 1e-3, 0.0, 20.0], [0.0; 4], [0.0; 4]];
    let fault = solved(&line, 0.0, 0.01).unwrap_err();
    assert_eq!(fault.kind, FaultKind::ParameterBackwards);
    // Less than a tenth of the first-order step, or backwards.
    assert!(fault.value < -0.9, "{fault:?}");
}

#[test]
fn a_place_without_a_stretch_is_refused() {
    let (surface, per_mm) = surface_on(&CURVED);
    for (inverse, log_speed_derivative) in [(1.0, f32::NAN), (f32::NAN, 1.0)] {
        let start = surface.path_at(0);
        let start = PathSpeed {
            inv_speed: start.inv_speed * inverse,
            log_speed_derivative: start.log_speed_derivative * log_speed_derivative,
        };
        let path_at = |fraction| surface.path_at(fraction);
        let arc = ((0.01 * per_mm) as f32, &Parts::WHOLE);
        let fault = solve(path_at, [0, u64::MAX], &start, || None, arc).unwrap_err();
        assert_eq!(fault.kind, FaultKind::ParameterBackwards);
        assert!(fault.value.is_nan());
    }
}

/// A line that bends like a hyperbola around u = 0.5, within this width: its speed falls to 1 there.
fn around_a_bend(width: f64, u: f64) -> PathSpeed {
    let t = (u - 0.5) / width;
    PathSpeed {
        inv_speed: (1.0 / t.hypot(1.0)) as f32,
        log_speed_derivative: (t / ((1.0 + t * t) * width)) as f32,
    }
}

/// Its arc from the bend.
fn arc_from_the_bend(width: f64, u: f64) -> f64 {
    let t = (u - 0.5) / width;
    0.5 * width * (t * t.hypot(1.0) + t.asinh())
}

/// Where an arc ends that is found in parts, if on the patch, and how much of it is.
fn solved_in_parts(
    path_at: impl Fn(u64) -> PathSpeed,
    [from, limit]: [u64; 2],
    arc: f64,
) -> (Option<u64>, f64) {
    let (mut at, mut rest, mut parts) = (from, arc as f32, Parts::WHOLE);
    loop {
        let length = parts.next(rest);
        match solve(&path_at, [at, limit], &path_at(at), || None, (length, &parts)) {
            Ok(Reach::Within(end)) if length >= rest => return (Some(end), arc),
            Ok(Reach::Within(end)) => {
                (at, rest) = (end, rest - length);
                parts.lengthen();
            }
            Ok(Reach::Beyond(covered)) => return (None, arc - f64::from(rest) + f64::from(covered)),
            Err(fault) => assert!(parts.shorten(length), "{fault:?}"),
        }
    }
}

/// Arcs over a bend that are too long for one quadrature, up to the patch's end and beyond.
#[test]
fn parts_of_an_arc_follow_a_sharp_bend() {
    let mut in_parts = 0;
    for width in [0.02, 0.05, 0.1] {
        for from in [-3.0, -1.5, -0.8, -0.2] {
            for share in [0.3, 0.9, 1.5, 2.5] {
                let from = 0.5 + width * from;
                let to = f64::min(0.5 + width * share, 0.99);
                let arc = arc_from_the_bend(width, to) - arc_from_the_bend(width, from);
                let path_at = |at: u64| around_a_bend(width, at as f64 / 2_f64.powi(64));
                let start = path_at(fraction(from));
                for (limit, is_within) in [(to + 1e-3, true), (to - 1e-3, false)] {
                    let range = [fraction(from), fraction(limit)];
                    let whole = (arc as f32, &Parts::WHOLE);
                    if solve(path_at, range, &start, || None, whole).is_ok() {
                        continue;
                    }
                    in_parts += 1;
                    let (end, covered) = solved_in_parts(path_at, range, arc);
                    assert_eq!(end.is_some(), is_within);
                    let end = end.map_or(limit, |end| end as f64 / 2_f64.powi(64));
                    let exact = arc_from_the_bend(width, end) - arc_from_the_bend(width, from);
                    let error = (exact - covered) / arc;
                    assert!(error.abs() < 1e-5, "{width} {from} {to}: {error:e}");
                }
            }
        }
    }
    assert!(in_parts > 30, "{in_parts}");
}
