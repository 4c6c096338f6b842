//! The programs and images: how Cargo builds each, where it then is, and where an installation has it.

use boards::Board;

use crate::place::{LIBEXEC, SHARE};

/// Target of the firmware.
const BOARD_TARGET: &str = "thumbv7em-none-eabihf";

/// A program or an image that is built apart from the tool.
#[derive(Clone, Copy, Debug)]
pub enum Part {
    /// Reads CAD files; not optimised.
    CadReader,
    /// Reads CAD files; optimised: takes longer to build, and reads large files sooner. Only installed, never used in a checkout.
    FastCadReader,
    /// Talks to debug probes.
    DebugProbe,
    /// QEMU's plugin that counts cycles.
    CyclePlugin,
    /// Executes a board's image on models of its chip. For developers: an installation does not have it.
    ChipEmulator,
    /// The firmware for QEMU.
    QemuImage,
    /// The firmware for a board.
    BoardImage(&'static Board),
    /// The firmware for a board's boot loader; the board's own image where it has none.
    LoaderImage(&'static Board),
}

impl Part {
    /// What an installation has, with this reader of CAD files.
    #[must_use]
    pub fn installation(reader: Self) -> Vec<Self> {
        let has_loader = |board: &&'static Board| board.loader.is_some();
        let for_loaders = boards::BOARDS
            .into_iter()
            .filter(has_loader)
            .map(Self::LoaderImage);
        let images = boards::BOARDS
            .into_iter()
            .map(Self::BoardImage)
            .chain(for_loaders);
        [reader, Self::DebugProbe, Self::CyclePlugin, Self::QemuImage]
            .into_iter()
            .chain(images)
            .collect()
    }

    /// For an image: Cargo's alias that builds it, and the folder in `target/`.
    fn image(self) -> Option<(&'static str, &'static str)> {
        match self {
            Self::QemuImage => Some(("fw-qemu", "qemu")),
            Self::BoardImage(board) => Some(board.build),
            Self::LoaderImage(board) => Some(board.loader.map_or(board.build, |loader| loader.build)),
            Self::CadReader
            | Self::FastCadReader
            | Self::DebugProbe
            | Self::CyclePlugin
            | Self::ChipEmulator => None,
        }
    }

    /// For a program: its package, Cargo's profile, and the file that is built.
    fn program(self) -> Option<(&'static str, &'static str, &'static str)> {
        match self {
            Self::CadReader => Some(("cad-reader", "plain", "cad-reader")),
            Self::FastCadReader => Some(("cad-reader", "cad", "cad-reader")),
            Self::DebugProbe => Some(("debug-probe", "plain", "debug-probe")),
            Self::CyclePlugin => Some(("cycle-plugin", "release", "libcycle_plugin.so")),
            Self::ChipEmulator => Some(("chip", "dev", "chip")),
            Self::QemuImage | Self::BoardImage(_) | Self::LoaderImage(_) => None,
        }
    }

    /// Cargo's alias that builds it; none for a program.
    pub(crate) fn alias(self) -> Option<&'static str> {
        self.image().map(|(alias, _)| alias)
    }

    /// Cargo's arguments that build it.
    pub(crate) fn build(self) -> Vec<String> {
        let words: Vec<&str> = match (self.image(), self.program()) {
            (Some((alias, _)), _) => vec![alias, "--quiet", "--locked"],
            // By its name among the default members: with -p, features of its dependencies would differ from those that the tests use, and
            // all of them would be built a second time.
            (None, Some((_, "dev", file))) => vec!["build", "--quiet", "--locked", "--bin", file],
            (None, Some((package, profile, _))) => {
                vec![
                    "build",
                    "--quiet",
                    "--locked",
                    "--profile",
                    profile,
                    "-p",
                    package,
                ]
            }
            (None, None) => Vec::new(),
        };
        let folder = self.program().map(|_| ["--target-dir".to_owned(), self.folder()]);
        words
            .into_iter()
            .map(str::to_owned)
            .chain(folder.into_iter().flatten())
            .collect()
    }

    /// The folder of a checkout that it is built in: one each, so that no build overwrites another's file.
    fn folder(self) -> String {
        let name = match self {
            Self::CadReader | Self::FastCadReader => "cad-reader",
            Self::DebugProbe => "debug-probe",
            Self::CyclePlugin => "plugin",
            // Beside the tests, which share its dependencies.
            Self::ChipEmulator => return "target".to_owned(),
            Self::QemuImage | Self::BoardImage(_) | Self::LoaderImage(_) => {
                self.image().unwrap_or_default().1
            }
        };
        format!("target/{name}")
    }

    /// The file in a checkout.
    #[must_use]
    pub fn built(self) -> String {
        let folder = self.folder();
        match self.program() {
            Some((_, "dev", file)) => format!("{folder}/debug/{file}"),
            Some((_, profile, file)) => format!("{folder}/{profile}/{file}"),
            None => format!("{folder}/{BOARD_TARGET}/release/firmware"),
        }
    }

    /// The file in an installation, from its prefix.
    #[must_use]
    pub fn installed(self) -> String {
        match self {
            Self::QemuImage => format!("{SHARE}/images/qemu.elf"),
            Self::BoardImage(board) => format!("{SHARE}/images/{}.elf", board.id),
            Self::LoaderImage(board) => format!("{SHARE}/images/{}-card.elf", board.id),
            Self::CadReader
            | Self::FastCadReader
            | Self::DebugProbe
            | Self::CyclePlugin
            | Self::ChipEmulator => {
                let file = self.program().map_or("", |(_, _, file)| file);
                format!("{LIBEXEC}/{file}")
            }
        }
    }
}
