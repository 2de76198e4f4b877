//! The C ABI: what the host reads through a library's pointers, from its entry to its plans.
//!
//! An input is a script, a line for a structure, which a library that is made of it hands to
//! the host: with any size, lists of any order, functions that are missing, pointers that
//! are null or not aligned. Only what the contract lets a host believe is true: as much
//! memory is behind a pointer as was declared, no byte more, so that the address sanitizer
//! sees whoever reads more; and where nothing may be read, nothing is there. After each call
//! the memory is overwritten and given back.
//!
//! The host takes exactly what is valid, and takes it as it was during the call.

#![allow(unsafe_code, reason = "both sides of the C ABI")]

use std::cell::RefCell;
use std::collections::HashMap;
use std::ffi::c_void;
use std::ptr;
use std::sync::{Arc, Mutex, MutexGuard};

use fleetyard_abi::object::Object;
use fleetyard_abi::sdk::{Catalog, Options, Rejected, Sink};
use fleetyard_abi::{
    Assignment, Budget, Environment, Goals, GridEnvironment, GridPlan, Heading, Instance, Kind,
    Lists, LogLevel, Motion, Objective, Status, c,
};
use fleetyard_runtime::Library;

/// Most elements of a list that is really there.
const LONGEST: u64 = 1 << 12;

/// Most cells of a plan that the host reads.
const MOST_CELLS: u64 = 1 << 28;

/// A structure: its name, and the values of its fields.
type Line = (String, HashMap<String, String>);

/// Makes a library of the script, loads it, and has it plan.
pub fn run(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    let lines: Vec<Line> = text.lines().take(64).filter_map(line).collect();
    let (mut memory, mut stage) = (Memory::default(), Stage::default());
    let entry = stage.set(&lines, &mut memory);
    let loads = stage.loads;
    STAGE.set(stage);
    // SAFETY: the entry is as long as it says, and lives longer than the library.
    let entry: &'static c::PluginEntry = unsafe { &*entry };
    match Library::from_entries(&[entry]) {
        Ok(library) => {
            assert!(loads, "it was loaded: {text}");
            use_it(&library);
            library.deinit();
        }
        Err(fault) => {
            assert!(!loads, "{fault}: {text}");
            assert!(!fault.to_string().is_empty());
        }
    }
    STAGE.take();
    drop(memory);
}

fn line(text: &str) -> Option<Line> {
    let mut words = text.split_whitespace();
    let name = words.next()?.to_owned();
    let fields = words.filter_map(|word| word.split_once('='));
    let fields = fields.map(|(name, value)| (name.to_owned(), value.to_owned()));
    Some((name, fields.collect()))
}

// ---- The values of a script --------------------------------------------------------

fn number<T: TryFrom<i64>>(line: &Line, name: &str, otherwise: T) -> T {
    let value = line.1.get(name).and_then(|value| value.parse::<i64>().ok());
    value
        .and_then(|value| T::try_from(value).ok())
        .unwrap_or(otherwise)
}

/// The size that a structure claims to have: of its own, or so much more or less.
fn size<T>(line: &Line) -> u32 {
    let real = size_of::<T>() as u32;
    let Some(text) = line.1.get("size") else {
        return real;
    };
    let value = text.parse::<i64>().unwrap_or(i64::from(real));
    let relative = text.starts_with(['+', '-']);
    (if relative {
        i64::from(real) + value
    } else {
        value
    }) as u32
}

fn list<T: TryFrom<u64> + Default>(line: &Line, name: &str) -> Vec<T> {
    let text = line.1.get(name).map_or("", String::as_str);
    let values = text
        .split(',')
        .filter_map(|value| value.parse::<u64>().ok());
    values
        .map(|value| T::try_from(value).unwrap_or_default())
        .collect()
}

fn word(line: &Line, name: &str) -> String {
    line.1.get(name).cloned().unwrap_or_default()
}

fn misses(line: &Line, function: &str) -> bool {
    word(line, "missing")
        .split(',')
        .any(|name| name == function)
}

/// The target of a pointer.
#[derive(Clone, Copy, PartialEq)]
enum To {
    There,
    Null,
    /// Beside where it could be read.
    Odd,
}

fn to(line: &Line, name: &str) -> To {
    match word(line, name).as_str() {
        "null" => To::Null,
        "odd" => To::Odd,
        _ => To::There,
    }
}

