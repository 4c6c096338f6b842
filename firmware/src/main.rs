//! The firmware: five tasks around the machine.
//!
//! ```text
//!  priority 4   supply    PVD, the voltage falls  the journal's record of it
//!  priority 3   receive   USART1, every byte      port ──► bytes
//!  priority 2   sample    TIM2, every period      commands ──► RealTime::tick ──► events
//!  priority 1   plan      EXTI0, after a sample   RealTime::plan
//!  priority 0   idle      when nothing else is    bytes ──► Link ──► commands;   events ──► Link ──► port
//! ```
//!
//! Tasks communicate through queues of fixed capacity with one writer and one reader. The
//! machine itself is shared by `sample`, which gets it without a lock, `plan`, which locks it for the planning of a period, and `idle`, which locks
//! it for one short call at a time ([`guarded_machine`]). The planning follows the sample that pended it, and takes up to 28 100 cycles (21 % of the period by the pessimistic model;
//! docs/limits.md), so that its lock delays a sample only where it is late, which is a fault. The record of a failing supply is shared by `supply` and `idle`, whose lock holds all tasks
//! off for a copy of 44 bytes; the machine's lock does not hold off `receive`. The tool path is computed in
//! `interp-core`; requests are handled in `controller`; board-specific code is in
//! [`board`].
#![no_std]
#![no_main]

mod board;
mod design_parameters;
mod drivers;
mod events;
mod guarded_machine;
mod plan_task;
mod sample_task;
mod watch;

use crate::{design_parameters::PERIOD_US, drivers::sample_timer::uptime_periods};

// The log's time stamp is that of the sample timer: it stands still where the timer does.
defmt::timestamp!("{=u64:us}", u64::from(uptime_periods()) * u64::from(PERIOD_US));

#[rtic::app(device = stm32f4xx_hal::pac, peripherals = true)]
mod app {
    use boards::{Line, Role};
    use controller::{
        jobs::JobStore, link::Link, machine::Instruction, realtime::RealTime, settings::Settings,
        step_output::Buffers,
    };
    use cortex_m::peripheral::NVIC;
    use heapless::spsc::{Consumer, Producer, Queue};
    use interp_core::steps::BUFFER_WORDS;
    use protocol::message::ResetCause;
    use stm32f4xx_hal::pac;

    use crate::{
        board::{self, BOARD},
        design_parameters::{
            COMMAND_PLACES, EVENT_PLACES, FLUSH_PERIODS, JOB_WORDS, PERIOD_COUNTS, RECEIVE_PLACES,
            SLOT_COUNTS, TICK_BUDGET_CYCLES, WATCHDOG_RELOAD,
        },
        drivers::{
            cycle_counter::CycleCounter,
            drive_enable::DriveEnable,
            gpio::{self, Output},
            safety_inputs::SafetyInputs,
            sample_timer::{SampleTimer, uptime_periods},
            serial::{self, Receiver, Transmitter, bytes_lost},
            status_led::StatusLed,
            step_output::{StepDriver, StepSetup},
            watchdog::Watchdog,
        },
        events::{EventMemory, EventSource},
        guarded_machine::{BoardFalling, BoardRealTime, GuardedMachine},
        plan_task,
        sample_task::{Guards, SampleTask},
        watch::Watch,
    };

    /// The status LED.
    const LED: Line = BOARD.line(Role::StatusLed);

    /// The board's safety inputs.
    const INPUTS: SafetyInputs<board::InputPorts> = SafetyInputs::new(board::InputPorts, BOARD.lines);

    /// Drive enables, spindle and coolant, initially off.
    const DRIVES: DriveEnable<gpio::Ports> = DriveEnable::new(gpio::Ports, BOARD, !board::TIME_IS_SIMULATED);

    #[shared]
    struct Shared {
        real_time: BoardRealTime,
        falling: BoardFalling,
    }

    #[local]
    struct Local {
        task: SampleTask,
        guards: Guards<board::InputPorts, gpio::Ports, pac::IWDG>,
        output: StepDriver,
        receiver: Receiver,
        transmitter: Transmitter,
        led: StatusLed<Output>,
        settings: Settings<board::SettingsFlash>,
        jobs: JobStore<board::JobFlash>,
        bytes_in: Producer<'static, u8>,
        bytes_out: Consumer<'static, u8>,
        commands_in: Producer<'static, Instruction>,
        events_out: EventSource,
    }

