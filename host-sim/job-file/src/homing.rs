//! The sections `[home]`, `[probe]` and `[door]` of a machine's profile.

use job::{AXES, AxisLimits, Contact, Homing, JobError};
use toml::de::DeValue;

use crate::section::Section;

const KEYS: [&str; 7] = [
    "order",
    "at_upper_end",
    "position_mm",
    "seek_mm_s",
    "approach_mm_s",
    "back_off_mm",
    "survives_off",
];

/// Entry of the homing order without an axis.
const NO_AXIS: u8 = 3;

/// Expected value of a key with three speeds or distances, for messages.
const ABOVE_0: &str = "three numbers above 0, one each for x, y and z, e.g. [20, 20, 10]";

/// Default speed of the approach, mm/s.
const APPROACH_MM_S: f64 = 1.0;
/// Default distance from the switch before the approach and after it, mm.
const BACK_OFF_MM: f64 = 3.0;
/// Default speed of the search for a switch, as a share of the axis's velocity limit.
const SEEK_SHARE: f64 = 0.5;

/// Longest distance from a switch, mm.
const BACK_OFF_MAX_MM: f64 = 100.0;

/// Reads `[home]`.
pub(super) fn read(
    home: &Section<'_>,
    limits: &AxisLimits,
    travel_mm: Option<[[f64; 2]; 3]>,
) -> Result<Homing, JobError> {
    home.only(&KEYS, &[])?;
    let Some(travel_mm) = travel_mm else {
        return Err(home.error(
            "order",
            "homing needs `travel_mm`: a switch is looked for no farther than the travel",
            "add travel_mm = [[least, most], ..] to [machine], in machine coordinates",
        ));
    };
    let order = read_order(home)?;
    let at_upper_end = switches(home, "at_upper_end", [false, false, true])?;
    let position_mm = if home.has("position_mm") {
        home.positions("position_mm")?
    } else {
        std::array::from_fn(|axis| travel_mm[axis][usize::from(at_upper_end[axis])])
    };
    let seek = limits.velocity_mm_s.map(|velocity| velocity * SEEK_SHARE);
    let seek_mm_s = home.positive_axes("seek_mm_s", ABOVE_0)?.unwrap_or(seek);
    let approach_mm_s = home
        .positive_axes("approach_mm_s", ABOVE_0)?
        .unwrap_or(seek_mm_s.map(|seek| seek.min(APPROACH_MM_S)));
    let back_off_mm = home
        .positive_axes("back_off_mm", ABOVE_0)?
        .unwrap_or([BACK_OFF_MM; 3]);
    home.check_positions("back_off_mm", &back_off_mm)?;
    for (index, axis) in AXES.into_iter().enumerate() {
        let (seek, approach, most) = (
            seek_mm_s[index],
            approach_mm_s[index],
            limits.velocity_mm_s[index],
        );
        if !order.contains(&u8::try_from(index).unwrap_or(NO_AXIS)) {
            continue;
        }
        if seek > most {
            let what =
                format!("`seek_mm_s` is faster than {axis} may be: {seek}, {most} in velocity_max_mm_s");
            return Err(home.error("seek_mm_s", what, "search more slowly"));
        }
        if approach > seek {
            let what = format!("`approach_mm_s` of {axis} is faster than its search: {approach}, {seek}");
            return Err(home.error(
                "approach_mm_s",
                what,
                "approach more slowly: its speed makes the home exact",
            ));
        }
        let off = back_off_mm[index];
        if off > BACK_OFF_MAX_MM {
            let what = format!("`back_off_mm` of {axis} must be at most {BACK_OFF_MAX_MM}, not {off}");
            return Err(home.error(
                "back_off_mm",
                what,
                "give a distance at which the switch is released",
            ));
        }
        let [least, most] = travel_mm[index];
        let rests = position_mm[index] + if at_upper_end[index] { -off } else { off };
        if !(least..=most).contains(&rests) {
            let what = format!(
                "after homing {axis} would stand at {rests} mm, outside its travel of {least} to {most} mm"
            );
            let remedy = "`position_mm` is the machine coordinate at which the switch trips: the axis then goes back by `back_off_mm`";
            return Err(home.error("position_mm", what, remedy));
        }
    }
    Ok(Homing {
        order,
        at_upper_end,
        position_mm,
        seek_mm_s,
        approach_mm_s,
        back_off_mm,
        survives_off: home.has("survives_off") && home.switch("survives_off")?,
    })
}

/// The order of the axes; z first, out of the way.
fn read_order(home: &Section<'_>) -> Result<[u8; 3], JobError> {
    const DEFAULT: [u8; 3] = [2, 0, 1];
    if !home.has("order") {
        return Ok(DEFAULT);
    }
    let text = home.text("order")?;
    let axes: Option<Vec<u8>> = text
        .chars()
        .map(|letter| match letter {
            'x' => Some(0),
            'y' => Some(1),
            'z' => Some(2),
            _ => None,
        })
        .collect();
    let has_none_twice =
        |axes: &Vec<u8>| (0..3).all(|axis| axes.iter().filter(|other| **other == axis).count() <= 1);
    match axes.filter(|axes| !axes.is_empty() && has_none_twice(axes)) {
        Some(axes) => Ok(std::array::from_fn(|place| {
            axes.get(place).copied().unwrap_or(NO_AXIS)
        })),
        None => Err(home.error(
            "order",
            format!("`order` must name the axes that have a switch, each once, not \"{text}\""),
            "write order = \"zxy\", or \"xy\" for a machine without a switch of z",
        )),
    }
}

/// Three switches.
fn switches(home: &Section<'_>, key: &str, default: [bool; 3]) -> Result<[bool; 3], JobError> {
    let mut values = default;
    if home.has(key) {
        for (value, given) in values.iter_mut().zip(home.value(key)?.list_of(3, "switch")?) {
            let DeValue::Boolean(is_set) = given.get() else {
                return Err(given.error("must be true or false", "write [false, false, true]"));
            };
            *value = *is_set;
        }
    }
    Ok(values)
}

/// Reads `[probe]`: whether its contact closes when it touches.
pub(super) fn read_probe(probe: &Section<'_>) -> Result<bool, JobError> {
    probe.only(&["contact"], &[])?;
    Ok(contact(probe, "contact")? == Contact::NormallyOpen)
}

/// Reads `[door]`: what its contact does when the door opens.
pub(super) fn read_door(door: &Section<'_>) -> Result<Contact, JobError> {
    door.only(&["contact"], &[])?;
    if !door.has("contact") {
        return Ok(Contact::NormallyClosed);
    }
    contact(door, "contact")
}

/// Reads the kind of a contact.
pub(super) fn contact(section: &Section<'_>, key: &str) -> Result<Contact, JobError> {
    let kinds = [
        ("normally-closed", Contact::NormallyClosed),
        ("normally-open", Contact::NormallyOpen),
    ];
    section.choice(key, &kinds)
}
