#!/usr/bin/env bash
# Prints the licences of the libraries that are linked into the programs and images of the archive: names, sources, texts (each once).
set -euo pipefail
cd "$(dirname "$0")/.."

libraries() {
    local format='{p}|{l}|{r}'
    cargo tree --locked --offline --prefix none --edges normal --format "$format" \
        -p host-sim -p cad-reader -p debug-probe -p cycle-plugin
    cargo tree --locked --offline --prefix none --edges normal --format "$format" \
        -p firmware --target thumbv7em-none-eabihf --features board-skr-pro
}

listed=$(libraries | sed 's/ (\*)//; s/ (proc-macro)//' | grep -v -e ' (/' -e '^|' | sort -u)
printf 'Libraries in this installation, with their licences and sources:\n\n'
printf '%s\n' "$listed" | while IFS='|' read -r library licence source; do
    printf '%-40s %s  %s\n' "$library" "$licence" "$source"
done

# Many libraries carry the same text: each is printed once, under the names of all that carry it.
declare -A text_of names_of
while read -r library version; do
    for file in "${CARGO_HOME:-$HOME/.cargo}"/registry/src/*/"$library-${version#v}"/{LICENSE,LICENCE,COPYING,NOTICE,UNLICENSE}*; do
        [ -f "$file" ] || continue
        digest=$(md5sum < "$file")
        text_of[$digest]=$file
        names_of[$digest]+="$library "
    done
done < <(printf '%s\n' "$listed" | cut -d'|' -f1)
for digest in $(printf '%s\n' "${!text_of[@]}" | tr -d ' -' | sort); do
    printf '\n======== %s\n\n' "${names_of["$digest  -"]}"
    cat "${text_of["$digest  -"]}"
done
