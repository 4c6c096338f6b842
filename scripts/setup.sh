# shellcheck shell=bash
# Installs the programs that ./demo and ./check need and that are missing: for Debian and Ubuntu with git and rustup.
# Source it in the root of the repository. Prints one line per installed item, and nothing if all are present.

FLIP_LINK_VERSION=0.1.12
CARGO_DENY_VERSION=0.20.2
BOARD_TARGET=thumbv7em-none-eabihf

# These variables would override the link flags of the board images.
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

# LinuxCNC's stand-alone interpreter, unpacked into target/: an installation of the package would pull in a desktop.
need_rs274() {
    local place=target/rs274
    if command -v rs274 > /dev/null || [ -x $place/rs274 ]; then return; fi
    command -v apt-get > /dev/null || die "rs274 is missing; install it (Debian and Ubuntu have it in the package linuxcnc-uspace)"
    say "unpacking linuxcnc-uspace into $place, for rs274"
    if ! apt-cache show linuxcnc-uspace > /dev/null 2>&1; then as_root apt-get update -qq; fi
    rm -rf $place
    mkdir -p $place/packages $place/root
    local packages
    # The libraries of the interpreter and their dependencies, except for the C library, which the system has.
    packages=$(apt-cache depends linuxcnc-uspace | awk '$1 == "Depends:" && /libboost-python|libedit|libpython3|libtirpc/ { print $2 }' |
        grep -v '<' | xargs apt-cache depends --recurse --no-recommends --no-suggests --no-conflicts --no-breaks \
            --no-replaces --no-enhances | grep '^[a-z]' | grep -vE '^(libc6|libgcc-s1|gcc-.*|libcrypt1|debconf.*)(:|$)' | sort -u)
    # shellcheck disable=SC2086
    (cd $place/packages && apt-get download -qq linuxcnc-uspace $packages 2> /dev/null) || die "linuxcnc-uspace cannot be downloaded"
    local package
    for package in "$place"/packages/*.deb; do dpkg -x "$package" $place/root; done
    rm -rf $place/packages $place/root/usr/share $place/root/usr/include
    cat > $place/rs274 << 'END'
#!/bin/sh
root=$(cd "$(dirname "$0")/root" && pwd)
for folder in "$root"/usr/lib "$root"/usr/lib/*-linux-gnu* "$root"/lib/*-linux-gnu*; do
    if [ -d "$folder" ]; then LD_LIBRARY_PATH="$folder${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"; fi
done
export LD_LIBRARY_PATH PYTHONHOME="$root/usr" PYTHONPATH="$root/usr/lib/python3/dist-packages"
exec "$root/usr/bin/rs274" "$@"
END
    chmod +x $place/rs274
    # Runs a program of one block to check the unpacked interpreter, which writes its parameters into the working directory.
    (cd $place && : > empty.tbl && : > empty.var && printf 'G1X1F1\nM2\n' > probe.ngc &&
        HOME=$PWD ./rs274 -t empty.tbl -v empty.var -g probe.ngc < /dev/null 2> /dev/null | grep -q STRAIGHT_FEED) ||
        die "linuxcnc-uspace was unpacked into $place, but its rs274 does not run"
}

# A Chromium for the report's test: the first of the names that tests/report_page/browser.rs tries, if it runs.
need_browser() {
    local program version
    for program in ${CHROMIUM:+"$CHROMIUM"} chromium google-chrome google-chrome-stable chromium-browser; do
        # The stub of a snap exists but does not run; a snap runs but cannot read files in /tmp.
        if version=$("$program" --version 2> /dev/null) && [ "${version%snap*}" = "$version" ]; then return; fi
        if [ "$program" = "${CHROMIUM:-}" ]; then die "CHROMIUM=$CHROMIUM is no Chromium that runs"; fi
    done
    command -v apt-get > /dev/null || die "Chromium is missing; install it, or name it in the variable CHROMIUM"
    if ! apt-cache show chromium > /dev/null 2>&1; then as_root apt-get update -qq; fi
    case $(apt-cache policy chromium 2> /dev/null | awk '$1 == "Candidate:" { print $2 }') in
        '' | '(none)' | *snap*)
            die "Chromium is missing, and apt has it only as a snap here, which cannot read the tests' pages; install Google Chrome's \
package for this system, or name another Chromium in the variable CHROMIUM"
            ;;
    esac
    need_program chromium chromium
}

# The processor of host-sim/chip: a library that is loaded when it runs, and linked with nothing.
need_unicorn() {
    if ldconfig -p 2> /dev/null | grep -q 'libunicorn\.so'; then return; fi
    command -v apt-get > /dev/null || die "libunicorn is missing; install it (Debian and Ubuntu have it in the package libunicorn2)"
    say "installing libunicorn2"
    if ! apt-cache show libunicorn2 > /dev/null 2>&1; then as_root apt-get update -qq; fi
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends libunicorn2 > /dev/null
}

# need_tool CRATE VERSION: built without optimisation and without the crate's own link-time optimisation, in half the time: cargo-deny in 73 s of
# processor time instead of 160 s. They run for a second.
need_tool() {
    if command -v "$1" > /dev/null; then return; fi
    say "building $1 $2 (once)"
    CARGO_PROFILE_RELEASE_OPT_LEVEL=0 CARGO_PROFILE_RELEASE_LTO=off CARGO_PROFILE_RELEASE_CODEGEN_UNITS=4 \
        cargo install --quiet --locked "$1" --version "$2"
}

need_toolchain() {
    # A rustup installed by hand may not be on the path of a non-interactive shell.
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

# Requirements of every build.
setup() {
    need_toolchain
    need_program cc build-essential
    need_program qemu-system-arm qemu-system-arm
    need_tool flip-link "$FLIP_LINK_VERSION"
}

# Additional requirements of ./check, apart from cargo-deny, which it builds beside its other steps.
setup_check() {
    need_program arm-none-eabi-objdump binutils-arm-none-eabi
    need_rs274
    need_unicorn
    need_browser
}
