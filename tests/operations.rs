//! Operations of a sample, counted from the instructions of the firmware, against the operations that the source of the core says.
//! Needs `qemu-system-arm`; builds the firmware and the plugin.
#![allow(clippy::unwrap_used, reason = "a test may fail by panic")]

use cycles::measure::{MeasurementSetup, Ticks};
use cycles::operations::{self, Operations, count, of_tick};
use cycles::{SURFACES, golden, image};
use machine::prepare::prepare;
use machine::remote::qemu;

/// Ticks of each job.
const TICKS: u32 = 5000;

#[test]
fn look() {
    let path = qemu::firmware().unwrap();
    let (plan, _) = image::read(&path).unwrap();
    let setup = MeasurementSetup::new(&path, &plan).unwrap();
    for (name, job) in SURFACES {
        let job = qemu::workspace().join(format!("jobs/{job}.toml"));
        let prepared = prepare(&job_file::load(&job).unwrap()).unwrap();
        let ticks = setup.run(&prepared, TICKS).unwrap();
        println!("{name} {:?}", count(&ticks));
        let mut m = std::collections::BTreeMap::new();
        for r in &ticks.records {
            *m.entry((of_tick(r), [0usize, 1, 2, 3].map(|k| r.operations[k].to_array())))
                .or_insert(0) += 1;
        }
        let mut v: Vec<_> = m.into_iter().collect();
        v.sort_by_key(|x| std::cmp::Reverse(x.1));
        for (k, n) in v.iter().take(8) {
            println!("   {n} {:?} {:?}", k.0.to_array(), k.1);
        }
        println!("   {} kinds", v.len());
    }
}
