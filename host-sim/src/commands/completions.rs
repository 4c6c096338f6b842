//! `completions`: what makes a shell complete `cargo sim`, or `isofeed` where that is installed.
//!
//! `cargo sim` is an alias of cargo's, so the shell asks cargo's completion about it, which knows nothing of our commands. The script
//! therefore defines completions for a command of the name `cargo_sim`, which need not exist, and puts itself in front of cargo's own:
//! behind `cargo sim` it asks the former, everywhere else what was there before.

use clap::{Args, ValueEnum};
use clap_complete::Shell;
use programs::Place;

use super::Result;
use super::out::say_part;

/// The name that the completions are made for; with a hyphen, clap_complete 4.6 writes names for bash that do not fit each other.
const NAME: &str = "cargo_sim";

/// Shells whose hook was tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Hooked {
    Bash,
    Zsh,
    Fish,
}

/// Writes a script that makes your shell complete `cargo sim`; other completions stay.
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
    // An installed tool is a program: it needs no hook.
    let (name, hook) = match programs::place() {
        Place::Installed(_) => (programs::command_name(), ""),
        Place::Checkout(_) | Place::Nowhere => (NAME, hook),
    };
    let mut command = super::arguments().name(name).bin_name(name);
    clap_complete::generate(shell, &mut command, name, &mut script);
    say_part!("{}\n{hook}", String::from_utf8_lossy(&script));
    Ok(())
}
