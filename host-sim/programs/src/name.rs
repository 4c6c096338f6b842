//! What the tool is called: `cargo sim` in a checkout, `isofeed` where it is installed.

use std::borrow::Cow;

use crate::place::{Place, place};

/// The tool's command in a checkout: the name that the sources use in every help text and message.
const IN_CHECKOUT: &str = "cargo sim";
/// The tool's command where it is installed.
const INSTALLED: &str = "isofeed";

/// The command that started the tool.
#[must_use]
pub fn command_name() -> &'static str {
    match place() {
        Place::Installed(_) => INSTALLED,
        Place::Checkout(_) | Place::Nowhere => IN_CHECKOUT,
    }
}

/// A text that names the tool `cargo sim`, with the name that it has here.
#[must_use]
pub fn with_command_name(text: &str) -> Cow<'_, str> {
    named(text, command_name())
}

/// A text that names the tool `cargo sim`, with the name that it has where it is installed.
#[must_use]
pub fn installed_name(text: &str) -> Cow<'_, str> {
    named(text, INSTALLED)
}

pub(crate) fn named<'a>(text: &'a str, name: &str) -> Cow<'a, str> {
    if name == IN_CHECKOUT || !text.contains(IN_CHECKOUT) {
        Cow::Borrowed(text)
    } else {
        Cow::Owned(text.replace(IN_CHECKOUT, name))
    }
}