// ---- Memory ------------------------------------------------------------------------

/// The targets of pointers, each in a place of its own.
#[derive(Default)]
struct Memory(Vec<Box<[u64]>>);

impl Memory {
    fn room(&mut self, bytes: usize) -> *mut u8 {
        self.0.push(vec![0; bytes.div_ceil(8)].into_boxed_slice());
        let room = self.0.last_mut().map(|room| room.as_mut_ptr());
        room.map_or(ptr::null_mut(), <*mut u64>::cast)
    }

    /// A list that is as long as it is.
    fn list<T: Copy>(&mut self, values: &[T], to: To) -> *const T {
        match to {
            To::Null => ptr::null(),
            To::Odd => self.room(8).wrapping_add(1).cast(),
            To::There => {
                let bytes = size_of_val(values);
                let room = self.room(bytes);
                // SAFETY: there is room for so many bytes.
                unsafe { ptr::copy_nonoverlapping(values.as_ptr().cast(), room, bytes) };
                room.cast_const().cast()
            }
        }
    }

    /// A structure that begins with its size, as much of it as it claims to have, but at
    /// least what is the same in all versions.
    fn structure<T: Copy>(&mut self, value: T, size: u32, to: To) -> *const T {
        if to != To::There {
            return self.list(&[value], to);
        }
        let bytes = (size as usize).clamp(8, size_of::<T>());
        let room = self.room(bytes);
        // SAFETY: there is room for so many bytes, of which the first are the size.
        unsafe {
            ptr::copy_nonoverlapping((&raw const value).cast(), room, bytes);
            ptr::copy_nonoverlapping((&raw const size).cast(), room, size_of::<u32>());
        }
        room.cast_const().cast()
    }

    fn text(&mut self, text: &str) -> c::Str {
        c::Str {
            ptr: self.list(text.as_bytes(), To::There),
            len: text.len(),
        }
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        for room in &mut self.0 {
            room.fill(0xA5A5_A5A5_A5A5_A5A5);
        }
    }
}

/// An address that may not be read: a read of it ends the process.
fn nothing<T>() -> *const T {
    ptr::without_provenance(1 << 12)
}

// ---- The library -------------------------------------------------------------------

/// Answers of the library's functions.
#[derive(Default)]
struct Stage {
    lines: Vec<Line>,
    factory: Option<*const c::PlannerFactory>,
    descriptor: Option<*const c::Descriptor>,
    count: u32,
    init: i32,
    /// True if the host has to load it.
    loads: bool,
    /// Data that the host has to have taken at the end of a call.
    expected: Expected,
}

#[derive(Default)]
struct Expected {
    plans: Vec<GridPlan>,
    instances: Vec<Instance>,
    metrics: Vec<(String, u64)>,
    logs: usize,
    /// True if something that was submitted breaks the contract.
    broken: bool,
    /// An answer of the host that is wrong.
    wrong: Option<String>,
}

thread_local! {
    static STAGE: RefCell<Stage> = RefCell::new(Stage::default());
}

fn with<T>(look: impl FnOnce(&mut Stage) -> T) -> T {
    STAGE.with_borrow_mut(look)
}

impl Stage {
    fn line(&self, name: &str) -> Line {
        let found = self.lines.iter().find(|(known, _)| known == name);
        found.cloned().unwrap_or((name.into(), HashMap::new()))
    }

