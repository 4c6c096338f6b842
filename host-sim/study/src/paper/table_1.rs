//! Table 1: operations of steps 2 to 4 in a period, and the time that they take.

use super::Item;
use crate::operations::{self, Operations};
use cycles::golden;

/// Clock of the paper's 486, MHz.
const PAPER_MHZ: f64 = 66.0;
/// Clock of the board, MHz.
const BOARD_MHZ: f64 = 168.0;

/// The operations by name.
fn named(of: Operations) -> [(&'static str, u32); 5] {
    [
        ("additions, subtractions", of.add),
        ("multiplications", of.multiply),
        ("divisions", of.divide),
        ("square roots", of.root),
        ("sines, cosines", of.sine),
    ]
}

/// A row of the paper's table: what, microseconds. In the order of [`operations::PAPER`], which has the operations.
pub const PRINTED: [(&str, f64); 3] = [
    ("Example 5, revolved, path along u", 88.0),
    ("Example 5, revolved, path along v", 80.0),
    ("Example 6, general bicubic", 143.0),
];

/// Cycles of steps 2 to 4 for each row, by the model of a Cortex-M4F: the mean over many ticks.
pub type Cycles = [f64; 3];

/// The cycles that the golden table of `budget` holds, if it is there.
#[must_use]
pub fn golden_cycles() -> Option<Cycles> {
    cycles_of(&std::fs::read_to_string(golden::path()).ok()?)
}

/// The cycles in a text of the golden table.
#[must_use]
pub fn cycles_of(table: &str) -> Option<Cycles> {
    let mean = |surface: &str| {
        let row = format!("{surface} | steps 2-4 | nominal | ");
        let line = table.lines().find_map(|line| line.strip_prefix(&row))?;
        line.split(" | ").next()?.trim().parse().ok()
    };
    let [u, v, bicubic] = operations::PAPER.map(|(surface, _)| mean(surface));
    Some([u?, v?, bicubic?])
}

/// Table 1. `operations`: counted in our core, row by row; `cycles`: of our core on the Cortex-M4F.
#[must_use]
pub fn items(operations: Option<&[Operations; 3]>, cycles: Option<&Cycles>) -> Vec<Item> {
    let mut items = Vec::new();
    let rows = PRINTED.into_iter().zip(operations::PAPER);
    for (index, ((what, microseconds), (_, printed))) in rows.enumerate() {
        let ours = operations.and_then(|rows| rows.get(index)).map(|row| named(*row));
        for (k, (operation, count)) in named(printed).into_iter().enumerate() {
            items.push(Item {
                part: "Table 1",
                what: format!("{what}: {operation}"),
                unit: "",
                decimals: 0,
                printed: Some(count.into()),
                ours: ours.and_then(|row| row.get(k).map(|(_, count)| f64::from(*count))),
                note: if ours.is_some() {
                    ""
                } else {
                    "ours are counted on the sample jobs of a checkout"
                }
                .into(),
            });
        }
        let ours = cycles.and_then(|rows| rows.get(index)).copied();
        let unmeasured = "ours is not measured: cargo sim budget --bless writes it";
        items.push(Item {
            part: "Table 1",
            what: format!("{what}: cycles of steps 2 to 4"),
            unit: "",
            decimals: 0,
            printed: Some(microseconds * PAPER_MHZ),
            ours,
            note: if ours.is_some() {
                "printed: its microseconds times 66 MHz; ours: mean, by the model of a Cortex-M4F (cargo sim budget), third \
                 order, with every check"
                    .into()
            } else {
                unmeasured.into()
            },
        });
        items.push(Item {
            part: "Table 1",
            what: format!("{what}: time of steps 2 to 4"),
            unit: "µs",
            decimals: 2,
            printed: Some(microseconds),
            ours: ours.map(|cycles| cycles / BOARD_MHZ),
            note: if ours.is_some() {
                "a 486 at 66 MHz against a Cortex-M4F at 168 MHz".into()
            } else {
                unmeasured.into()
            },
        });
    }
    items
}
