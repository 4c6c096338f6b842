//! `explain`: meaning, cause and remedy of a code.

use clap::Args;
use clap::builder::PossibleValuesParser;
use serde_json::{Value, json};

use super::out::say;
use super::{Failure, Result};
use explain::{Entry, Family, entries, entry};

/// Width of the text, columns.
const WIDTH: usize = 88;

/// Explains a fault, or the reason of a board's refusal: meaning, cause, remedy.
///
/// Example: cargo sim explain 1
/// Example: cargo sim explain ball-does-not-fit
/// Example: cargo sim explain R7
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Number or name of the fault; R and a number for the reason of a refusal. Default: lists all.
    #[arg(value_parser = codes(), hide_possible_values = true, ignore_case = true)]
    code: Option<String>,
    /// Prints JSON instead of text.
    #[arg(long)]
    pub(super) json: bool,
}

/// Every label and name: for completion in the shell, and for the suggestion of the nearest one.
fn codes() -> PossibleValuesParser {
    let names = entries()
        .into_iter()
        .flat_map(|entry| [entry.label(), entry.name.to_owned()]);
    // clap wants `&'static str`; the parser is built once per process.
    PossibleValuesParser::new(names.map(|name| &*name.leak()))
}

fn family(entry: &Entry) -> &'static str {
    match entry.family {
        Family::Fault => "fault",
        Family::Reason => "reason",
    }
}

fn json(entry: &Entry) -> Value {
    json!({
        "family": family(entry),
        "code": entry.code,
        "label": entry.label(),
        "name": entry.name,
        "meaning": entry.meaning,
        "value": entry.value,
        "why": entry.why,
        "remedy": entry.remedy,
        "example": entry.example,
    })
}

/// Wraps words into lines of at most [`WIDTH`] columns, indented by `indent`.
fn filled(text: &str, indent: usize) -> String {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let last = lines.last().map_or(0, |line| line.chars().count());
        if last > 0 && indent + last + 1 + word.chars().count() > WIDTH {
            lines.push(String::new());
        }
        if let Some(line) = lines.last_mut() {
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines.join(&format!("\n{:indent$}", ""))
}

fn print(entry: &Entry) {
    say!("{} {} ({})", family(entry), entry.label(), entry.name);
    for (head, text) in [
        ("means", entry.meaning),
        ("value", entry.value),
        ("why", entry.why),
        ("help", entry.remedy),
        ("example", entry.example),
    ] {
        say!("  {head:<8} {}", filled(text, 11));
    }
}

fn list(all: &[Entry]) {
    for (of, head) in [
        (
            Family::Fault,
            "faults, which stop a run or refuse a job (interp-core)",
        ),
        (
            Family::Reason,
            "reasons of a board's refusal of a request (protocol)",
        ),
    ] {
        say!("{head}");
        for entry in all.iter().filter(|entry| entry.family == of) {
            say!(
                "  {:>3}  {:<20} {}",
                entry.label(),
                entry.name,
                filled(entry.meaning, 28)
            );
        }
    }
    say!("details of one: cargo sim explain CODE");
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let Some(code) = &arguments.code else {
        let all = entries();
        if arguments.json {
            say!(
                "{}",
                serde_json::json!({ "entries": all.iter().map(json).collect::<Vec<_>>() })
            );
        } else {
            list(&all);
        }
        return Ok(());
    };
    let found = entry(code)
        .ok_or_else(|| Failure::input(format!("there is no code {code}"), "cargo sim explain lists them"))?;
    if arguments.json {
        say!("{}", json(&found));
    } else {
        print(&found);
    }
    Ok(())
}
