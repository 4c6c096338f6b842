#!/usr/bin/env bash
# Unpacks the archive of ./dist in a folder of its own, and uses it as a user does: without Cargo, without this checkout.
#
#   scripts/test_dist.sh           makes the archive of what the tests have built (./dist --as-tested), and tries that
#   scripts/test_dist.sh ARCHIVE   tries this one
set -euo pipefail
cd "$(dirname "$0")/.."
checkout=$PWD

if [ $# -eq 0 ]; then
    archive=$(./dist --as-tested)
    set -- "$archive"
fi
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
tar --extract --file "$1" --directory "$folder"
prefix=$(echo "$folder"/isofeed-*)
mkdir "$folder/home" "$folder/work"
failures=0

fail() {
    printf 'FAILED: %s\n' "$1" >&2
    failures=$((failures + 1))
}

# try CODE PATTERN ARGUMENT...: the installed tool exits with the code, and what it prints has the pattern in it.
try() {
    local code=$1 pattern=$2 status=0 printed
    shift 2
    printed=$(cd "$folder/work" && env -i PATH="${path:-/usr/bin:/bin}" HOME="$folder/home" "$prefix/bin/isofeed" "$@" 2>&1) || status=$?
    if [ "$status" -ne "$code" ]; then
        fail "isofeed $*: exit code $status, not $code"
    elif ! grep -q -e "$pattern" <<< "$printed"; then
        fail "isofeed $*: prints no \"$pattern\""
    elif grep -q -e 'cargo sim' -e "$checkout" <<< "$printed"; then
        fail "isofeed $*: speaks of Cargo or of the checkout"
    else
        return 0
    fi
    printf '%s\n' "$printed" | head -20 >&2
}

jobs=$prefix/share/isofeed/jobs

# From a CAD file over a verified job to the firmware.
try 0 'face' import "$jobs/cad/mouse.step" --list
try 0 'part.toml' import "$jobs/cad/mouse.step" --face 1 -o part.toml
try 0 'scallop' verify part.toml
try 0 'isofeed simulate' new -o first.toml
grep -q 'isofeed verify' "$folder/work/first.toml" || fail "a new job does not name the tool isofeed"
try 0 'digest' simulate "$jobs/torus.toml"
try 0 'bit for bit the same' run "$jobs/torus.toml" --qemu
try 0 'min' budget "$jobs/plate.toml" --ticks 2000

# Bad input, a failed run, a missing program.
try 2 'isofeed new' simulate nothing.toml
try 2 'STEP' import part.toml --list
sed 's/^radius_mm = 5$/radius_mm = 9/' "$jobs/torus.toml" > "$folder/work/large_ball.toml"
try 1 'isofeed explain 1' simulate large_ball.toml
try 2 'checkout' budget --bless
path=$folder try 2 'qemu-system-arm' run "$jobs/torus.toml" --qemu
mv "$prefix/libexec/isofeed/cad-reader" "$folder/cad-reader"
try 2 'unpack the whole archive' import "$jobs/cad/mouse.step" --list
mv "$folder/cad-reader" "$prefix/libexec/isofeed/cad-reader"

# The selector matches no probe, so that a board on this machine is not written; a missing program would be reported instead.
try 1 'no debug probe was found' flash --board skr-pro --probe 0000:0000:nowhere
try 0 'Usage: isofeed' --help
try 0 'Example: isofeed import' import --help
for shell in bash zsh fish; do try 0 'isofeed' completions "$shell"; done

bash -c 'source "$1" && complete -p isofeed' - "$prefix/share/bash-completion/completions/isofeed" > /dev/null ||
    fail "bash does not take the completions"
[ -s "$prefix/share/isofeed/LICENSES-OF-LIBRARIES.txt" ] || fail "the libraries' licences are missing"
for program in "$prefix/bin/isofeed" "$prefix"/libexec/isofeed/*; do
    if grep -q --text -F "$checkout" "$program"; then fail "$(basename "$program") has the checkout's path in it"; fi
done

[ "$failures" -eq 0 ]
printf 'the archive works: %s\n' "$(basename "$1")"
