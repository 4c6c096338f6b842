//! A script of operator commands, period by period: the same on the machine in this process and behind a line.
//!
//! ```text
//! # half speed, a pause, on
//! tick 500: override 50
//! tick 1200: hold
//! tick 1500: resume
//! tick 1500: override 100
//! ```
//!
//! A line is `tick N: ACTION`, ACTION one of `hold`, `pause`, `resume`, `stop`, `abort`, `start`, `override P` (percent, 0 to 200); `#` begins a
//! comment. N counts periods from the one that begins the first run, which is 0 and starts implicitly; N never decreases. A period takes one
//! request and one override. A request that the state does not allow is ignored, as on the machine.

mod play;

use std::path::Path;

use interp_core::Command;
pub use interp_core::command::{OVERRIDE_MAX_PERCENT, OVERRIDE_NORMAL_PERCENT};

use job::JobError;

pub use play::{Played, play};

/// What a line looks like.
const FORM: &str =
    "write a line as `tick N: hold`, with hold, pause, resume, stop, abort, start or `override P`";

/// What the operator does in one period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inputs {
    /// A command.
    pub action: Option<Command>,
    /// A new feed override, percent, which holds until the next.
    pub override_percent: Option<u8>,
}

/// Largest script, bytes: a hundred thousand commands.
const BYTES_MAX: u64 = 2_000_000;

/// Operator inputs, period by period, ascending.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Script {
    steps: Vec<(u32, Inputs)>,
}

impl Script {
    /// Reads a script from a file.
    ///
    /// # Errors
    /// The file cannot be read, or a line is not a step: with the line and the remedy.
    pub fn load(path: &Path) -> Result<Self, JobError> {
        let name = path.display().to_string();
        let unreadable = |cause: String| {
            JobError::of_file(
                &name,
                format!("cannot read the script: {cause}"),
                "give the path of a text file",
            )
        };
        let bytes = job::read_regular(path, BYTES_MAX).map_err(|cause| unreadable(cause.to_string()))?;
        let text = String::from_utf8(bytes).map_err(|_| unreadable("it is not UTF-8 text".to_owned()))?;
        Self::parse(&name, &text)
    }

    /// Reads a script from text; `name` is the file's name in errors.
    ///
    /// # Errors
    /// As [`Script::load`].
    pub fn parse(name: &str, text: &str) -> Result<Self, JobError> {
        // Some editors begin a file with a mark of its byte order.
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut script = Self::default();
        let mut start = 0;
        // The line after which the feed is 0 for good.
        let mut stands: Option<std::ops::Range<usize>> = None;
        for whole in text.split_inclusive('\n') {
            let line = whole.split('#').next().unwrap_or("");
            let words = line.trim();
            if !words.is_empty() {
                let at = start + (line.len() - line.trim_start().len());
                script
                    .add(words)
                    .map_err(|(what, remedy)| JobError::at(name, text, at..at + words.len(), what, remedy))?;
                stands = script
                    .stands_for_ever()
                    .then(|| stands.unwrap_or(at..at + words.len()));
            }
            start += whole.len();
        }
        match stands {
            Some(line) => Err(JobError::at(
                name,
                text,
                line,
                "the feed is 0 from here on, so the run would never end".to_owned(),
                "let another override follow, or a hold or abort (a stop and a pause obey the override on their way up)".to_owned(),
            )),
            None => Ok(script),
        }
    }

    /// Whether the script leaves a run at an override of 0, neither held nor ended.
    fn stands_for_ever(&self) -> bool {
        let steps = self.steps.iter().rev();
        if steps.clone().find_map(|(_, inputs)| inputs.override_percent) != Some(0) {
            return false;
        }
        let mut actions = steps.filter_map(|(_, inputs)| inputs.action);
        match actions.find(|action| *action != Command::Hold) {
            Some(Command::Abort) => false,
            // Their ways up obey the override, and while the tool slows down for them a hold is ignored.
            Some(Command::Stop | Command::Pause) => true,
            _ => self.last_action() != Some(Command::Hold),
        }
    }

    fn last_action(&self) -> Option<Command> {
        self.steps.iter().rev().find_map(|(_, inputs)| inputs.action)
    }

    /// The steps: period and inputs; each period once.
    #[must_use]
    pub fn steps(&self) -> &[(u32, Inputs)] {
        &self.steps
    }

    /// The inputs of a period.
    #[must_use]
    pub fn at(&self, period: u32) -> Inputs {
        self.steps
            .binary_search_by_key(&period, |step| step.0)
            .map_or_else(|_| Inputs::default(), |place| self.steps[place].1)
    }

    /// Whether the script sets an override other than 100 %.
    #[must_use]
    pub fn overrides(&self) -> bool {
        let other = |(_, inputs): &(u32, Inputs)| {
            inputs
                .override_percent
                .is_some_and(|percent| percent != OVERRIDE_NORMAL_PERCENT)
        };
        self.steps.iter().any(other)
    }

