//! `completions`: what makes a shell complete `cargo sim`, or `isofeed` where that is installed.
//!
//! `cargo sim` is a cargo alias, so the shell calls cargo's completion, which does not list the commands of an alias. The script therefore
//! defines completions for a command named `cargo_sim`, which need not exist, and wraps cargo's completion: after `cargo sim` it calls the
//! former, otherwise the original.

use clap::{Args, ValueEnum};
use clap_complete::Shell;
use programs::Place;

use super::Result;
use super::out::say_part;

/// Command name in the completions. With a hyphen, clap_complete 4.6 writes inconsistent function names for bash.
const NAME: &str = "cargo_sim";

/// Supported shells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum SupportedShell {
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
    shell: SupportedShell,
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let (shell, hook) = match arguments.shell {
        SupportedShell::Bash => (Shell::Bash, include_str!("completions/hook.bash")),
        SupportedShell::Zsh => (Shell::Zsh, include_str!("completions/hook.zsh")),
        SupportedShell::Fish => (Shell::Fish, include_str!("completions/hook.fish")),
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
