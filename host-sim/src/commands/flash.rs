//! `flash`: writes the firmware into the flash of a board by a debug probe, or an image for the board's boot loader or the chip's own.

mod loader;

use std::path::{Path, PathBuf};
use std::time::Instant;

use boards::{BOARDS, Board};
use clap::Args;
use indicatif::ProgressBar;
use serde_json::json;

use super::out::{complain, say};
use super::{Failure, Result, progress, spinner};
use crate::probe::{self, Event, Image, ProbeError, Problem, Program, Request, Target, Work};
use programs::{Part, image_remedy};

/// Writes the firmware into a board's flash by a debug probe, compares what was written, and starts it. Without a probe: by a card (--sd) or by USB (--dfu).
///
/// Builds the firmware first if it has changed. Switch off the power of the drives before: while the chip is being written, the state
/// of its pins is undefined. docs/bring-up.md describes the wiring.
///
/// Example: cargo sim flash --board skr-pro
/// Example: cargo sim flash --board skr-pro --sd /media/card
/// Example: cargo sim flash --board stm32f405 --dfu
/// Example: cargo sim flash --board stm32f405 --chip STM32F407VETx --probe 0483:3748
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    #[command(flatten)]
    pub(super) place: BoardArguments,
    /// Compares only, with the image for a probe and with that for the board's own loader: writes nothing, and does not interrupt the running firmware.
    #[arg(long)]
    verify: bool,
    /// Writes the image for the board's own boot loader into this folder, the root of a card.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["verify", "probe", "chip", "dfu", "dfu_file"])]
    sd: Option<PathBuf>,
    /// Writes the flash by USB, through the loader in the chip's ROM. Needs dfu-util.
    #[arg(long, conflicts_with_all = ["verify", "probe", "chip", "dfu_file"])]
    dfu: bool,
    /// Writes the image as a DfuSe file, for another program that talks to the loader in the chip's ROM.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["verify", "probe", "chip"])]
    dfu_file: Option<PathBuf>,
    /// Overwrites an existing file of --sd or --dfu-file.
    #[arg(long)]
    force: bool,
    /// Prints one JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
}

/// The board, its chip, the probe, and the image.
#[derive(Debug, Args)]
pub(super) struct BoardArguments {
    /// The board.
    #[arg(long, value_name = "BOARD", value_parser = board_parser(), default_value = "stm32f405")]
    board: String,
    /// The chip, if it differs from the board's default; a name of probe-rs.
    #[arg(long, value_name = "NAME")]
    chip: Option<String>,
    /// The debug probe, if several are connected: VID:PID or VID:PID:SERIAL, hexadecimal.
    #[arg(long, value_name = "SELECTOR")]
    probe: Option<String>,
    /// An ELF file of the firmware, instead of building it.
    #[arg(long, value_name = "ELF")]
    pub(super) image: Option<PathBuf>,
}

pub(super) fn board_parser() -> clap::builder::PossibleValuesParser {
    BOARDS
        .map(|board| clap::builder::PossibleValue::new(board.id).help(board.name))
        .into()
}

impl From<ProbeError> for Failure {
    fn from(error: ProbeError) -> Self {
        match error {
            // Errors in command-line arguments.
            ProbeError::Problem(
                problem @ (Problem::BadSelector(_)
                | Problem::UnknownChip(_)
                | Problem::BadImage(_)
                | Problem::SeveralProbes(_)),
            ) => Self::input(probe::sentence(&problem), probe::remedy(&problem)),
            ProbeError::Problem(problem) => Self::Failed(Some(format!(
                "{}\n  help: {}",
                probe::sentence(&problem),
                probe::remedy(&problem)
            ))),
            ProbeError::Unavailable(cause) => Self::Failed(Some(format!(
                "there is no program that talks to debug probes: {cause}\n  help: {}",
                cause.remedy()
            ))),
            error @ ProbeError::Program(_) => {
                Self::Failed(Some(format!("{error}\n  help: please report it")))
            }
        }
    }
}

/// The board of this name, which the command line has checked.
pub(super) fn board_of(id: &str) -> &'static Board {
    BOARDS
        .into_iter()
        .find(|board| board.id == id)
        .unwrap_or(BOARDS[0])
}

