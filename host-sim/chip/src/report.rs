//! The report as JSON: figures, complaints, registers.

use serde_json::{Value, json};

use crate::{chip::Chip, part::nvic, processor::Account, unicorn};

/// Registers that a program sets, as lines of text.
fn registers(chip: &Chip) -> Vec<String> {
    let mut all = chip.rcc.snapshot();
    for port in &chip.ports {
        all.extend(
            port.snapshot()
                .into_iter()
                .filter(|(name, _)| !name.ends_with("ODR")),
        );
    }
    for timer in [&chip.tim1, &chip.tim2, &chip.tim5] {
        all.extend(timer.snapshot());
    }
    all.extend(chip.dma.snapshot());
    all.extend(chip.usart.snapshot());
    all.extend(chip.watchdog.snapshot());
    all.extend(chip.nvic.snapshot());
    all.extend(chip.debug.snapshot());
    all.into_iter()
        .map(|(name, value)| format!("{name} = {value:#010x}"))
        .collect()
}

/// An interrupt's figures.
fn interrupt(chip: &Chip, line: usize) -> Value {
    let account = chip.nvic.account(line);
    json!({
        "count": account.count,
        "latency_max_cycles": account.latency_max,
        "latency_moving_max_cycles": account.latency_moving,
        "latency_mean_cycles": account.latency_sum as f64 / account.count.max(1) as f64,
        "longest_cycles": account.duration_max,
    })
}

/// The whole report.
pub(crate) fn of(chip: &Chip, account: &Account, seconds_spent: f64) -> Value {
    let hclk_hz = chip.world.hclk_hz();
    let now = chip.world.now;
    json!({
        "board": chip.board.id,
        "ms": chip.world.seconds(now) * 1e3,
        "cycles": now,
        "hclk_hz": hclk_hz,
        "wall_s": seconds_spent,
        "library": unicorn::version(),
        "complaints": chip.world.complaints,
        "complained": chip.world.complained,
        "notes": chip.world.notes,
        "events": chip.world.events.iter().map(|(cycle, what)| json!({"cycle": cycle, "what": what})).collect::<Vec<_>>(),
        "resets": chip.resets,
        "flash_operations": chip.flash.operations,
        "flash_erased": chip.flash.erased,
        "periods": chip.periods,
        "slots_from_cycle": chip.slots_from,
        "carriages_mm": chip.machine.as_ref().map(crate::machine::Machine::at_mm),
        "spindle_duty": chip.pwm.duty(),
        "spindle_duty_max": chip.pwm.most,
        "first_pulse_ms": chip.moved.map(|seconds| seconds * 1e3),
        "tim2": interrupt(chip, nvic::TIM2),
        "usart1": interrupt(chip, nvic::USART1),
        "exti0": interrupt(chip, nvic::EXTI0),
        "bytes_sent": chip.usart.sent,
        "bytes_received": chip.usart.received,
        "bytes_lost": chip.overruns + chip.usart.overruns,
        "bytes_lost_to_flash": chip.lost_to_flash + chip.usart.lost_to_flash,
        "bytes_unheard": chip.usart.unheard,
        "byte_wait_max_cycles": chip.usart.longest_wait,
        "slots_played": chip.dma.played,
        "watchdog_fed": chip.watchdog.fed,
        "watchdog_gap_max_ms": chip.watchdog.longest_gap as f64 / hclk_hz * 1e3,
        "frames": account.frames,
        "float_frames": account.float_frames,
        "hard_faults": account.hard_faults,
        "asleep": account.slept as f64 / now.max(1) as f64,
        "least_sp": account.least_sp,
        "registers": registers(chip),
    })
}