    fn set(&mut self, lines: &[Line], memory: &mut Memory) -> *const c::PluginEntry {
        self.lines = lines.to_vec();
        let entry = self.line("entry");
        let entry_size = size::<c::PluginEntry>(&entry);
        let raw = c::PluginEntry {
            struct_size: entry_size,
            abi_major: number(&entry, "major", c::ABI_MAJOR),
            abi_minor: number(&entry, "minor", c::ABI_MINOR),
            init: (!misses(&entry, "init")).then_some(init),
            deinit: (!misses(&entry, "deinit")).then_some(deinit),
            get_factory: (!misses(&entry, "get_factory")).then_some(get_factory),
        };
        self.init = number(&entry, "init", c::OK);
        let factory = self.line("factory");
        self.count = number(&factory, "count", 1);
        let table = c::PlannerFactory {
            struct_size: 0,
            reserved: 0,
            count: (!misses(&factory, "count")).then_some(count),
            descriptor: (!misses(&factory, "descriptor")).then_some(descriptor),
            create: (!misses(&factory, "create")).then_some(create),
        };
        let factory_size = size::<c::PlannerFactory>(&factory);
        self.factory = Some(memory.structure(table, factory_size, to(&factory, "to")));
        let about = self.line("descriptor");
        let (id, schema) = (word(&about, "id"), word(&about, "schema"));
        let described = c::Descriptor {
            struct_size: 0,
            reserved: 0,
            id: memory.text(&id),
            name: memory.text(&word(&about, "name")),
            version: c::Str {
                ptr: ptr::null(),
                len: number(&about, "length", 0),
            },
            description: memory.text(""),
            license: memory.text("MIT"),
            options_schema: memory.text(&schema),
            capabilities: number(&about, "capabilities", 0),
        };
        let about_size = size::<c::Descriptor>(&about);
        self.descriptor = Some(memory.structure(described, about_size, to(&about, "to")));
        let allowed =
            |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || b"._-".contains(&byte);
        let described = to(&about, "to") == To::There
            && about_size == size_of::<c::Descriptor>() as u32
            && !id.is_empty()
            && id.bytes().all(allowed)
            && (schema.is_empty() || serde_json::from_str::<serde_json::Value>(&schema).is_ok());
        let made = to(&factory, "to") == To::There
            && factory_size == size_of::<c::PlannerFactory>() as u32
            && table.count.is_some()
            && table.descriptor.is_some()
            && table.create.is_some()
            && (self.count == 0 || (self.count <= 1024 && described));
        self.loads = entry_size == size_of::<c::PluginEntry>() as u32
            && raw.abi_major == c::ABI_MAJOR
            && raw.get_factory.is_some()
            && (raw.init.is_none() || self.init == c::OK)
            && (to(&factory, "to") == To::Null || made);
        memory.list(&[raw], To::There)
    }
}

unsafe extern "C" fn init(host: *const c::Host, path: c::Str) -> i32 {
    // SAFETY: the host's structure and text live through the call.
    let (size, path) = unsafe { ((*host).struct_size, fleetyard_abi::convert::string(path)) };
    let right = size == size_of::<c::Host>() as u32 && !path.is_empty();
    with(|stage| if right { stage.init } else { -2 })
}

unsafe extern "C" fn deinit() {}

unsafe extern "C" fn get_factory(id: c::Str) -> *const c_void {
    // SAFETY: the host's text lives through the call.
    let id = unsafe { fleetyard_abi::convert::string(id) };
    if id == c::PLANNER_FACTORY_ID {
        with(|stage| stage.factory.map_or(ptr::null(), <*const _>::cast))
    } else {
        ptr::null()
    }
}

unsafe extern "C" fn count() -> u32 {
    with(|stage| stage.count)
}

unsafe extern "C" fn descriptor(_: u32) -> *const c::Descriptor {
    with(|stage| stage.descriptor.unwrap_or(ptr::null()))
}

unsafe extern "C" fn create(
    _: u32,
    options: c::Str,
    sink: *const c::Sink,
    out: *mut c::Planner,
) -> i32 {
    let object = with(|stage| stage.line("object"));
    // SAFETY: what the host hands over lives through the call; `out` is to be filled.
    unsafe {
        if fleetyard_abi::convert::string(options) != OPTIONS {
            return c::STATUS_INVALID_INPUT;
        }
        say(sink, &object);
        (*out).struct_size = size::<c::Planner>(&object);
        (*out).context = ptr::null_mut();
        (*out).prepare = (!misses(&object, "prepare")).then_some(prepare);
        (*out).plan = (!misses(&object, "plan")).then_some(plan);
        (*out).destroy = (!misses(&object, "destroy")).then_some(destroy);
    }
    number(&object, "code", c::STATUS_SOLVED)
}

unsafe extern "C" fn destroy(_: *mut c_void) {}

unsafe extern "C" fn prepare(
    _: *mut c_void,
    environment: *const c::Environment,
    budget: *const c::Budget,
    sink: *const c::Sink,
) -> i32 {
    // SAFETY: what the host hands over lives through the call.
    let read = unsafe { (Environment::from_c(environment), Budget::from_c(budget)) };
    if read.0.as_ref() != Ok(&environment_of()) || read.1 != Ok(budget_of()) {
        return c::STATUS_INVALID_INPUT;
    }
    let line = with(|stage| stage.line("prepare"));
    // SAFETY: as above.
    unsafe { say(sink, &line) };
    number(&line, "code", c::STATUS_SOLVED)
}

