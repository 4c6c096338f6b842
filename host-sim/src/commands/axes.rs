//! Motion outside a job: home, jog, probe, touch-off, work offsets, tool length.

pub(super) mod jog;

use clap::Subcommand;
use protocol::message::{JogWay, MotionStatus, Offsets, Request, WORK_OFFSETS};
use serde_json::json;

use super::home::{self, PositionNm};
use super::out::say;
use super::{Failure, Result, interrupt, numbers, run};
use job::AXES;
use job::units::NM_PER_MM;
use machine::remote::Session;
use machine::remote::axes;

/// Default speed of a jog, mm/s: the limits of the axes reduce it.
pub(super) const JOG_MM_S: f32 = 1000.0;
/// Default speed of a probe move, mm/s.
pub(super) const PROBE_MM_S: f32 = 5.0;
/// Speed of the second, slow probe move, mm/s.
const SLOW_MM_S: f32 = 0.5;

/// Way back before the slow probe move, nm.
const BACK_NM: i32 = 1_000_000;
/// Greatest length of the slow probe move, nm.
const AGAIN_NM: i32 = 2 * BACK_NM;

/// An axis and a distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Distance {
    axis: u8,
    nm: i32,
}

impl Distance {
    fn jog(self, speed_mm_s: f32) -> Request {
        let mut nm = [0; 3];
        if let Some(place) = nm.get_mut(usize::from(self.axis)) {
            *place = self.nm;
        }
        Request::Jog {
            way: JogWay::By { nm },
            speed_mm_s,
        }
    }

    pub(super) fn probe(self, speed_mm_s: f32) -> Request {
        Request::Probe {
            axis: self.axis,
            nm: self.nm,
            speed_mm_s,
        }
    }
}

fn axis_of(letter: char) -> Option<u8> {
    (0..)
        .zip(AXES)
        .find(|(_, name)| name.starts_with(letter))
        .map(|(axis, _)| axis)
}

/// Parses an axis with a distance in mm: `x+10`, `z-0.5`.
pub(super) fn distance(text: &str) -> std::result::Result<Distance, String> {
    let wrong = || "expected an axis and a signed distance in mm, such as x+10 or z-0.5".to_owned();
    let mut letters = text.chars();
    let axis = letters.next().and_then(axis_of).ok_or_else(wrong)?;
    let rest = letters.as_str();
    if !rest.starts_with(['+', '-']) {
        return Err(wrong());
    }
    let nm = (rest.parse::<f64>().map_err(|_| wrong())? * NM_PER_MM).round();
    #[expect(clippy::cast_possible_truncation, reason = "within the range of an i32")]
    match nm.abs() <= f64::from(i32::MAX) {
        true => Ok(Distance { axis, nm: nm as i32 }),
        false => Err(wrong()),
    }
}

/// Parses an axis with a coordinate in mm: `z=0`, `x=-12.5`.
fn coordinate(text: &str) -> std::result::Result<Distance, String> {
    let wrong = || "expected an axis and a position in mm, such as z=0".to_owned();
    let (axis, position) = text.split_once('=').ok_or_else(wrong)?;
    let sign = if position.starts_with(['+', '-']) { "" } else { "+" };
    distance(&format!("{axis}{sign}{position}")).map_err(|_| wrong())
}

/// Parses axes as bits: `z`, `xy`.
pub(super) fn axes(text: &str) -> std::result::Result<u8, String> {
    let bits: Option<u8> = text
        .chars()
        .map(|letter| axis_of(letter).map(|axis| 1 << axis))
        .try_fold(0, |bits, bit| Some(bits | bit?));
    bits.filter(|bits| *bits != 0)
        .ok_or_else(|| "expected axes, such as z or xy".to_owned())
}

/// Number of a work offset, from 1.
pub(super) fn work_number() -> clap::builder::RangedI64ValueParser<u8> {
    clap::value_parser!(u8).range(1..=WORK_OFFSETS as i64)
}

