//! Unicorn's Cortex-M4F (`libunicorn.so.2`), loaded at run time: the C declarations that are used, and a safe engine around them.
//!
//! The library is the system's (Debian: `libunicorn2`); nothing of it is linked or copied. Constants are those of its public headers, the same
//! in 2.0 and 2.1. Every `unsafe` of this program is in this file and in [`crate::memory`].

use std::ffi::{c_char, c_int, c_uint, c_void};

use libloading::Library;

use crate::memory::Memory;

/// Names under which the library is looked for.
const NAMES: [&str; 2] = ["libunicorn.so.2", "libunicorn.so"];

const ARCH_ARM: c_int = 1;
/// Thumb and M profile.
const MODE: c_int = 1 << 4 | 1 << 5;
/// `uc_ctl`: write, one argument, the processor's model.
const CTL_CPU_MODEL: c_int = 7 | 1 << 26 | 1 << 30;
const CPU_CORTEX_M4: c_int = 9;
const HOOK_INTERRUPT: c_int = 1 << 0;
const HOOK_BLOCK: c_int = 1 << 3;
/// Accesses to addresses that are not mapped, or not allowed.
const HOOK_INVALID: c_int = 0x3f << 4;
const PROTECT_READ_EXECUTE: u32 = 1 | 4;
const PROTECT_ALL: u32 = 7;

/// A register, by Unicorn's number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Register(c_int);

#[rustfmt::skip]
impl Register {
    pub(crate) const FPSCR: Self = Self(6);
    pub(crate) const LR: Self = Self(10);
    pub(crate) const PC: Self = Self(11);
    pub(crate) const SP: Self = Self(12);
    pub(crate) const CONTROL: Self = Self(117);
    pub(crate) const XPSR: Self = Self(120);
    pub(crate) const PRIMASK: Self = Self(123);
    pub(crate) const BASEPRI: Self = Self(124);
    /// The flags of `XPSR` alone.
    pub(crate) const FLAGS: Self = Self(138);
    /// The registers saved by an exception, in the frame's order.
    pub(crate) const SAVED: [Self; 6] = [Self(66), Self(67), Self(68), Self(69), Self(78), Self::LR];

    /// `S0` to `S31`.
    pub(crate) const fn single(number: u8) -> Self {
        Self(79 + number as c_int)
    }
}

type Handle = *mut c_void;
type Hook<H> = unsafe extern "C" fn(Handle, u64, u32, *mut Context<H>);
type Interrupt<H> = unsafe extern "C" fn(Handle, u32, *mut Context<H>);
type Invalid<H> = unsafe extern "C" fn(Handle, c_int, u64, c_int, i64, *mut Context<H>) -> bool;

/// The functions that are used.
struct Api {
    open: unsafe extern "C" fn(c_int, c_int, *mut Handle) -> c_int,
    close: unsafe extern "C" fn(Handle) -> c_int,
    describe: unsafe extern "C" fn(c_int) -> *const c_char,
    control: unsafe extern "C" fn(Handle, c_int, ...) -> c_int,
    map: unsafe extern "C" fn(Handle, u64, usize, u32, *mut c_void) -> c_int,
    map_device: unsafe extern "C" fn(
        Handle,
        u64,
        u64,
        *const c_void,
        *mut c_void,
        *const c_void,
        *mut c_void,
    ) -> c_int,
    hook: unsafe extern "C" fn(Handle, *mut usize, c_int, *const c_void, *mut c_void, u64, u64, ...) -> c_int,
    start: unsafe extern "C" fn(Handle, u64, u64, u64, usize) -> c_int,
    stop: unsafe extern "C" fn(Handle) -> c_int,
    read: unsafe extern "C" fn(Handle, c_int, *mut c_void) -> c_int,
    write: unsafe extern "C" fn(Handle, c_int, *const c_void) -> c_int,
    /// Last: unloaded after everything else.
    _library: Library,
}

