//! x
#![allow(clippy::unwrap_used, reason = "a test may fail by panic")]
use std::path::PathBuf;
use host_sim::approach::{Kind, measure, measure_run, passes, planned, Linear, Chords};
use host_sim::job_file::JobFile;
use host_sim::oracle::Oracle;

fn load(name: &str) -> JobFile {
    JobFile::load(&PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("../jobs/{name}.toml"))).unwrap()
}
#[test]
fn explore() {
    for name in ["revolved", "revolved_v", "ruled_printed", "ruled_reconstructed", "freeform", "sphere_cap", "torus"] {
        let job = load(name);
        for kind in Kind::ALL {
            let t = std::time::Instant::now();
            match measure(kind, &job, |_, _| {}) {
                Ok(m) => println!("{name} {:12} passes {} seg {} per {:.2} bytes {} step {:.3} t {:.2} min cc {:.1} cl {:.1} ccv {:.4?} clv {:.4?} ch {:.4} ripple {:.5} rms {:.5} pos {:.4} um int {:.8} {:.2?}",
                kind.name(), m.planned.passes, m.planned.segments, m.planned.segments as f64/m.planned.passes as f64, m.planned.bytes, m.planned.speed_step_mm_s, m.time_s/60., m.report.cc_length_mm, m.cl_length_mm, m.cc_mm_s, m.cl_mm_s, m.cl_change_mm_s, m.report.ripple_pct.max, m.report.ripple_pct.rms(), m.report.position_nm.max*1e-3, m.interval_min, t.elapsed()),
                Err(e) => println!("{name} {} {e}", kind.name()),
            }
        }
        let mut job = job; job.machine.period_us = 5000.0;
        let oracle = Oracle::new(&job).unwrap();
        for rule in [Chords::Equation, Chords::EquationNormal, Chords::Held] {
            let m = measure_run(&job, &mut |_,_|{}, |each| planned(&Linear::new(&job, rule), &job, &passes(&oracle)?[..3], each)).unwrap();
            println!("  {rule:?} seg {} ripple {:.4} rms {:.4} pos {:.4}um step {:.4} ccv {:.4?} clv {:.4?}", m.planned.segments/3, m.report.ripple_pct.max, m.report.ripple_pct.rms(), m.report.position_nm.max*1e-3, m.planned.speed_step_mm_s, m.cc_mm_s, m.cl_mm_s);
        }
    }
}
