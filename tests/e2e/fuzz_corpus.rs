//! Everything that reads bytes from outside, on the corpus of `tests/fuzz/` and on seeded
//! mutations of it: the targets that cargo-fuzz runs for hours, as a test that takes
//! seconds and gives the same result every time. Here the memory is counted that an input
//! takes; there it is limited.
//!
//! An input that fails is kept in a file, and the message says how to run it again. For
//! one that ends the whole process, as a stack overflow does, run the test once more with
//! `FLEETYARD_FUZZ_TRACE=1`: every input is kept in the file `current` while it is run.

#![allow(unsafe_code, reason = "an allocator that counts")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::collections::BTreeSet;
use std::fs;
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};

use fleetyard_core::Hasher;
use fleetyard_world::SeededRandom;

use crate::fuzz::{self, Target};

/// Names a file that is run instead of the corpus.
const REPLAY: &str = "FLEETYARD_FUZZ_INPUT";

/// Keeps every input while it is run.
const TRACE: &str = "FLEETYARD_FUZZ_TRACE";

/// Longest input that is made.
const LONGEST: usize = 4096;

/// Memory that an input may take for each of its bytes, apart from that of any input.
const MEMORY_PER_BYTE: usize = 256;

struct Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

thread_local! {
    // Of this thread; what another one frees is counted there.
    static TAKEN: Cell<isize> = const { Cell::new(0) };
    static MOST: Cell<isize> = const { Cell::new(0) };
}

fn count(bytes: isize) {
    TAKEN.set(TAKEN.get() + bytes);
    MOST.set(MOST.get().max(TAKEN.get()));
}

// SAFETY: the system's allocator does it all; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: by the caller's promise, here and below.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // The old place and the new one may exist at the same time.
        count(size as isize);
        count(-(layout.size() as isize));
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// The most bytes that a piece of work had at one time.
fn memory_of(work: impl FnOnce()) -> usize {
    let before = TAKEN.get();
    MOST.set(before);
    work();
    (MOST.get() - before) as usize
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fuzz")
}

/// A target with what it is fed on.
struct Food {
    name: &'static str,
    target: Target,
    seeds: Vec<Vec<u8>>,
    words: Vec<Vec<u8>>,
    /// Bytes of memory that any input may take.
    memory: usize,
    kept: PathBuf,
    trace: bool,
}

impl Food {
    fn new(name: &'static str, target: Target, memory: usize) -> Self {
        let corpus = folder().join("corpus").join(name);
        let entries = fs::read_dir(&corpus).unwrap();
        let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
        // What a fuzzer found here has no extension: it is nobody else's.
        files.retain(|file| file.extension().is_some());
        files.sort();
        let dictionary = folder().join("dictionaries").join(format!("{name}.dict"));
        let kept = Path::new(env!("CARGO_TARGET_TMPDIR"))
            .join("fuzz")
            .join(name);
        fs::create_dir_all(&kept).unwrap();
        Self {
            name,
            target,
            seeds: files.iter().map(|file| fs::read(file).unwrap()).collect(),
            words: words(&fs::read_to_string(dictionary).unwrap()),
            memory,
            kept,
            trace: std::env::var_os(TRACE).is_some(),
        }
    }

    fn run(&self, input: &[u8]) {
        if self.trace {
            fs::write(self.kept.join("current"), input).unwrap();
        }
        let ran = catch_unwind(|| memory_of(|| (self.target)(input)));
        let reason = match ran {
            Ok(memory) if memory <= self.memory + MEMORY_PER_BYTE * input.len() => return,
            Ok(memory) => format!("{} bytes took {memory} bytes of memory", input.len()),
            Err(_) => "a property does not hold, see above".to_owned(),
        };
        let mut hasher = Hasher::new("fuzz");
        hasher.bytes(input);
        let file = self.kept.join(format!("failed-{}", hasher.finish()));
        fs::write(&file, input).unwrap();
        let (name, file) = (self.name, file.display());
        panic!(
            "{reason}\nthe input is in {file}\nagain: \
             {REPLAY}={file} cargo test -p fleetyard --test e2e -- --exact fuzz_corpus::{name}"
        );
    }

