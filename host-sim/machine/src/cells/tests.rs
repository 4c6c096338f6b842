use job::{AxisLimits, Pattern};

use super::*;

/// xorshift64.
struct Random(u64);

impl Random {
    fn within(&mut self, low: f64, high: f64) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn star(random: &mut Random, centre: [f64; 2], reach: f64, corners: u32) -> Polygon {
    let corner = |k: u32| {
        let (sin, cos) = (f64::from(k) / f64::from(corners) * std::f64::consts::TAU).sin_cos();
        let radius = reach * random.within(0.5, 1.0);
        [centre[0] + radius * cos, centre[1] + radius * sin]
    };
    (0..corners).map(corner).collect()
}

/// A plate of 60 x 40 mm.
fn plate(along: Along, loops: Vec<Polygon>) -> Job {
    let text = "[surface]\nkind = \"bicubic\"\ncoefficients_mm = [\n\
        [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 60], [0, 0, 0, -30]],\n\
        [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 40, -20]],\n\
        [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]]\n\
        [tool]\nkind = \"ball\"\nradius_mm = 3\n\
        [cut]\nfeed_mm_min = 1200\nscallop_mm = 0.01\nalong = \"u\"\nside = \"up\"\n";
    let mut job = job_file::parse("plate.toml", text).unwrap();
    (job.along, job.pattern) = (along, Pattern::Zigzag);
    job.machine.limits = Some(AxisLimits::DEFAULT);
    job.region = Some(Region::new(loops));
    job
}

/// Cells of random regions hold each place of the region once, and nothing else; and no line meets one too often.
#[test]
fn cells_tile_the_region() {
    let mut random = Random(0x1357_9bdf_0246_8ace);
    let (mut parted, mut probes) = (0, 0);
    for case in 0..60_u32 {
        let corners = [3, 5, 12, 60][case as usize % 4];
        let mut loops = vec![star(&mut random, [0.5, 0.5], 0.5, corners)];
        for k in 0..case % 5 {
            let at = [0.35 + 0.1 * f64::from(k), random.within(0.4, 0.6)];
            loops.push(star(&mut random, at, 0.05, corners));
        }
        let along = [Along::U, Along::V][case as usize % 2];
        let mut job = plate(along, loops);
        choose(&mut job);
        let region = job.region.unwrap();
        parted += usize::from(region.cells.len() > 1);
        let parts = region.parts();
        for _ in 0..400 {
            let at = [random.within(0.0, 1.0), random.within(0.0, 1.0)];
            let times = parts.iter().filter(|part| part.contains(at)).count();
            assert_eq!(times, usize::from(region.contains(at)), "case {case} at {at:?}");
            probes += times;
        }
        for part in &parts {
            assert!(Pieces::new(part, along).most_on_a_line() <= INTERVALS_MAX);
        }
    }
    assert!(parted > 20 && probes > 5000, "{parted} {probes}");
}

/// A hole is passed on one side and then on the other, where that takes less time; a small one is crossed.
#[test]
fn a_hole_parts_a_region() {
    let square = |from: f64, to: f64| vec![[from, from], [to, from], [to, to], [from, to]];
    let cells = |hole: Polygon, limits: bool| {
        let mut job = plate(Along::U, vec![square(0.0, 1.0), hole]);
        if !limits {
            job.machine.limits = None;
        }
        choose(&mut job);
        job.region.unwrap().cells
    };
    let large = cells(square(0.3, 0.7), true);
    // Below and one side, the other side; or the part above with it.
    assert_eq!(large.len(), 2, "{large:?}");
    assert_eq!(large.iter().map(Vec::len).sum::<usize>(), 4);
    assert!(cells(square(0.5, 0.51), true).is_empty());
    // Without limits there are no links.
    assert!(cells(square(0.3, 0.7), false).is_empty());
}

/// What a line meets too often is parted, with limits and without.
#[test]
fn a_comb_is_parted() {
    let tooth = |k: i32| {
        let at = f64::from(k) / 50.0;
        vec![[at, 0.2], [at + 0.01, 0.2], [at + 0.01, 1.0], [at, 1.0]]
    };
    let mut loops: Vec<Polygon> = (0..50).map(tooth).collect();
    loops.push(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 0.2], [0.0, 0.2]]);
    for limits in [Some(AxisLimits::DEFAULT), None] {
        let mut job = plate(Along::U, loops.clone());
        job.machine.limits = limits;
        choose(&mut job);
        let cells = &job.region.as_ref().unwrap().cells;
        assert!(cells.len() >= 4, "{}", cells.len());
        crate::prepare::prepare(&job).unwrap();
        // Across the teeth no line meets more than two.
        job.along = Along::V;
        choose(&mut job);
        crate::prepare::prepare(&job).unwrap();
    }
}

/// A roof of two planes of 10 x 20 mm, straight along v, the ridge at u = 1.
fn roof(along: Along, loops: Vec<Polygon>) -> Job {
    let text = "[surface]\nkind = \"nurbs\"\ndegree = [1, 1]\nknots_u = [0, 0, 1, 2, 2]\nknots_v = [0, 0, 1, 1]\n\
        poles_mm = [\n\
        [[0, 0, 0], [0, 20, 0]],\n\
        [[10, 0, 2], [10, 20, 2]],\n\
        [[20, 0, 0], [20, 20, 0]]]\n\
        [tool]\nkind = \"ball\"\nradius_mm = 3\n\
        [cut]\nfeed_mm_min = 1200\nscallop_mm = 0.01\nalong = \"u\"\nside = \"up\"\n";
    let mut job = job_file::parse("roof.toml", text).unwrap();
    (job.along, job.pattern) = (along, Pattern::Zigzag);
    job.machine.limits = Some(AxisLimits::DEFAULT);
    job.region = Some(Region::new(loops));
    job
}

/// A region that is cut at a crease runs to its end, with passes along the crease and across; one over it does not.
#[test]
fn parts_beside_a_crease_are_cells() {
    let part = |from: f64, to: f64| vec![[from, 0.0], [to, 0.0], [to, 1.0], [from, 1.0]];
    for along in [Along::U, Along::V] {
        let mut job = roof(along, vec![part(0.0, 0.999), part(1.001, 2.0)]);
        choose(&mut job);
        assert_eq!(job.region.as_ref().unwrap().cells.len(), 2);
        let prepared = crate::prepare::prepare(&job).unwrap();
        let mut machine = crate::Machine::load(&prepared).unwrap();
        let (mut sides, mut highest_nm) = ([0_u32; 2], 0);
        machine
            .run(|sample| {
                if sample.state == interp_core::State::Running {
                    let [x, _, z] = sample.cl_nm;
                    sides[usize::from(x > 10_000_000)] += 1;
                    highest_nm = highest_nm.max(z);
                }
                true
            })
            .unwrap();
        assert!(
            sides.iter().all(|samples| *samples > 5000),
            "{along:?}: {sides:?}"
        );
        // The ball's centre over the ridge, on either plane.
        let ridge_mm = 2.0 + 3.0 / 1.04_f64.sqrt();
        assert!(
            f64::from(highest_nm) * 1e-6 <= ridge_mm,
            "{along:?}: {highest_nm}"
        );
    }
    let mut job = roof(Along::U, vec![part(0.0, 2.0)]);
    choose(&mut job);
    let prepared = crate::prepare::prepare(&job).unwrap();
    let fault = crate::Machine::load(&prepared).unwrap().run(|_| true);
    assert_eq!(fault.unwrap_err().kind, interp_core::FaultKind::DegenerateSurface);
}
