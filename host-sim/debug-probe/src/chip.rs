//! The debug probe, the chip, and the content of its flash.

use probe_rs::config::RegistryError;
use probe_rs::probe::list::{Accessibility, Lister};
use probe_rs::probe::{DebugProbeInfo, DebugProbeSelector};
use probe_rs::{Core, Error, MemoryInterface, Permissions, Session};

use crate::event::{Event, Problem, Target, Work};
use crate::image::Image;
use crate::tell;

/// `DBGMCU_IDCODE` (RM0090, 38.6.1): `DEV_ID` in the lower 12 bits.
const IDENTITY: u64 = 0xE004_2000;
/// The upper half of this word is the size of the flash in KiB (RM0090, 39.2).
const FLASH_SIZE: u64 = 0x1FFF_7A20;
/// Bytes per read: about 50 ms with a slow probe.
const CHUNK: usize = 2048;

/// The requested probe, or the only one.
pub(crate) fn find(wanted: Option<&str>) -> Result<DebugProbeInfo, Problem> {
    let selector = wanted
        .map(|text| {
            text.parse::<DebugProbeSelector>()
                .map_err(|_| Problem::BadSelector(text.to_owned()))
        })
        .transpose()?;
    let mut found = Lister::new().list_with_access(selector.as_ref());
    let probe = match found.len() {
        0 => return Err(Problem::NoProbe),
        1 => found.remove(0),
        _ => {
            return Err(Problem::SeveralProbes(
                found.iter().map(|probe| probe.info.to_string()).collect(),
            ));
        }
    };
    let name = probe.info.to_string();
    if probe.accessibility == Accessibility::PermissionDenied {
        return Err(Problem::NotAllowed(name));
    }
    tell(&Event::Probe { name });
    Ok(probe.info)
}

/// Connection mode.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reach {
    /// Without reset; the firmware continues.
    Running,
    /// Under reset, if the chip does not answer otherwise.
    ByReset,
}

/// Connects to the chip, and checks its identifier and that the image fits its flash.
pub(crate) fn connect(target: &Target, image: &Image, reach: Reach) -> Result<Session, Problem> {
    let info = find(target.probe.as_deref())?;
    let open = || info.open().map_err(|error| Problem::NotOpened(chain(&error)));
    let attached = open()?.attach(target.chip.as_str(), Permissions::default());
    let attached = match attached {
        Err(error) if reach == Reach::ByReset && !is_unknown(&error) => {
            open()?.attach_under_reset(target.chip.as_str(), Permissions::default())
        }
        attached => attached,
    };
    let mut session = attached.map_err(|error| {
        if is_unknown(&error) {
            Problem::UnknownChip(target.chip.clone())
        } else {
            Problem::NoChip(chain(&error))
        }
    })?;
    check(&mut session, target, image).map(|()| session)
}

fn is_unknown(error: &Error) -> bool {
    matches!(
        error,
        Error::ChipNotFound(RegistryError::ChipNotFound(_) | RegistryError::ChipNotUnique(..))
    )
}

fn check(session: &mut Session, target: &Target, image: &Image) -> Result<(), Problem> {
    let silent = |error: Error| Problem::NoChip(chain(&error));
    let mut core = session.core(0).map_err(silent)?;
    let device_id = (core.read_word_32(IDENTITY).map_err(silent)? & 0xFFF) as u16;
    if device_id != target.device_id {
        return Err(Problem::OtherChip(device_id));
    }
    let flash_bytes = (core.read_word_32(FLASH_SIZE).map_err(silent)? >> 16) << 10;
    let image_bytes = image.reach_bytes().map_err(Problem::BadImage)?;
    if image_bytes > flash_bytes {
        return Err(Problem::TooLarge {
            flash_bytes,
            image_bytes,
        });
    }
    Ok(())
}

/// Compares the flash with the image. The firmware may run meanwhile.
pub(crate) fn compare(core: &mut Core<'_>, image: &Image) -> Result<(), Problem> {
    let (mut done, total) = (0, image.bytes());
    for (address, data) in &image.segments {
        let mut address = *address;
        for chunk in data.chunks(CHUNK) {
            let mut there = vec![0; chunk.len()];
            core.read(u64::from(address), &mut there)
                .map_err(|error| Problem::Gone(chain(&error)))?;
            if let Some(index) = there.iter().zip(chunk).position(|(there, here)| there != here) {
                return Err(Problem::Differs(address + index as u32));
            }
            address += chunk.len() as u32;
            done += chunk.len() as u64;
            tell(&Event::Progress {
                work: Work::Compare,
                done,
                total,
            });
        }
    }
    Ok(())
}

/// An error with the chain of its causes.
pub(crate) fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text = format!("{text}: {error}");
        cause = error.source();
    }
    text
}