unsafe extern "C" fn plan(
    _: *mut c_void,
    instance: *const c::Instance,
    budget: *const c::Budget,
    sink: *const c::Sink,
) -> i32 {
    // SAFETY: what the host hands over lives through the call.
    let read = unsafe {
        (
            Instance::from_c(instance, usize::MAX),
            Budget::from_c(budget),
        )
    };
    if read.0.as_ref() != Ok(&instance_of()) || read.1 != Ok(budget_of()) {
        return c::STATUS_INVALID_INPUT;
    }
    for line in with(|stage| stage.lines.clone()) {
        // SAFETY: as above.
        unsafe {
            match line.0.as_str() {
                "plan" => submit_plan(sink, &line),
                "instance" => submit_instance(sink, &line),
                "say" => say(sink, &line),
                _ => {}
            }
        }
    }
    number(
        &with(|stage| stage.line("return")),
        "code",
        c::STATUS_SOLVED,
    )
}

/// Notes what the host has to have taken, and whether it said that it has.
fn expect<T>(what: Option<T>, code: i32, of: impl FnOnce(&mut Expected) -> &mut Vec<T>) {
    let right = if what.is_some() { c::OK } else { c::REJECTED };
    with(|stage| {
        let expected = &mut stage.expected;
        if code != right {
            expected.wrong = Some(format!("the host answered {code} and not {right}"));
        }
        if let Some(taken) = what {
            of(expected).push(taken);
        } else {
            // It says so in the log.
            expected.broken = true;
            expected.logs += 1;
        }
    });
}

/// Offsets and cells.
type Flat = (Vec<u64>, Vec<u32>);

/// Lists in one, of `agents`: where they begin, and all that is in them, as long as
/// declared; and what the host has to read, if it may. None if it would believe more than
/// there can be.
fn lists(
    memory: &mut Memory,
    line: &Line,
    agents: usize,
    (offsets, cells): (&str, &str),
) -> Option<(*const u64, *const u32, Option<Flat>)> {
    let mut begin: Vec<u64> = list(line, offsets);
    begin.resize(agents + 1, begin.last().copied().unwrap_or(0));
    let to_begin = to(line, &format!("{offsets}_to"));
    let total = begin[agents];
    let may = to_begin == To::There && begin[0] == 0 && begin.is_sorted() && total <= MOST_CELLS;
    let begin_at = memory.list(&begin, to_begin);
    if !may {
        return Some((begin_at, nothing(), None));
    }
    if total > LONGEST {
        // The host would believe it.
        return None;
    }
    let mut values: Vec<u32> = list(line, cells);
    values.resize(total as usize, 0);
    let to_values = to(line, &format!("{cells}_to"));
    let values_at = memory.list(&values, to_values);
    let is_there = to_values == To::There || total == 0;
    Some((begin_at, values_at, is_there.then_some((begin, values))))
}

unsafe fn submit_plan(sink: *const c::Sink, line: &Line) {
    let mut memory = Memory::default();
    let agents: u32 = number(line, "agents", AGENTS);
    let right = agents == AGENTS;
    let lists = if right {
        lists(&mut memory, line, agents as usize, ("offsets", "cells"))
    } else {
        Some((nothing(), nothing(), None))
    };
    let Some((offsets, cells, valid)) = lists else {
        return;
    };
    let raw = c::Plan {
        struct_size: 0,
        agents,
        offsets,
        cells,
    };
    let size = size::<c::Plan>(line);
    let whole = to(line, "to") == To::There && size == size_of::<c::Plan>() as u32;
    let raw = memory.structure(raw, size, to(line, "to"));
    let valid = valid.filter(|_| whole);
    let valid =
        valid.and_then(|(offsets, cells)| Some(GridPlan::from(Lists::from_flat(offsets, cells)?)));
    // SAFETY: the sink is the host's, and the plan is as long as it says.
    let code = unsafe {
        (*sink)
            .submit_plan
            .map(|submit| submit((*sink).context, raw))
    };
    drop(memory);
    expect(valid, code.unwrap_or(-2), |expected| &mut expected.plans);
}

