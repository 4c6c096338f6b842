//! Table 1: operations of steps 2 to 4 in a period, and the time that they take.

use super::Item;
use crate::operations::{self, PAPER};
use cycles::golden;
use cycles::operations::Operations;

/// Clock of the paper's 486, MHz.
const PAPER_MHZ: f64 = 66.0;
/// Clock of the board, MHz.
const BOARD_MHZ: f64 = 168.0;

/// Names of the operations, in the order of [`Operations::to_array`].
const OPERATIONS: [&str; 4] = [
    "additions, subtractions",
    "multiplications",
    "divisions",
    "square roots",
];

/// Where our operations come from.
const OPERATIONS_NOTE: &str = "ours: from the instructions that the firmware executes, multiply-accumulate as one of each (cargo sim budget)";

/// Name and microseconds of a row of the paper's table, in the order of [`PAPER`], which has the operations.
pub const PRINTED: [(&str, f64); 3] = [
    ("Example 5, revolved, path along u", 88.0),
    ("Example 5, revolved, path along v", 80.0),
    ("Example 6, general bicubic", 143.0),
];

/// Cycles of steps 2 to 4 for each row, by the model of a Cortex-M4F: the mean over many ticks.
pub type Cycles = [f64; 3];

/// Our columns of the table; `None` where the golden table of `budget` lacks them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ours {
    /// Operations of steps 2 to 4, row by row.
    pub operations: Option<[Operations; 3]>,
    /// Cycles of steps 2 to 4.
    pub cycles: Option<Cycles>,
}

impl Ours {
    /// The columns in a text of the golden table.
    #[must_use]
    pub fn in_table(table: &str) -> Self {
        Self {
            operations: operations::in_table(table),
            cycles: cycles_of(table),
        }
    }

    /// The columns of this checkout's golden table, if it has one.
    #[must_use]
    pub fn golden() -> Self {
        std::fs::read_to_string(golden::path())
            .map_or_else(|_| Self::default(), |table| Self::in_table(&table))
    }
}

/// The cycles in a text of the golden table.
#[must_use]
pub fn cycles_of(table: &str) -> Option<Cycles> {
    let mean = |surface: &str| {
        let row = format!("{surface} | steps 2-4 | nominal | ");
        let line = table.lines().find_map(|line| line.strip_prefix(&row))?;
        line.split(" | ").next()?.trim().parse().ok()
    };
    let [u, v, bicubic] = PAPER.map(|row| mean(row.surface));
    Some([u?, v?, bicubic?])
}

/// The items of a row of the table: its operations.
fn operation_items(row: usize, name: &str, ours: Option<Operations>) -> Vec<Item> {
    let paper = PAPER[row];
    let item = |operation: &str, printed: u32, ours: Option<u32>, note: &str| Item {
        part: "Table 1",
        what: format!("{name}: {operation}"),
        unit: "",
        decimals: 0,
        printed: Some(printed.into()),
        ours: ours.map(f64::from),
        note: note.into(),
    };
    let printed = paper.operations.to_array();
    let mut items: Vec<Item> = (0..OPERATIONS.len())
        .map(|k| {
            let ours = ours.map(|ours| ours.to_array()[k]);
            let note = if ours.is_some() {
                OPERATIONS_NOTE
            } else {
                UNMEASURED
            };
            item(OPERATIONS[k], printed[k], ours, note)
        })
        .collect();
    let note = "ours are polynomials, counted as additions and multiplications";
    items.push(item("sines, cosines", paper.sines, None, note));
    items
}

/// Note of an item without our figure.
const UNMEASURED: &str = "ours is not measured: cargo sim budget --bless writes it";

/// The items of Table 1, with our columns.
#[must_use]
pub fn items(ours: &Ours) -> Vec<Item> {
    let mut items = Vec::new();
    for (row, (name, microseconds)) in PRINTED.into_iter().enumerate() {
        items.extend(operation_items(row, name, ours.operations.map(|rows| rows[row])));
        let cycles = ours.cycles.map(|rows| rows[row]);
        let item = |what: &str, unit, decimals, printed, ours: Option<f64>, note: &str| Item {
            part: "Table 1",
            what: format!("{name}: {what}"),
            unit,
            decimals,
            printed: Some(printed),
            ours,
            note: if ours.is_some() { note } else { UNMEASURED }.into(),
        };
        items.push(item(
            "cycles of steps 2 to 4",
            "",
            0,
            microseconds * PAPER_MHZ,
            cycles,
            "printed: its microseconds times 66 MHz; ours: mean, by the model of a Cortex-M4F (cargo sim budget), third \
             order, with every check",
        ));
        items.push(item(
            "time of steps 2 to 4",
            "µs",
            2,
            microseconds,
            cycles.map(|cycles| cycles / BOARD_MHZ),
            "a 486 at 66 MHz against a Cortex-M4F at 168 MHz",
        ));
    }
    items
}
