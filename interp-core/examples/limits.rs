//! A job within the limits of the axes: from home to home, with a feed override and a feed hold on the way.

use interp_core::{AxisLimits, Command, Header, Inputs, Interpolator, Pattern, State, encode};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A level plate of 40 mm x 2 mm at z = 0.
    let mut c = [[[0.0; 4]; 4]; 3];
    (c[0][1][0], c[1][0][1]) = (40.0, 2.0);
    let centred = c.map(|axis| encode::substitute(&axis, [0.0, 1.0], [0.0, 1.0]));
    let patch = encode::polynomial(&centred, Default::default())?;
    let limits = AxisLimits {
        velocity_mm_s: [100.0, 100.0, 50.0],
        acceleration_mm_s2: [1000.0, 1000.0, 500.0],
        jerk_mm_s3: [20_000.0, 20_000.0, 10_000.0],
        chord_mm: 0.005,
        overrun_mm: 0.0,
        travel_nm: [[-100_000_000, 100_000_000]; 3],
        home_nm: [0, 0, 30_000_000],
        plunge_mm: 2.0,
        end_nm: None,
        end_height_nm: 0,
        safe_z_nm: 15_000_000,
    };
    let header = Header {
        pattern: Pattern::Zigzag,
        path_spans: 1,
        side_spans: 1,
        ball_radius_mm: 5.0,
        feed_mm_s: 20.0,
        scallop_mm: 0.01,
        period_s: 0.001,
        axes: Some(limits),
        ..Header::default()
    };
    let mut machine = Box::new(Interpolator::<[i32; 64]>::new());
    machine.load_begin(&header, 54)?;
    machine.load_words(0, &[encode::width(1.0)?; 2])?;
    machine.load_words(2, &patch.to_words())?;
    machine.load_check(0)?;
    machine.load_finish()?;

    let (mut fastest_mm_s, mut held) = (0.0_f32, 0_u32);
    let mut sample = *machine.tick(Command::Start);
    while sample.state.is_under_way() {
        let inputs = Inputs {
            command: match sample.tick {
                3_000 if held == 0 => Some(Command::Hold),
                _ if held == 500 => Some(Command::Resume),
                _ => None,
            },
            // Half the feed for the first two seconds, then a tenth more than programmed.
            feed_override: if sample.tick < 2_000 { 50 } else { 110 },
        };
        machine.plan(); // once after each tick, on a board from a task of lower priority
        sample = *machine.tick(inputs);
        held += u32::from(sample.state == State::Held);
        if sample.state == State::Running {
            fastest_mm_s = fastest_mm_s.max(sample.feed_mm_s);
        }
    }
    println!(
        "{} after {} passes and {:.2} s, held for {held} periods; fastest {fastest_mm_s:.2} mm/s",
        sample.state.name(),
        sample.pass + 1,
        f64::from(sample.tick) * 1e-3,
    );
    assert_eq!(sample.cl_nm, limits.home_nm);
    machine.fault().map_or(Ok(()), |fault| Err(fault.into()))
}
