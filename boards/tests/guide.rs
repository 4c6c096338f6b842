//! The guide's wiring tables are those of the boards. `BLESS=1 cargo test -p boards --test guide` writes them anew.

use std::fmt::Write;

use boards::{BOARDS, Board};

const GUIDE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/bring-up.md");

/// The marks that a table stands between.
fn marks(board: &Board) -> [String; 2] {
    ["begin", "end"].map(|which| format!("<!-- {which} pins {} -->\n", board.id))
}

fn table(board: &Board) -> String {
    let mut text = String::from("| line | pin | active | where |\n|---|---|---|---|\n");
    for line in board.lines {
        writeln!(
            text,
            "| {} | {} | {} | {} |",
            line.role,
            line.pin,
            format!("{:?}", line.active).to_lowercase(),
            line.place
        )
        .expect("a text takes it");
    }
    text
}

#[test]
fn tables_are_those_of_the_boards() {
    let guide = std::fs::read_to_string(GUIDE).expect("the guide is there");
    let mut written = guide.clone();
    for board in BOARDS {
        let [begin, end] = marks(board);
        let (before, rest) = written
            .split_once(&begin)
            .expect("the table's beginning is marked");
        let (_, after) = rest.split_once(&end).expect("so is its end");
        written = format!("{before}{begin}{}{end}{after}", table(board));
    }
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(GUIDE, written).expect("the guide can be written");
    } else {
        assert!(
            written == guide,
            "the tables in docs/bring-up.md are not those of the boards: BLESS=1 writes them"
        );
    }
}
