//! What a board, QEMU or a chip emulator refuses, as failures with their remedies.

use interp_core::Fault;
use protocol::message::Reason;

use super::super::{Failure, home};
use inspect::comparison::ComparisonError;
use machine::remote::RemoteError;
use machine::remote::chip::ChipError;
use machine::remote::qemu::QemuError;

impl From<ComparisonError> for Failure {
    fn from(error: ComparisonError) -> Self {
        match error {
            ComparisonError::Remote(error) => error.into(),
            ComparisonError::Refused(error) => error.into(),
        }
    }
}

impl From<RemoteError> for Failure {
    fn from(error: RemoteError) -> Self {
        if let Some(refusal) = unsafe_to(&error).or_else(|| home::elsewhere(&error)) {
            return Self::Failed(Some(refusal));
        }
        let code = match &error {
            RemoteError::Refused {
                reason: Reason::Job { fault, .. },
                ..
            } => fault.code.to_string(),
            RemoteError::Refused { reason, .. } => format!("R{}", reason.code()),
            RemoteError::Version(_) => "R3".to_owned(),
            _ => return Self::Failed(Some(error.to_string())),
        };
        let remedy = explain::entry(&code).map_or("", |entry| entry.remedy);
        Self::Failed(Some(format!(
            "{error}\n  help: {remedy}\n        cargo sim explain {code}"
        )))
    }
}

/// The text of a refusal for safety, with its remedy.
fn unsafe_to(error: &RemoteError) -> Option<String> {
    let RemoteError::Refused {
        request,
        reason: Reason::Unsafe { fault },
    } = error
    else {
        return None;
    };
    let (what, remedy) = explain::fault(Fault::new(fault.kind()?, fault.value));
    let code = fault.code;
    Some(format!(
        "the board refused {request}: {what}\n  help: {remedy}\n        cargo sim explain {code}"
    ))
}

impl From<QemuError> for Failure {
    fn from(error: QemuError) -> Self {
        match error {
            QemuError::Missing => {
                Self::input(error.to_string(), "install it, or run the job with `simulate`")
            }
            QemuError::Firmware(_) | QemuError::Plugin(_) | QemuError::Start(_) => {
                Self::Failed(Some(error.to_string()))
            }
        }
    }
}

impl From<ChipError> for Failure {
    fn from(error: ChipError) -> Self {
        let remedy = match &error {
            ChipError::Unavailable(_, cause) if programs::checkout().is_some() => cause.remedy(),
            ChipError::Unavailable(..) => {
                "run it in a checkout of the sources, where the image can be built, or run the job with `simulate`"
            }
            ChipError::Start(_) => return Self::Failed(Some(error.to_string())),
        };
        Self::Failed(Some(format!("{error}\n  help: {remedy}")))
    }
}
