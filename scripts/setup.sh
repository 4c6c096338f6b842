# shellcheck shell=bash
# What ./demo and ./check need, brought in where it is missing: for Debian and Ubuntu with git and rustup.
# To be sourced in the repository's root. Says one line for each thing that it brings; silent where nothing is missing.

FLIP_LINK_VERSION=0.1.12
CARGO_DENY_VERSION=0.20.2
BOARD_TARGET=thumbv7em-none-eabihf

# Flags from outside would replace those that the board's images are linked with.
unset RUSTFLAGS CARGO_ENCODED_RUSTFLAGS CARGO_BUILD_TARGET CARGO_BUILD_RUSTFLAGS

say() { printf '%s\n' "-- $*"; }

die() {
    printf '%s\n' "error: $1" >&2
    exit 1
}

as_root() {
    if [ "$(id -u)" -eq 0 ]; then
        "$@"
    elif command -v sudo > /dev/null; then
        sudo "$@"
    else
        die "this needs root, and there is no sudo: $*"
    fi
}

# need_program PROGRAM PACKAGE
need_program() {
    if command -v "$1" > /dev/null; then return; fi
    command -v apt-get > /dev/null || die "$1 is missing; install it (Debian and Ubuntu have it in the package $2)"
    say "installing $2, for $1"
    as_root apt-get update -qq
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$2" > /dev/null
    command -v "$1" > /dev/null || die "$2 was installed, but there is no $1"
}

# need_tool CRATE VERSION
need_tool() {
    if command -v "$1" > /dev/null; then return; fi
    say "building $1 $2 (once)"
    cargo install --quiet --locked "$1" --version "$2"
}

need_toolchain() {
    # Installed by hand, rustup may not be on the path of a shell that is not interactive.
    export PATH="${CARGO_HOME:-$HOME/.cargo}/bin:$PATH"
    command -v rustup > /dev/null || die "rustup is missing; it is described at https://rustup.rs"
    local channel sysroot
    channel=$(sed -n 's/^channel = "\(.*\)"$/\1/p' rust-toolchain.toml)
    if sysroot=$(rustup run "$channel" rustc --print sysroot 2> /dev/null) &&
        [ -d "$sysroot/lib/rustlib/$BOARD_TARGET" ] && [ -x "$sysroot/bin/cargo-clippy" ] && [ -x "$sysroot/bin/rustfmt" ]; then
        return
    fi
    say "installing Rust $channel with $BOARD_TARGET"
    rustup toolchain install --no-self-update > /dev/null
}

# What every build needs.
setup() {
    need_toolchain
    need_program cc build-essential
    need_program qemu-system-arm qemu-system-arm
    need_tool flip-link "$FLIP_LINK_VERSION"
}

# What only the check needs.
setup_check() {
    need_program arm-none-eabi-objdump binutils-arm-none-eabi
    need_tool cargo-deny "$CARGO_DENY_VERSION"
}
