//! `operate spindle` and `operate coolant` outside a run: on for as long as the command runs, because the board switches off when it does not hear the host for a second.

use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use clap::Args;
use protocol::message::{Request, SpindleOrder, Status, Turning};
use serde_json::json;

use super::operate::{json_of as status_json, typed};
use super::out::{say, to_stderr};
use super::typed::lines;
use super::{Failure, Result, axes, interrupt, numbers};
use machine::remote::operate::{act, spindle_words};
use machine::remote::{RemoteError, Session};

/// Interval of the requests that keep the spindle on.
const LOOK: Duration = Duration::from_millis(200);

/// A speed or `off`, and for how long.
#[derive(Clone, Debug, Args)]
pub(super) struct Turn {
    /// Turns a minute, or off.
    #[arg(value_name = "RPM", value_parser = rpm)]
    rpm: u32,
    /// Counterclockwise, seen from above.
    #[arg(long)]
    ccw: bool,
    /// Switches off after this time, s. Default: with this command's end, or the line `off`.
    #[arg(long = "for", value_name = "SECONDS", value_parser = numbers::seconds, allow_negative_numbers = true)]
    pub(super) seconds: Option<f64>,
}

impl Turn {
    pub(super) const fn request(&self) -> Request {
        Request::Turn {
            turning: match (self.rpm, self.ccw) {
                (0, _) => Turning::Off,
                (_, false) => Turning::Clockwise,
                (_, true) => Turning::Counterclockwise,
            },
            rpm: self.rpm,
        }
    }
}

fn rpm(text: &str) -> std::result::Result<u32, String> {
    match text {
        "off" => Ok(0),
        _ => text
            .parse()
            .map_err(|_| "expected turns a minute, such as 12000, or off".to_owned()),
    }
}

/// `on` or `off`.
pub(super) fn switch(text: &str) -> std::result::Result<bool, String> {
    match text {
        "on" => Ok(true),
        "off" => Ok(false),
        _ => Err("expected on or off".to_owned()),
    }
}

/// Spindle and coolant as they are switched.
pub(super) fn json_of(order: SpindleOrder) -> serde_json::Value {
    json!({
        "turning": match order.turning {
            Turning::Off => "off",
            Turning::Clockwise => "cw",
            Turning::Counterclockwise => "ccw",
        },
        "rpm": order.rpm,
        "coolant": order.coolant,
    })
}

/// Whether what a request has switched on goes off without a host.
pub(super) fn needs_a_host(request: &Request, status: &Status) -> bool {
    matches!(request, Request::Turn { .. } | Request::Coolant { .. })
        && status.safety.spindle != SpindleOrder::OFF
        && !status.state.is_under_way()
}

/// Keeps it on until the time is over, standard input ends, or a line says so; other lines are commands, such as `jog x+1`.
pub(super) fn keep(session: &mut Session, seconds: Option<f64>, as_json: bool) -> Result<()> {
    let status = session.status()?;
    if !as_json {
        say!("{}", spindle_words(status.safety.spindle));
        if seconds.is_none() {
            to_stderr(format_args!(
                "on until this command ends: type off and Enter, or another command, such as jog x+1, spindle 8000, coolant on, status"
            ));
        }
    }
    let end = seconds.map(|seconds| Instant::now() + Duration::from_secs_f64(seconds));
    let lines = lines();
    interrupt::watch("Ctrl-C switches it off");
    while !interrupt::is_asked() && end.is_none_or(|end| Instant::now() < end) {
        match lines.recv_timeout(LOOK) {
            Ok(line) if matches!(line.trim(), "off" | "q") => break,
            Ok(line) => obey(session, &line)?,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) if end.is_none() => break,
            Err(RecvTimeoutError::Disconnected) => std::thread::sleep(LOOK),
        }
        let status = session.status()?;
        if status.safety.spindle == SpindleOrder::OFF {
            let asserted: Vec<_> = status.safety.lines.names().collect();
            let why = match (asserted.as_slice(), status.safety.drives_on) {
                ([], true) => "by a command, or because the host was not heard for a second".to_owned(),
                ([], false) => "the drives are off".to_owned(),
                (names, _) => names.join(", "),
            };
            return Err(Failure::Failed(Some(format!(
                "the board has switched the spindle off: {why}\n  help: cargo sim operate --port DEV status"
            ))));
        }
    }
    let off = Request::Turn {
        turning: Turning::Off,
        rpm: 0,
    };
    session.command(&off)?;
    let status = act(session, &Request::Coolant { on: false }).map_err(Failure::from)?;
    if as_json {
        let board = session.capabilities().description.board.clone();
        say!("{}", status_json(&status, &board));
    } else {
        say!("{}", spindle_words(status.safety.spindle));
    }
    Ok(())
}

/// Carries out a typed line; what is wrong with it, or refused, is said.
fn obey(session: &mut Session, line: &str) -> Result<()> {
    let request = match typed(line) {
        Ok(Some(request)) => request,
        Ok(None) => return Ok(()),
        Err(why) => {
            to_stderr(format_args!("{}", why.trim_end()));
            return Ok(());
        }
    };
    let said = if axes::moves(&request) {
        axes::go(session, &request, false)
    } else {
        act(session, &request)
            .map(|status| {
                to_stderr(format_args!(
                    "{}, {}",
                    status.state.name(),
                    spindle_words(status.safety.spindle)
                ));
            })
            .map_err(|error| match error {
                RemoteError::Line(_) | RemoteError::Silent(_) => error.into(),
                refused => Failure::Failed(Some(refused.to_string())),
            })
    };
    match said {
        Err(Failure::Failed(Some(why))) => to_stderr(format_args!("{why}")),
        other => other?,
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_and_switches_are_read() {
        assert_eq!((rpm("12000"), rpm("off")), (Ok(12_000), Ok(0)));
        assert!(rpm("fast").is_err() && rpm("-1").is_err() && rpm("1.5").is_err());
        assert_eq!((switch("on"), switch("off")), (Ok(true), Ok(false)));
        assert!(switch("1").is_err());
    }
}