impl Api {
    #[allow(unsafe_code, reason = "a library of the system")]
    fn load() -> Result<Self, String> {
        // SAFETY: the library's initialisers have no conditions; the types are those of unicorn.h.
        unsafe {
            let library = NAMES.iter().find_map(|name| Library::new(name).ok()).ok_or(
                "libunicorn.so.2 is not installed; on Debian and Ubuntu: sudo apt-get install libunicorn2",
            )?;
            macro_rules! symbol {
                ($name:literal) => {
                    *library
                        .get(concat!($name, "\0").as_bytes())
                        .map_err(|error| format!("{}: {error}", $name))?
                };
            }
            Ok(Self {
                open: symbol!("uc_open"),
                close: symbol!("uc_close"),
                describe: symbol!("uc_strerror"),
                control: symbol!("uc_ctl"),
                map: symbol!("uc_mem_map_ptr"),
                map_device: symbol!("uc_mmio_map"),
                hook: symbol!("uc_hook_add"),
                start: symbol!("uc_emu_start"),
                stop: symbol!("uc_emu_stop"),
                read: symbol!("uc_reg_read"),
                write: symbol!("uc_reg_write"),
                _library: library,
            })
        }
    }
}

/// Access to the processor's registers, also from a hook.
#[derive(Clone, Copy)]
pub(crate) struct Registers {
    handle: Handle,
    read: unsafe extern "C" fn(Handle, c_int, *mut c_void) -> c_int,
    write: unsafe extern "C" fn(Handle, c_int, *const c_void) -> c_int,
}

impl Registers {
    /// Reads one.
    #[allow(unsafe_code, reason = "a call of the library")]
    pub(crate) fn get(&self, register: Register) -> u32 {
        let mut value = 0_u32;
        // SAFETY: the handle lives as long as its engine, which lends this; the registers used are 32 bits wide.
        unsafe { (self.read)(self.handle, register.0, (&raw mut value).cast()) };
        value
    }

    /// Writes one.
    #[allow(unsafe_code, reason = "a call of the library")]
    pub(crate) fn set(&self, register: Register, value: u32) {
        // SAFETY: likewise.
        unsafe { (self.write)(self.handle, register.0, (&raw const value).cast()) };
    }
}

/// The processor's environment.
pub(crate) trait Surroundings {
    /// A block of instructions is about to be executed; false leaves it, and stops.
    fn block(&mut self, registers: &Registers, address: u32, bytes: u32) -> bool;
    /// A read of a device, aligned to its size.
    fn read(&mut self, address: u32, bytes: u32) -> u32;
    /// A write of a device.
    fn write(&mut self, address: u32, bytes: u32, value: u32);
}

/// State shared by the hooks.
struct Context<H> {
    surroundings: H,
    registers: Registers,
    stop: unsafe extern "C" fn(Handle) -> c_int,
    stopped: bool,
    interrupt: Option<u32>,
    invalid: Option<Invalidity>,
}

/// An invalid access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Invalidity {
    /// Its address.
    pub(crate) address: u32,
    /// Whether an instruction was to be fetched there.
    pub(crate) is_fetch: bool,
}

/// Why the processor stopped.
#[derive(Clone, Debug, Default)]
pub(crate) struct Halt {
    /// Requested by the environment.
    pub(crate) asked: bool,
    /// An exception of the processor, by QEMU's number.
    pub(crate) interrupt: Option<u32>,
    /// An invalid access.
    pub(crate) invalid: Option<Invalidity>,
    /// The library's own words, if it has failed.
    pub(crate) error: Option<String>,
}

/// The processor with its memory and its surroundings.
pub(crate) struct Engine<H> {
    api: Api,
    handle: Handle,
    context: *mut Context<H>,
    /// Mapped as long as the handle lives.
    _memory: [Memory; 2],
}

#[allow(unsafe_code, reason = "called by the library")]
unsafe extern "C" fn on_block<H: Surroundings>(
    _: Handle,
    address: u64,
    bytes: u32,
    context: *mut Context<H>,
) {
    // SAFETY: the engine's own context; while the library runs, no other reference to it exists, and hooks do not nest.
    let context = unsafe { &mut *context };
    if !context
        .surroundings
        .block(&context.registers, address as u32, bytes)
    {
        context.stopped = true;
        // SAFETY: the engine's handle.
        unsafe { (context.stop)(context.registers.handle) };
    }
}

#[allow(unsafe_code, reason = "called by the library")]
unsafe extern "C" fn on_interrupt<H>(_: Handle, number: u32, context: *mut Context<H>) {
    // SAFETY: as in `on_block`.
    let context = unsafe { &mut *context };
    context.interrupt = Some(number);
    // SAFETY: the engine's handle.
    unsafe { (context.stop)(context.registers.handle) };
}

