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
use std::str::FromStr;
use std::sync::{Arc, Mutex, MutexGuard};

use fleetyard_abi::convert::{
    CEnvironment, CFleetState, CInstance, CSink, SinkContext, size_of, string,
};
use fleetyard_abi::figures::check_figure;
use fleetyard_abi::memory::Data;
use fleetyard_abi::object::Object;
use fleetyard_abi::sdk::{Catalog, Failure, Options, Rejected, Sink};
use fleetyard_abi::{
    Annotation, Assignment, Budget, ControlPlan, Environment, FleetState, FleetStatus, Footprint,
    Goals, GridEnvironment, GridPlan, Heading, Instance, Kind, Knot, KnotPlan, Lists, LogLevel,
    Motion, MotionPlan, Mover, Objective, Part, Plan, PlanRef, Request, RoadmapEnvironment, Robot,
    SharedEnvironment, State, Status, View, Visit, WorkspaceEnvironment, c,
};
use fleetyard_core::is_unseen;
use fleetyard_runtime::Library;
use serde_json::{Value, json};

/// Most elements of a list that is really there.
const LONGEST: u64 = 1 << 12;

/// More elements than the host reads of any list.
const TOO_MANY: u64 = 1 << 28;

/// Most parts of a structure, and most features of a plugin.
const MOST_NAMED: u64 = 1 << 10;

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
fn size<T>(line: &Line, name: &str) -> u32 {
    let real = size_of::<T>();
    let Some(text) = line.1.get(name) else {
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

/// The values of a list, as many as can be read.
fn list<T: FromStr>(line: &Line, name: &str) -> Vec<T> {
    let text = line.1.get(name).map_or("", String::as_str);
    text.split(',')
        .filter_map(|value| value.parse().ok())
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

/// True if the host finds a whole structure, which may be of a later version.
fn is_whole<T>(line: &Line, size_name: &str, to_name: &str) -> bool {
    to(line, to_name) == To::There && size::<T>(line, size_name) >= size_of::<T>()
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
    /// least what is the same in all versions. A longer one ends with what nobody knows.
    fn structure<T: Copy>(&mut self, value: T, size: u32, to: To) -> *const T {
        if to != To::There {
            return self.list(&[value], to);
        }
        let real = std::mem::size_of::<T>();
        let bytes = (size as usize).clamp(8, real + 64);
        let room = self.room(bytes);
        // SAFETY: there is room for so many bytes, of which the first are the size.
        unsafe {
            room.write_bytes(0xA5, bytes);
            ptr::copy_nonoverlapping((&raw const value).cast(), room, bytes.min(real));
            ptr::copy_nonoverlapping((&raw const size).cast(), room, 4);
        }
        room.cast_const().cast()
    }

    fn text(&mut self, text: &str) -> c::Str {
        c::Str {
            ptr: self.list(text.as_bytes(), To::There).cast(),
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
    features: Vec<String>,
    count: u32,
    init: i32,
    /// True if the host has to load it.
    loads: bool,
    /// The question that the host asks.
    question: Option<Arc<Question>>,
    /// The environment of the last `prepare`.
    environment: Option<*const c::Environment>,
    destroyed: u32,
    /// Data that the host has to have taken at the end of a call.
    expected: Expected,
}

#[derive(Default)]
struct Expected {
    plans: Vec<Plan>,
    requests: Vec<Request>,
    metrics: Vec<(String, u64)>,
    notes: Vec<(String, String)>,
    logs: usize,
    /// True if something that was submitted breaks the contract.
    broken: bool,
    /// An answer of the host, or something that it handed over, that is wrong.
    wrong: Option<String>,
}

thread_local! {
    static STAGE: RefCell<Stage> = RefCell::new(Stage::default());
}

fn with<T>(look: impl FnOnce(&mut Stage) -> T) -> T {
    STAGE.with_borrow_mut(look)
}

/// The contexts of the factory and of the object: the host passes them back and looks at
/// neither.
fn factory_context() -> *mut c_void {
    nothing::<c_void>().cast_mut()
}

fn object_context() -> *mut c_void {
    factory_context().wrapping_byte_add(8)
}

/// Notes something that is wrong with what the host does.
fn insist(right: bool, wrong: &str) {
    if !right {
        with(|stage| stage.expected.wrong = Some(wrong.to_owned()));
    }
}

impl Stage {
    fn line(&self, name: &str) -> Line {
        let found = self.lines.iter().find(|(known, _)| known == name);
        found.cloned().unwrap_or((name.into(), HashMap::new()))
    }

    fn set(&mut self, lines: &[Line], memory: &mut Memory) -> *const c::PluginEntry {
        self.lines = lines.to_vec();
        let entry = self.line("entry");
        let entry_size = size::<c::PluginEntry>(&entry, "size");
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
            reserved: number(&factory, "reserved", 0),
            context: factory_context(),
            count: (!misses(&factory, "count")).then_some(count),
            descriptor: (!misses(&factory, "descriptor")).then_some(descriptor),
            create: (!misses(&factory, "create")).then_some(create),
        };
        let factory_size = size::<c::PlannerFactory>(&factory, "size");
        self.factory = Some(memory.structure(table, factory_size, to(&factory, "to")));
        let described = self.describe(memory);
        let made = is_whole::<c::PlannerFactory>(&factory, "size", "to")
            && table.reserved == 0
            && table.count.is_some()
            && table.descriptor.is_some()
            && table.create.is_some()
            && (self.count == 0 || (self.count <= 1024 && described));
        self.loads = entry_size >= size_of::<c::PluginEntry>()
            && raw.abi_major == c::ABI_MAJOR
            && raw.get_factory.is_some()
            && (raw.init.is_none() || self.init == c::OK)
            && (to(&factory, "to") == To::Null || made);
        memory.list(&[raw], To::There)
    }

    /// Sets the descriptor, and says if it is one.
    fn describe(&mut self, memory: &mut Memory) -> bool {
        let about = self.line("descriptor");
        let (id, schema) = (word(&about, "id"), word(&about, "schema"));
        self.features = list(&about, "features");
        self.features.retain(|feature| !feature.is_empty());
        let listed = self.features.len() as u64;
        let declared = number(&about, "feature_count", listed as u32);
        let too_many = u64::from(declared) > MOST_NAMED;
        let to_features = to(&about, "features_to");
        let feature_count = if too_many {
            declared
        } else {
            declared.min(listed as u32)
        };
        self.features.truncate(feature_count as usize);
        let features: Vec<c::Str> = self
            .features
            .iter()
            .map(|feature| memory.text(feature))
            .collect();
        let raw = c::Descriptor {
            struct_size: 0,
            feature_count,
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
            features: if too_many {
                nothing()
            } else {
                memory.list(&features, to_features)
            },
        };
        let about_size = size::<c::Descriptor>(&about, "size");
        self.descriptor = Some(memory.structure(raw, about_size, to(&about, "to")));
        let letter = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit();
        let allowed = |byte: u8| letter(byte) || b"._-".contains(&byte);
        is_whole::<c::Descriptor>(&about, "size", "to")
            && !too_many
            && (to_features == To::There || feature_count == 0)
            && id.bytes().next().is_some_and(letter)
            && id.bytes().all(allowed)
            && id.len() <= 100
            && (schema.is_empty() || serde_json::from_str::<Value>(&schema).is_ok())
    }
}

unsafe extern "C" fn init(host: *const c::Host, path: c::Str) -> i32 {
    // SAFETY: the host's structure and text live through the call.
    let (size, path) = unsafe { ((*host).struct_size, string(path)) };
    let right = size == size_of::<c::Host>() && !path.is_empty();
    with(|stage| if right { stage.init } else { -2 })
}

unsafe extern "C" fn deinit() {}

unsafe extern "C" fn get_factory(id: c::Str) -> *const c_void {
    // SAFETY: the host's text lives through the call.
    let id = unsafe { string(id) };
    if id == c::PLANNER_FACTORY_ID {
        with(|stage| stage.factory.map_or(ptr::null(), <*const _>::cast))
    } else {
        ptr::null()
    }
}

unsafe extern "C" fn count(context: *mut c_void) -> u32 {
    insist(context == factory_context(), "the context of `count`");
    with(|stage| stage.count)
}

unsafe extern "C" fn descriptor(context: *mut c_void, _: u32) -> *const c::Descriptor {
    insist(context == factory_context(), "the context of `descriptor`");
    with(|stage| stage.descriptor.unwrap_or(ptr::null()))
}

unsafe extern "C" fn create(
    context: *mut c_void,
    _: u32,
    options: *const c::Options,
    sink: *const c::Sink,
    out: *mut c::Planner,
) -> i32 {
    let object = with(|stage| stage.line("object"));
    insist(context == factory_context(), "the context of `create`");
    // SAFETY: what the host hands over lives through the call; `out` is to be filled.
    unsafe {
        insist(has_options(options), "the options");
        insist((*out).struct_size >= size_of::<c::Planner>(), "the room");
        say(sink, &object);
        (*out).struct_size = size::<c::Planner>(&object, "size");
        (*out).reserved = number(&object, "reserved", 0);
        (*out).context = object_context();
        (*out).prepare = (!misses(&object, "prepare")).then_some(prepare);
        (*out).plan = (!misses(&object, "plan")).then_some(plan);
        (*out).destroy = (!misses(&object, "destroy")).then_some(destroy);
    }
    number(&object, "code", c::STATUS_SOLVED)
}

/// True if the options are those that were given, as a table and as text.
///
/// # Safety
/// The options are as the header says.
unsafe fn has_options(options: *const c::Options) -> bool {
    // SAFETY: by the caller's promise, here and below.
    let options = unsafe { &*options };
    // SAFETY: as promised.
    let list = unsafe { std::slice::from_raw_parts(options.list, options.count as usize) };
    let value = |option: &c::PluginOption| {
        // SAFETY: as promised.
        let text = unsafe { string(option.text) };
        let value = match option.kind {
            c::OPTION_NUMBER => json!(option.number),
            c::OPTION_FLAG => json!(option.number != 0.0),
            c::OPTION_TEXT => json!(text),
            c::OPTION_JSON => serde_json::from_str(&text).ok()?,
            _ => return None,
        };
        // SAFETY: as promised.
        (option.reserved == 0).then(|| (unsafe { string(option.name) }, value))
    };
    let table: Option<serde_json::Map<String, Value>> = list.iter().map(value).collect();
    // SAFETY: as promised.
    let text = unsafe { string(options.json) };
    let given: Value = serde_json::from_str(OPTIONS).expect("JSON");
    options.struct_size == size_of::<c::Options>()
        && text == OPTIONS
        && table.is_some_and(|table| Value::Object(table) == given)
}

unsafe extern "C" fn destroy(context: *mut c_void) {
    insist(context == object_context(), "the context of `destroy`");
    with(|stage| stage.destroyed += 1);
}

/// True if something was read, and as it was given. As text, for `NaN` differs from itself.
fn is_given<T: std::fmt::Debug>(read: Result<T, Failure>, given: &T) -> bool {
    read.is_ok_and(|read| format!("{read:?}") == format!("{given:?}"))
}

fn question() -> Arc<Question> {
    with(|stage| stage.question.clone()).expect("the host has asked")
}

unsafe extern "C" fn prepare(
    context: *mut c_void,
    environment: *const c::Environment,
    budget: *const c::Budget,
    sink: *const c::Sink,
) -> i32 {
    let question = question();
    // SAFETY: what the host hands over lives through the call.
    let read = unsafe { (Environment::from_c(environment), Budget::from_c(budget)) };
    insist(context == object_context(), "the context of `prepare`");
    insist(is_given(read.0, &question.environment), "the environment");
    insist(is_given(read.1, &budget_of()), "the budget of `prepare`");
    let line = with(|stage| {
        stage.environment = Some(environment);
        stage.line("prepare")
    });
    // SAFETY: as above.
    unsafe { say(sink, &line) };
    number(&line, "code", c::STATUS_SOLVED)
}

unsafe extern "C" fn plan(
    context: *mut c_void,
    instance: *const c::Instance,
    budget: *const c::Budget,
    sink: *const c::Sink,
) -> i32 {
    let question = question();
    // SAFETY: what the host hands over lives through the call, and the environment until the
    // next `prepare`.
    let (environment, kept, read, budget) = unsafe {
        (
            (*instance).environment,
            Environment::from_c((*instance).environment),
            Instance::from_c(instance),
            Budget::from_c(budget),
        )
    };
    let (lines, learnt) = with(|stage| (stage.lines.clone(), stage.environment));
    insist(context == object_context(), "the context of `plan`");
    insist(learnt == Some(environment), "another map than in `prepare`");
    insist(
        is_given(kept, &question.environment),
        "the kept environment",
    );
    insist(is_given(read, &question.instance), "the instance");
    insist(is_given(budget, &budget_of()), "the budget of `plan`");
    for line in &lines {
        // SAFETY: as above.
        unsafe {
            match line.0.as_str() {
                "plan" => submit_plan(sink, line, &lines),
                "request" => submit_request(sink, line, &lines),
                "say" => say(sink, line),
                _ => {}
            }
        }
    }
    let line = with(|stage| stage.line("return"));
    number(&line, "code", c::STATUS_SOLVED)
}

/// Notes what the host has to have taken, and whether it said that it has.
fn expect<T>(what: Option<T>, code: Option<i32>, of: impl FnOnce(&mut Expected) -> &mut Vec<T>) {
    let right = if what.is_some() { c::OK } else { c::REJECTED };
    with(|stage| {
        let expected = &mut stage.expected;
        if code != Some(right) {
            expected.wrong = Some(format!("the host answered {code:?} and not {right}"));
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

/// Offsets of as many lists as there are agents: where they are, and what they are if the host
/// may go by them. None if it would believe more than there can be.
fn offsets(memory: &mut Memory, line: &Line, name: &str) -> Option<(*const u64, Option<Vec<u64>>)> {
    let lists = AGENTS as usize;
    let mut begin: Vec<u64> = list(line, name);
    begin.resize(lists + 1, begin.last().copied().unwrap_or(0));
    let to = to(line, &format!("{name}_to"));
    let total = begin[lists];
    let may = to == To::There && begin[0] == 0 && begin.is_sorted() && total <= TOO_MANY;
    if may && total > LONGEST {
        // The host would believe it.
        return None;
    }
    Some((memory.list(&begin, to), may.then_some(begin)))
}

/// The values of a list: where they are, as many as the host reads, and what they are if it
/// finds them. Nothing is there where it may not read.
fn column<T: Copy + Default + FromStr>(
    memory: &mut Memory,
    line: &Line,
    name: &str,
    len: Option<usize>,
) -> (*const T, Option<Vec<T>>) {
    let Some(len) = len else {
        return (nothing(), None);
    };
    let mut values: Vec<T> = list(line, name);
    values.resize(len, T::default());
    let to = to(line, &format!("{name}_to"));
    let pointer = memory.list(&values, to);
    (pointer, (to == To::There || len == 0).then_some(values))
}

fn all_finite(numbers: &[f64]) -> bool {
    numbers.iter().all(|number| number.is_finite())
}

/// The parts that a structure names by their numbers among the lines of parts, and if the host
/// may take the structure with them.
fn parts(memory: &mut Memory, line: &Line, lines: &[Line]) -> (c::Parts, bool) {
    let described: Vec<&Line> = lines.iter().filter(|line| line.0 == "part").collect();
    let mut right = true;
    let raw: Vec<c::Part> = list(line, "parts")
        .into_iter()
        .filter_map(|number: usize| described.get(number).copied())
        .take(16)
        .map(|line| {
            let (raw, is_right) = part(memory, line);
            right &= is_right;
            raw
        })
        .collect();
    let declared = number(line, "part_count", raw.len() as u64);
    if declared > MOST_NAMED {
        let list = nothing();
        let count = declared;
        return (c::Parts { list, count }, false);
    }
    let to = to(line, "parts_to");
    let list = memory.list(&raw, to);
    let count = raw.len() as u64;
    let there = to == To::There || count == 0;
    (c::Parts { list, count }, right && there)
}

fn part(memory: &mut Memory, line: &Line) -> (c::Part, bool) {
    let flags: u32 = number(line, "flags", 0);
    let reserved: u32 = number(line, "reserved", 0);
    let (is_json, critical) = (flags & c::PART_JSON != 0, flags & c::PART_CRITICAL != 0);
    let known = flags & !(c::PART_JSON | c::PART_CRITICAL) == 0 && reserved == 0;
    let text = word(line, "json");
    let json = c::Json {
        struct_size: 0,
        reserved: number(line, "json_reserved", 0),
        text: memory.text(&text),
    };
    let data = if is_json && known {
        memory.structure(json, size::<c::Json>(line, "size"), to(line, "to"))
    } else {
        nothing()
    };
    let whole = is_whole::<c::Json>(line, "size", "to")
        && json.reserved == 0
        && serde_json::from_str::<Value>(&text).is_ok();
    let raw = c::Part {
        id: memory.text(&word(line, "id")),
        data: data.cast(),
        flags,
        reserved,
    };
    (raw, known && !critical && (!is_json || whole))
}

/// The body of a plan, and the plan if the host may take it.
fn body<T: Copy>(
    memory: &mut Memory,
    line: &Line,
    body: T,
    plan: Option<Plan>,
) -> (*const c_void, Option<Plan>) {
    let size = size::<T>(line, "body_size");
    let raw = memory.structure(body, size, to(line, "body_to"));
    (raw.cast(), plan)
}

unsafe fn submit_plan(sink: *const c::Sink, line: &Line, lines: &[Line]) {
    let mut memory = Memory::default();
    let agents: u32 = number(line, "agents", AGENTS);
    let reserved: u32 = number(line, "reserved", 0);
    let body_reserved: u32 = number(line, "body_reserved", 0);
    let form: i32 = number(line, "form", c::FORM_CELLS);
    let (parts, with_parts) = parts(&mut memory, line, lines);
    let whole = is_whole::<c::Plan>(line, "size", "to");
    let has_body = match form {
        c::FORM_CELLS => is_whole::<c::Cells>(line, "body_size", "body_to"),
        c::FORM_VISITS => is_whole::<c::Visits>(line, "body_size", "body_to"),
        c::FORM_TRAJECTORIES => is_whole::<c::Trajectories>(line, "body_size", "body_to"),
        _ => false,
    };
    let right = whole && agents == AGENTS && reserved == 0 && with_parts;
    let begins = if right && has_body && body_reserved == 0 {
        offsets(&mut memory, line, "offsets")
    } else {
        Some((nothing(), None))
    };
    let Some((offsets, begins)) = begins else {
        return;
    };
    let len = begins
        .as_ref()
        .map(|begins| begins[AGENTS as usize] as usize);
    let (body, valid) = match form {
        c::FORM_CELLS => {
            let (cells, read) = column(&mut memory, line, "cells", len);
            let plan = || Some(GridPlan::from(Lists::from_flat(begins?, read?)?).into());
            let raw = c::Cells {
                struct_size: 0,
                reserved: body_reserved,
                cells,
            };
            body(&mut memory, line, raw, plan())
        }
        c::FORM_VISITS => {
            let (vertices, read) = column(&mut memory, line, "vertices", len);
            let (arrival_s, arrivals) = column(&mut memory, line, "arrival_s", len);
            let (departure_s, departures) = column(&mut memory, line, "departure_s", len);
            let raw = c::Visits {
                struct_size: 0,
                reserved: body_reserved,
                vertices,
                arrival_s,
                departure_s,
            };
            body(
                &mut memory,
                line,
                raw,
                visits(begins, read, arrivals, departures),
            )
        }
        c::FORM_TRAJECTORIES => {
            let [(time_s, times), (x_m, xs), (y_m, ys)] =
                ["time_s", "x_m", "y_m"].map(|name| column(&mut memory, line, name, len));
            let (heading_rad, headings): (*const f64, _) =
                if line.1.contains_key("heading_rad") || to(line, "heading_rad_to") != To::There {
                    column(&mut memory, line, "heading_rad", len)
                } else {
                    (ptr::null(), None)
                };
            let headings = if heading_rad.is_null() {
                len.map(|len| vec![f64::NAN; len])
            } else {
                headings
            };
            let knots = || knots(begins, [times, xs, ys, headings]);
            let Some((controls, plan)) = controls(&mut memory, line, knots) else {
                return;
            };
            let raw = c::Trajectories {
                struct_size: 0,
                reserved: body_reserved,
                time_s,
                x_m,
                y_m,
                heading_rad,
                ..controls
            };
            body(&mut memory, line, raw, plan)
        }
        _ => (nothing(), None),
    };
    let raw = c::Plan {
        struct_size: 0,
        agents,
        form,
        reserved,
        offsets,
        body: if right { body } else { nothing() },
        parts,
    };
    let raw = memory.structure(raw, size::<c::Plan>(line, "size"), to(line, "to"));
    // SAFETY: the sink is the host's, and the plan is as long as it says.
    let code = unsafe {
        (*sink)
            .submit_plan
            .map(|submit| submit((*sink).context, raw))
    };
    drop(memory);
    expect(valid, code, |expected| &mut expected.plans);
}

fn visits(
    begins: Option<Vec<u64>>,
    vertices: Option<Vec<u32>>,
    arrivals: Option<Vec<f64>>,
    departures: Option<Vec<f64>>,
) -> Option<Plan> {
    let arrivals = arrivals.filter(|numbers| all_finite(numbers))?;
    let departures = departures.filter(|numbers| all_finite(numbers))?;
    let visit = |((vertex, arrival_s), departure_s)| Visit {
        vertex,
        arrival_s,
        departure_s,
    };
    let visits = vertices?.into_iter().zip(arrivals).zip(departures);
    Some(Lists::from_flat(begins?, visits.map(visit).collect())?.into())
}

/// The columns of controls, and the plan if the host may take it. None if the host would believe
/// more than there can be.
fn controls(
    memory: &mut Memory,
    line: &Line,
    knots: impl FnOnce() -> Option<KnotPlan>,
) -> Option<(c::Trajectories, Option<Plan>)> {
    // SAFETY: zeros are a value of the structure.
    let mut raw: c::Trajectories = unsafe { std::mem::zeroed() };
    if !line.1.contains_key("segments") {
        return Some((raw, knots().map(Plan::from)));
    }
    let mut lists = |name: &str, numbers: &str| {
        let (offsets, begins) = offsets(memory, line, name)?;
        let len = begins
            .as_ref()
            .map(|begins| begins[AGENTS as usize] as usize);
        let (items, read) = column(memory, line, numbers, len);
        let read = read.filter(|numbers| all_finite(numbers));
        let read = begins.zip(read);
        let read = read.and_then(|(begins, read)| Lists::from_flat(begins, read));
        Some((offsets, items, read))
    };
    let (segment_offsets, duration_s, durations) = lists("segments", "duration_s")?;
    let (control_offsets, controls, numbers) = lists("control_offsets", "controls")?;
    raw.segment_offsets = segment_offsets;
    raw.duration_s = duration_s;
    raw.control_offsets = control_offsets;
    raw.controls = controls;
    let plan = || {
        let controls = ControlPlan::new(durations?, numbers?).ok()?;
        Some(MotionPlan::new(knots()?, controls)?.into())
    };
    Some((raw, plan()))
}

fn knots(begins: Option<Vec<u64>>, columns: [Option<Vec<f64>>; 4]) -> Option<KnotPlan> {
    let [times, xs, ys, headings] = columns;
    let [times, xs, ys] = [times?, xs?, ys?];
    // A robot without a heading has none in any of its knots.
    let headings = headings.filter(|all| all.iter().all(|heading| !heading.is_infinite()))?;
    let knot = |at: usize| Knot {
        time_s: times[at],
        x_m: xs[at],
        y_m: ys[at],
        heading_rad: headings[at],
    };
    let finite = all_finite(&times) && all_finite(&xs) && all_finite(&ys);
    let knots = finite.then(|| (0..times.len()).map(knot).collect())?;
    Lists::from_flat(begins?, knots)
}

unsafe fn submit_request(sink: *const c::Sink, line: &Line, lines: &[Line]) {
    let mut memory = Memory::default();
    let agents: u32 = number(line, "agents", AGENTS);
    let reserved: u32 = number(line, "reserved", 0);
    let assigned: u64 = number(line, "assigned", 0);
    let (parts, with_parts) = parts(&mut memory, line, lines);
    let whole = is_whole::<c::Request>(line, "size", "to");
    let right = whole && agents == AGENTS && reserved == 0 && with_parts;
    if right && (LONGEST + 1..=TOO_MANY).contains(&assigned) {
        // The host would believe it.
        return;
    }
    // Tasks and agents in turns.
    let given: Vec<u64> = list(line, "assignments");
    let given = |at: usize| given.get(at).copied().unwrap_or(0);
    let assignment_reserved = number(line, "assignment_reserved", 0);
    let may = right && assigned <= LONGEST;
    let assignments: Vec<c::Assignment> = (0..if may { assigned as usize } else { 0 })
        .map(|at| c::Assignment {
            task: given(2 * at),
            agent: given(2 * at + 1) as u32,
            reserved: assignment_reserved,
        })
        .collect();
    let to_assignments = to(line, "assignments_to");
    let assignments_at = if may {
        memory.list(&assignments, to_assignments)
    } else {
        nothing()
    };
    let may = may && (assigned == 0 || (to_assignments == To::There && assignment_reserved == 0));
    let begins = if may {
        offsets(&mut memory, line, "offsets")
    } else {
        Some((nothing(), None))
    };
    let Some((goal_offsets, begins)) = begins else {
        return;
    };
    let len = begins
        .as_ref()
        .map(|begins| begins[AGENTS as usize] as usize);
    let (goals, read) = column(&mut memory, line, "goals", len);
    let raw = c::Request {
        struct_size: 0,
        agents,
        goal_offsets,
        goals,
        assignments: assignments_at,
        assignment_count: assigned,
        window_steps: number(line, "window", 0),
        reserved,
        window_s: list(line, "window_s").first().copied().unwrap_or(0.0),
        parts,
    };
    let at = memory.structure(raw, size::<c::Request>(line, "size"), to(line, "to"));
    let valid = || {
        let goals = Goals::from_flat(begins?, read?)?;
        raw.window_s.is_finite().then(|| Request {
            goals,
            window_steps: raw.window_steps,
            window_s: raw.window_s,
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
    // SAFETY: the sink is the host's, and the request is as long as it says.
    let code = unsafe {
        (*sink)
            .submit_request
            .map(|submit| submit((*sink).context, at))
    };
    drop(memory);
    expect(valid, code, |expected| &mut expected.requests);
}

/// Texts, with the lengths that they have.
unsafe fn say(sink: *const c::Sink, line: &Line) {
    let mut memory = Memory::default();
    let (text, value) = (word(line, "text"), number(line, "value", 0_u32));
    let figure = f64::from_bits(u64::from(value) << 32);
    let null = c::Str {
        ptr: ptr::null(),
        len: usize::MAX >> 1,
    };
    let there = to(line, "to") != To::Null;
    let shown = if there { memory.text(&text) } else { null };
    // SAFETY: the sink is the host's, and the text is as long as it says.
    let whole = unsafe {
        let (context, sink) = ((*sink).context, &*sink);
        let calls = (sink.metric, sink.log, sink.note, sink.fail);
        let others = (
            sink.progress,
            sink.cancelled,
            sink.now_ns,
            sink.get_extension,
        );
        if let (Some(metric), Some(log), Some(note), Some(fail)) = calls
            && let (Some(progress), Some(cancelled), Some(now_ns), Some(extension)) = others
        {
            metric(context, shown, figure);
            log(context, number(line, "level", 0), shown);
            note(context, shown, shown);
            fail(context, shown);
            progress(context, 1, value.into());
            cancelled(context);
            now_ns(context) > 0 && extension(context, shown).is_null()
        } else {
            false
        }
    };
    drop(memory);
    insist(whole, "the functions of the sink");
    with(|stage| {
        let expected = &mut stage.expected;
        let text = if there { text } else { String::new() };
        if check_figure(&text, figure).is_ok() {
            expected.metrics.push((text.clone(), figure.to_bits()));
        } else {
            expected.broken = true;
            expected.logs += 1;
        }
        expected.notes.push((text.clone(), text));
        expected.logs += 1;
    });
}

// ---- The host ----------------------------------------------------------------------

const AGENTS: u32 = 2;
const OPTIONS: &str = r#"{"deep":[1,{"a":null}],"fast":true,"name":"yard","speed":2.5}"#;

/// The question to the library: a map, and an instance on it.
struct Question {
    environment: SharedEnvironment,
    instance: Instance,
}

/// One in each representation, with all that there can be in it.
fn questions() -> [Question; 3] {
    [on_a_grid(), on_a_roadmap(), in_the_plane()]
}

fn named_parts() -> Vec<Part> {
    let part = |id: &str, critical, data| Part {
        id: id.into(),
        critical,
        data: Data::Json(data),
    };
    vec![
        part("org.example.wind/1", false, json!({ "from": [0.5, null] })),
        part("org.example.ice/2", true, json!("everywhere")),
    ]
}

fn environment_of(name: &str, view: View) -> SharedEnvironment {
    SharedEnvironment::new(Environment {
        name: name.into(),
        digest: "5eed".into(),
        view,
        parts: named_parts(),
    })
}

fn on_a_grid() -> Question {
    let plain = GridEnvironment::new(2, 3, 8, vec![1, 1, 0, 1, 1, 1]);
    // From the second cell nobody goes back west.
    let mut moves = plain.moves.clone();
    moves[1] &= !c::MOVE_WEST;
    let grid = GridEnvironment {
        cell_size_m: 0.5,
        origin_m: [-1.5, 0.25],
        terrain: b".e@.w.".to_vec(),
        moves,
        ..plain
    };
    Question {
        environment: environment_of("small", View::Grid(grid)),
        instance: Instance {
            headings: Some(vec![Heading::North, Heading::East]),
            window_steps: 5,
            radius_m: 0.2,
            strict: true,
            parts: named_parts(),
            ..Instance::one_shot(vec![0, 4], vec![4, 0])
        },
    }
}

fn on_a_roadmap() -> Question {
    let edges = [vec![1, 2], vec![0, 2], vec![]].into_iter().collect();
    let straight = RoadmapEnvironment::straight(
        vec![0.0, 3.0, -1e-3],
        vec![0.0, 4.0, 1e100],
        edges,
        1.5,
        0.7,
    );
    let roadmap = RoadmapEnvironment {
        length_m: vec![5.0, 7.0, 5.5, 1e101],
        workspace: Some(yard()),
        ..straight
    };
    Question {
        environment: environment_of("ways", View::Roadmap(roadmap)),
        instance: Instance {
            starts: vec![2, 0],
            goals: [vec![1, 0, 1], vec![]].into_iter().collect(),
            motion: Motion::Slower,
            objective: Objective::Makespan,
            window_s: 2.5,
            radius_m: 0.35,
            ..Instance::default()
        },
    }
}

fn triangle() -> Footprint {
    Footprint {
        radius_m: 0.5,
        corners_m: vec![[0.5, 0.0], [-0.3, 0.4], [-0.3, -0.4]],
    }
}

/// Free space with an obstacle that stands and one that moves.
fn yard() -> WorkspaceEnvironment {
    let square = vec![[1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0]];
    let corner = vec![[9.0, 9.0], [8.0, 9.0], [9.0, 8.0]];
    WorkspaceEnvironment {
        min_m: [-0.5, 0.0],
        max_m: [9.0, 10.0],
        obstacles: [square, corner].into_iter().collect(),
        movers: vec![Mover {
            footprint: triangle(),
            knots: vec![[0.0, 3.0, 3.0, -0.0], [4.0, 3.0, 7.0, 7.5]],
        }],
    }
}

fn in_the_plane() -> Question {
    let disc = Robot {
        name: "disc".into(),
        footprint: Footprint::disc(0.25),
        dynamics: "fleetyard.double-integrator/1".into(),
        has_heading: false,
        polar_state: true,
        polar_control: true,
        state_limits: vec![
            [None; 2],
            [None; 2],
            [Some(-1.0), Some(1.0)],
            [None, Some(2.0)],
        ],
        control_limits: vec![[Some(-0.5), None], [Some(-0.5), Some(0.5)]],
        parameters: Vec::new(),
    };
    let cart = Robot {
        name: "cart".into(),
        footprint: triangle(),
        dynamics: "org.example.cart/3".into(),
        has_heading: true,
        polar_state: false,
        polar_control: false,
        state_limits: vec![[None; 2]; 3],
        control_limits: Vec::new(),
        parameters: vec![0.1, -2.0],
    };
    let any = f64::NAN;
    let turned = State(vec![3.0, 4.0, any]);
    Question {
        environment: environment_of("yard", View::Workspace(yard())),
        instance: Instance {
            start_states: vec![State(vec![0.0, 5.0, 1.5]), State(vec![5.0, 0.0, 0.0, -0.5])],
            goal_states: [vec![turned], vec![]].into_iter().collect(),
            robots: vec![disc, cart],
            robot_of: vec![1, 0],
            motion: Motion::Dynamics,
            radius_m: 0.5,
            goal_tolerance_m: 0.1,
            goal_tolerance_rad: 0.2,
            parts: named_parts(),
            ..Instance::default()
        },
    }
}

fn budget_of() -> Budget {
    Budget {
        deadline_monotonic_ns: u64::MAX,
        answer_by_ns: u64::MAX - 1,
        wall_ns: 1_000_000,
        nodes: 5,
        memory_bytes: 1 << 30,
        threads: 2,
        seed: 7,
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
        self.now().plans.push(plan.to_plan());
        Ok(())
    }

    fn submit_request(&self, request: &Request) -> Result<(), Rejected> {
        self.now().requests.push(request.clone());
        Ok(())
    }

    fn metric(&self, name: &str, value: f64) {
        self.now().metrics.push((name.into(), value.to_bits()));
    }

    fn note(&self, name: &str, text: &str) {
        self.now().notes.push((name.into(), text.into()));
    }

    fn log(&self, _: LogLevel, _: &str) {
        self.now().logs += 1;
    }

    fn progress(&self, _: u64, _: u64) {}

    fn cancelled(&self) -> bool {
        false
    }
}

/// Makes an object, and asks it each question twice.
fn use_it(library: &Library) {
    let Some(first) = library.descriptors().into_iter().next() else {
        return;
    };
    let line = |name: &str| with(|stage| stage.line(name));
    let (about, object) = (line("descriptor"), line("object"));
    // A name is one line, and what is seen of it stays.
    let seen = |text: &str| text.replace(is_unseen, " ");
    let name: String = seen(&word(&about, "name")).chars().take(200).collect();
    assert_eq!(first.name.trim_end_matches('…'), name.trim_end_matches('…'));
    assert_eq!(first.features, with(|stage| stage.features.clone()));
    assert_eq!(
        first.capabilities.bits(),
        number(&about, "capabilities", 0_u64)
    );
    let taken = Taken::default();
    let made = library.create(Kind::Planner, &first.id, Options::new(OPTIONS), &taken);
    let whole = size::<c::Planner>(&object, "size") >= size_of::<c::Planner>()
        && number(&object, "reserved", 0_u32) == 0
        && !misses(&object, "prepare")
        && !misses(&object, "plan");
    let failed = number(&object, "code", c::STATUS_SOLVED) != c::STATUS_SOLVED;
    let broken = compare(&taken) || !(failed || whole);
    judge(made.as_ref().map(|_| &()), &object, broken);
    let Ok(Object::Planner(mut planner)) = made else {
        return;
    };
    for question in questions() {
        let question = Arc::new(question);
        let (environment, instance) = (&question.environment, &question.instance);
        assert_eq!(environment.check(), Ok(()));
        assert_eq!(instance.check(environment.places()), Ok(()));
        with(|stage| stage.question = Some(Arc::clone(&question)));
        let prepared = planner.prepare(environment, &budget_of(), &taken);
        let broken = compare(&taken);
        judge(prepared.as_ref(), &line("prepare"), broken);
        for _ in 0..2 {
            let planned = planner.plan(instance, &budget_of(), &taken);
            let broken = compare(&taken);
            if prepared.is_ok() {
                judge(planned.as_ref(), &line("return"), broken);
            } else {
                // It has no map, and is not asked.
                let status = planned.map_err(|failure| failure.status);
                assert_eq!(status, Err(Status::InvalidInput));
                assert!(!broken);
            }
        }
    }
    drop(planner);
    let destroyed = with(|stage| stage.destroyed);
    assert_eq!(destroyed, u32::from(!misses(&object, "destroy")));
    assert!(!compare(&taken));
}

/// Checks the result of a call that returned the code of a line and may have broken the
/// contract besides.
fn judge(result: Result<&(), &Failure>, line: &Line, broken: bool) {
    let code = number(line, "code", c::STATUS_SOLVED);
    match result {
        Ok(()) => assert!(!broken && code == c::STATUS_SOLVED),
        Err(failure) if failure.broke_contract => {
            assert!(broken || Status::from_code(code).is_none(), "{failure}");
        }
        Err(failure) => assert_eq!((failure.status.code(), false), (code, broken), "{failure}"),
    }
}

/// Checks that the host took all that was submitted, after the memory of it is gone, and says
/// if some of it breaks the contract.
fn compare(taken: &Taken) -> bool {
    let expected = with(|stage| std::mem::take(&mut stage.expected));
    let taken = std::mem::take(&mut *taken.now());
    assert_eq!(expected.wrong, None);
    assert_eq!(taken.plans.len(), expected.plans.len());
    for (plan, expected) in taken.plans.iter().zip(&expected.plans) {
        assert!(is_same_plan(plan, expected), "{plan:?} is not {expected:?}");
    }
    assert_eq!(taken.requests, expected.requests);
    assert_eq!(taken.metrics, expected.metrics);
    assert_eq!(taken.notes, expected.notes);
    assert_eq!(taken.logs, expected.logs);
    expected.broken
}

/// As `==`, except that headings that are not there are the same.
pub(super) fn is_same_plan(plan: &Plan, other: &Plan) -> bool {
    let (Plan::Trajectories(knots), Plan::Trajectories(others)) = (plan, other) else {
        return plan == other;
    };
    let bits = |knot: &Knot| {
        let heading_rad = if knot.heading_rad.is_nan() {
            f64::NAN
        } else {
            knot.heading_rad
        };
        [knot.time_s, knot.x_m, knot.y_m, heading_rad].map(f64::to_bits)
    };
    let (controls, others_controls) = (knots.controls(), others.controls());
    let (knots, others) = (knots.knots(), others.knots());
    let items = knots.items().iter().map(bits);
    knots.offsets() == others.offsets()
        && items.eq(others.items().iter().map(bits))
        && controls == others_controls
}

// ---- There and back ----------------------------------------------------------------

/// Checks that an environment is the same by its C form.
pub(super) fn environment_by_c(environment: &SharedEnvironment) {
    let raw = CEnvironment::new(environment);
    // SAFETY: the structure lives as long as `raw`.
    let read = unsafe { Environment::from_c(raw.raw()) };
    assert_eq!(read.as_ref(), Ok(&**environment));
}

/// The map of instances by their C form: nobody looks at it.
const NO_MAP: *const c::Environment = ptr::null();

/// Checks that an instance that was checked is the same by its C form.
pub(super) fn instance_by_c(instance: &Instance) {
    let raw = CInstance::new(instance, NO_MAP);
    // SAFETY: the structure lives as long as `raw`.
    let read = unsafe { Instance::from_c(raw.raw()) };
    assert!(is_given(read, instance), "{instance:?}");
}

/// Checks that a fleet's state whose instance was checked is the same by its C form.
pub(super) fn state_by_c(state: &FleetState) {
    let raw = CFleetState::new(state, NO_MAP);
    // SAFETY: the structure lives as long as `raw`.
    let read = unsafe { FleetState::from_c(raw.raw()) };
    assert!(is_given(read, state), "{state:?}");
}

/// Checks that a fleet's status is the same by its C form.
pub(super) fn status_by_c(status: &FleetStatus) {
    let raw = status.to_c();
    // SAFETY: the structure lives through the call.
    let read = unsafe { FleetStatus::from_c(&raw const raw) };
    assert_eq!(read.as_ref(), Ok(status));
}

/// Checks that an annotation is refused by its C form as it is otherwise, or is the same.
pub(super) fn annotation_by_c(annotation: &Annotation) {
    const AGENTS: usize = 4;
    const PLACES: usize = 64;
    // Who says by a number that it is about nobody says so by C too.
    if annotation.agent == Some(c::NONE) {
        return;
    }
    // SAFETY: the structure lives through the call.
    let read = annotation.with_c(|raw| unsafe { Annotation::from_c(raw, AGENTS, PLACES) });
    match annotation.check(AGENTS, PLACES) {
        Ok(()) => assert_eq!(read.as_ref(), Some(&Ok(annotation.clone()))),
        Err(_) => assert!(read.is_none_or(|read| read.is_err())),
    }
}

/// Checks that a plan and a request that a Rust plugin submits by the C form are what a host
/// takes.
pub(super) fn plan_by_c(plan: &Plan) {
    let taken = by_c(plan.agents(), |sink| sink.submit_plan(plan.as_ref()));
    assert!(matches!(&taken.plans[..], [same] if is_same_plan(same, plan)));
}

/// As [`plan_by_c`].
pub(super) fn request_by_c(request: &Request) {
    let taken = by_c(request.goals.len(), |sink| sink.submit_request(request));
    assert_eq!(taken.requests, std::slice::from_ref(request));
}

fn by_c(agents: usize, submit: impl FnOnce(&dyn Sink) -> Result<(), Rejected>) -> Expected {
    let taken = Taken::default();
    let context = SinkContext::new(&taken, Some(agents), usize::MAX);
    let raw = context.to_c();
    // SAFETY: the structure lives as long as the sink.
    let sink = unsafe { CSink::new(&raw const raw) }.expect("a sink");
    let submitted = submit(&sink);
    assert_eq!((submitted, context.take_fault()), (Ok(()), None));
    std::mem::take(&mut *taken.now())
}
