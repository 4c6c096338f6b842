//! What `verify` finds on a job, in numbers and in words, and whether the remedies that it names help.

use serde_json::Value;

use super::json_output::misfits_of;
use super::{err, folder_with, json, out, run};

/// The message of a scallop above its limit names two remedies, and both help.
#[test]
fn remedies_for_a_scallop_help() {
    // The paper's spacing exceeds the height on this job.
    let first_order = (
        "pattern = \"zigzag\"",
        "pattern = \"zigzag\"\nspacing = \"first-order\"",
    );
    let folder = folder_with("torus", &[first_order]);
    let output = run(folder.path(), "verify job.toml");
    let reported = out(&output);
    assert_eq!(output.status.code(), Some(1), "{reported}");
    let after = |what: &str| {
        let rest = reported
            .split(what)
            .nth(1)
            .unwrap_or_else(|| panic!("no {what} in {reported}"));
        rest.split([',', '\n']).next().unwrap().trim().to_owned()
    };
    let tolerance = after("--scallop-tolerance ");
    let accepted = run(
        folder.path(),
        &format!("verify job.toml --scallop-tolerance {tolerance}"),
    );
    assert_eq!(accepted.status.code(), Some(0), "{}", out(&accepted));
    let asked = format!("scallop_mm = {}", after("ask for scallop_mm = "));
    let lower = folder_with("torus", &[first_order, ("scallop_mm = 0.005", &asked)]);
    let found = json(lower.path(), "verify job.toml --json --scallop-tolerance 100%");
    assert!(found["scallop_max_mm"].as_f64().unwrap() <= 0.005, "{found}");
}

/// A ball that does not fit at the first place: nothing is called met that was measured on no sample.
#[test]
fn a_run_without_a_sample_meets_nothing() {
    let folder = folder_with("torus", &[("radius_mm = 5", "radius_mm = 900")]);
    let output = run(folder.path(), "verify job.toml --json");
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(found["samples"], 0, "{found}");
    assert_eq!(
        (&found["passed"], &found["gouge_max_mm"]),
        (&false.into(), &Value::Null)
    );
    let missing = found["not_measured"].as_array().unwrap();
    assert!(missing.contains(&"gouge_max_mm".into()));
    for key in [
        "position_error_max_nm",
        "position_error_rms_nm",
        "normal_error_max_rad",
        "ripple_max_pct",
        "fit_max",
    ] {
        assert!(
            found[key].is_null() && missing.contains(&key.into()),
            "{key}: {found}"
        );
    }
    assert!(found["interval_error_max"].is_null());
    let reported = out(&run(folder.path(), "verify job.toml"));
    assert!(
        reported.contains("not measured: the run has no sample") && !reported.contains("none deeper"),
        "{reported}"
    );
}

/// A plane that leans over the tool by 10 degrees: the contact is above the ball's equator, the shank in the plane. The reported turn helps,
/// and a holder that touches a fixture is reported with its place.
#[test]
fn verify_tells_what_the_tool_does_not_reach() {
    let folder = tempfile::tempdir().unwrap();
    let job = |rotate: &str, tool: &str, rest: &str| {
        format!(
            "[surface]\nkind = \"ruled\"\nrail0_mm = [[0, 0, 20, 0], [0, 0, 0, 0], [0, 0, 0, 0]]\nrail1_mm = [[0, 0, 20, 0], [0, 0, 0, 12], \
             [0, 0, 0, 0]]\n[placement]\nrotate_deg = {rotate}\n[tool]\nkind = \"ball\"\nradius_mm = 3\n{tool}\n[cut]\nfeed_mm_min = 1200\n\
             scallop_mm = 0.05\nalong = \"u\"\nside = \"+\"\npattern = \"zigzag\"\n{rest}"
        )
    };
    let write = |text: &str| std::fs::write(folder.path().join("job.toml"), text).unwrap();
    let verify = |code: i32| -> Value {
        let output = run(folder.path(), "verify job.toml --json");
        assert_eq!(output.status.code(), Some(code), "{}", err(&output));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    write(&job("[100, 0, 20]", "", ""));
    let reported = verify(1);
    let (contact, parts) = (&reported["reach"]["contact"], &reported["reach"]["parts"]);
    assert_eq!(contact["verdict"], "violated");
    let height = contact["height_max_mm"].as_f64().unwrap();
    assert!(
        (height - 3.0 * 10.0_f64.to_radians().sin()).abs() < 1e-5,
        "{height}"
    );
    assert_eq!(reported["reach"]["undercut_share"], 1.0);
    assert_eq!(
        (&parts[0]["part"], &parts[0]["verdict"]),
        (&"shank".into(), &"violated".into())
    );
    let failures = reported["failures"].to_string();
    assert!(
        failures.contains("above its equator") && failures.contains("rotate_deg"),
        "{failures}"
    );
    write(&job(&reported["reach"]["rotate_deg"].to_string(), "", ""));
    let reported = verify(0);
    assert_eq!(reported["reach"]["verdict"], "met");
    assert_eq!(reported["reach"]["undercut_share"], 0.0);
    assert!(reported["reach"]["contact"]["height_max_mm"].as_f64().unwrap() < -2.5);
    // Flat: the holder's face is 30 mm above the tip, 20 mm wide, beside a fixture that is 31 mm high: 5 mm from the outermost axis.
    let tool = "length_mm = 30\nholder = { diameter_mm = 20, length_mm = 40 }";
    let fixture = "[[fixture]]\nname = \"jaw\"\nbox_mm = [[25, 40], [0, 12], [-5, 31]]\n[stock]\nbox_mm = [[-5, 25], [-5, 17], [-5, 2]]\n";
    write(&job("[0, 0, 0]", tool, fixture));
    let reported = verify(1);
    let hit = reported["reach"]["parts"]
        .as_array()
        .unwrap()
        .iter()
        .find(|part| part["verdict"] == "violated")
        .unwrap();
    assert_eq!(
        (&hit["part"], &hit["obstacle"]),
        (&"holder".into(), &"fixture jaw".into())
    );
    let depth = hit["depth_mm"].as_f64().unwrap();
    assert!((depth - 1.0).abs() < 1e-3, "{depth}");
    assert_eq!(misfits_of(&reported, "verification"), Vec::<String>::new());
    let text = run(folder.path(), "verify job.toml --report out");
    let text = String::from_utf8_lossy(&text.stdout).into_owned();
    assert!(
        text.contains("FAIL reach: holder") && text.contains("deep in fixture jaw"),
        "{text}"
    );
    let page = std::fs::read_to_string(folder.path().join("out/index.html")).unwrap();
    assert!(page.contains("holder 1.000 mm in fixture jaw"));
}