#[derive(Clone, Debug, Subcommand)]
pub(super) enum Action {
    /// Moves to a position of the machine, mm: z first where it goes up, last where it goes down.
    Goto {
        /// Machine coordinates, mm: X,Y,Z.
        #[arg(value_parser = home::position, allow_hyphen_values = true)]
        position: PositionNm,
        /// The position is one of this work offset's coordinates.
        #[arg(long, value_name = "N", value_parser = work_number())]
        work: Option<u8>,
        /// Speed, mm/s; the profile's velocity bounds it.
        #[arg(long, default_value_t = JOG_MM_S, value_parser = numbers::speed, allow_negative_numbers = true)]
        speed: f32,
    },
    /// Probes along an axis, fast and then slowly, and sets a work offset by the place: touch z-30 --work 1 --plate 15 --radius 3.
    Touch {
        /// Axis and greatest distance, mm.
        #[arg(value_parser = distance, allow_hyphen_values = true)]
        by: Distance,
        /// The work offset, 1 to 3.
        #[arg(long, value_name = "N", value_parser = work_number())]
        work: u8,
        /// Work coordinate of the touched face, mm.
        #[arg(long, default_value_t = 0.0, value_parser = numbers::coordinate, allow_hyphen_values = true)]
        at: f64,
        /// Thickness of a plate or block between face and tool, mm.
        #[arg(long, default_value_t = 0.0, value_parser = numbers::thickness, allow_negative_numbers = true)]
        plate: f64,
        /// Radius of the tool's ball, mm: positions are its centre's.
        #[arg(long, default_value_t = 0.0, value_parser = numbers::thickness, allow_negative_numbers = true)]
        radius: f64,
        /// Speed of the first move, mm/s.
        #[arg(long, default_value_t = PROBE_MM_S, value_parser = numbers::speed, allow_negative_numbers = true)]
        speed: f32,
    },
    /// Sets a work offset so that the axes stand at these work coordinates: zero xy --work 1.
    Zero {
        /// The axes, such as xy or z.
        #[arg(value_parser = axes)]
        axes: u8,
        /// The work offset, 1 to 3.
        #[arg(long, value_name = "N", value_parser = work_number())]
        work: u8,
        /// Work coordinate of where they stand, mm.
        #[arg(long, default_value_t = 0.0, value_parser = numbers::coordinate, allow_hyphen_values = true)]
        at: f64,
    },
    /// Measures the tool's length on a tool setter below it: tool z-60 (the reference tool), later tool z-60 --setter Z.
    Tool {
        /// Axis and greatest distance, mm.
        #[arg(value_parser = distance, allow_hyphen_values = true)]
        by: Distance,
        /// Where the reference tool tripped, mm: printed when it was measured. Without: this is the reference tool.
        #[arg(long, value_parser = numbers::coordinate, allow_hyphen_values = true)]
        setter: Option<f64>,
        /// Speed of the first move, mm/s.
        #[arg(long, default_value_t = PROBE_MM_S, value_parser = numbers::speed, allow_negative_numbers = true)]
        speed: f32,
    },
    /// Declares where an axis without a switch stands, in machine coordinates, once the others are homed: place z=0.
    Place {
        /// Axis and position, mm.
        #[arg(value_parser = coordinate)]
        at: Distance,
    },
    /// Prints the work offsets and the tool length.
    Offsets,
}

/// Whether a request is followed until the axes rest.
pub(super) const fn moves(request: &Request) -> bool {
    matches!(
        request,
        Request::Jog { .. } | Request::Home { .. } | Request::Probe { .. }
    )
}

/// Carries out a motion; an end other than the wanted one is a failure.
fn carried_out(session: &mut Session, request: &Request) -> Result<MotionStatus> {
    interrupt::watch("Ctrl-C stops the axes along their ramp");
    let motion = axes::go(session, request, || !interrupt::is_asked())?;
    match axes::failure(&motion) {
        None => Ok(motion),
        Some((what, remedy)) => Err(Failure::Failed(Some(format!(
            "{what}, with {} in motion, at {} mm\n  help: {remedy}",
            letters(motion.axes),
            PositionNm(motion.at_nm).words()
        )))),
    }
}

pub(super) fn json_of(motion: &MotionStatus) -> serde_json::Value {
    let mm = |nm: i32| f64::from(nm) / NM_PER_MM;
    json!({
        "at_mm": motion.at_nm.map(mm),
        "activity": motion.activity.name(),
        "end": motion.end.name(),
        "inputs": motion.lines.names().collect::<Vec<_>>(),
        "tripped_mm": motion.tripped_nm.map(mm),
        "homed_axes": AXES.iter().enumerate()
            .filter(|(axis, _)| motion.homed_axes >> axis & 1 != 0)
            .map(|(_, name)| name).collect::<Vec<_>>(),
        "periods": motion.periods,
        "digest": format!("{:016x}", motion.digest),
    })
}

/// Letters of axes, one bit each.
fn letters(axes: u8) -> String {
    let names: Vec<_> = AXES
        .iter()
        .enumerate()
        .filter(|(axis, _)| axes >> axis & 1 != 0)
        .map(|(_, name)| *name)
        .collect();
    names.join(", ")
}

/// The axes whose position is not known.
const fn unknown(motion: &MotionStatus) -> u8 {
    !motion.homed_axes & 0b111
}

/// Whether some axes are homed and others are not.
pub(super) const fn is_homed_in_part(motion: &MotionStatus) -> bool {
    !matches!(unknown(motion), 0 | 0b111)
}

