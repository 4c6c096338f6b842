//! Feed within the axes' limits: sample jobs on a machine that has some.

use host_sim::job_file::JobFile;
use host_sim::prepare::prepare;
use host_sim::remote::qemu;
use interp_core::{Axes, Inputs, Interpolator, Request, Sample, State};

/// The usual limits, and a height that is clear.
fn axes(safe_z_nm: i32) -> Axes {
    Axes {
        velocity_mm_s: [100.0, 100.0, 50.0],
        acceleration_mm_s2: [1000.0, 1000.0, 500.0],
        jerk_mm_s3: [20_000.0, 20_000.0, 10_000.0],
        chord_mm: 0.005,
        travel_nm: [[-2_000_000_000, 2_000_000_000]; 3],
        home_nm: [0, 0, safe_z_nm],
        plunge_mm: 2.0,
        safe_z_nm,
    }
}

#[derive(Default, Debug)]
struct Use {
    last: Vec<[i64; 3]>,
    worst: [f64; 3],
    place: [(u32, u32, State); 3],
}

impl Use {
    fn add(&mut self, sample: &Sample, axes: &Axes) {
        let here = sample.cl_nm.map(i64::from);
        self.last.push(here);
        if self.last.len() > 4 {
            self.last.remove(0);
        }
        let t = 1e-3;
        for axis in 0..3 {
            let q: Vec<f64> = self.last.iter().rev().map(|p| p[axis] as f64 * 1e-6).collect();
            let limits = [
                axes.velocity_mm_s[axis],
                axes.acceleration_mm_s2[axis],
                axes.jerk_mm_s3[axis],
            ];
            let found = [
                (q.len() > 1).then(|| ((q[0] - q[1]).abs() - 1e-6).max(0.0) / t),
                (q.len() > 2).then(|| ((q[0] - 2.0 * q[1] + q[2]).abs() - 2e-6).max(0.0) / t / t),
                (q.len() > 3)
                    .then(|| ((q[0] - 3.0 * q[1] + 3.0 * q[2] - q[3]).abs() - 4e-6).max(0.0) / t / t / t),
            ];
            for k in 0..3 {
                let used = found[k].unwrap_or(0.0) / f64::from(limits[k]);
                if used > self.worst[k] {
                    self.worst[k] = used;
                    self.place[k] = (sample.tick, sample.pass, sample.state);
                }
            }
        }
    }
}

#[test]
fn look() {
    for name in ["freeform"] {
        for feed in [1.0_f32, 2.0, 4.0] {
            let job = qemu::workspace().join(format!("jobs/{name}.toml"));
            let mut prepared = prepare(&JobFile::load(&job).unwrap()).unwrap();
            let mut core: Box<Interpolator> = Box::new(Interpolator::new());
            let load = |core: &mut Interpolator, header: &interp_core::Header| {
                core.load_begin(header, prepared.words.len() as u32).unwrap();
                core.load_words(0, &prepared.words).unwrap();
                for record in 0..core.load_records() {
                    core.load_check(record).unwrap();
                }
                core.load_finish().unwrap();
            };
            let mut header = prepared.header;
            header.feed_mm_s *= feed;
            load(&mut core, &header);
            let mut top = i32::MIN;
            let (mut free, mut passes) = (0, 0);
            let mut sample = *core.tick(Request::Start);
            while sample.state == State::Running {
                top = top.max(sample.cl_nm[2]);
                (free, passes) = (free + 1, sample.pass);
                sample = *core.tick(Request::None);
            }
            println!("{name} x{feed}: {:?}", core.fault());
            header.axes = Some(axes(top + 5_000_000));
            core.tick(Request::Abort);
            load(&mut core, &header);
            let mut used = Use::default();
            let (mut links, mut ticks) = (0, 0);
            let mut last_pass = 0;
            let mut sample = *core.tick(Request::Start);
            while sample.state.is_under_way() && ticks < 2_000_000 {
                used.add(&sample, header.axes.as_ref().unwrap());
                ticks += 1;
                links += u32::from(sample.state == State::Linking);
                last_pass = sample.pass;
                sample = *core.tick(Inputs::default());
            }
            println!(
                "  passes {passes}/{last_pass}, ticks {free} free, {ticks} with limits, {links} links; use {:.4?} at {:?}; {:?} {:?}",
                used.worst,
                used.place,
                sample.state,
                core.fault()
            );
        }
    }
    prepare(&JobFile::load(&qemu::workspace().join("jobs/plate.toml")).unwrap()).unwrap();
}
