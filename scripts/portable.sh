#!/usr/bin/env bash
# Checks that interp-core builds for cores without an FPU or DSP instructions, and for other architectures.
# A target that is not installed is added with rustup. Where that fails, the script fails if the toolchains' server answers; without
# a network it goes on, and says which targets it did not check.
set -euo pipefail
cd "$(dirname "$0")/.."

targets=(
    thumbv6m-none-eabi          # Cortex-M0, M0+: no FPU, no long multiplication
    thumbv7m-none-eabi          # Cortex-M3: no FPU, no DSP
    thumbv7em-none-eabi         # Cortex-M4, M7 without using an FPU
    thumbv7em-none-eabihf       # Cortex-M4F, M7F: the reference
    thumbv8m.main-none-eabihf   # Cortex-M33, M35P
    riscv32imc-unknown-none-elf # RISC-V without floating point
    wasm32-unknown-unknown      # a page in a browser
)

# Whether the toolchains' server answers: `rustup check` ends with 0, or with 100 where it found updates.
reachable() {
    local status=0
    timeout 60 rustup check >/dev/null 2>&1 || status=$?
    [ "$status" -eq 0 ] || [ "$status" -eq 100 ]
}

checked=()
missing=()
for target in "${targets[@]}"; do
    if ! rustup target list --installed | grep -qx "$target"; then
        echo "interp-core: adding the target $target"
        if ! timeout 300 rustup target add "$target"; then
            if reachable; then
                echo "interp-core: $target cannot be added, although the server answers" >&2
                exit 1
            fi
            missing+=("$target")
            continue
        fi
    fi
    cargo check --quiet -p interp-core --target "$target" --target-dir target/portable
    checked+=("$target")
done

echo "interp-core builds for: ${checked[*]:-none}"
if [ "${#missing[@]}" -gt 0 ]; then
    echo "interp-core NOT CHECKED, no network to add the target: ${missing[*]}"
fi
