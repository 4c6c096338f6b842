//! A failed command as a JSON object: `{error: {code, message, file, line, help}}`.

use job::JobError;
use serde_json::{Value, json};

use super::Failure;

/// The object of a failure that has a message; `None` where standard output has the result already.
pub(super) fn of_failure(failure: &Failure) -> Option<Value> {
    match failure {
        Failure::Input(report) => Some(of_input(report)),
        Failure::Failed(Some(message)) => Some(of_text(message)),
        Failure::Failed(None) => None,
    }
}

/// Bad input: with file and line if a job file has it.
fn of_input(report: &miette::Report) -> Value {
    if let Some(error) = report.downcast_ref::<JobError>() {
        let line = error.line_and_column().map(|(line, _)| line);
        return object(
            "bad-input",
            error.what(),
            Some(error.name()),
            line,
            Some(error.remedy()),
        );
    }
    let help = report.help().map(|help| help.to_string());
    object("bad-input", &report.to_string(), None, None, help.as_deref())
}

/// A failed run: its sentence, and the remedy behind `help:`.
fn of_text(message: &str) -> Value {
    let (what, help) = message
        .split_once("\n  help: ")
        .map_or((message, None), |(what, help)| (what, Some(help)));
    object("failed", what, None, None, help)
}

/// An error of the command line.
pub(super) fn of_usage(error: &clap::Error) -> Value {
    let text = error.to_string();
    let text = text.trim_start_matches("error: ").trim();
    let (what, help) = text
        .split_once("\n\n")
        .map_or((text, None), |(what, help)| (what, Some(help)));
    object("bad-usage", what.trim(), None, None, help.map(str::trim))
}

fn object(code: &str, message: &str, file: Option<&str>, line: Option<usize>, help: Option<&str>) -> Value {
    let file = file.filter(|file| !file.is_empty());
    json!({ "error": { "code": code, "message": message, "file": file, "line": line, "help": help } })
}
