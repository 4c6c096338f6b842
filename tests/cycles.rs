//! The cycle counter: its decoder against a disassembler over the whole image, its count against a timer in the guest,
//! and the cycles of the sample task against the golden table. Needs `qemu-system-arm`; builds the firmware and the plugin.

use std::fmt::Write;
use std::io::Read;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use cycle_plugin::account::Account;
use cycle_plugin::decode::{Branch, Class, decode};
use cycle_plugin::plan::{Plan, Stage};
use cycle_plugin::record::{RECORD_BYTES, Record};
use cycles::search::genes::JobClass;
use cycles::search::search;
use cycles::session::MeasurementSession;
use cycles::{
    PERIOD_CYCLES, PLANNING_CYCLES_MAX, SURFACES, TICK_SHARE_MAX_PCT, figures, figures::Figure, golden,
    image, operations, operations::Operations,
};
use machine::prepare::prepare;
use machine::remote::qemu::{self, Qemu};

use crate::images;

/// A guest of a few instructions. The thread starts TIM5 and pends USART1; USART1's handler pends TIM2, whose priority is
/// higher, twice; TIM2's handler reads TIM5 before and after its work, and sends the difference, four bytes.
mod guest {
    /// Words of the vector table.
    pub(super) const VECTORS: u32 = 98;
    /// From the end of the vector table.
    pub(super) const OUTER: u32 = 0x40;
    /// From the end of the vector table.
    pub(super) const TICK: u32 = 0x68;

    pub(super) const CODE: [u16; 92] = [
        // reset: enable the floating-point unit
        0x4827, 0xf44f, 0x0170, 0x6001, // ldr r0,=CPACR; mov r1,#0xf00000; str r1,[r0]
        0x4826, 0x2101, 0x6001, // ldr r0,=TIM5; movs r1,#1; str r1,[r0]
        0xf06f, 0x0100, 0x62c1, // mvn r1,#0; str r1,[r0,#ARR]
        0x4d24, 0xf04f, 0x5180, 0x6029, // ldr r5,=ISER0; mov r1,#1<<28; str r1,[r5]
        0x2120, 0x6069, // movs r1,#0x20; str r1,[r5,#4]
        0x4b22, 0x2180, 0xf883, 0x1025, // ldr r3,=IPR; movs r1,#0x80; strb r1,[r3,#37]
        0x4c21, 0xf242, 0x0108, 0x60e1, // ldr r4,=USART1; movw r1,#0x2008; str r1,[r4,#CR1]
        0x4d20, 0x2120, 0x6069, // ldr r5,=ISPR0; movs r1,#0x20; str r1,[r5,#4]
        0xf3bf, 0x8f4f, 0xf3bf, 0x8f6f, 0xe7fe, // dsb; isb; b .
        // outer
        0xb510, 0x260a, 0x3e01, 0xd1fd, // push {r4,lr}; movs r6,#10; 1: subs r6,#1; bne 1b
        0xf04f, 0x5180, 0x6029, // mov r1,#1<<28; str r1,[r5]
        0xf3bf, 0x8f4f, 0xf3bf, 0x8f6f, // dsb; isb
        0x2664, 0x3e01, 0xd1fd, 0x6029, // movs r6,#100; 2: subs r6,#1; bne 2b; str r1,[r5]
        0xf3bf, 0x8f4f, 0xf3bf, 0x8f6f, 0xbd10, // dsb; isb; pop {r4,pc}
        // tick
        0xb590, 0x6a42, 0x2632, 0xbf00, // push {r4,r7,lr}; ldr r2,[r0,#CNT]; movs r6,#50; nop
        0xf000, 0xf814, 0x3e01, 0xbf18, // 3: bl callee; subs r6,#1; it ne
        0x3701, 0x2e00, 0xd1f8, // addne r7,#1; cmp r6,#0; bne 3b
        0xee20, 0x0a81, 0xee70, 0x1a00, // vmul.f32 s0,s1,s2; vadd.f32 s3,s0,s0
        0x6a43, 0x1a9b, // ldr r3,[r0,#CNT]; subs r3,r3,r2
        0x6063, 0x0a1b, 0x6063, 0x0a1b, // str r3,[r4,#DR]; lsrs r3,#8; ..
        0x6063, 0x0a1b, 0x6063, // .. four times
        0xbd90, 0xbf00, // pop {r4,r7,pc}; nop
        0x2103, 0x4770, // callee: movs r1,#3; bx lr
        // literals
        0xed88, 0xe000, 0x0c00, 0x4000, 0xe100, 0xe000, 0xe400, 0xe000, 0x1000, 0x4001, 0xe200, 0xe000,
    ];

