//! The JSON of the commands: the names and types that scripts rely on, and the schema of `verify`.

use serde_json::Value;

use super::{err, folder_with, json, run};

/// JSON keys and types of the contract: `n` number, `n?` number or null (no interval before the first sample), `s` text, `o?` object or null, `o` object, `b` true or false.
fn has(reported: &Value, names: &str, of: &str) {
    for name in names.split_whitespace() {
        let (key, kind) = name.split_once(':').unwrap();
        let value = reported
            .get(key)
            .unwrap_or_else(|| panic!("{of}: no {key} in {reported}"));
        let fits = match kind {
            "n" => value.is_number(),
            "n?" => value.is_number() || value.is_null(),
            "s" => value.is_string(),
            "o" => value.is_object(),
            "o?" => value.is_object() || value.is_null(),
            "a" => value.is_array(),
            "a?" => value.is_array() || value.is_null(),
            "b" => value.is_boolean(),
            other => panic!("no kind {other}"),
        };
        assert!(fits, "{of}: {key} is {value}");
    }
}

#[test]
fn json_has_the_names_that_scripts_rely_on() {
    const SIMULATE: &str = "approach:s along:s along_auto:o? passes:n samples:n ticks:n segments:n program_bytes:n cc_length_mm:n \
        cl_length_mm:n machining_time_s:n interval_min:n? ripple_max_pct:n ripple_rms_pct:n digest:s samples_per_second:n fault:o?";
    const FAULT: &str = "code:n name:s message:s tick:n pass:n u:n v:n";
    const VERIFY: &str = "position_error_max_nm:n normal_error_max_rad:n ripple_max_pct:n scallop_max_mm:n? scallop_mean_mm:n? \
        gouge_max_mm:n? limits:o? passed:b";
    const EXPORT: &str = "approach:s along:s along_auto:o? feed_mode:s passes:n segments:n blocks:n program_bytes:n cutting_time_s:n safe_z_mm:n home_mm:a? \
        spindle_rpm:n? warnings:a";
    const EXPLAIN: &str = "family:s code:n label:s name:s meaning:s value:s why:s remedy:s example:s";
    let folder = folder_with("torus", &[("along = \"u\"", "along = \"auto\"")]);
    for approach in ["constant-cl", "linear", "curve", "surface"] {
        let reported = json(
            folder.path(),
            &format!("simulate job.toml --approach {approach} --json"),
        );
        has(&reported, SIMULATE, approach);
        assert_eq!(reported["approach"], approach);
        has(
            &reported["along_auto"]["u"],
            "ticks:n machining_time_s:n",
            "along_auto",
        );
    }
    has(&json(folder.path(), "verify job.toml --json"), VERIFY, "verify");
    let reported = json(folder.path(), "export job.toml --format grbl -o x.nc --json");
    has(&reported, EXPORT, "export");
    has(&json(folder.path(), "explain R1 --json"), EXPLAIN, "explain");
    assert_eq!(
        json(folder.path(), "explain --json")["entries"]
            .as_array()
            .unwrap()
            .len(),
        explain::entries().len()
    );
    has(&json(folder.path(), "new -o n.toml --json"), "job:s", "new");
    let bad = folder_with("torus", &[("radius_mm = 5", "radius_mm = 9")]);
    let output = run(bad.path(), "simulate job.toml --json");
    let reported: Value = serde_json::from_slice(&output.stdout).unwrap();
    has(&reported, SIMULATE, "a fault");
    has(&reported["fault"], FAULT, "fault");
}

