//! The proof that no panic can be reached from the sample task, the planning task and the task of a failing supply, made by the linker.
//!
//! This image has the firmware's tasks (`sample_task.rs`, `plan_task.rs`, `drivers/supply.rs` and `drivers/flash.rs`, the same files) under the same RTIC handlers, with minimal
//! code at the other ends of its queues, and a panic handler that calls an undefined function. If a
//! panic is reachable, the handler stays in the image, and the linker reports the undefined symbol. Flags,
//! profile and target are the firmware's; `tests/no_panic.rs` links it, and checks that linking fails with each of the features
//! `with-a-panic`, `with-a-panic-in-planning` and `with-a-panic-in-supply`. The image is never run.
//!
//! Limits of the proof: the compiler removes code that it can prove unreachable, so a check that cannot fail but
//! that the compiler cannot prove so counts as a panic. Processor faults and the other tasks are not covered.
#![no_std]
#![no_main]

use defmt as _;

/// What the drivers need of a board.
mod board {
    /// Clock of TIM2, as on the chip.
    pub(crate) const TIMER_HZ: u32 = 84_000_000;
}
mod drivers;
#[path = "../../src/events.rs"]
mod events;
#[path = "../../src/plan_task.rs"]
mod plan_task;
#[path = "../../src/sample_task.rs"]
mod sample_task;

#[rtic::app(device = stm32f4xx_hal::pac, peripherals = true)]
mod app {
    use core::hint::black_box;

    use controller::{
        machine::Instruction,
        realtime::RealTime,
        step_output::{Buffers, Pin, Port, Wiring},
    };
    use heapless::spsc::{Producer, Queue};
    use interp_core::{StepConfig, job::STORE_WORDS, steps::BUFFER_WORDS};
    use stm32f4xx_hal::pac;

    use crate::{
        drivers::{
            cycle_counter::CycleCounter,
            drive_enable::DriveEnable,
            flash::{self, FallingFlash},
            gpio::Ports,
            safety_inputs::SafetyInputs,
            sample_timer::SampleTimer,
            step_output::{StepDriver, StepSetup},
            supply::FallingRecord,
            watchdog::Watchdog,
        },
        events::{EventMemory, EventSource},
        plan_task,
        sample_task::{Guards, SampleTask},
    };

    /// One period in counts of the timers, as on the chip.
    const PERIOD_COUNTS: u32 = 84_000;

    /// A board with inputs on four ports.
    const BOARD: &boards::Board = &boards::SKR_PRO;

    const INPUTS: SafetyInputs<Ports> = SafetyInputs::new(Ports, BOARD.lines);
    const DRIVES: DriveEnable<Ports> = DriveEnable::new(Ports, BOARD, true);

    #[shared]
    struct Shared {
        real_time: RealTime<&'static mut [i32; STORE_WORDS]>,
        falling: FallingRecord<FallingFlash>,
    }

    #[local]
    struct Local {
        task: SampleTask,
        guards: Guards<Ports, Ports, pac::IWDG>,
        output: StepDriver,
        commands_in: Producer<'static, Instruction>,
        events_out: EventSource,
    }

    #[init(local = [
        store: [i32; STORE_WORDS] = [0; STORE_WORDS],
        slots: Buffers = [[0; BUFFER_WORDS]; 2],
        rest: u32 = 0,
        commands: Queue<Instruction, 8> = Queue::new(),
        events: EventMemory<64> = EventMemory::new(),
    ])]
    fn init(context: init::Context) -> (Shared, Local) {
        let counter = CycleCounter::new(context.core.DCB, context.core.DWT);
        let device = context.device;
        let wiring = Wiring {
            step_port: Port::B,
            step: [12, 13, 14],
            direction: [Pin(Port::C, 6), Pin(Port::C, 7), Pin(Port::C, 8)],
        };
        let setup = StepSetup {
            wiring,
            plus_is_high: 0b111,
            slot_counts: 168,
        };
        let (slots, rest) = (context.local.slots, context.local.rest);
        let output = StepDriver::new(device.TIM1, device.DMA2, setup, (slots, rest));
        let (_, _, falling) = flash::sectors(device.FLASH);
        let mut real_time = RealTime::with_store(context.local.store);
        if let Ok(steps) = StepConfig::DEFAULT.check() {
            real_time.set_step_pins(steps, wiring.step);
        }
        let timer = SampleTimer::new(device.TIM2, device.TIM5, PERIOD_COUNTS - 1, PERIOD_COUNTS);
        let guards = Guards {
            inputs: INPUTS,
            drives: DRIVES,
            watchdog: Watchdog::start(device.IWDG, 93),
        };
        let (commands_in, commands_out) = context.local.commands.split();
        let (events_in, events_out) = context.local.events.split();
        (
            Shared {
                real_time,
                falling: FallingRecord::new(falling),
            },
            Local {
                task: SampleTask::new(timer, counter, commands_out, events_in),
                guards,
                output,
                commands_in,
                events_out,
            },
        )
    }

    /// The firmware's sample task. The machine's state is opaque to the compiler, so it may be any state.
    #[task(binds = TIM2, priority = 2, shared = [real_time], local = [task, guards, output])]
    fn sample(mut context: sample::Context) {
        let sample::LocalResources {
            task, guards, output, ..
        } = context.local;
        context
            .shared
            .real_time
            .lock(|real_time| task.tick(real_time, guards, output));
        #[cfg(feature = "with-a-panic")]
        assert!(black_box(true), "the control");
    }

    /// The firmware's planning task.
    #[task(binds = EXTI0, priority = 1, shared = [real_time])]
    fn plan(mut context: plan::Context) {
        context.shared.real_time.lock(plan_task::plan);
        #[cfg(feature = "with-a-panic-in-planning")]
        assert!(black_box(true), "the control");
    }

    /// The firmware's task of a failing supply.
    #[task(binds = PVD, priority = 4, shared = [falling])]
    fn supply(mut context: supply::Context) {
        context
            .shared
            .falling
            .lock(|falling| falling.changed(black_box(true)));
        #[cfg(feature = "with-a-panic-in-supply")]
        assert!(black_box(true), "the control");
    }

    /// The other ends of the queues: any command may arrive, each event is read, and any record may be prepared.
    #[idle(shared = [real_time, falling], local = [commands_in, events_out])]
    fn idle(mut context: idle::Context) -> ! {
        loop {
            let command = black_box(Instruction::Run { ticks: 0 });
            let _ = context.local.commands_in.enqueue(command);
            let _ = context.local.events_out.drain(|event| {
                black_box(event);
            });
            context.shared.real_time.lock(|real_time| {
                black_box(real_time);
            });
            context.shared.falling.lock(|falling| {
                black_box(falling);
            });
        }
    }
}

#[panic_handler]
fn panic(_info: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: the function does not exist; an image that could call it does not link.
    #[allow(unsafe_code, reason = "a name for the linker to miss")]
    unsafe extern "C" {
        safe fn a_panic_can_be_reached_from_a_real_time_task() -> !;
    }
    a_panic_can_be_reached_from_a_real_time_task()
}