#[allow(unsafe_code, reason = "called by the library")]
unsafe extern "C" fn on_invalid<H>(
    _: Handle,
    kind: c_int,
    address: u64,
    _: c_int,
    _: i64,
    context: *mut Context<H>,
) -> bool {
    // SAFETY: as in `on_block`.
    let context = unsafe { &mut *context };
    // Fetch unmapped, fetch protected.
    let is_fetch = matches!(kind, 21 | 24);
    context.invalid = Some(Invalidity {
        address: address as u32,
        is_fetch,
    });
    false
}

#[allow(unsafe_code, reason = "called by the library")]
unsafe extern "C" fn on_read<H: Surroundings, const BASE: u32>(
    _: Handle,
    offset: u64,
    bytes: c_uint,
    context: *mut Context<H>,
) -> u64 {
    // SAFETY: as in `on_block`.
    let context = unsafe { &mut *context };
    context.surroundings.read(BASE + offset as u32, bytes).into()
}

#[allow(unsafe_code, reason = "called by the library")]
unsafe extern "C" fn on_write<H: Surroundings, const BASE: u32>(
    _: Handle,
    offset: u64,
    bytes: c_uint,
    value: u64,
    context: *mut Context<H>,
) {
    // SAFETY: as in `on_block`.
    let context = unsafe { &mut *context };
    context
        .surroundings
        .write(BASE + offset as u32, bytes, value as u32);
}

/// Address of the flash sectors that the model can write.
const SETTINGS: u32 = crate::part::flash::SETTINGS;
/// Address of the system memory, which holds the size of the chip's flash.
const SYSTEM: u32 = 0x1fff_0000;
/// Address of the peripherals.
const PERIPHERALS: u32 = 0x4000_0000;
/// Address of the peripherals' bit-band alias.
const BIT_BAND: u32 = 0x4200_0000;
/// Address of the processor's own peripherals.
const PRIVATE: u32 = 0xe000_0000;

impl<H: Surroundings> Engine<H> {
    /// A processor with flash (also at address 0, as BOOT0 = 0 has it) and SRAM.
    #[allow(unsafe_code, reason = "calls of the library")]
    pub(crate) fn new(surroundings: H, flash: Memory, sram: Memory) -> Result<Self, String> {
        let api = Api::load()?;
        let mut handle: Handle = std::ptr::null_mut();
        // SAFETY: writes the handle.
        let code = unsafe { (api.open)(ARCH_ARM, MODE, &raw mut handle) };
        if code != 0 {
            return Err(Self::words(&api, code));
        }
        let registers = Registers {
            handle,
            read: api.read,
            write: api.write,
        };
        let context = Box::into_raw(Box::new(Context {
            surroundings,
            registers,
            stop: api.stop,
            stopped: false,
            interrupt: None,
            invalid: None,
        }));
        let engine = Self {
            api,
            handle,
            context,
            _memory: [flash, sram],
        };
        engine.map(flash, sram)?;
        engine.hook()?;
        Ok(engine)
    }

    fn words(api: &Api, code: c_int) -> String {
        #[allow(unsafe_code, reason = "a call of the library")]
        // SAFETY: a text that is there for good, for any code.
        let words = unsafe { std::ffi::CStr::from_ptr((api.describe)(code)) };
        format!("libunicorn: {}", words.to_string_lossy())
    }

    fn check(&self, code: c_int) -> Result<(), String> {
        if code == 0 {
            Ok(())
        } else {
            Err(Self::words(&self.api, code))
        }
    }

    #[allow(unsafe_code, reason = "calls of the library")]
    fn map(&self, flash: Memory, sram: Memory) -> Result<(), String> {
        let map = |memory: Memory, base: u32, protection: u32| {
            // SAFETY: the memory is there for good.
            self.check(unsafe {
                (self.api.map)(
                    self.handle,
                    base.into(),
                    memory.bytes(),
                    protection,
                    memory.pointer(),
                )
            })
        };
        // SAFETY: the one argument is an `int`.
        self.check(unsafe { (self.api.control)(self.handle, CTL_CPU_MODEL, CPU_CORTEX_M4) })?;
        map(flash, flash.base(), PROTECT_READ_EXECUTE)?;
        map(flash, 0, PROTECT_READ_EXECUTE)?;
        map(sram, sram.base(), PROTECT_ALL)?;
        self.map_device::<SETTINGS>(crate::part::flash::SETTINGS_BYTES.into())?;
        self.map_device::<SYSTEM>(0x8000)?;
        self.map_device::<PERIPHERALS>(0x8_0000)?;
        self.map_device::<BIT_BAND>(0x200_0000)?;
        self.map_device::<PRIVATE>(0x10_0000)
    }

