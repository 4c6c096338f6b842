//! Jogs: by distances, in a straight line of up to three axes, and by keys for as long as they are held.

use job::units::NM_PER_MM;
use std::sync::mpsc::RecvTimeoutError;

use console::{Key, Term};
use protocol::message::{InputLines, JogWay, MotionEnd, Profile, Request};

use super::super::out::to_stderr;
use super::super::{Failure, Result};
use super::Distance;
use machine::remote::Session;
use machine::remote::axes;

/// The jog by distances of different axes.
pub(in super::super) fn by(distances: &[Distance], speed_mm_s: f32) -> std::result::Result<Request, String> {
    let mut nm = [0; 3];
    for distance in distances {
        match nm.get_mut(usize::from(distance.axis)) {
            Some(place) if *place == 0 => *place = distance.nm,
            _ => return Err("an axis is given twice: give each once, such as jog x+10 y-5".to_owned()),
        }
    }
    Ok(Request::Jog {
        way: JogWay::By { nm },
        speed_mm_s,
    })
}

/// Speeds of the jog by keys, as shares of the profile's velocity.
const SHARES: [f32; 4] = [0.02, 0.1, 0.3, 1.0];

/// The direction of a key: arrows, or the digits of a keypad, whose corners are diagonals.
const fn direction_of(key: &Key) -> Option<[i8; 3]> {
    Some(match key {
        Key::ArrowRight | Key::Char('6') => [1, 0, 0],
        Key::ArrowLeft | Key::Char('4') => [-1, 0, 0],
        Key::ArrowUp | Key::Char('8') => [0, 1, 0],
        Key::ArrowDown | Key::Char('2') => [0, -1, 0],
        Key::Char('9') => [1, 1, 0],
        Key::Char('7') => [-1, 1, 0],
        Key::Char('3') => [1, -1, 0],
        Key::Char('1') => [-1, -1, 0],
        Key::PageUp => [0, 0, 1],
        Key::PageDown => [0, 0, -1],
        _ => return None,
    })
}

/// Whether a key ends the jog.
const fn ends(key: &Key) -> bool {
    matches!(key, Key::Escape | Key::Char('q' | 'Q') | Key::CtrlC)
}

/// What keys ask for that have waited while the board answered: the first of them that ends, else the last.
fn wish(first: Key, later: impl Iterator<Item = Key>) -> Key {
    let mut last = first;
    for key in later {
        if ends(&last) {
            break;
        }
        last = key;
    }
    last
}

/// A share of the velocity of the slowest axis that moves.
fn speed_of(signs: [i8; 3], velocity_mm_s: [f32; 3], share: f32) -> f32 {
    let moving = signs.iter().zip(velocity_mm_s).filter(|(sign, _)| **sign != 0);
    share * moving.map(|(_, velocity)| velocity).fold(f32::MAX, f32::min)
}

/// Jogs for as long as keys are held: the board stops the axes when the key's repetition ends.
pub(in super::super) fn by_keys(session: &mut Session) -> Result<()> {
    let term = Term::stderr();
    if !term.is_term() || !console::user_attended_stderr() {
        return Err(Failure::input(
            "a jog by keys needs a terminal",
            "give the distance: operate jog x+10",
        ));
    }
    let Some(Profile { velocity_mm_s, .. }) = session.profile()? else {
        return Err(Failure::Failed(Some(
            "the board keeps no machine profile\n  help: cargo sim settings --port DEV --machine machine.toml".to_owned(),
        )));
    };
    to_stderr(format_args!(
        "hold a key: arrows or digits x and y (7 9 1 3 diagonally), page up and down z; + and - speed; q or Escape ends. The axes stop when the key is released."
    ));
    let (sender, keys) = std::sync::mpsc::channel();
    // The thread ends with the process, or with the last key.
    std::thread::spawn(move || {
        while let Ok(key) = Term::stderr().read_key() {
            if sender.send(key).is_err() {
                break;
            }
        }
    });
    let mut share = 1;
    let mut lit = InputLines::NONE;
    loop {
        let first = keys.recv_timeout(std::time::Duration::from_millis(500));
        let key = match first {
            Ok(first) => Some(wish(first, keys.try_iter())),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        };
        match key {
            Some(key) if ends(&key) => {
                axes::stop(session)?;
                to_stderr(format_args!(""));
                return Ok(());
            }
            Some(Key::Char('+')) => share = (share + 1).min(SHARES.len() - 1),
            Some(Key::Char('-')) => share = share.saturating_sub(1),
            Some(key) => {
                if let Some(signs) = direction_of(&key) {
                    let request = Request::Jog {
                        way: JogWay::Towards { signs },
                        speed_mm_s: speed_of(signs, velocity_mm_s, SHARES[share]),
                    };
                    if let Err(error) = session.command(&request) {
                        to_stderr(format_args!("{error}"));
                    }
                }
            }
            None => {}
        }
        let motion = session.motion()?;
        if motion.end == MotionEnd::LimitSwitch
            && motion.lines != lit
            && let Some((what, remedy)) = axes::failure(&motion)
        {
            to_stderr(format_args!("{what}; {remedy}"));
        }
        lit = motion.lines;
        let [x, y, z] = motion.at_nm.map(|nm| f64::from(nm) / NM_PER_MM);
        let percent = SHARES[share] * 100.0;
        term.clear_line().ok();
        term.write_str(&format!(
            "x {x:9.3}  y {y:9.3}  z {z:9.3} mm   speed {percent:.0} %\r"
        ))
        .ok();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_of_different_axes_are_one_jog() {
        let distance = |axis, nm| Distance { axis, nm };
        let request = by(&[distance(0, 10), distance(2, -5)], 3.0);
        let wanted = Request::Jog {
            way: JogWay::By { nm: [10, 0, -5] },
            speed_mm_s: 3.0,
        };
        assert_eq!(request, Ok(wanted));
        assert!(by(&[distance(0, 10), distance(0, 5)], 3.0).is_err());
    }

    #[test]
    fn no_later_key_hides_one_that_ends() {
        for end in [Key::Escape, Key::Char('q'), Key::Char('Q'), Key::CtrlC] {
            let keys = [Key::ArrowLeft, end.clone(), Key::ArrowLeft, Key::Char('+')];
            for from in 0..2 {
                let later = keys[from + 1..].iter().cloned();
                assert_eq!(wish(keys[from].clone(), later), end);
            }
            assert_eq!(wish(Key::ArrowUp, std::iter::once(end.clone())), end);
        }
        let later = [Key::Char('+'), Key::ArrowRight];
        assert_eq!(wish(Key::ArrowLeft, later.into_iter()), Key::ArrowRight);
    }

    #[test]
    fn a_diagonal_is_as_fast_as_its_slower_axis() {
        assert_eq!(direction_of(&Key::Char('1')), Some([-1, -1, 0]));
        assert_eq!(speed_of([1, -1, 0], [100.0, 60.0, 10.0], 0.5), 30.0);
        assert_eq!(speed_of([0, 0, 1], [100.0, 60.0, 10.0], 1.0), 10.0);
    }
}
