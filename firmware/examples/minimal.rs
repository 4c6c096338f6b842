//! The least firmware around the core: the tick in the timer's interrupt, the planning in a task below it. It compiles, and runs no job: it loads none and sets up
//! neither clock nor timer. What a machine needs is in `src/`.
#![no_std]
#![no_main]

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}

#[rtic::app(device = stm32f4xx_hal::pac, dispatchers = [EXTI0])]
mod app {
    use interp_core::Interpolator;

    /// Words of the longest job, `front_words` of it included.
    const WORDS: usize = 4096;

    #[shared]
    struct Shared {
        machine: Interpolator<&'static mut [i32; WORDS]>,
    }

    #[local]
    struct Local {}

    /// The store is a static of zeroes, which takes no flash.
    #[init(local = [store: [i32; WORDS] = [0; WORDS]])]
    fn init(context: init::Context) -> (Shared, Local) {
        let machine = Interpolator::with_store(context.local.store);
        (Shared { machine }, Local {})
    }

    /// The timer's interrupt, once a period.
    #[task(binds = TIM2, shared = [machine], priority = 2)]
    fn tick(mut context: tick::Context) {
        let sample = context.shared.machine.lock(|machine| *machine.tick(None));
        to_the_axes(sample.cl_nm);
        // Still waiting where the last portion is: then this period has none, and the samples are others than the desk's.
        let _ = plan::spawn();
    }

    /// The lock keeps the tick from preempting a portion.
    #[task(shared = [machine], priority = 1)]
    async fn plan(mut context: plan::Context) {
        context.shared.machine.lock(|machine| machine.plan());
    }

    /// Where the axes' driver goes.
    fn to_the_axes(cl_nm: [i32; 3]) {
        let _ = cl_nm;
    }
}
