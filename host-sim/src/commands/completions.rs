//! `completions`: writes a shell script that completes `cargo sim`.
//!
//! `cargo sim` is a cargo alias, so the shell calls cargo's completion, which does not list the commands of an alias. The script therefore
//! defines completions for a command named `cargo_sim`, which need not exist, and wraps cargo's completion: after `cargo sim` it calls the
//! former, otherwise the original.

use clap::{Args, CommandFactory, ValueEnum};
use clap_complete::Shell;

use super::out::say_part;
use super::{Cli, Result};

/// Command name in the completions. With a hyphen, clap_complete 4.6 writes inconsistent function names for bash.
const NAME: &str = "cargo_sim";

/// Supported shells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum SupportedShell {
    Bash,
    Zsh,
    Fish,
}

/// Writes a script that completes `cargo sim` in your shell; the completion of cargo itself remains.
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
    let mut command = Cli::command().name(NAME).bin_name(NAME);
    clap_complete::generate(shell, &mut command, NAME, &mut script);
    say_part!("{}\n{hook}", String::from_utf8_lossy(&script));
    Ok(())
}