impl BoardArguments {
    pub(super) fn board(&self) -> &'static Board {
        board_of(&self.board)
    }

    /// Looks for the probe, before the build of the firmware, which takes minutes.
    pub(super) fn find(&self, program: &Program) -> Result<String> {
        let mut found = String::new();
        let request = Request::Find {
            probe: self.probe.clone(),
        };
        program.run(&request, None, |event| {
            if let Event::Probe { name } = event {
                found.clone_from(name);
            }
        })?;
        Ok(found)
    }

    /// The image: the one given, or the board's, which is built.
    pub(super) fn image(&self) -> Result<PathBuf> {
        self.image_of(Part::BoardImage(self.board()))
    }

    /// The same for an image of another kind.
    fn image_of(&self, part: Part) -> Result<PathBuf> {
        let Some(image) = &self.image else {
            let bar = spinner("building the firmware");
            let image = programs::find(part);
            bar.finish_and_clear();
            return image.map_err(|error| {
                let remedy = error.remedy();
                Failure::Failed(Some(format!("there is no firmware: {error}\n  help: {remedy}")))
            });
        };
        if !image.is_file() {
            return Err(Failure::input(
                format!("there is no image {}", image.display()),
                image_remedy(part),
            ));
        }
        Ok(image.clone())
    }

    /// Checks the image given, if one is, before the search for a probe.
    pub(super) fn check_image_in_chip(&self) -> Result<()> {
        let given = self.image.is_some().then(|| self.image()).transpose()?;
        given.map_or(Ok(()), |image| {
            load(&image, self.board(), Image::check_in_chip).map(|_| ())
        })
    }

    /// Calls `read` with the image that the chip holds: the one given; else the board's, or the one for its loader, whichever is there. Returns that one.
    pub(super) fn with_image_in_chip(
        &self,
        mut read: impl FnMut(Target) -> std::result::Result<(), ProbeError>,
    ) -> Result<(PathBuf, Image)> {
        let board = self.board();
        let has_two = self.image.is_none() && board.loader.is_some();
        let of_card = has_two.then_some(Part::LoaderImage(board));
        in_chip(Part::BoardImage(board), of_card, |part| {
            let path = self.image_of(part)?;
            let image = load(&path, board, Image::check_in_chip)?;
            Ok(read(self.target(&path)).map(|()| (path, image)))
        })
    }

    pub(super) fn target(&self, image: &Path) -> Target {
        let chip = self.board().chip;
        Target {
            probe: self.probe.clone(),
            chip: self.chip.clone().unwrap_or_else(|| chip.name.to_owned()),
            device_id: chip.device_id,
            image: image.to_owned(),
        }
    }
}

/// The program that talks to probes.
pub(super) fn program() -> Result<Program> {
    if Program::needs_build() {
        complain!("building the program that talks to debug probes (once, some minutes)");
    }
    Ok(Program::find()?)
}

/// A check of an image for a board.
type Check = fn(&Image, &Board) -> std::result::Result<(), String>;

/// Reads an image, and makes sure that it is one for this board and fits its flash.
fn load(path: &Path, board: &'static Board, check: Check) -> Result<Image> {
    let refused = |why: String| {
        Failure::input(
            format!("{}: {why}", path.display()),
            image_remedy(Part::BoardImage(board)),
        )
    };
    let image = Image::load(path).map_err(refused)?;
    check(&image, board).map_err(refused)?;
    Ok(image)
}

/// Calls `read` with an image, and where the chip holds another one, with the other.
fn in_chip<T>(
    image: Part,
    other: Option<Part>,
    mut read: impl FnMut(Part) -> Result<std::result::Result<T, ProbeError>>,
) -> Result<T> {
    match (read(image)?, other) {
        (Err(ProbeError::Problem(Problem::Differs(_))), Some(other)) => Ok(read(other)??),
        (outcome, _) => Ok(outcome?),
    }
}

/// One progress bar per kind of work.
pub(super) struct Bars(Option<(Work, ProgressBar)>);

impl Bars {
    pub(super) fn new() -> Self {
        Self(None)
    }

