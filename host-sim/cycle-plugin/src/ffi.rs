//! Interface to QEMU: the functions of its plugin interface that are the same in all versions from 7.2 to 10.
//!
//! Their addresses are resolved when QEMU loads the library, so that the host tool and the tests can link it without QEMU. The
//! interface version is set at the same time: 7.2 refuses versions above 1, 9 and 10 refuse versions below their own; the functions
//! used here are the same in all of them.
#![allow(unreachable_pub, reason = "QEMU finds these items by their names")]
#![allow(unsafe_code, reason = "a C interface; the other modules are safe code")]

use std::cell::RefCell;
use std::ffi::{CStr, c_char, c_int, c_uint, c_void};
use std::fs::File;
use std::io::Write;
use std::sync::Mutex;
use std::sync::atomic::{AtomicI32, AtomicU32, Ordering};

use crate::account::{Account, RAM};
use crate::plan::Plan;
use crate::record::Record;

/// `QEMU_PLUGIN_CB_NO_REGS`.
const NO_REGISTERS: c_uint = 0;

/// `QEMU_PLUGIN_MEM_W`.
const WRITES: c_uint = 2;

/// Version of the interface that QEMU 7.2 to 8.2 have.
const VERSION_OLD: c_int = 1;

/// Version that QEMU 9.2 and 10.0 have.
const VERSION_NEW: c_int = 4;

/// Version that QEMU 9.0 has, the last before `qemu_plugin_insn_data` copies.
const VERSION_9_0: c_int = 2;

/// Interface version, which QEMU reads before it calls [`qemu_plugin_install`]; set when the library is loaded.
#[unsafe(no_mangle)]
pub static qemu_plugin_version: AtomicI32 = AtomicI32::new(VERSION_OLD);

type Execute = extern "C" fn(c_uint, *mut c_void);
type Store = extern "C" fn(c_uint, c_uint, u64, *mut c_void);
type Translate = extern "C" fn(u64, *mut c_void);

type Register = extern "C" fn(u64, Translate);
type Count = extern "C" fn(*const c_void) -> usize;
type Get = extern "C" fn(*const c_void, usize) -> *mut c_void;
type Address = extern "C" fn(*const c_void) -> u64;
type OnExecution = extern "C" fn(*mut c_void, Execute, c_uint, *mut c_void);
type OnMemory = extern "C" fn(*mut c_void, Store, c_uint, c_uint, *mut c_void);

/// The functions of QEMU.
#[derive(Clone, Copy)]
struct Api {
    on_translation: Register,
    instructions: Count,
    instruction: Get,
    address: Address,
    on_execution: OnExecution,
    on_memory: OnMemory,
}

unsafe extern "C" {
    safe fn dlsym(handle: *mut c_void, name: *const c_char) -> *mut c_void;
}

fn symbol(name: &CStr) -> Option<*mut c_void> {
    // A null handle (RTLD_DEFAULT) searches the program itself.
    let found = dlsym(std::ptr::null_mut(), name.as_ptr());
    (!found.is_null()).then_some(found)
}

/// A function of QEMU by name, as this type.
macro_rules! function {
    ($name:literal, $kind:ty) => {{
        let found = symbol($name)?;
        // SAFETY: QEMU declares the function of this name with this signature in `qemu-plugin.h`, versions 1 to 4.
        unsafe { std::mem::transmute::<*mut c_void, $kind>(found) }
    }};
}

impl Api {
    fn find() -> Option<Self> {
        Some(Self {
            on_translation: function!(c"qemu_plugin_register_vcpu_tb_trans_cb", Register),
            instructions: function!(c"qemu_plugin_tb_n_insns", Count),
            instruction: function!(c"qemu_plugin_tb_get_insn", Get),
            address: function!(c"qemu_plugin_insn_vaddr", Address),
            on_execution: function!(c"qemu_plugin_register_vcpu_insn_exec_cb", OnExecution),
            on_memory: function!(c"qemu_plugin_register_vcpu_mem_cb", OnMemory),
        })
    }
}

/// Runs when the library is loaded, before QEMU reads the version.
extern "C" fn choose_version() {
    let version = if symbol(c"qemu_plugin_read_memory_vaddr").is_some() {
        VERSION_NEW
    } else if symbol(c"qemu_plugin_num_vcpus").is_some() {
        VERSION_9_0
    } else {
        VERSION_OLD
    };
    qemu_plugin_version.store(version, Ordering::Relaxed);
}

// SAFETY: the loader calls each function of this section once, with arguments that a C function may ignore.
#[unsafe(link_section = ".init_array")]
#[used]
static CHOOSE_VERSION: extern "C" fn() = choose_version;

struct Plugin {
    api: Api,
    account: Account,
    records: File,
    last: Option<Record>,
}