    /// One input made of others.
    fn mutated(&self, random: &mut SeededRandom) -> Vec<u8> {
        let pick = |random: &mut SeededRandom| &self.seeds[random.below(self.seeds.len())];
        let mut input = pick(random).clone();
        // Half of them with one change: more would leave little that can be read.
        let changes = 1 + random.below(2) * random.below(4);
        for _ in 0..changes {
            let at = random.below(input.len() + 1);
            let end = (at + 1 + random.below(8)).min(input.len());
            match random.below(14) {
                0 if at < end => input[at] ^= 1 << random.below(8),
                1 if at < end => input[at] = random.below(256) as u8,
                2 if at < end => input[at] = input[random.below(input.len())],
                // A neighbour is more often of the kind that may stand here.
                3 if at < end => input.swap(at, end - 1),
                4 => drop(input.drain(at..end)),
                5 => {
                    let part = input[at..end].repeat(1 + random.below(4));
                    input.splice(at..at, part);
                }
                6 => input.truncate(at),
                7 => {
                    let word = &self.words[random.below(self.words.len())];
                    let end = if random.below(2) == 0 { at } else { end };
                    input.splice(at..end, word.iter().copied());
                }
                8 => {
                    let other = pick(random);
                    let from = random.below(other.len() + 1);
                    input.truncate(at);
                    input.extend_from_slice(&other[from..]);
                }
                9 => input.extend_from_slice(pick(random)),
                10 => change_number(&mut input, at, random),
                11 => {
                    let deep = [b'[', b'{', b'"', b'\\', b' ', b'9'][random.below(6)];
                    let many = 1 << random.below(11);
                    input.splice(at..at, std::iter::repeat_n(deep, many));
                }
                _ => change_lines(&mut input, random),
            }
        }
        input.truncate(LONGEST);
        input
    }
}

/// Another number in the place of the first one after `at`.
fn change_number(input: &mut Vec<u8>, at: usize, random: &mut SeededRandom) {
    const NUMBERS: [&str; 14] = [
        "0",
        "1",
        "2",
        "3",
        "4",
        "-1",
        "1073741824",
        "4294967295",
        "4294967296",
        "18446744073709551615",
        "99999999999999999999",
        "1e300",
        "1e-320",
        "0.1",
    ];
    let digit = |byte: &u8| byte.is_ascii_digit();
    let Some(first) = input[at..].iter().position(digit) else {
        return;
    };
    let first = at + first;
    let digits = input[first..].iter().take_while(|byte| digit(byte)).count();
    let number = NUMBERS[random.below(NUMBERS.len())];
    input.splice(first..first + digits, number.bytes());
}

/// A line twice, missing, or in another place.
fn change_lines(input: &mut Vec<u8>, random: &mut SeededRandom) {
    let mut lines: Vec<Vec<u8>> = input
        .split_inclusive(|byte| *byte == b'\n')
        .map(<[u8]>::to_vec)
        .collect();
    if lines.is_empty() {
        return;
    }
    let (one, other) = (random.below(lines.len()), random.below(lines.len()));
    match random.below(3) {
        0 => lines.insert(one, lines[other].clone()),
        1 => drop(lines.remove(one)),
        _ => lines.swap(one, other),
    }
    *input = lines.concat();
}

/// The words of a dictionary of libFuzzer: a quoted string a line.
fn words(text: &str) -> Vec<Vec<u8>> {
    let word = |line: &str| {
        let quoted = line.strip_prefix('"')?.strip_suffix('"')?;
        let mut word = Vec::new();
        let mut letters = quoted.bytes();
        while let Some(letter) = letters.next() {
            word.push(match letter {
                b'\\' => match letters.next()? {
                    b'x' => {
                        let digits = [letters.next()?, letters.next()?];
                        u8::from_str_radix(std::str::from_utf8(&digits).ok()?, 16).ok()?
                    }
                    escaped => escaped,
                },
                letter => letter,
            });
        }
        Some(word)
    };
    let lines = text.lines();
    lines
        .map(|line| word(line).unwrap_or_else(|| panic!("{line} is no word")))
        .collect()
}

