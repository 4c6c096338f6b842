//! Derivatives by a window of first derivatives, against a polynomial's.

use crate::feed::stations::{WINDOW, Window};

/// Length of a cell, mm.
const CELL: f64 = 0.02;

/// x = s + 2 s^2 + 5 s^3 mm at station n: the place, nm, the arc, mm, and the first derivative.
fn station(n: usize) -> ([i32; 3], f32, [f32; 3]) {
    let s = CELL * n as f64;
    let place = 1e6 * (s + 2.0 * s * s + 5.0 * s * s * s);
    let first = 1.0 + 4.0 * s + 15.0 * s * s;
    ([place.round() as i32, 0, 0], s as f32, [first as f32, 0.0, 0.0])
}

/// Differences of positions rounded to a nanometre make a third derivative that is off by 1 and more here.
#[test]
fn directions_give_the_derivatives_of_a_cubic() {
    let mut window = Window::EMPTY;
    for n in 0..WINDOW {
        let (place, arc, first) = station(n);
        window.push(place, arc, Some(first));
    }
    for at in 0..WINDOW {
        let s = CELL * at as f64;
        let wanted = [1.0 + 4.0 * s + 15.0 * s * s, 4.0 + 30.0 * s, 30.0];
        let [got, ..] = window.derivatives(at);
        for ((got, wanted), noise) in got.into_iter().zip(wanted).zip(window.noise()) {
            assert!(
                (f64::from(got) - wanted).abs() <= f64::from(noise),
                "{at}: {got} for {wanted}"
            );
        }
    }
}

/// What the first derivatives do not tell of the way from one station to the next is seen; what they tell is not taken for more.
#[test]
fn a_bend_between_two_stations_is_seen() {
    let mut window = Window::EMPTY;
    for n in 0..3 {
        let (place, arc, first) = station(n);
        window.push(place, arc, Some(first));
    }
    let cubic = (30.0 * CELL * CELL * CELL) as f32;
    assert!(window.third_within() <= cubic, "{}", window.third_within());
    let ([x, y, z], arc, first) = station(3);
    window.push([x, y + 100, z], arc, Some(first));
    assert!(window.third_within() > 4.0 * cubic, "{}", window.third_within());
    // Positions alone tell nothing of it.
    let mut window = Window::EMPTY;
    for n in 0..3 {
        let (place, arc, _) = station(n);
        window.push(place, arc, None);
    }
    assert!(window.third_within() <= 0.0);
}