    pub(super) fn show(&mut self, work: Work, done: u64, total: u64) {
        let bar = match &self.0 {
            Some((shown, bar)) if *shown == work => bar,
            _ => {
                self.end();
                let what = match work {
                    Work::Erase => "erasing",
                    Work::Write => "writing",
                    Work::Compare => "comparing",
                };
                &self.0.insert((work, progress(total, what))).1
            }
        };
        bar.set_position(done);
    }

    pub(super) fn end(&mut self) {
        if let Some((_, bar)) = self.0.take() {
            bar.finish_and_clear();
        }
    }
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let place = &arguments.place;
    let board = place.board();
    if arguments.sd.is_some() || arguments.dfu || arguments.dfu_file.is_some() {
        return loader::command(arguments);
    }
    // First the checks that need no probe, then those that need no firmware.
    if arguments.verify {
        place.check_image_in_chip()?;
    } else if place.image.is_some() {
        load(&place.image()?, board, Image::check_for)?;
    }
    let program = program()?;
    let found = place.find(&program)?;
    let mut begun = Instant::now();
    let mut run = |request: &Request| {
        begun = Instant::now();
        let mut bars = Bars::new();
        let outcome = program.run(request, None, |event| {
            if let Event::Progress { work, done, total } = event {
                bars.show(*work, *done, *total);
            }
        });
        bars.end();
        outcome
    };
    let (path, image) = if arguments.verify {
        place.with_image_in_chip(|target| run(&Request::Compare(target)))?
    } else {
        let path = place.image()?;
        let image = load(&path, board, Image::check_for)?;
        run(&Request::Flash(place.target(&path)))?;
        (path, image)
    };
    let seconds = begun.elapsed().as_secs_f64();
    let chip = place.target(&path).chip;
    if arguments.json {
        say!(
            "{}",
            json!({
                "board": board.id,
                "chip": chip,
                "probe": found,
                "image": path,
                "bytes": image.bytes(),
                "written": !arguments.verify,
                "same": true,
                "seconds": seconds,
            })
        );
        return Ok(());
    }
    let done = if arguments.verify {
        "the chip holds this image"
    } else {
        "written, compared, started"
    };
    say!(
        "{}: {done}: {} bytes in {seconds:.1} s",
        board.name,
        image.bytes()
    );
    say!("  chip:  {chip}");
    say!("  probe: {found}");
    if !arguments.verify {
        say!("  next:  cargo sim log --board {}", board.id);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use boards::SKR_PRO;

    /// The image for a probe is compared first. The card's is tried, and built, where flash differs from that alone.
    #[test]
    fn the_cards_image_is_tried_where_the_chip_holds_no_other() {
        type Outcome = std::result::Result<u8, ProbeError>;
        let (of_probe, of_card) = (Part::BoardImage(&SKR_PRO), Part::LoaderImage(&SKR_PRO));
        let differs = |address| Err(ProbeError::Problem(Problem::Differs(address)));
        let gone = || Err(ProbeError::Problem(Problem::Gone("unplugged".to_owned())));
        let tried = |probe: Outcome, card: Outcome| {
            let (mut probe, mut card) = (Some(probe), Some(card));
            let outcome = in_chip(of_probe, Some(of_card), |image| {
                let outcome = match image {
                    Part::LoaderImage(_) => card.take(),
                    _ => probe.take(),
                };
                Ok(outcome.expect("each image is tried once"))
            });
            let said = outcome.map_err(|failure| match failure {
                Failure::Failed(Some(said)) => said,
                other => panic!("{other:?}"),
            });
            (said, card.is_none())
        };
        assert_eq!(tried(Ok(1), Ok(2)), (Ok(1), false));
        assert_eq!(tried(differs(0x0800_0000), Ok(2)), (Ok(2), true));
        let (said, has_tried_the_card) = tried(gone(), Ok(2));
        assert!(said.unwrap_err().contains("unplugged") && !has_tried_the_card);
        let (said, _) = tried(differs(0x0800_0000), differs(0x0800_9000));
        let said = said.unwrap_err();
        assert!(said.contains("0x08009000") && said.contains("--sd DIR"), "{said}");
    }
}