/// Checks a value against the part of JSON Schema that `docs/verify.schema.json` uses. Returns what does not fit.
fn misfits(value: &Value, schema: &Value, at: &str, all: &mut Vec<String>) {
    let name = match value {
        Value::Null => "null",
        Value::Bool(_) => "boolean",
        Value::Number(_) => "number",
        Value::String(_) => "string",
        Value::Array(_) => "array",
        Value::Object(_) => "object",
    };
    let permitted = match &schema["type"] {
        Value::String(one) => one == name,
        Value::Array(several) => several.iter().any(|one| one == name),
        _ => schema["enum"].as_array().unwrap().contains(value),
    };
    if !permitted {
        all.push(format!("{at}: {value}"));
    }
    let (Value::Object(keys), Some(known)) = (value, schema["properties"].as_object()) else {
        return;
    };
    for (key, value) in keys {
        match known.get(key) {
            Some(schema) => misfits(value, schema, &format!("{at}.{key}"), all),
            None => all.push(format!("{at}.{key} is not in the schema")),
        }
    }
    for required in schema["required"].as_array().into_iter().flatten() {
        if !keys.contains_key(required.as_str().unwrap()) {
            all.push(format!("{at} lacks {required}"));
        }
    }
}

pub(super) fn misfits_of(value: &Value, definition: &str) -> Vec<String> {
    let schema: Value = serde_json::from_str(include_str!("../../../docs/verify.schema.json")).unwrap();
    let mut all = Vec::new();
    misfits(value, &schema["$defs"][definition], definition, &mut all);
    all
}

/// Whatever happens, `verify --json` prints one object of the schema, with the exit code of old.
#[test]
fn verify_prints_an_object_of_the_schema_for_every_outcome() {
    let folder = folder_with("torus", &[]);
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let torus = std::fs::read_to_string(folder.path().join("job.toml")).unwrap();
    write(
        "limits.toml",
        &format!(
            "{}\n[machine]\njerk_max_mm_s3 = [2000, 2000, 2000]\n",
            torus.replace("scallop_mm = 0.005", "scallop_mm = 0.2")
        ),
    );
    write("fault.toml", &torus.replace("radius_mm = 5", "radius_mm = 9"));
    let curved = "spacing = \"constant\"\nstart = \"auto\"\npattern =";
    write(
        "curved.toml",
        &torus
            .replace("pattern =", curved)
            .replace("scallop_mm = 0.005", "scallop_mm = 0.1"),
    );
    write(
        "line.toml",
        &torus.replace("feed_mm_min = 600", "feed_mm_min = -1"),
    );
    write("region.toml", include_str!("../../../jobs/region.toml"));
    for (arguments, code, definition) in [
        ("verify job.toml --json", 0, "verification"),
        ("verify limits.toml --json", 0, "verification"),
        ("verify fault.toml --json", 1, "verification"),
        ("verify curved.toml --json", 0, "verification"),
        ("verify region.toml --json", 0, "verification"),
        ("verify line.toml --json", 2, "error"),
        ("verify nothing.toml --json", 2, "error"),
        ("verify --json", 2, "error"),
        ("verify job.toml --json --scallop-tolerance x", 2, "error"),
        ("verify job.toml limits.toml --json", 0, "several"),
        ("verify job.toml fault.toml --json", 1, "several"),
        ("verify fault.toml line.toml job.toml --json", 2, "several"),
    ] {
        let output = run(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments}: {}", err(&output));
        let reported: Value =
            serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{arguments}: {error}"));
        assert_eq!(
            misfits_of(&reported, definition),
            Vec::<String>::new(),
            "{arguments}"
        );
        for job in reported["jobs"].as_array().into_iter().flatten() {
            let definition = if job.get("error").is_some() {
                "error"
            } else {
                "verification"
            };
            let mut off = misfits_of(job, definition);
            // In a list an error names its job too.
            off.retain(|line| {
                definition == "verification" || !(line.contains(".job") || line.contains(".passed"))
            });
            assert_eq!(off, Vec::<String>::new(), "{arguments}");
        }
        assert_eq!(
            reported["passed"].as_bool().unwrap_or(false),
            code == 0,
            "{arguments}"
        );
    }
    let reported: Value =
        serde_json::from_slice(&run(folder.path(), "verify line.toml --json").stdout).unwrap();
    let line = torus
        .lines()
        .position(|line| line.starts_with("feed_mm_min"))
        .unwrap()
        + 1;
    assert_eq!(reported["error"]["line"], line, "{reported}");
    assert!(reported["error"]["help"].as_str().unwrap().contains("600"));
}