    /// Interrupts are off until this returns, so that initialisation is complete before the first tick.
    ///
    /// The store is a separate zero-initialised static, so it takes no flash, and the 64 KiB are never moved through the stack.
    #[init(local = [
        store: [i32; JOB_WORDS] = [0; JOB_WORDS],
        slots: Buffers = [[0; BUFFER_WORDS]; 2],
        rest: u32 = 0,
        bytes: Queue<u8, RECEIVE_PLACES> = Queue::new(),
        commands: Queue<Instruction, COMMAND_PLACES> = Queue::new(),
        events: EventMemory<EVENT_PLACES> = EventMemory::new(),
    ])]
    fn init(context: init::Context) -> (Shared, Local) {
        let board = board::init(context.device);
        // Read once, because the linker removes unreferenced data from the image.
        core::hint::black_box(&board::MARK);
        defmt::info!(
            "isofeed {=str} on {=str}, room for {=usize} words",
            env!("CARGO_PKG_VERSION"),
            BOARD.id,
            JOB_WORDS
        );
        let counter = CycleCounter::new(context.core.DCB, context.core.DWT);
        let (bytes_in, bytes_out) = context.local.bytes.split();
        let (commands_in, commands_out) = context.local.commands.split();
        let (events_in, events_out) = context.local.events.split();
        // Before the sample timer, whose first update starts it.
        let output = StepDriver::new(
            board.tim1,
            board.dma2,
            StepSetup {
                wiring: board::WIRING,
                plus_is_high: board::PLUS_IS_HIGH,
                slot_counts: SLOT_COUNTS,
            },
            (context.local.slots, context.local.rest),
        );
        if !output.is_present() {
            defmt::warn!("this board puts no steps out");
        }
        // Before the first tick, because an erase stops the processor.
        let settings = Settings::open(board.settings);
        let jobs = JobStore::open(board.jobs);
        let timer = SampleTimer::new(board.tim2, board.tim5, board::TIMER_RELOAD, PERIOD_COUNTS);
        let mut real_time = RealTime::with_store(context.local.store);
        real_time.set_tick_budget(TICK_BUDGET_CYCLES);
        real_time.set_reset_cause(board.reset);
        real_time.set_has_drives(output.is_present());
        match board.reset {
            ResetCause::Watchdog => defmt::error!("the watchdog has reset the board"),
            cause => defmt::info!("last reset: {=str}", cause.name()),
        }
        // From here on the first tick is less than a period away.
        let watchdog = Watchdog::start(board.iwdg, WATCHDOG_RELOAD);
        if !watchdog.is_settled() {
            defmt::warn!("the watchdog has not taken its time over");
        }
        let guards = Guards {
            inputs: INPUTS,
            drives: DRIVES,
            watchdog,
        };
        if let Ok(steps) = board::STEPS.check() {
            real_time.set_step_pins(steps, board::WIRING.step);
        }
        let (transmitter, receiver) = serial::open(board.usart1, board::SERIAL_DIVIDER);
        (
            Shared {
                real_time,
                falling: BoardFalling::new(board.falling),
            },
            Local {
                task: SampleTask::new(timer, counter, commands_out, events_in),
                guards,
                output,
                receiver,
                transmitter,
                led: StatusLed::new(Output::new(LED.pin), LED.active),
                settings,
                jobs,
                bytes_in,
                bytes_out,
                commands_in,
                events_out,
            },
        )
    }

    /// One period of the machine.
    ///
    /// | | |
    /// |---|---|
    /// | priority | 2: `receive` and `supply` interrupt it |
    /// | period | 1 ms, by TIM2 |
    /// | worst case | see `cargo sim budget`; the board measures each tick and reports the maximum (`tick_cycles_max`) |
    /// | over a fifth of the period | a fault of the run (`tick-over-budget`), which stops along the path |
    /// | a miss | counted, reported, and a fault of the run (`deadline-missed`), which stops along the path |
    /// | either | does not feed the watchdog, which resets the board when no tick does for some periods |
    /// | a panic | cannot be reached: `firmware/no-panic` does not link otherwise |
    #[task(binds = TIM2, priority = 2, shared = [real_time], local = [task, guards, output])]
    fn sample(mut context: sample::Context) {
        let sample::LocalResources {
            task, guards, output, ..
        } = context.local;
        context
            .shared
            .real_time
            .lock(|real_time| task.tick(real_time, guards, output));
    }

    /// The planning of the period, ahead of the tool. `sample` pends it, if there is anything to plan.
    ///
    /// | | |
    /// |---|---|
    /// | priority | 1: `receive` and `supply` interrupt it, and `sample` until it has locked the machine |
    /// | period | 1 ms, after the sample |
    /// | worst case | 28 100 cycles nominal, 36 000 pessimistic (21 % of the period), in the jobs of `docs/figures.md`; see `cargo sim budget` |
    /// | a miss | the next sample is due before the end: counted, reported, and a fault of the run (`deadline-missed`), which stops along the path; in lockstep time waits |
    /// | a panic | cannot be reached: `firmware/no-panic` does not link otherwise |
    #[task(binds = EXTI0, priority = 1, shared = [real_time])]
    fn plan(mut context: plan::Context) {
        context.shared.real_time.lock(plan_task::plan);
    }

    /// The voltage falls, or is back.
    ///
    /// | | |
    /// |---|---|
    /// | priority | 4, the highest: some milliseconds are left |
    /// | period | none |
    /// | worst case | the ten words of a record: 0.2 ms, 1.1 ms by the chip's data sheet |
    /// | a miss | the record before it stands, and the pass is machined again |
    /// | a panic | cannot be reached: `firmware/no-panic` does not link otherwise |
    #[task(binds = PVD, priority = 4, shared = [falling])]
    fn supply(mut context: supply::Context) {
        context
            .shared
            .falling
            .lock(|falling| falling.changed(board::supply_is_low()));
    }

    /// Reads a byte from the port.
    ///
    /// | | |
    /// |---|---|
    /// | priority | 3: the port has no FIFO, and a tick may take 18 byte times |
    /// | period | 11 us at 921 600 baud, while the host sends |
    /// | worst case | a few dozen cycles, plus the longest time with interrupts masked: a few instructions, or a word being written to flash (16 us, 100 us at most). The log masks none |
    /// | a miss | the byte is lost and counted; its frame fails its check, and the host repeats it |
    #[task(binds = USART1, priority = 3, local = [receiver, bytes_in])]
    fn receive(context: receive::Context) {
        let received = context.local.receiver.read();
        let full = received
            .byte
            .is_some_and(|byte| context.local.bytes_in.enqueue(byte).is_err());
        if received.error || full {
            serial::count_lost();
        }
    }

    /// The link with the host, the LED and the log; sleeps when there is nothing to do.
    ///
    /// | | |
    /// |---|---|
    /// | priority | 0 |
    /// | period | none; woken by every interrupt |
    /// | worst case | one frame's answer and its time on the line, 3.3 ms; a finished upload checks every record before its answer; storing a job takes 0.3 s |
    /// | a miss | in lockstep time waits for it; on a free clock events are lost once their queue is full, and counted (`samples_lost`) |
    #[idle(
        shared = [real_time, falling],
        local = [transmitter, led, settings, jobs, bytes_out, commands_in, events_out]
    )]
    fn idle(context: idle::Context) -> ! {
        let idle::LocalResources {
            transmitter,
            led,
            settings,
            jobs,
            bytes_out,
            commands_in,
            events_out,
            ..
        } = context.local;
        let idle::SharedResources {
            real_time, falling, ..
        } = context.shared;
        let mut machine = GuardedMachine {
            real_time,
            falling,
            commands: commands_in,
            settings,
            jobs,
        };
        transmitter.listen();
        // A constant is copied to where it is kept; of a call's result LLVM may keep a second one, 4 KB, on the stack.
        let mut link = const { Link::new() };
        link.power_up(&mut machine);
        let mut watch = Watch::default();
        let mut last_event = None;
        loop {
            let mut send = |bytes: &[u8]| transmitter.write(bytes);
            let now = uptime_periods();
            if events_out.drain(|event| link.event(event, &mut send)) {
                last_event = Some(now);
            }
            if let Some(byte) = bytes_out.dequeue() {
                link.receive(byte, &mut machine, &mut send);
            }
            if last_event.is_some_and(|then| now.wrapping_sub(then) >= FLUSH_PERIODS) {
                link.flush(&mut send);
                last_event = None;
            }
            link.keep_journal(now, &mut machine);
            if watch.is_due(now) {
                watch.look(now, &mut machine, bytes_lost());
                led.show(watch.state, now);
            }
            // With interrupts masked, none is handled between the check and the sleep; a pending one still ends
            // the sleep.
            cortex_m::interrupt::free(|_| {
                if bytes_out.ready() || events_out.ready() {
                    return;
                }
                if board::TIME_IS_SIMULATED && machine.wants_tick() {
                    NVIC::pend(pac::Interrupt::TIM2);
                } else {
                    cortex_m::asm::wfi();
                }
            });
        }
    }
}