fn corpus_and_mutations(name: &str, mutations: usize, memory: usize) {
    let known = fuzz::TARGETS.iter().find(|(known, _)| *known == name);
    let (name, target) = *known.unwrap();
    let food = Food::new(name, target, memory);
    if let Some(file) = std::env::var_os(REPLAY) {
        return food.run(&fs::read(file).unwrap());
    }
    for seed in &food.seeds {
        food.run(seed);
    }
    let mut random = SeededRandom::new("fuzz", 1);
    for _ in 0..mutations {
        food.run(&food.mutated(&mut random));
    }
}

#[test]
fn abi() {
    // Of a thousand plugins each has its texts and its schema.
    corpus_and_mutations("abi", 10_000, 64 << 20);
}

#[test]
fn adapter() {
    // Patterns again, each of a megabyte at most.
    corpus_and_mutations("adapter", 30_000, 16 << 20);
}

#[test]
fn bundle() {
    corpus_and_mutations("bundle", 30_000, 1 << 20);
}

#[test]
fn fleet() {
    corpus_and_mutations("fleet", 200_000, 1 << 20);
}

#[test]
fn formats() {
    // A few numbers stand for a map, and a run of waits for many positions.
    corpus_and_mutations("formats", 20_000, 96 << 20);
}

#[test]
fn league() {
    // Of tasks so many may be known at a time.
    corpus_and_mutations("league", 10_000, 1 << 20);
}

#[test]
fn lock() {
    corpus_and_mutations("lock", 50_000, 1 << 20);
}

#[test]
fn map() {
    corpus_and_mutations("map", 300_000, 1 << 20);
}

#[test]
fn options() {
    // A pattern may become an automaton of some size.
    corpus_and_mutations("options", 20_000, 32 << 20);
}

#[test]
fn plan() {
    corpus_and_mutations("plan", 200_000, 1 << 20);
}

#[test]
fn plane() {
    // An XML document is a tree, and every text is tried as one.
    corpus_and_mutations("plane", 60_000, 1 << 20);
}

#[test]
fn recording() {
    // A replay has a simulator, and an assigner of tasks.
    corpus_and_mutations("recording", 1_000, 32 << 20);
}

#[test]
fn rows() {
    // A page of a report has its program in it.
    corpus_and_mutations("rows", 500, 32 << 20);
}

#[test]
fn scen() {
    corpus_and_mutations("scen", 150_000, 1 << 20);
}

#[test]
fn studio() {
    // A few words stand for a map, and a preset for a robot.
    corpus_and_mutations("studio", 40_000, 32 << 20);
}

#[test]
fn suite() {
    // A few words stand for a million seeds.
    corpus_and_mutations("suite", 30_000, 32 << 20);
}

#[test]
fn task() {
    corpus_and_mutations("task", 40_000, 1 << 20);
}

#[test]
fn trace() {
    // A group of states may be of a few megabytes on either side.
    corpus_and_mutations("trace", 20_000, 32 << 20);
}

#[test]
fn values() {
    corpus_and_mutations("values", 10_000, 1 << 20);
}

#[test]
fn view() {
    corpus_and_mutations("view", 40_000, 1 << 20);
}

#[test]
fn wire() {
    corpus_and_mutations("wire", 20_000, 1 << 20);
}

#[test]
fn world() {
    corpus_and_mutations("world", 60_000, 1 << 20);
}

#[test]
fn every_target_has_a_program_a_corpus_and_a_dictionary() {
    let names = |path: &str| -> BTreeSet<String> {
        let entries = fs::read_dir(folder().join(path)).unwrap();
        let stem = |path: PathBuf| path.file_stem().unwrap().to_str().unwrap().to_owned();
        entries.map(|entry| stem(entry.unwrap().path())).collect()
    };
    let targets: BTreeSet<String> = fuzz::TARGETS
        .iter()
        .map(|(name, _)| (*name).into())
        .collect();
    for path in ["fuzz_targets", "corpus", "dictionaries"] {
        assert_eq!(names(path), targets, "{path}");
    }
    let manifest = fs::read_to_string(folder().join("Cargo.toml")).unwrap();
    for (name, target) in fuzz::TARGETS {
        assert!(
            manifest.contains(&format!("[[bin]]\nname = \"{name}\"\n")),
            "{name}"
        );
        // Small enough to be read by people.
        let seeds = Food::new(name, *target, 0).seeds;
        assert!(seeds.iter().all(|seed| seed.len() <= LONGEST), "{name}");
    }
}
