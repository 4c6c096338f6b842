//! The error of a job file: message, location and remedy.

use std::fmt;
use std::ops::Range;

use crate::text::{masked, one_line, printable};
use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};

/// A fault in a job file. As a [`miette::Diagnostic`] it shows the line with a caret; as text it reads
/// `file:line:column: message`.
#[derive(Debug)]
pub struct JobError(Box<Inner>);

#[derive(Debug)]
struct Inner {
    what: String,
    remedy: String,
    name: String,
    /// `None` where the file as a whole is wrong.
    place: Option<Location>,
}

#[derive(Debug)]
struct Location {
    source: NamedSource<String>,
    span: Range<usize>,
    line: usize,
    column: usize,
}

impl JobError {
    /// An error at a byte range of the text.
    pub fn at(name: &str, text: &str, span: Range<usize>, what: String, remedy: String) -> Self {
        let span = clipped(text, span);
        let before = text.get(..span.start).unwrap_or(text);
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().map_or(0, |last| last.chars().count()) + 1;
        // The line is shown, so that a terminal obeys nothing in it.
        let source = NamedSource::new(one_line(name), masked(text));
        Self(Box::new(Inner {
            what: printable(&what).into_owned(),
            remedy: printable(&remedy).into_owned(),
            name: one_line(name),
            place: Some(Location {
                source,
                span,
                line,
                column,
            }),
        }))
    }

    /// An error of a file as a whole, for a file that is not a job file.
    pub fn of_file(name: &str, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::whole(name, what.into(), remedy.into())
    }

    /// An error of the file as a whole.
    pub(super) fn whole(name: &str, what: String, remedy: String) -> Self {
        Self(Box::new(Inner {
            what: printable(&what).into_owned(),
            remedy: printable(&remedy).into_owned(),
            name: one_line(name),
            place: None,
        }))
    }

    /// The message without the location.
    #[must_use]
    pub fn what(&self) -> &str {
        &self.0.what
    }

    /// The file's name as given.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// The remedy.
    #[must_use]
    pub fn remedy(&self) -> &str {
        &self.0.remedy
    }

    /// Line and column, both from 1; `None` where the file as a whole is wrong.
    #[must_use]
    pub fn line_and_column(&self) -> Option<(usize, usize)> {
        self.0.place.as_ref().map(|place| (place.line, place.column))
    }
}

/// The range, limited to the text and to its first line: a caret under several lines is unreadable.
fn clipped(text: &str, span: Range<usize>) -> Range<usize> {
    let start = span.start.min(text.len());
    let end = span.end.clamp(start, text.len());
    let first_line = text
        .get(start..end)
        .and_then(|marked| marked.find('\n'))
        .map_or(end, |at| start + at);
    start..first_line
}

impl fmt::Display for JobError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line_and_column() {
            Some((line, column)) => write!(out, "{}:{line}:{column}: {}", self.0.name, self.0.what),
            None => write!(out, "{}: {}", self.0.name, self.0.what),
        }
    }
}

impl std::error::Error for JobError {}

impl Diagnostic for JobError {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(&self.0.remedy))
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.0
            .place
            .as_ref()
            .map(|place| &place.source as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let place = self.0.place.as_ref()?;
        let label = LabeledSpan::new_with_span(Some("here".to_owned()), place.span.clone());
        Some(Box::new(std::iter::once(label)))
    }
}