    /// Calls of the tick's loop.
    pub(super) const CALLS: u32 = 50;
}

/// Image and plan of the guest; the whole guest is one stage.
fn guest_plan() -> Plan {
    let code_at = 4 * guest::VECTORS;
    let mut words = vec![code_at + 1; guest::VECTORS as usize];
    words[0] = 0x2000_1000;
    words[16 + 37] = code_at + guest::OUTER + 1;
    words[16 + 28] = code_at + guest::TICK + 1;
    let mut code: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    code.extend(guest::CODE.iter().flat_map(|halfword| halfword.to_le_bytes()));
    Plan {
        base: 0,
        exception: 16 + 28,
        planning: 16 + 37,
        stack_end: 0x2000_1000,
        stages: vec![Some(Stage::Rest); code.len() / 2],
        starts: Vec::new(),
        code,
    }
}

/// The guest runs for milliseconds; a busy machine may give QEMU no processor time for much longer.
const GUEST_TIMEOUT: Duration = Duration::from_secs(600);

/// Runs the guest. Returns the timer differences that it sent, in instructions, and the plugin's records.
fn run_guest(folder: &Path) -> (Vec<u32>, Vec<Record>) {
    let path = |name: &str| folder.join(name);
    let plan = guest_plan();
    std::fs::write(path("plan"), plan.to_bytes()).unwrap();
    std::fs::write(path("image"), &plan.code).unwrap();
    let plugin = format!(
        "{},plan={},records={}",
        qemu::cycle_plugin().unwrap().display(),
        path("plan").display(),
        path("records").display()
    );
    let (_qemu, mut stream) = Qemu::start_with(&path("image"), &["-plugin".to_owned(), plugin]).unwrap();
    let mut bytes = Vec::new();
    let deadline = Instant::now() + GUEST_TIMEOUT;
    while bytes.len() < 8 && Instant::now() < deadline {
        let mut some = [0; 8];
        if let Ok(count) = stream.read(&mut some) {
            bytes.extend_from_slice(&some[..count]);
        }
    }
    // The plugin writes a record at the first instruction after its handler: those of the two ticks, and that of the handler that they preempt.
    let mut records = Vec::new();
    while records.len() < 3 * RECORD_BYTES && Instant::now() < deadline {
        records = std::fs::read(path("records")).unwrap();
        std::thread::sleep(Duration::from_millis(5));
    }
    // TIM5 counts nanoseconds, and an instruction takes 8 of them.
    let counted = bytes
        .chunks_exact(4)
        .map(|word| u32::from_le_bytes(word.try_into().unwrap()) / 8)
        .collect();
    (counted, Record::read_all(&records))
}