    #[allow(unsafe_code, reason = "a call of the library")]
    fn map_device<const BASE: u32>(&self, bytes: u64) -> Result<(), String> {
        let context = self.context.cast();
        let (read, write) = (
            on_read::<H, BASE> as *const c_void,
            on_write::<H, BASE> as *const c_void,
        );
        // SAFETY: functions of the types that the library wants, with the context that they want.
        self.check(unsafe {
            (self.api.map_device)(self.handle, BASE.into(), bytes, read, context, write, context)
        })
    }

    #[allow(unsafe_code, reason = "calls of the library")]
    fn hook(&self) -> Result<(), String> {
        let block: Hook<H> = on_block::<H>;
        let interrupt: Interrupt<H> = on_interrupt::<H>;
        let invalid: Invalid<H> = on_invalid::<H>;
        for (kind, function) in [
            (HOOK_BLOCK, block as *const c_void),
            (HOOK_INTERRUPT, interrupt as *const c_void),
            (HOOK_INVALID, invalid as *const c_void),
        ] {
            let mut hook = 0_usize;
            // SAFETY: a function of the type that this kind of hook wants, for all addresses (begin > end).
            self.check(unsafe {
                (self.api.hook)(
                    self.handle,
                    &raw mut hook,
                    kind,
                    function,
                    self.context.cast(),
                    1,
                    0,
                )
            })?;
        }
        Ok(())
    }

    /// The surroundings, while the processor stands.
    #[allow(unsafe_code, reason = "the hooks share it")]
    pub(crate) fn surroundings(&mut self) -> &mut H {
        // SAFETY: made by `Box::into_raw`; the library, whose hooks use it, does not run while `self` is borrowed.
        unsafe { &mut (*self.context).surroundings }
    }

    /// The processor's registers, while it stands.
    pub(crate) fn registers(&self) -> Registers {
        Registers {
            handle: self.handle,
            read: self.api.read,
            write: self.api.write,
        }
    }

    /// Executes from `PC` on until something stops it.
    #[allow(unsafe_code, reason = "a call of the library")]
    pub(crate) fn run(&mut self) -> Halt {
        let pc = self.registers().get(Register::PC);
        // SAFETY: as in `surroundings`.
        let context = unsafe { &mut *self.context };
        (context.stopped, context.interrupt, context.invalid) = (false, None, None);
        // SAFETY: the hooks' context is not borrowed: the reference above is used no more until the call is over.
        let code = unsafe { (self.api.start)(self.handle, u64::from(pc | 1), 0xffff_fffe, 0, 0) };
        // SAFETY: as above.
        let context = unsafe { &mut *self.context };
        Halt {
            asked: context.stopped,
            interrupt: context.interrupt,
            invalid: context.invalid,
            error: (code != 0).then(|| Self::words(&self.api, code)),
        }
    }

    /// Ends the processor, and hands back what surrounded it.
    #[allow(unsafe_code, reason = "the counterpart of `new`")]
    pub(crate) fn into_surroundings(self) -> H {
        let this = std::mem::ManuallyDrop::new(self);
        // SAFETY: closed once; afterwards no hook is called any more, so that the context is owned again. The library is left loaded.
        unsafe {
            (this.api.close)(this.handle);
            Box::from_raw(this.context).surroundings
        }
    }
}

impl<H> Drop for Engine<H> {
    #[allow(unsafe_code, reason = "the counterpart of `new`")]
    fn drop(&mut self) {
        // SAFETY: as in `into_surroundings`.
        unsafe {
            (self.api.close)(self.handle);
            drop(Box::from_raw(self.context));
        }
    }
}

/// Version of the library, where it is there.
pub(crate) fn version() -> Option<String> {
    // SAFETY: both arguments may be null; the library's initialisers have no conditions.
    #[allow(unsafe_code, reason = "a call of the library")]
    let version = unsafe {
        let library = NAMES.iter().find_map(|name| Library::new(name).ok())?;
        let version = library
            .get::<unsafe extern "C" fn(*mut c_uint, *mut c_uint) -> c_uint>(b"uc_version\0")
            .ok()?;
        version(std::ptr::null_mut(), std::ptr::null_mut())
    };
    // Major, minor, patch, each a byte from the highest of the three on in 2.x.
    Some(format!("{version:#x}"))
}
