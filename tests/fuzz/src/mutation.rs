//! Changes of an input: of its bytes, of its numbers, and of its lines.

use fastrand::Rng;

/// Numbers that are at or beyond an end of something.
const NUMBERS: [&str; 18] = [
    "0",
    "-0.0",
    "1",
    "-1",
    "2",
    "255",
    "65536",
    "4294967296",
    "1e308",
    "-1e308",
    "1e-320",
    "1.E999",
    "nan",
    "inf",
    "-",
    "1e5",
    "3.14159",
    "00",
];
/// Most changes of one input.
const CHANGES_MAX: usize = 6;
/// Largest input, bytes.
const BYTES_MAX: usize = 1 << 16;

/// A part of the input, at most `most` long.
fn part(rng: &mut Rng, length: usize, most: usize) -> std::ops::Range<usize> {
    let start = rng.usize(0..=length);
    let end = (start + rng.usize(0..=most)).min(length);
    start..end
}

/// A digit and all that belongs to its number.
fn number(rng: &mut Rng, data: &[u8]) -> Option<std::ops::Range<usize>> {
    let from = rng.usize(0..data.len().max(1));
    let start = from + data.get(from..)?.iter().position(u8::is_ascii_digit)?;
    let part_of = |byte: &&u8| byte.is_ascii_digit() || b".eE+-".contains(byte);
    let length = data[start..].iter().take_while(part_of).count();
    Some(start..start + length)
}

/// One of the inputs, changed in a few places.
#[must_use]
pub fn mutated(rng: &mut Rng, seeds: &[Vec<u8>]) -> Vec<u8> {
    let pick = |rng: &mut Rng| {
        seeds
            .get(rng.usize(0..seeds.len().max(1)))
            .cloned()
            .unwrap_or_default()
    };
    let mut data = pick(rng);
    for _ in 0..rng.usize(1..=CHANGES_MAX) {
        match rng.u8(0..9) {
            0 => {
                if let Some(byte) = (!data.is_empty())
                    .then(|| rng.usize(0..data.len()))
                    .and_then(|at| data.get_mut(at))
                {
                    *byte ^= 1 << rng.u8(0..8);
                }
            }
            1 => {
                let at = part(rng, data.len(), 4);
                let count = rng.usize(0..5);
                let new: Vec<u8> = std::iter::repeat_with(|| rng.u8(..)).take(count).collect();
                data.splice(at, new);
            }
            2 => {
                let at = part(rng, data.len(), 200);
                data.drain(at);
            }
            3 => {
                let copied = data[part(rng, data.len(), 100)].to_vec();
                let at = rng.usize(0..=data.len());
                data.splice(at..at, copied);
            }
            4 => {
                let other = pick(rng);
                let copied = other[part(rng, other.len(), 400)].to_vec();
                let at = part(rng, data.len(), 40);
                data.splice(at, copied);
            }
            5 => {
                let cut = rng.usize(0..=data.len());
                data.truncate(cut);
            }
            6 => {
                // One line for another.
                let lines: Vec<&[u8]> = data.split_inclusive(|byte| *byte == b'\n').collect();
                let mut order: Vec<usize> = (0..lines.len()).collect();
                if lines.len() > 1 {
                    let [a, b] = [rng.usize(0..lines.len()), rng.usize(0..lines.len())];
                    order[a] = b;
                }
                data = order
                    .into_iter()
                    .flat_map(|index| lines[index].iter().copied())
                    .collect();
            }
            _ => {
                if let Some(at) = number(rng, &data) {
                    data.splice(at, rng.choice(NUMBERS).unwrap_or("0").bytes());
                }
            }
        }
        data.truncate(BYTES_MAX);
    }
    data
}
