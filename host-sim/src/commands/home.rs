//! The declared position of the axes: parsed from the command line, and checked against the start of the job.

use protocol::message::Reason;

use super::{Result, settled};
use job::Job;
use machine::prepare::Prepared;
use machine::remote::RemoteError;

const MM_PER_NM: f64 = 1e-6;

/// A place of the axes, nm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PlaceNm(pub(super) [i32; 3]);

impl PlaceNm {
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
pub(super) fn place(text: &str) -> std::result::Result<PlaceNm, String> {
    let mut axes = text.split(',').map(|axis| {
        let mm: f64 = axis.trim().parse().ok()?;
        let nm = (mm * 1e6).round();
        #[expect(clippy::cast_possible_truncation, reason = "within the range of an i32")]
        (nm.abs() <= f64::from(i32::MAX)).then_some(nm as i32)
    });
    let mut next = || axes.next().flatten();
    match (next(), next(), next()) {
        (Some(x), Some(y), Some(z)) if axes.next().is_none() => Ok(PlaceNm([x, y, z])),
        _ => Err("expected three numbers in mm, each within 2147, such as 0,0,50".to_owned()),
    }
}

/// Loads a job; if it has no `home_mm`, `home` becomes its home.
pub(super) fn load(path: &std::path::Path, stands: Option<PlaceNm>) -> Result<(Job, Prepared)> {
    let mut job = job_file::load_with(path, &cad::Faces)?;
    if let Some(stands) = stands {
        job.machine.home_mm.get_or_insert(stands.mm());
    }
    settled(job)
}

/// Position at which the run of the job begins. A job without limits begins with its first pass, whatever the position of the axes.
pub(super) fn of(prepared: &Prepared) -> PlaceNm {
    PlaceNm(prepared.header.axes.map_or([0; 3], |axes| axes.home_nm))
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
        "move the axes there with the drives off, and declare the position: --home {}",
        PlaceNm(*home_nm).words().replace(' ', "")
    );
    let remedy = match stands_nm {
        Some(at_nm) => format!(
            "set `home_mm = [{}]` in [machine], so that the job begins at the position of the axes; or {bring}",
            PlaceNm(*at_nm).words()
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
    fn a_place_is_read_as_it_is_said() {
        for nm in [
            [0, -1, 1],
            [i32::MAX, -i32::MAX, 50_000_000],
            [-120_500_000, 7, 999_999],
        ] {
            assert_eq!(place(&PlaceNm(nm).words()), Ok(PlaceNm(nm)));
        }
        assert_eq!(
            PlaceNm([-500, 50_000_000, 1_250_000]).words(),
            "-0.0005, 50, 1.25"
        );
        for text in ["1,2", "1,2,3,4", "1,2,x", "0,0,2148", "0,0,inf", "nan,0,0"] {
            assert!(place(text).is_err(), "{text}");
        }
    }

    /// A position written into a job is parsed to the same nanometre.
    #[test]
    fn no_nanometre_is_lost_in_a_job() {
        for nm in (0..i32::MAX).step_by(7_919_737) {
            for nm in [nm, -nm] {
                let [mm, ..] = PlaceNm([nm; 3]).mm();
                #[allow(clippy::cast_possible_truncation, reason = "the job's own rounding")]
                let again = (mm * 1e6).round() as i32;
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
        let told = elsewhere(&refused(Some([1_500_000, -2, 3]))).unwrap();
        assert!(told.contains("home_mm = [1.5, -0.000002, 0.000003]"), "{told}");
        assert!(
            told.contains("--home 0,0,50") && told.contains("explain R18"),
            "{told}"
        );
        let told = elsewhere(&refused(None)).unwrap();
        assert!(
            !told.contains("home_mm") && told.contains("--home 0,0,50"),
            "{told}"
        );
    }
}
