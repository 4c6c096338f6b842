//! A job in thirty lines: a shallow dome, a ball of 5 mm, every pass from the first sample to the last.

use interp_core::{Command, Header, Interpolator, encode};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // z = 20 - (x^2 + y^2)/100 on 80 mm x 60 mm: c[axis][i][j] of u^i v^j in mm, u and v from 0 to 1.
    let mut c = [[[0.0; 4]; 4]; 3];
    (c[0][0][0], c[0][1][0]) = (-40.0, 80.0);
    (c[1][0][0], c[1][0][1]) = (-30.0, 60.0);
    (c[2][0][0], c[2][1][0], c[2][2][0], c[2][0][1], c[2][0][2]) = (-5.0, 64.0, -64.0, 36.0, -36.0);
    let centred = c.map(|axis| encode::substitute(&axis, [0.0, 1.0], [0.0, 1.0]));
    let patch = encode::polynomial(&centred, Default::default())?;
    let header = Header {
        path_spans: 1,
        side_spans: 1,
        ball_radius_mm: 5.0,
        feed_mm_s: 20.0,
        scallop_mm: 0.01,
        period_s: 0.001,
        ..Header::default()
    };
    let mut machine = Interpolator::<[i32; 64]>::new();
    machine.load_begin(&header, 54)?;
    machine.load_words(0, &[encode::width(1.0)?; 2])?; // one span each way, as wide as the parameter's range
    machine.load_words(2, &patch.to_words())?;
    machine.load_check(0)?;
    machine.load_finish()?;
    let mut sample = *machine.tick(Command::Start);
    while sample.state.is_under_way() {
        machine.plan(); // in what is left of the period: plans ahead
        sample = *machine.tick(None); // once a period: sample.cl_nm is the ball's centre for the axes
    }
    println!(
        "{} passes, {} samples, {}",
        sample.pass + 1,
        sample.tick + 1,
        sample.state.name()
    );
    machine.fault().map_or(Ok(()), |fault| Err(fault.into()))
}