/// Names the homed axes, and the remedy for the others.
pub(super) fn homed_words(motion: &MotionStatus) -> String {
    match unknown(motion) {
        0 => "homed".to_owned(),
        0b111 => "no axis is homed".to_owned(),
        rest => format!(
            "homed: {}; not homed: {}: home it, or jog it to a place that you know and declare it, as by: operate place {}=0",
            letters(motion.homed_axes),
            letters(rest),
            AXES.get(rest.trailing_zeros() as usize).copied().unwrap_or("z"),
        ),
    }
}

/// A motion, and the position after it.
pub(super) fn go(session: &mut Session, request: &Request, as_json: bool) -> Result<()> {
    let motion = carried_out(session, request)?;
    if as_json {
        say!("{}", json_of(&motion));
        return Ok(());
    }
    if let (Request::Probe { axis, .. }, Some(tripped)) = (request, motion.tripped_nm) {
        let axis = AXES.get(usize::from(*axis)).copied().unwrap_or("?");
        say!(
            "the probe tripped at {axis} = {:.6} mm",
            f64::from(tripped) / NM_PER_MM
        );
    }
    if let Request::Home { .. } = request {
        say!("{}", homed_words(&motion));
    }
    say!("axes at {} mm", PositionNm(motion.at_nm).words());
    Ok(())
}

pub(super) fn command(action: &Action, port: &str, as_json: bool) -> Result<()> {
    let mut session = run::open_port(port)?;
    let session = &mut session;
    match action {
        Action::Goto {
            position,
            work,
            speed,
        } => go_to(session, *position, *work, *speed)?,
        Action::Touch {
            by,
            work,
            at,
            plate,
            radius,
            speed,
        } => {
            // The face is on the far side of plate and ball.
            let beyond = if by.nm < 0 {
                plate + radius
            } else {
                -(plate + radius)
            };
            touch(session, *by, *work, nm_of(at + beyond)?, *speed)?;
        }
        Action::Zero { axes, work, at } => zero(session, *axes, *work, nm_of(*at)?)?,
        Action::Tool { by, setter, speed } => {
            let setter_nm = setter.map(nm_of).transpose()?;
            let tripped = measure_tool(session, *by, setter_nm, *speed)?;
            if setter.is_none() && !as_json {
                let mm = f64::from(tripped) / NM_PER_MM;
                say!("this is the reference tool; for every other one: tool .. --setter {mm:.6}");
            }
        }
        Action::Place { at } => place(session, *at)?,
        Action::Offsets => {}
    }
    print_offsets(&session.motion()?, &session.offsets()?, as_json);
    Ok(())
}

/// Position of the axes, work offsets and tool length.
fn print_offsets(motion: &MotionStatus, offsets: &Offsets, as_json: bool) {
    let mm = |nm: i32| f64::from(nm) / NM_PER_MM;
    if as_json {
        say!(
            "{}",
            json!({
                "axes": json_of(motion),
                "work_mm": offsets.work_nm.map(|origin| origin.map(mm)),
                "tool_mm": mm(offsets.tool_nm),
            })
        );
        return;
    }
    say!("axes at {} mm", PositionNm(motion.at_nm).words());
    for (number, origin) in (1..).zip(offsets.work_nm) {
        say!("  work offset {number}: {} mm", PositionNm(origin).words());
    }
    say!("  tool length: {:.6} mm", mm(offsets.tool_nm));
}

/// Probes a face, and sets a work offset in which the tool's ball stands at this coordinate, nm, where it touches.
fn touch(session: &mut Session, by: Distance, work: u8, face_nm: i32, speed: f32) -> Result<()> {
    let tripped = touched(session, by, speed)?;
    let mut offsets = session.offsets()?;
    let machine_nm = tripped.wrapping_sub(tool_nm(&offsets, by.axis));
    set(&mut offsets, work, by.axis, machine_nm.wrapping_sub(face_nm));
    session.command(&Request::SetOffsets(offsets))?;
    Ok(())
}

/// Sets a work offset so that these axes (bits) stand at this coordinate, nm.
fn zero(session: &mut Session, axes: u8, work: u8, at_nm: i32) -> Result<()> {
    must_be_homed(session)?;
    let stands = session.motion()?.at_nm;
    let mut offsets = session.offsets()?;
    for (axis, nm) in (0_u8..).zip(stands) {
        if axes >> axis & 1 != 0 {
            let machine_nm = nm.wrapping_sub(tool_nm(&offsets, axis));
            set(&mut offsets, work, axis, machine_nm.wrapping_sub(at_nm));
        }
    }
    session.command(&Request::SetOffsets(offsets))?;
    Ok(())
}