unsafe fn submit_instance(sink: *const c::Sink, line: &Line) {
    let mut memory = Memory::default();
    let agents: u32 = number(line, "agents", AGENTS);
    let assigned: u32 = number(line, "assigned", 0);
    if u64::from(agents) > LONGEST || u64::from(assigned) > LONGEST {
        return;
    }
    let many = agents as usize;
    let Some((goal_offsets, goals, own)) = lists(&mut memory, line, many, ("offsets", "goals"))
    else {
        return;
    };
    let mut starts: Vec<u32> = list(line, "starts");
    starts.resize(many, 0);
    let mut codes: Vec<i32> = list(line, "headings");
    codes.resize(many, 0);
    // Agents and tasks in turns.
    let given: Vec<u32> = list(line, "assignments");
    let assignments: Vec<c::Assignment> = (0..assigned as usize)
        .map(|at| c::Assignment {
            task: given.get(2 * at).copied().unwrap_or(0).into(),
            agent: given.get(2 * at + 1).copied().unwrap_or(0),
            reserved: 0,
        })
        .collect();
    let (motion, objective): (i32, i32) = (number(line, "motion", 0), number(line, "objective", 0));
    let to_headings = if line.1.contains_key("headings") {
        to(line, "headings_to")
    } else {
        To::Null
    };
    let raw = c::Instance {
        struct_size: 0,
        agents,
        environment: nothing(),
        starts: memory.list(&starts, to(line, "starts_to")),
        headings: memory.list(&codes, to_headings),
        goal_offsets,
        goals,
        motion,
        objective,
        window_steps: number(line, "window", 0),
        allows_cycles: number(line, "cycles", 0),
        radius_m: 0.35,
        assignments_count: assigned,
        reserved: 0,
        assignments: memory.list(&assignments, to(line, "assignments_to")),
    };
    let size = size::<c::Instance>(line);
    let whole = to(line, "to") == To::There && size == size_of::<c::Instance>() as u32;
    let at = memory.structure(raw, size, to(line, "to"));
    let is_there = |name: &str, len: usize| to(line, name) == To::There || len == 0;
    let headings: Option<Option<Vec<Heading>>> = match to_headings {
        To::Null => Some(None),
        To::Odd if many > 0 => None,
        _ => codes
            .iter()
            .map(|code| Heading::from_code(*code))
            .collect::<Option<Vec<_>>>()
            .map(Some),
    };
    let valid = || {
        let (offsets, goals) = own?;
        let there = is_there("starts_to", many) && is_there("assignments_to", assignments.len());
        (whole && there).then_some(())?;
        Some(Instance {
            starts,
            headings: headings?,
            goals: Goals::from_flat(offsets, goals)?,
            motion: Motion::from_code(motion)?,
            objective: Objective::from_code(objective)?,
            window_steps: raw.window_steps,
            radius_m: raw.radius_m,
            allows_cycles: raw.allows_cycles != 0,
            assignments: assignments
                .iter()
                .map(|given| Assignment {
                    agent: given.agent,
                    task: given.task,
                })
                .collect(),
        })
    };
    let valid = valid();
    // SAFETY: the sink is the host's, and the instance is as long as it says.
    let code = unsafe {
        (*sink)
            .submit_instance
            .map(|submit| submit((*sink).context, at))
    };
    drop(memory);
    expect(valid, code.unwrap_or(-2), |expected| {
        &mut expected.instances
    });
}

/// Texts, with the lengths that they have.
unsafe fn say(sink: *const c::Sink, line: &Line) {
    let mut memory = Memory::default();
    let (text, value) = (word(line, "text"), number(line, "value", 0_u32));
    let null = c::Str {
        ptr: ptr::null(),
        len: usize::MAX >> 1,
    };
    let there = to(line, "to") != To::Null;
    let shown = if there { memory.text(&text) } else { null };
    // SAFETY: the sink is the host's, and the text is as long as it says.
    unsafe {
        let context = (*sink).context;
        if let (Some(metric), Some(log), Some(fail)) = ((*sink).metric, (*sink).log, (*sink).fail) {
            metric(context, shown, f64::from_bits(u64::from(value) << 32));
            log(context, number(line, "level", 0), shown);
            fail(context, shown);
        }
        if let (Some(progress), Some(cancelled)) = ((*sink).progress, (*sink).cancelled) {
            progress(context, 1, value.into());
            cancelled(context);
        }
    }
    drop(memory);
    with(|stage| {
        let text = if there { text } else { String::new() };
        stage.expected.metrics.push((text, u64::from(value) << 32));
        stage.expected.logs += 1;
    });
}