/// Handed over by the thread that loads the library. QEMU translates and executes the board's one processor in another.
static INSTALLED: Mutex<Option<Plugin>> = Mutex::new(None);

thread_local! {
    /// The executing thread's. A lock for each instruction would take a quarter of a measurement's time.
    static PLUGIN: RefCell<Option<Plugin>> = const { RefCell::new(None) };
}

/// The lowest address on the stack that was stored to, without the lock: most stores are above it.
static STORED_LOWEST: AtomicU32 = AtomicU32::new(u32::MAX);

fn with_slot(f: impl FnOnce(&mut Option<Plugin>)) {
    // Neither fails: no function here is called within another, and the thread lives as long as QEMU executes.
    let _ = PLUGIN.try_with(|slot| slot.try_borrow_mut().map(|mut slot| f(&mut slot)));
}

fn with_plugin(f: impl FnOnce(&mut Plugin)) {
    with_slot(|slot| {
        if let Some(plugin) = slot {
            f(plugin);
        }
    });
}

/// Takes over what was installed.
fn take_over() {
    with_slot(|slot| {
        if slot.is_none()
            && let Ok(mut installed) = INSTALLED.lock()
        {
            *slot = installed.take();
        }
    });
}

impl Plugin {
    fn new(arguments: &[String]) -> Result<Self, String> {
        let value = |key: &str| {
            arguments
                .iter()
                .find_map(|argument| argument.strip_prefix(key)?.strip_prefix('='))
                .ok_or(format!("argument {key}= is missing"))
        };
        let (plan, records) = (value("plan")?, value("records")?);
        let bytes = std::fs::read(plan).map_err(|error| format!("{plan}: {error}"))?;
        let plan = Plan::from_bytes(&bytes).ok_or(format!("{plan} is not a plan of this version"))?;
        Ok(Self {
            api: Api::find().ok_or("QEMU lacks a function of its plugin interface")?,
            account: Account::new(plan),
            records: File::create(records).map_err(|error| format!("{records}: {error}"))?,
            last: None,
        })
    }

    fn write(&mut self, record: &Record) {
        // A board that waits for its host makes thousands of equal idle ticks.
        if record.is_idle() && self.last.as_ref() == Some(record) {
            return;
        }
        self.last = Some(*record);
        // Unbuffered: QEMU may be terminated at any time. A write that fails shows as missing records, which the reader checks.
        let _ = self.records.write_all(&record.to_bytes());
    }
}

/// Entry point: QEMU calls it once, with the arguments that follow the library's name.
///
/// # Safety
/// `arguments` must point to `count` C strings.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn qemu_plugin_install(
    id: u64,
    _information: *const c_void,
    count: c_int,
    arguments: *const *const c_char,
) -> c_int {
    let arguments: Vec<String> = (0..usize::try_from(count).unwrap_or(0))
        .map(|index| {
            // SAFETY: the caller guarantees `count` C strings at `arguments`.
            let text = unsafe { CStr::from_ptr(*arguments.add(index)) };
            text.to_string_lossy().into_owned()
        })
        .collect();
    match Plugin::new(&arguments) {
        Ok(plugin) => {
            let api = plugin.api;
            if let Ok(mut slot) = INSTALLED.lock() {
                *slot = Some(plugin);
            }
            (api.on_translation)(id, translated);
            0
        }
        Err(error) => {
            eprintln!("cycle-plugin: {error}");
            1
        }
    }
}

/// Called for each translated block: registers callbacks for each of its instructions and stores.
extern "C" fn translated(_id: u64, block: *mut c_void) {
    take_over();
    with_plugin(|plugin| {
        let api = plugin.api;
        for number in 0..(api.instructions)(block) {
            let instruction = (api.instruction)(block, number);
            let address = u32::try_from((api.address)(instruction)).unwrap_or(u32::MAX);
            let Some(index) = plugin.account.decode(address) else {
                continue;
            };
            // The pointer carries the index.
            let index = std::ptr::without_provenance_mut(index);
            (api.on_execution)(instruction, executed, NO_REGISTERS, index);
            (api.on_memory)(instruction, stored, NO_REGISTERS, WRITES, std::ptr::null_mut());
        }
    });
}

extern "C" fn executed(_processor: c_uint, index: *mut c_void) {
    with_plugin(|plugin| {
        if let Some(record) = plugin.account.execute(index.addr()) {
            plugin.write(&record);
        }
    });
}

extern "C" fn stored(_processor: c_uint, _access: c_uint, address: u64, _data: *mut c_void) {
    if let Ok(address) = u32::try_from(address)
        && (RAM..STORED_LOWEST.load(Ordering::Relaxed)).contains(&address)
    {
        with_plugin(|plugin| STORED_LOWEST.store(plugin.account.store(address), Ordering::Relaxed));
    }
}
