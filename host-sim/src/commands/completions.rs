//! `completions`: what makes a shell complete `cargo sim`.
//!
//! `cargo sim` is an alias of cargo's, so the shell asks cargo's completion about it, which knows nothing of our commands. The script
//! therefore defines completions for a command of the name `cargo_sim`, which need not exist, and puts itself in front of cargo's own:
//! behind `cargo sim` it asks the former, everywhere else what was there before.

use clap::{Args, CommandFactory, ValueEnum};
use clap_complete::Shell;

use super::out::say_part;
use super::{Cli, Result};

/// The name that the completions are made for; with a hyphen, clap_complete 4.6 writes names for bash that do not fit each other.
const NAME: &str = "cargo_sim";

/// Shells whose hook was tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Hooked {
    Bash,
    Zsh,
    Fish,
}

/// Writes a script that makes your shell complete `cargo sim`; cargo's own completion stays.
///
/// Example: cargo sim completions bash > ~/.isofeed.bash   # then in ~/.bashrc: source ~/.isofeed.bash
/// Example: cargo sim completions zsh > ~/.isofeed.zsh     # then in ~/.zshrc, after compinit: source ~/.isofeed.zsh
/// Example: cargo sim completions fish > ~/.config/fish/conf.d/isofeed.fish
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// The shell.
    #[arg(value_enum)]
    shell: Hooked,
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let (shell, hook) = match arguments.shell {
        Hooked::Bash => (Shell::Bash, include_str!("completions/hook.bash")),
        Hooked::Zsh => (Shell::Zsh, include_str!("completions/hook.zsh")),
        Hooked::Fish => (Shell::Fish, include_str!("completions/hook.fish")),
    };
    let mut script = Vec::new();
    let mut command = Cli::command().name(NAME).bin_name(NAME);
    clap_complete::generate(shell, &mut command, NAME, &mut script);
    say_part!("{}\n{hook}", String::from_utf8_lossy(&script));
    Ok(())
}