/// Two ticks that preempt another handler: instructions against a timer in the guest, cycles against a count by hand,
/// and the other handler's instructions charged to that handler.
#[test]
fn instructions_agree_with_a_counter_in_the_guest() {
    let folder = std::env::temp_dir().join(format!("isofeed-cycles-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let (counted, records) = run_guest(&folder);
    std::fs::remove_dir_all(&folder).unwrap();
    assert_eq!((counted.len(), records.len()), (2, 3));
    let [ticks @ .., outer] = &records[..] else {
        unreachable!("three records")
    };
    assert_eq!(
        [false, false, true],
        [0, 1, 2].map(|index: usize| records[index].is_planning)
    );
    // For each call bl, movs, bx, subs, it, addne, cmp, bne; in addition movs, nop, vmul, vadd and the second ldr.
    let work = 8 * guest::CALLS + 5;
    // push and the first ldr; subs, four str, three lsrs, pop.
    let around = 2 + 9;
    // bl 1+1, movs 1, bx 1+2, subs, it, addne, cmp 1 each, bne 1+1, except the last bne: 1.
    let calls = 12 * guest::CALLS - 1;
    // Entry, exit; push 4, ldr 2, movs, nop; vmul, vadd, ldr 2, subs; four str, three lsrs, pop 4. The cycles of the pop's
    // branch belong to the exit.
    let nominal = 24 + (4 + 2 + 1 + 1) + calls + (1 + 1 + 2 + 1) + (4 + 3 + 4);
    for (record, counted) in ticks.iter().zip(counted) {
        assert_eq!(counted, work);
        assert_eq!((record.instructions, record.unknown), (work + around, 0));
        let cycles: u32 = record.stages.iter().map(|cycles| cycles.nominal).sum();
        assert_eq!(cycles, nominal);
        assert_eq!(record.stages[Stage::Exception as usize].nominal, 24);
        // Two flash lines, and lazy stacking at entry and exit.
        let exception = record.stages[Stage::Exception as usize].pessimistic;
        assert_eq!(exception, 24 + 5 + 5 + 2 * 17);
    }
    // Between the two ticks: dsb, isb, movs, 100 times subs and bne, str.
    let between = 2 + 1 + 2 * 100 + 1;
    assert_eq!(ticks[1].elsewhere, between);
    // The handler that they preempt stands for the planning: push, movs, ten times subs and bne, mov, str; between; dsb, isb, pop. No
    // instruction of the ticks, but an entry and an exit of its own.
    let own = (2 + 2 * 10 + 2) + between + 3;
    assert_eq!((outer.instructions, outer.elsewhere), (own, 0));
    // push 3, movs, ten times subs 1 and bne 2 but the last 1, mov, str; movs, the second loop, str; four barriers; pop 3.
    let cycles: u32 = outer.stages.iter().map(|cycles| cycles.nominal).sum();
    assert_eq!(
        cycles,
        24 + (3 + 1 + 29 + 1 + 1) + (1 + 299 + 1) + 4 * BARRIER + 3
    );
}

/// Cycles of a barrier in both models.
const BARRIER: u32 = 4;

/// The account without QEMU: cycles of a taken and of an untaken branch.
#[test]
fn the_account_follows_a_loop() {
    let plan = guest_plan();
    let code_at = 4 * guest::VECTORS;
    let (outer, tick) = (code_at + guest::OUTER, code_at + guest::TICK);
    let mut account = Account::new(plan);
    let mut at = |address: u32| {
        let index = account.decode(address).unwrap();
        account.execute(index)
    };
    // The thread, the outer handler, the tick that preempts it, directly to its return, and the outer handler again.
    assert_eq!(at(code_at), None);
    assert_eq!(at(outer), None);
    assert_eq!(at(outer + 2), None);
    assert_eq!(at(tick), None);
    assert_eq!(at(tick + 0x30), None);
    let record = at(outer + 4).unwrap();
    // push {r4,r7,lr} and pop {r4,r7,pc}, 4 cycles each.
    assert_eq!((record.instructions, record.elsewhere), (2, 3));
    assert_eq!(record.stages[Stage::Rest as usize].nominal, 4 + 4);
}

/// Lines of a disassembler: address, mnemonic without width, operands. Panics if no disassembler is installed, because the
/// decoder would then not be tested.
fn disassembly(image: &Path) -> Vec<(u32, String, String)> {
    let tool = ["arm-none-eabi-objdump", "llvm-objdump", "rust-objdump"]
        .into_iter()
        .find_map(|tool| {
            let output = Command::new(tool)
                .args(["-d", "--no-show-raw-insn"])
                .arg(image)
                .output()
                .ok()?;
            output
                .status
                .success()
                .then(|| String::from_utf8_lossy(&output.stdout).into_owned())
        })
        .expect("no disassembler for ARM; on Debian and Ubuntu: sudo apt-get install binutils-arm-none-eabi");
    let line = |line: &str| {
        let (address, rest) = line.split_once(':')?;
        let address = u32::from_str_radix(address.trim(), 16).ok()?;
        let mut parts = rest.trim().splitn(2, char::is_whitespace);
        let mnemonic = parts
            .next()?
            .trim_end_matches(".w")
            .trim_end_matches(".n")
            .to_owned();
        let known = mnemonic.starts_with(|c: char| c.is_ascii_lowercase());
        known.then(|| (address, mnemonic, parts.next().unwrap_or("").trim().to_owned()))
    };
    tool.lines().filter_map(line).collect()
}

/// The class of a mnemonic; the number of words of multiple transfers is 0.
fn class_of(mnemonic: &str, operands: &str) -> Class {
    let begins = |names: &[&str]| names.iter().any(|name| mnemonic.starts_with(name));
    let base = mnemonic.split('.').next().unwrap_or(mnemonic);
    let conditions = [
        "", "eq", "ne", "hs", "cs", "lo", "cc", "mi", "pl", "vs", "vc", "hi", "ls", "ge", "lt", "gt", "le",
    ];
    let is = |name: &str| {
        base.strip_prefix(name)
            .is_some_and(|rest| conditions.contains(&rest))
    };
    let double = operands.starts_with('d');
    let literal = operands.contains("[pc");
    let indexed = operands
        .split_once('[')
        .and_then(|(_, inside)| inside.split(']').next()?.split_once(','))
        .is_some_and(|(_, offset)| !offset.trim().starts_with('#'));
    let into_pc = operands.starts_with("pc");
    match base {
        _ if is("bl") => Class::Branch(Branch::Call(0)),
        _ if is("blx") => Class::Branch(Branch::CallIndirect),
        _ if is("bx") && operands == "lr" => Class::Branch(Branch::Return),
        _ if is("bx") => Class::Branch(Branch::Indirect),
        "cbz" | "cbnz" => Class::Branch(Branch::Direct(0)),
        _ if is("b") => Class::Branch(Branch::Direct(0)),
        "tbb" | "tbh" => Class::Table,
        "bkpt" | "svc" | "udf" | "trap" => Class::Trap,
        "nop" | "sev" | "pld" | "clrex" | "yield" => Class::Hint,
        "wfi" | "wfe" => Class::Wait,
        "dmb" | "dsb" | "isb" => Class::Barrier,
        "mrs" | "msr" => Class::SpecialRegister,
        "cpsie" | "cpsid" => Class::ChangeState,
        _ if begins(&["it"]) => Class::IfThen,
        _ if is("udiv") || is("sdiv") => Class::Divide,
        _ if begins(&["vmla", "vmls", "vnmla", "vnmls", "vfma", "vfms", "vfnm"]) => Class::FloatMultiplyAdd,
        _ if begins(&["vdiv"]) => Class::FloatDivide,
        _ if begins(&["vsqrt"]) => Class::FloatRoot,
        _ if begins(&["vadd", "vsub"]) => Class::FloatAdd,
        _ if begins(&["vmul", "vnmul"]) => Class::FloatMultiply,
        _ if begins(&["vcvt"]) => Class::FloatConvert,
        _ if begins(&["vmov"]) && operands.matches(',').count() >= 2 => Class::FloatMovePair,
        _ if begins(&["vmov"]) && double && operands.matches(',').count() == 2 => Class::FloatMovePair,
        _ if begins(&["vmov", "vabs", "vneg", "vcmp", "vmrs", "vmsr"]) => Class::FloatMove,
        _ if begins(&["vldr"]) && !double => Class::FloatLoad,
        _ if begins(&["vstr"]) && !double => Class::FloatStore,
        _ if begins(&["vldr", "vldm", "vpop"]) => Class::FloatLoadMultiple(0),
        _ if begins(&["vstr", "vstm", "vpush"]) => Class::FloatStoreMultiple(0),
        _ if begins(&["ldrd", "ldm", "pop"]) => Class::LoadMultiple(0),
        _ if begins(&["strd", "stm", "push"]) && !begins(&["strexd"]) => Class::StoreMultiple(0),
        _ if begins(&["ldr"]) && literal => Class::LoadLiteral,
        _ if begins(&["ldr"]) => Class::Load,
        _ if begins(&["strex"]) => Class::Store,
        _ if begins(&["str"]) && indexed => Class::StoreIndexed,
        _ if begins(&["str"]) => Class::Store,
        _ if begins(&["mul", "smmul", "smul", "umull"]) => Class::Multiply,
        _ if begins(&["mla", "mls", "sml", "smml", "umlal", "umaal"]) => Class::MultiplyAdd,
        _ if into_pc && begins(&["mov", "add"]) => Class::Branch(Branch::Indirect),
        _ if begins(&["adc", "sbc"]) => Class::AddWithCarry,
        _ if is_addition(base, operands) => Class::Add { sets_flags: false },
        _ => Class::Simple,
    }
}

/// Whether an instruction adds or subtracts two values. Stack and code addresses, and negations, do not count.
fn is_addition(base: &str, operands: &str) -> bool {
    let adds = ["add", "sub", "rsb"].iter().any(|name| base.starts_with(name));
    let registers = operands.split(',').map(str::trim);
    let negates = base.starts_with("rsb") && operands.ends_with("#0");
    adds && !negates && !registers.clone().any(|name| name == "sp" || name == "pc")
}

/// A class reduced to the information that the mnemonic alone gives.
fn plain(class: Class) -> Class {
    match class {
        Class::Branch(Branch::Direct(_)) => Class::Branch(Branch::Direct(0)),
        Class::Branch(Branch::Call(_)) => Class::Branch(Branch::Call(0)),
        // In an IT block a 16-bit instruction sets no flags.
        Class::Add { .. } => Class::Add { sets_flags: false },
        Class::LoadMultiple(_) => Class::LoadMultiple(0),
        Class::StoreMultiple(_) => Class::StoreMultiple(0),
        Class::FloatLoadMultiple(_) => Class::FloatLoadMultiple(0),
        Class::FloatStoreMultiple(_) => Class::FloatStoreMultiple(0),
        other => other,
    }
}

/// For each instruction of the image, class, length and the target of a direct branch agree with the disassembler.
#[test]
fn the_decoder_agrees_with_a_disassembler() {
    let path = images::for_qemu();
    let lines = disassembly(path);
    let (plan, _) = image::read(path).unwrap();
    let mut wrong = String::new();
    for pair in lines.windows(2) {
        let (address, mnemonic, operands) = &pair[0];
        let index = ((address - plan.base) / 2) as usize;
        let instruction = decode(*address, plan.halfword(index), plan.halfword(index + 1));
        let target = match instruction.class {
            Class::Branch(Branch::Direct(to) | Branch::Call(to)) => Some(format!("{to:x}")),
            _ => None,
        };
        // Between functions and in front of tables there may be padding.
        let length = pair[1].0 - address;
        let agrees = plain(instruction.class) == class_of(mnemonic, operands)
            && (u32::from(instruction.length) == length || length > 4)
            && target.is_none_or(|target| operands.contains(&target));
        if !agrees {
            let _ = writeln!(
                wrong,
                "{address:x}: {mnemonic} {operands}: {instruction:?}, {length} bytes"
            );
        }
    }
    assert!(lines.len() > 10_000, "{} lines", lines.len());
    assert!(wrong.is_empty(), "{wrong}");
    println!("{} instructions agree", lines.len());
}

/// A tail call: the callee's cycles are charged to the function that branched to it, not to that function's caller.
#[test]
fn a_tail_call_keeps_the_stage() {
    let mut plan = guest_plan();
    let code_at = 4 * guest::VECTORS;
    let at = |address: u32| (address / 2) as usize;
    let (tick, callee) = (code_at + guest::TICK, code_at + guest::TICK + 0x34);
    // In the tick, `bl` calls the reset code; its last instruction is taken as a branch to `callee`.
    let reset_end = code_at + guest::OUTER - 2;
    plan.stages[at(reset_end)] = Some(Stage::PassChange);
    plan.stages[at(callee)] = Some(Stage::Surface);
    plan.starts = vec![false; plan.stages.len()];
    plan.starts[at(callee)] = true;
    let mut account = Account::new(plan);
    let mut run = |address: u32| {
        let index = account.decode(address).unwrap();
        account.execute(index)
    };
    // tick: push, bl; the reset code's `b`; callee: movs, bx; return to the tick, and from it.
    for address in [
        code_at,
        tick,
        tick + 8,
        reset_end,
        callee,
        callee + 2,
        tick + 0x30,
    ] {
        assert_eq!(run(address), None);
    }
    let record = run(code_at + 2).unwrap();
    assert_eq!(record.stages[Stage::Surface as usize].nominal, 0);
    // b 1 + 1, movs 1, bx 1 + 2; one more for each target that straddles a word boundary, here none.
    assert_eq!(record.stages[Stage::PassChange as usize].nominal, 6);
}

/// Every loop of the sample task and of the planning task has a documented bound, no function of them panics, and the stack bound derived from the
/// image fits into the RAM that is left.
#[test]
fn the_image_is_bounded() {
    let path = images::for_qemu();
    let analysis = images::analysis();
    assert!(analysis.task.len() > 5, "{:?}", analysis.task);
    assert_eq!(analysis.unresolved, [""; 0], "not followed");
    let unbounded = analysis.unbounded();
    assert!(
        unbounded.is_empty(),
        "loops without a bound in host-sim/cycles/src/graph/bounds.rs: {unbounded:#?}"
    );
    assert_eq!(analysis.stale(), [""; 0], "bounds without a loop");
    assert_eq!(analysis.panics(), [""; 0], "in a real-time task");
    for name in ["Sequencer::tick", "Sequencer>::plan", "Lookahead::work"] {
        assert!(
            analysis.task.iter().any(|function| function.ends_with(name)),
            "{name} is not followed"
        );
    }
    let sizes = image::sizes(path).unwrap();
    let (needed, room) = (u64::from(analysis.stack_bytes()), sizes.stack_room);
    assert!(
        needed < room,
        "{needed} of {room} bytes of stack: {:?}",
        analysis.contexts
    );
}

/// Figures and operations of a job of the table; not the shared measurement where `again`.
fn counted((name, path, ticks): (&str, PathBuf, u32), again: bool) -> (Vec<Figure>, (String, Operations)) {
    let other;
    let ticks = if !again && SURFACES.iter().any(|(surface, _)| *surface == name) {
        images::ticks_of(name)
    } else {
        let prepared = prepare(&job_file::load(&path).unwrap()).unwrap();
        other = images::setup().run(&prepared, ticks).unwrap();
        &other
    };
    let operations = operations::count(ticks).unwrap().operations;
    (figures::figures(name, ticks), (name.to_owned(), operations))
}

/// Figures and operations of all jobs of the table, measured in parallel on all processors.
fn all_counted(again: bool) -> (Vec<Figure>, Vec<(String, Operations)>) {
    let jobs = Mutex::new(cycles::jobs().into_iter());
    let next = || jobs.lock().unwrap().next();
    let threads = std::thread::available_parallelism().map_or(1, NonZero::get);
    let counted: Vec<_> = std::thread::scope(|scope| {
        let worker = || {
            std::iter::from_fn(next)
                .map(|job| counted(job, again))
                .collect::<Vec<_>>()
        };
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(worker)).collect();
        let counted = workers.into_iter().flat_map(|worker| worker.join().unwrap());
        counted.collect()
    });
    let (figures, operations): (Vec<_>, Vec<_>) = counted.into_iter().unzip();
    (figures.into_iter().flatten().collect(), operations)
}

/// Measurements after which a difference from the golden table counts.
const MEASUREMENTS: u32 = 3;

/// Compares with the golden table; `measure` gets the number of measurements before. A busy machine may stop QEMU within a tick for longer
/// than a period, and the firmware then counts a missed one, which takes some hundred cycles: growth is what each measurement shows.
fn check_growth(measure: impl Fn(u32) -> (Vec<Figure>, Vec<(String, Operations)>)) {
    let table = std::fs::read_to_string(golden::path()).unwrap();
    let mut differences = Vec::new();
    for before in 0..MEASUREMENTS {
        let (figures, counts) = measure(before);
        differences = golden::differences(&table, &figures, &counts);
        if differences.is_empty() {
            return;
        }
    }
    panic!(
        "old -> new; if it is meant to be so, `cargo sim budget --bless`:\n{}",
        differences.join("\n")
    );
}

/// No stage takes more than 2 % more cycles than in the golden table, and a sample executes the same operations.
#[test]
fn no_stage_has_grown() {
    check_growth(|before| {
        let (all, counts) = all_counted(before > 0);
        for (name, ..) in cycles::jobs() {
            assert!(all.iter().any(|figure| figure.surface == name), "{name}");
        }
        for figure in all.iter().filter(|figure| figure.stage == "pulses") {
            assert!(figure.max < PERIOD_CYCLES / 10, "{figure:?}");
        }
        let ticks = all.iter().filter(|figure| figure.stage == figures::TICK);
        for figure in ticks {
            assert!(figure.period_share_pct() <= TICK_SHARE_MAX_PCT, "{figure:?}");
        }
        let planning = all.iter().filter(|figure| figure.stage == figures::PLANNING);
        let planned: Vec<_> = planning
            .inspect(|figure| assert!(figure.max <= PLANNING_CYCLES_MAX, "{figure:?}"))
            .collect();
        // Every job has a planning; two models.
        assert_eq!(planned.len(), cycles::jobs().len() * 2, "{planned:?}");
        (all, counts)
    });
}

/// The worst-case ticks that searches have found take no more cycles than in the golden table.
#[test]
fn the_worst_ticks_have_not_grown() {
    check_growth(|_| (golden::worst_ticks(images::setup()).unwrap(), Vec::new()));
}

/// A short search finds no tick above a tenth of the period, which is half of the firmware's tick budget (`TICK_BUDGET_CYCLES`, a fifth). The
/// stack used is within the bound derived from the image.
fn check_search(jobs: u32, class: JobClass) {
    let mut session = MeasurementSession::new(images::setup()).unwrap();
    let result = search(&mut session, jobs, 3, class, || {}).unwrap();
    assert!(
        result.executed >= (jobs / 3).max(1),
        "{} jobs ran",
        result.executed
    );
    let found = &result.elite[0];
    let cycles = figures::tick_cycles(&found.worst.record, figures::Model::Pessimistic);
    assert!(cycles < PERIOD_CYCLES / 10, "{cycles} cycles: {found:?}");
    let planning = session.planning_cycles_max();
    assert!(planning > 0);
    assert!(planning <= PLANNING_CYCLES_MAX, "{planning} cycles of planning");
    let analysis = images::analysis();
    assert!(
        session.stack_bytes() <= analysis.stack_bytes(),
        "more stack than the image says"
    );
}

#[test]
fn a_short_search_finds_no_tick_over_its_budget() {
    check_search(8, JobClass::default());
}

#[test]
fn a_short_search_with_limits_finds_no_tick_over_its_budget() {
    let class = JobClass {
        limits: true,
        ..JobClass::default()
    };
    check_search(2, class);
}

/// A short search of curved passes in a region, within axis limits.
#[test]
fn a_short_search_of_curved_passes_finds_no_tick_over_its_budget() {
    let class = JobClass {
        limits: true,
        constant: true,
        region: true,
    };
    check_search(2, class);
}