/// Measures the tool's length against where the reference tool tripped, nm; without that it is the reference tool. Returns where it tripped, nm.
fn measure_tool(session: &mut Session, by: Distance, setter_nm: Option<i32>, speed: f32) -> Result<i32> {
    let tripped = touched(session, by, speed)?;
    let mut offsets = session.offsets()?;
    offsets.tool_nm = setter_nm.map_or(0, |setter| tripped.wrapping_sub(setter));
    session.command(&Request::SetOffsets(offsets))?;
    Ok(tripped)
}

/// Declares where an axis stands, once the others are homed.
fn place(session: &mut Session, at: Distance) -> Result<()> {
    let motion = session.motion()?;
    let others = unknown(&motion) & !(1 << at.axis);
    if others != 0 {
        return Err(Failure::Failed(Some(format!(
            "{} is not homed\n  help: home first, then declare {}; or declare all three: operate home X,Y,Z",
            letters(others),
            letters(1 << at.axis),
        ))));
    }
    let mut home_nm = motion.at_nm;
    if let Some(place) = home_nm.get_mut(usize::from(at.axis)) {
        *place = at.nm;
    }
    session.command(&Request::SetHome { home_nm })?;
    Ok(())
}

/// The tool length as it counts for an axis, nm.
fn tool_nm(offsets: &Offsets, axis: u8) -> i32 {
    if axis == 2 { offsets.tool_nm } else { 0 }
}

fn set(offsets: &mut Offsets, work: u8, axis: u8, nm: i32) {
    let origin = offsets.work_nm.get_mut(usize::from(work).wrapping_sub(1));
    if let Some(place) = origin.and_then(|origin| origin.get_mut(usize::from(axis))) {
        *place = nm;
    }
}

/// A length in mm, as nm.
fn nm_of(mm: f64) -> Result<i32> {
    home::position(&format!("{mm},0,0"))
        .map(|position| position.0[0])
        .map_err(|why| Failure::input(why, "give a length in mm"))
}

fn must_be_homed(session: &mut Session) -> Result<()> {
    if session.status()?.safety.homed {
        return Ok(());
    }
    Err(Failure::Failed(Some(
        "the machine is not homed, so its coordinates mean nothing yet\n  help: operate home".to_owned(),
    )))
}

/// Probes fast, goes back, probes slowly, and goes back: where it tripped.
fn touched(session: &mut Session, by: Distance, speed: f32) -> Result<i32> {
    must_be_homed(session)?;
    carried_out(session, &by.probe(speed))?;
    let sign = by.nm.signum();
    let back = Distance {
        nm: -sign * BACK_NM,
        ..by
    };
    carried_out(session, &back.jog(speed))?;
    let again = Distance {
        nm: sign * AGAIN_NM,
        ..by
    };
    let motion = carried_out(session, &again.probe(SLOW_MM_S.min(speed)))?;
    carried_out(session, &back.jog(speed))?;
    motion
        .tripped_nm
        .ok_or_else(|| Failure::Failed(Some("the board did not latch the position".to_owned())))
}

/// Moves to a position: z first where it goes up, last where it goes down; x and y in a straight line.
fn go_to(session: &mut Session, to: PositionNm, work: Option<u8>, speed: f32) -> Result<()> {
    must_be_homed(session)?;
    let mut to_nm = to.0;
    if let Some(work) = work {
        let origin = session
            .offsets()?
            .origin_nm(usize::from(work) - 1)
            .unwrap_or([0; 3]);
        for (value, by) in to_nm.iter_mut().zip(origin) {
            *value = value.wrapping_add(by);
        }
    }
    let stands = session.motion()?.at_nm;
    let [x, y, z]: [i32; 3] = std::array::from_fn(|axis| to_nm[axis].wrapping_sub(stands[axis]));
    let level = [[0, 0, z], [x, y, 0]];
    let ways = if z > 0 { level } else { [level[1], level[0]] };
    for nm in ways.into_iter().filter(|nm| *nm != [0; 3]) {
        let way = JogWay::By { nm };
        carried_out(
            session,
            &Request::Jog {
                way,
                speed_mm_s: speed,
            },
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distance_is_an_axis_and_a_signed_number() {
        assert_eq!(
            distance("x+10"),
            Ok(Distance {
                axis: 0,
                nm: 10_000_000
            })
        );
        assert_eq!(distance("z-0.0005"), Ok(Distance { axis: 2, nm: -500 }));
        for wrong in ["x10", "+10", "w+1", "x", "x+", "y+3000", "x+inf", "x-nan", ""] {
            assert!(distance(wrong).is_err(), "{wrong}");
        }
        assert_eq!((axes("z"), axes("xy"), axes("zyx")), (Ok(4), Ok(3), Ok(7)));
        assert!(axes("").is_err() && axes("xa").is_err());
    }
}