    fn add(&mut self, line: &str) -> Result<(), (String, String)> {
        let wrong = |what: String| (what, FORM.to_owned());
        let (tick, action) = line
            .split_once(':')
            .ok_or_else(|| wrong(format!("`{line}` has no colon")))?;
        let number = tick
            .trim()
            .strip_prefix("tick")
            .filter(|rest| rest.starts_with(char::is_whitespace))
            .ok_or_else(|| wrong(format!("`{}` is no tick", tick.trim())))?
            .trim();
        let period: u32 = number
            .parse()
            .map_err(|_| wrong(format!("`{number}` is no number of a tick, 0 to {}", u32::MAX)))?;
        let inputs = read_action(action.trim())?;
        if period == 0 && inputs.action.is_some_and(|action| action != Command::Start) {
            return Err((
                format!(
                    "tick 0 begins the run, which leaves no room for `{}`",
                    action.trim()
                ),
                "put it at tick 1, or later".to_owned(),
            ));
        }
        let last = self.steps.last_mut().filter(|last| last.0 >= period);
        let Some((before, known)) = last else {
            self.steps.push((period, inputs));
            return Ok(());
        };
        if *before > period {
            return Err((
                format!("tick {period} comes after tick {before}"),
                "put the lines in the order of their ticks".to_owned(),
            ));
        }
        let twice = (known.action.is_some() && inputs.action.is_some())
            || (known.override_percent.is_some() && inputs.override_percent.is_some());
        if twice {
            return Err((
                format!("tick {period} has one of these already"),
                "a tick takes one request and one override: put this one at the next tick".to_owned(),
            ));
        }
        known.action = known.action.or(inputs.action);
        known.override_percent = known.override_percent.or(inputs.override_percent);
        Ok(())
    }
}

fn read_action(text: &str) -> Result<Inputs, (String, String)> {
    let mut words = text.split_whitespace();
    let (name, value, more) = (words.next().unwrap_or(""), words.next(), words.next());
    if name == "override" {
        let percent = value
            .filter(|_| more.is_none())
            .and_then(|value| value.trim_end_matches('%').parse().ok())
            .filter(|percent| *percent <= OVERRIDE_MAX_PERCENT);
        return match percent {
            Some(percent) => Ok(Inputs {
                action: None,
                override_percent: Some(percent),
            }),
            None => Err((
                format!("`{text}` is no feed override"),
                format!(
                    "write `override P` with P a whole number of percent from 0 to {OVERRIDE_MAX_PERCENT}"
                ),
            )),
        };
    }
    let action = Command::from_name(name).filter(|_| value.is_none());
    action.map_or_else(
        || Err((format!("`{text}` is nothing an operator can do"), FORM.to_owned())),
        |action| {
            Ok(Inputs {
                action: Some(action),
                override_percent: None,
            })
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_become_steps() {
        let text = "# an operator\ntick 0: override 50\r\n\n  tick 12 : hold   # a pause\ntick 40: resume\ntick 40: override 150%\ntick 99:abort\ntick 120: start\n";
        let script = Script::parse("s", text).unwrap();
        let inputs = |action, override_percent| Inputs {
            action,
            override_percent,
        };
        assert_eq!(
            script.steps(),
            [
                (0, inputs(None, Some(50))),
                (12, inputs(Some(Command::Hold), None)),
                (40, inputs(Some(Command::Resume), Some(150))),
                (99, inputs(Some(Command::Abort), None)),
                (120, inputs(Some(Command::Start), None)),
            ]
        );
        assert_eq!(script.at(40).override_percent, Some(150));
        assert_eq!(script.at(41), Inputs::default());
        assert_eq!(Script::parse("s", "\n# nothing\n").unwrap(), Script::default());
        assert_eq!(Script::parse("s", &format!("\u{feff}{text}")).unwrap(), script);
        // A run that stands at the end has to be held or ended.
        for end in [
            "tick 20: hold\n",
            "tick 20: abort\n",
            "tick 20: hold\ntick 21: hold\n",
            "tick 20: stop\ntick 21: abort\n",
            "tick 20: override 5\n",
        ] {
            Script::parse("s", &format!("tick 9: override 0\n{end}")).unwrap();
        }
        Script::parse("s", "tick 9: hold\ntick 10: override 0\n").unwrap();
    }

    #[test]
    fn mistakes_are_told_with_their_line() {
        for (text, line, what) in [
            ("tick 5: hold\ntick 4: resume\n", 2, "tick 4 comes after tick 5"),
            (
                "tick 5: hold\n\ntick 5: resume\n",
                3,
                "tick 5 has one of these already",
            ),
            ("tick 5 hold\n", 1, "`tick 5 hold` has no colon"),
            ("# a\ntock 5: hold\n", 2, "`tock 5` is no tick"),
            ("tick5: hold\n", 1, "`tick5` is no tick"),
            (
                "tick 5: override 37.5\n",
                1,
                "`override 37.5` is no feed override",
            ),
            (
                "tick 5: override 0\ntick 9: override 10\n\ntick 20: override 0\n# end\n",
                4,
                "the feed is 0 from here on",
            ),
            (
                "tick 5: override 0\ntick 9: hold\ntick 10: resume\n",
                3,
                "the feed is 0 from here on",
            ),
            (
                "tick 5: override 0\ntick 9: pause\n",
                1,
                "the feed is 0 from here on",
            ),
            (
                "tick 5: override 0\ntick 9: stop\n",
                1,
                "the feed is 0 from here on",
            ),
            (
                "tick 5: stop\ntick 9: override 0\n",
                2,
                "the feed is 0 from here on",
            ),
            (
                "tick 5: pause\ntick 900: override 0\n",
                2,
                "the feed is 0 from here on",
            ),
            (
                "tick 5: stop\ntick 9: override 0\ntick 10: hold\n",
                2,
                "the feed is 0 from here on",
            ),
            ("tick -5: hold\n", 1, "`-5` is no number"),
            ("tick 5: wait\n", 1, "`wait` is nothing an operator can do"),
            ("tick 5: hold on\n", 1, "`hold on` is nothing"),
            ("tick 5: override\n", 1, "`override` is no feed override"),
            ("tick 0: hold\n", 1, "tick 0 begins the run"),
            ("tick 5: override 201\n", 1, "`override 201` is no feed override"),
        ] {
            let error = Script::parse("s", text).unwrap_err();
            assert!(error.what().starts_with(what), "{text}: {}", error.what());
            assert_eq!(error.line_and_column().unwrap().0, line, "{text}");
            assert!(!error.remedy().is_empty());
        }
    }
}
