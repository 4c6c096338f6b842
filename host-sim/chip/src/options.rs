//! The command line.

use std::io::BufRead;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use clap::Parser;

use crate::machine::Machine;

/// Executes the image that would be flashed to an STM32F405/407, unchanged, on models of the chip. Ends with --ms, or with its standard input, of which each line is
/// an event: one of --at, whose pulses count from now on, or WHAT alone, which happens at once.
///
/// Inputs of the board's table are closed to ground unless an event opens them.
#[derive(Clone, Debug, Parser)]
#[command(version)]
pub(crate) struct Options {
    /// The image: an ELF file of the firmware.
    pub(crate) image: PathBuf,
    /// The serial line: a link to a pseudo-terminal is made here, to be opened like a serial port.
    #[arg(long, value_name = "LINK")]
    pub(crate) pty: Option<PathBuf>,
    /// As fast as it goes, instead of in real time: what waits for a host should then wait for ever.
    #[arg(long)]
    pub(crate) fast: bool,
    /// Time after which the program ends, milliseconds of the chip's time.
    #[arg(long, value_name = "MS")]
    pub(crate) ms: Option<f64>,
    /// Phase of the host's bytes.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// An event: MS:WHAT after power-on, motion+MS:WHAT after the first step pulse, or pulses+N:WHAT with the N-th pulse of a machine's carriages. WHAT is an input that opens (emergency-stop, drive-fault,
    /// x-min to z-max, start), an input that closes (x-min=closed), door, at-speed, stall (a machine's spindle falls below its speed), hang, fault, brown-out, or power=LAG,HOLD:
    /// the drives let go, LAG ms later the voltage is low, and HOLD ms after that the chip is without supply, which comes back.
    #[arg(long, value_name = "EVENT")]
    pub(crate) at: Vec<String>,
    /// Every change of a port's outputs goes to this file: 16 bytes each, little end first: cycle (8), port, by DMA, levels (2), outputs (2), 0 (2).
    #[arg(long, value_name = "FILE")]
    pub(crate) edges: Option<PathBuf>,
    /// Every step of the machine's carriages goes to this file: 20 bytes each, little end first: cycle (8), x, y, z in steps (4 each).
    #[arg(long, value_name = "FILE")]
    pub(crate) track: Option<PathBuf>,
    /// What happened, as JSON, goes to this file in the end.
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// The crystal does not oscillate.
    #[arg(long)]
    pub(crate) no_crystal: bool,
    /// The crystal, MHz.
    #[arg(long, default_value_t = 8.0)]
    pub(crate) hse_mhz: f64,
    /// The watchdog's clock, Hz: 17 000 to 47 000.
    #[arg(long, default_value_t = 32_000.0)]
    pub(crate) lsi_hz: f64,
    /// The supply fails in every N-th word or sector that the program writes or erases in flash, and comes back at once.
    #[arg(long, value_name = "N")]
    pub(crate) cut_flash_every: Option<u64>,
    /// The supply fails in every N-th sector that the program erases, and comes back at once.
    #[arg(long, value_name = "N")]
    pub(crate) cut_erase_every: Option<u64>,
    /// A machine around the board: `key=value;..` with start, lower, upper (mm, three numbers each: carriages and switches), steps (per mm), plate (mm); stuck, never
    /// (an input), swap (two inputs), bounce (periods), reverse (axes), spindle (ms to its speed, which its contact reports).
    #[arg(long, value_name = "SPEC", value_parser = Machine::parse)]
    pub(crate) machine: Option<Machine>,
    /// Says what happens as it does.
    #[arg(short, long)]
    pub(crate) verbose: bool,
    #[arg(skip)]
    end: End,
    #[arg(skip)]
    typed: Typed,
}

/// Set when standard input has ended.
#[derive(Clone, Debug, Default)]
struct End(Arc<AtomicBool>);

/// Lines of standard input that are not executed yet.
#[derive(Clone, Debug, Default)]
struct Typed(Arc<Mutex<Vec<String>>>);

impl Options {
    /// Begins to watch standard input: each line is an event that happens at once, and its end is this program's.
    pub(crate) fn watch_input(&self) {
        let (end, typed) = (self.end.0.clone(), self.typed.0.clone());
        std::thread::spawn(move || {
            for line in std::io::stdin().lock().lines().map_while(Result::ok) {
                if let Ok(mut typed) = typed.lock() {
                    typed.push(line.trim().to_owned());
                }
            }
            end.store(true, Ordering::Relaxed);
        });
    }

    /// The events typed since the last call.
    pub(crate) fn typed(&self) -> Vec<String> {
        self.typed
            .0
            .lock()
            .map(|mut lines| std::mem::take(&mut *lines))
            .unwrap_or_default()
    }

    /// Whether standard input has ended.
    pub(crate) fn is_over(&self) -> bool {
        self.end.0.load(Ordering::Relaxed)
    }
}
