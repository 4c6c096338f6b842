//! The declared position of the axes: parsed from the command line, and checked against the start of the job.

use clap::Args;
use protocol::message::Reason;

use super::{Result, read_job, settled};
use job::units::{MM_PER_NM, NM_PER_MM};
use job::{Job, MachineProfile};
use machine::prepare::Prepared;
use machine::remote::RemoteError;
use machine::work;

/// A position of the ball centre, nm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PositionNm(pub(super) [i32; 3]);

impl PositionNm {
    fn mm(self) -> [f64; 3] {
        self.0.map(|nm| f64::from(nm) * MM_PER_NM)
    }

    /// The position in mm with six decimals, as on the command line and in a job.
    pub(super) fn words(self) -> String {
        let axis = |nm: i32| {
            let (mm, rest) = (nm.unsigned_abs() / 1_000_000, nm.unsigned_abs() % 1_000_000);
            let text = format!("{}{mm}.{rest:06}", if nm < 0 { "-" } else { "" });
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        };
        self.0.map(axis).join(", ")
    }
}

/// Parses a position `X,Y,Z` in mm.
pub(super) fn position(text: &str) -> std::result::Result<PositionNm, String> {
    let mut axes = text.split(',').map(|axis| {
        let mm: f64 = axis.trim().parse().ok()?;
        let nm = (mm * NM_PER_MM).round();
        #[expect(clippy::cast_possible_truncation, reason = "within the range of an i32")]
        (nm.abs() <= f64::from(i32::MAX)).then_some(nm as i32)
    });
    let mut next = || axes.next().flatten();
    match (next(), next(), next()) {
        (Some(x), Some(y), Some(z)) if axes.next().is_none() => Ok(PositionNm([x, y, z])),
        _ => Err("expected three numbers in mm, each within 2147, such as 0,0,50".to_owned()),
    }
}

/// Where a job lies in the machine.
#[derive(Debug, Args)]
pub(super) struct Placed {
    /// Places the job's origin here, mm in machine coordinates, as `run --work` does: is it within the travel there?
    #[arg(long, value_name = "X,Y,Z", value_parser = position, allow_hyphen_values = true)]
    pub(super) origin: Option<PositionNm>,
}

/// Loads a job for a machine with this profile, its origin at this position of the machine; if it has no `home_mm`, it begins where the axes stand.
pub(super) fn load(
    path: &std::path::Path,
    profile: Option<&MachineProfile>,
    origin: Option<PositionNm>,
    stands: Option<PositionNm>,
) -> Result<(Job, Prepared)> {
    let mut job = read_job(path, profile)?;
    if let Some(origin) = origin {
        work::place(&mut job, origin.mm()).map_err(|error| {
            job.origin.error(
                "surface",
                error.to_string(),
                "choose another work offset, or set it anew: cargo sim operate touch, zero",
            )
        })?;
    }
    if let Some(stands) = stands {
        job.machine.home_mm.get_or_insert(stands.mm());
    }
    settled(job)
}

/// Position at which the run of the job begins. A job without limits begins with its first pass, whatever the position of the axes.
pub(super) fn of(prepared: &Prepared) -> PositionNm {
    PositionNm(prepared.header.axes.map_or([0; 3], |axes| axes.home_nm))
}

/// The refusal of a start away from the job's home, with its remedy.
pub(super) fn elsewhere(error: &RemoteError) -> Option<String> {
    let RemoteError::Refused {
        reason: reason @ Reason::NotAtHome { home_nm, stands_nm },
        ..
    } = error
    else {
        return None;
    };
    let bring = format!(
        "move the axes there: operate goto {home} on a homed machine; or with the drives off, and declare the position: --home {home}",
        home = PositionNm(*home_nm).words().replace(' ', "")
    );
    let remedy = match stands_nm {
        Some(at_nm) => format!(
            "set `home_mm = [{}]` in [machine], so that the job begins at the position of the axes; or {bring}",
            PositionNm(*at_nm).words()
        ),
        None => bring,
    };
    let code = reason.code();
    Some(format!(
        "{error}\n  help: {remedy}\n        cargo sim explain R{code}"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_position_is_parsed_as_it_is_printed() {
        for nm in [
            [0, -1, 1],
            [i32::MAX, -i32::MAX, 50_000_000],
            [-120_500_000, 7, 999_999],
        ] {
            assert_eq!(position(&PositionNm(nm).words()), Ok(PositionNm(nm)));
        }
        assert_eq!(
            PositionNm([-500, 50_000_000, 1_250_000]).words(),
            "-0.0005, 50, 1.25"
        );
        for text in ["1,2", "1,2,3,4", "1,2,x", "0,0,2148", "0,0,inf", "nan,0,0"] {
            assert!(position(text).is_err(), "{text}");
        }
    }

    /// A position written into a job is parsed to the same nanometre.
    #[test]
    fn no_nanometre_is_lost_in_a_job() {
        for nm in (0..i32::MAX).step_by(7_919_737) {
            for nm in [nm, -nm] {
                let [mm, ..] = PositionNm([nm; 3]).mm();
                #[allow(clippy::cast_possible_truncation, reason = "the job's own rounding")]
                let again = (mm * NM_PER_MM).round() as i32;
                assert_eq!(again, nm);
            }
        }
    }

    #[test]
    fn a_refusal_says_how_to_bring_both_together() {
        let refused = |stands_nm| RemoteError::Refused {
            request: "to start",
            reason: Reason::NotAtHome {
                home_nm: [0, 0, 50_000_000],
                stands_nm,
            },
        };
        let text = elsewhere(&refused(Some([1_500_000, -2, 3]))).unwrap();
        assert!(text.contains("home_mm = [1.5, -0.000002, 0.000003]"), "{text}");
        assert!(
            text.contains("--home 0,0,50") && text.contains("explain R18"),
            "{text}"
        );
        let text = elsewhere(&refused(None)).unwrap();
        assert!(
            !text.contains("home_mm") && text.contains("--home 0,0,50"),
            "{text}"
        );
    }
}