// ---- The host ----------------------------------------------------------------------

const AGENTS: u32 = 2;
const OPTIONS: &str = "{\"speed\":2}";

fn environment_of() -> Environment {
    Environment::Grid(GridEnvironment {
        map_name: "small".into(),
        rows: 2,
        cols: 3,
        connectivity: 4,
        cell_size_m: 0.5,
        step_s: 1.0,
        passable: vec![1, 1, 0, 1, 1, 1],
        terrain: vec![b'.', b'.', b'@', b'.', b'.', b'.'],
    })
}

fn budget_of() -> Budget {
    Budget {
        deadline_monotonic_ns: u64::MAX,
        answer_by_ns: u64::MAX,
        wall_ns: 1_000_000,
        nodes: 0,
        memory_bytes: 0,
        threads: 1,
        seed: 7,
    }
}

fn instance_of() -> Instance {
    Instance {
        starts: vec![0, 4],
        headings: Some(vec![Heading::North; AGENTS as usize]),
        goals: Goals::single(vec![4, 0]),
        motion: Motion::Pebble,
        objective: Objective::SumOfCosts,
        window_steps: 0,
        radius_m: 0.2,
        allows_cycles: false,
        assignments: vec![Assignment { agent: 1, task: 9 }],
    }
}

#[derive(Default)]
struct Taken(Mutex<Expected>);

impl Taken {
    fn now(&self) -> MutexGuard<'_, Expected> {
        self.0.lock().expect("nobody panics with it")
    }
}

impl Sink for Taken {
    fn submit_plan(&self, plan: PlanRef<'_>) -> Result<(), Rejected> {
        self.now().plans.push(plan.clone());
        Ok(())
    }

    fn submit_instance(&self, instance: &Instance) -> Result<(), Rejected> {
        self.now().instances.push(instance.clone());
        Ok(())
    }

    fn metric(&self, name: &str, value: f64) {
        self.now().metrics.push((name.into(), value.to_bits()));
    }

    fn log(&self, _: LogLevel, _: &str) {
        self.now().logs += 1;
    }

    fn progress(&self, _: u64, _: u64) {}

    fn cancelled(&self) -> bool {
        false
    }
}

/// Makes an object, and calls it twice.
fn use_it(library: &Library) {
    let Some(first) = library.descriptors().into_iter().next() else {
        return;
    };
    let (object, returned) = with(|stage| (stage.line("object"), stage.line("return")));
    let taken = Taken::default();
    let made = library.create(Kind::Planner, &first.id, Options::new(OPTIONS), &taken);
    let whole = size::<c::Planner>(&object) == size_of::<c::Planner>() as u32
        && !misses(&object, "prepare")
        && !misses(&object, "plan");
    let right = whole && number(&object, "code", c::STATUS_SOLVED) == c::STATUS_SOLVED;
    assert_eq!(made.is_ok(), right, "{:?}", made.err());
    compare(&taken);
    let Ok(Object::Planner(mut planner)) = made else {
        return;
    };
    let environment = Arc::new(environment_of());
    if planner.prepare(&environment, &budget_of(), &taken).is_err() {
        return;
    }
    compare(&taken);
    for _ in 0..2 {
        let result = planner.plan(&instance_of(), &budget_of(), &taken);
        let broken = with(|stage| stage.expected.broken);
        compare(&taken);
        let code = number(&returned, "code", c::STATUS_SOLVED);
        match result {
            Ok(()) => assert!(!broken && code == c::STATUS_SOLVED),
            Err(failure) if failure.broke_contract => {
                assert!(broken || Status::from_code(code).is_none(), "{failure}");
            }
            Err(failure) => assert_eq!(failure.status.code(), code, "{failure}"),
        }
    }
}

/// Checks that the host took all that was submitted, after the memory of it is gone.
fn compare(taken: &Taken) {
    let expected = with(|stage| std::mem::take(&mut stage.expected));
    let taken = std::mem::take(&mut *taken.now());
    assert_eq!(expected.wrong, None);
    assert_eq!(taken.plans, expected.plans);
    assert_eq!(taken.instances, expected.instances);
    assert_eq!(taken.metrics, expected.metrics);
    assert_eq!(taken.logs, expected.logs);
}
