//! A board behind a serial port.

use std::io::{Error, ErrorKind};
use std::time::Duration;

use super::{RemoteError, Stream};

/// Baud rate of the firmware's link (USART1, 8N1).
pub const BAUD: u32 = 921_600;

/// An open port: whoever is behind it may be gone unseen.
impl Stream for Box<dyn serialport::SerialPort> {}

/// Opens the port.
///
/// # Errors
/// The port does not exist, or may not be opened.
pub fn open(name: &str) -> Result<Box<dyn Stream>, RemoteError> {
    let port = serialport::new(name, BAUD)
        .timeout(Duration::from_millis(20))
        .open()
        .map_err(|error| match error.kind {
            // Its word for a port that is locked.
            serialport::ErrorKind::NoDevice => {
                Error::new(ErrorKind::ResourceBusy, "another program has the port open")
            }
            _ => error.into(),
        })?;
    Ok(Box::new(port))
}
