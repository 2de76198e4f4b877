//! Between the C structures and the owned model, in both directions.
//!
//! Reading from C checks what can be checked (null pointers, sizes, offsets,
//! codes, reserved fields); that a pointer has as many elements behind it as it should is the
//! promise of the other side. An error says `unsupported` of a code, flag or part that this
//! version does not know, and `invalid-input` of what no version allows.

mod annotation;
mod environment;
mod instance;
mod memory;
mod options;
mod plan;
mod sink;

use std::any::Any;
use std::ptr;

use crate::c;
use crate::lists::Lists;
use crate::memory::Data;
use crate::model::{Part, Status};
use crate::sdk::Failure;

pub use environment::CEnvironment;
pub use instance::{CFleetState, CInstance};
pub use options::COptions;
pub(crate) use options::options_json;
pub use plan::wrong_agents;
pub use sink::{CSink, SinkContext};

/// `sizeof` a C structure, for its `struct_size` field.
pub const fn size_of<T>() -> u32 {
    std::mem::size_of::<T>() as u32
}

/// Checks a pointer and the `struct_size` behind it: a structure of a later version may be longer.
///
/// # Safety
/// A pointer that is neither null nor misaligned points to a structure that begins with a `u32`
/// `struct_size`, and that is at least as long as it says, for all of `'a`.
pub unsafe fn checked<'a, T>(name: &str, pointer: *const T) -> Result<&'a T, String> {
    can_be_read(name, pointer, 1)?;
    // SAFETY: not null, and the first field is a u32 by the caller's promise.
    let size = unsafe { pointer.cast::<u32>().read() };
    if size < size_of::<T>() {
        let expected = size_of::<T>();
        return Err(format!(
            "{name}.struct_size is {size}, but the structure has {expected} bytes"
        ));
    }
    // SAFETY: the structure is whole by its size.
    Ok(unsafe { &*pointer })
}

/// Refuses a list of which no memory can have so many elements behind that pointer.
fn can_be_read<T>(name: &str, pointer: *const T, len: usize) -> Result<(), String> {
    if pointer.is_null() {
        return Err(format!("{name} is null"));
    }
    if !pointer.is_aligned() {
        return Err(format!("{name} is not aligned"));
    }
    if len > isize::MAX as usize / std::mem::size_of::<T>() {
        return Err(format!("{name} cannot have {len} elements"));
    }
    Ok(())
}

/// # Safety
/// A pointer that is neither null nor misaligned has `len` elements behind it for all of
/// `'a`.
unsafe fn slice<'a, T>(name: &str, pointer: *const T, len: usize) -> Result<&'a [T], Failure> {
    if len == 0 {
        return Ok(&[]);
    }
    can_be_read(name, pointer, len).map_err(invalid)?;
    // SAFETY: by the caller's promise.
    Ok(unsafe { std::slice::from_raw_parts(pointer, len) })
}

/// Copies without a look at what is copied.
///
/// # Safety
/// As [`slice`], except that somebody may be writing to the elements, of which any
/// bytes are a value.
unsafe fn copied<T: Copy>(name: &str, pointer: *const T, len: usize) -> Result<Vec<T>, Failure> {
    if len == 0 {
        return Ok(Vec::new());
    }
    can_be_read(name, pointer, len).map_err(invalid)?;
    let mut copy = Vec::new();
    // A plugin that is wrong about its own lists must not end the host.
    copy.try_reserve_exact(len).map_err(|_| {
        invalid(format!(
            "{name} has {len} elements, for which there is no memory"
        ))
    })?;
    // SAFETY: as promised, and the copy has room for them.
    unsafe {
        std::ptr::copy_nonoverlapping(pointer, copy.as_mut_ptr(), len);
        copy.set_len(len);
    }
    Ok(copy)
}

/// Reads text; bytes that are not UTF-8 are replaced.
///
/// # Safety
/// `text` points to `len` bytes, or `len` is 0.
pub unsafe fn string(text: c::Str) -> String {
    // SAFETY: by the caller's promise.
    match unsafe { slice("text", text.ptr.cast::<u8>(), text.len) } {
        Ok(bytes) => String::from_utf8_lossy(bytes).into_owned(),
        Err(_) => String::new(),
    }
}

/// No version of the contract allows that.
pub(crate) fn invalid(reason: impl Into<String>) -> Failure {
    Failure::new(Status::InvalidInput, reason)
}

/// A later version may allow that.
fn unsupported(reason: impl Into<String>) -> Failure {
    Failure::new(Status::Unsupported, reason)
}

/// As [`checked`].
///
/// # Safety
/// As [`checked`].
unsafe fn whole<'a, T>(name: &str, pointer: *const T) -> Result<&'a T, Failure> {
    // SAFETY: by the caller's promise.
    unsafe { checked(name, pointer) }.map_err(invalid)
}

/// A code of this contract; 0 is none in any version.
fn code<T>(what: &str, code: i32, from_code: impl Fn(i32) -> Option<T>) -> Result<T, Failure> {
    match from_code(code) {
        Some(value) => Ok(value),
        None if code == 0 => Err(invalid(format!("{what} is 0, which is no value"))),
        None => Err(unsupported(format!("{what} {code} is unknown"))),
    }
}

/// Refuses flags that are not among those known.
fn flags(what: &str, flags: u32, known: u32) -> Result<u32, Failure> {
    match flags & !known {
        0 => Ok(flags),
        unknown => Err(unsupported(format!(
            "{what} has the unknown flags {unknown:#x}"
        ))),
    }
}

/// Refuses a reserved field that is not 0.
fn reserved(what: &str, value: u32) -> Result<(), Failure> {
    match value {
        0 => Ok(()),
        _ => Err(invalid(format!("{what}.reserved is {value}, not 0"))),
    }
}

/// Refuses numbers that JSON does not have: what is submitted is the same by every attachment.
fn finite<'a>(name: &str, numbers: impl IntoIterator<Item = &'a f64>) -> Result<(), Failure> {
    match numbers.into_iter().find(|number| !number.is_finite()) {
        Some(number) => Err(invalid(format!("{name} has {number}, which is not finite"))),
        None => Ok(()),
    }
}

/// Copies lists, then looks at the copy: another thread of the other side may still write to
/// its arrays. Refuses more than `most` items together before it looks at an item.
///
/// # Safety
/// `offsets` has `len + 1` elements behind it and `items` as many as the last of
/// them says.
unsafe fn lists<T: Copy>(
    names: [&str; 2],
    offsets: *const u64,
    items: *const T,
    len: usize,
    most: usize,
) -> Result<Lists<T>, Failure> {
    // SAFETY: by the caller's promise.
    let (offsets, total) = unsafe { offsets_of(names, offsets, len, most)? };
    // SAFETY: by the caller's promise.
    let items = unsafe { copied(names[1], items, total)? };
    Lists::from_flat(offsets, items).ok_or_else(|| disordered(names[0]))
}

fn disordered(name: &str) -> Failure {
    invalid(format!("{name} do not begin with 0 or are out of order"))
}

/// Copies offsets and says how many items they are about.
///
/// # Safety
/// `offsets` has `len + 1` elements behind it.
unsafe fn offsets_of(
    names: [&str; 2],
    offsets: *const u64,
    len: usize,
    most: usize,
) -> Result<(Vec<u64>, usize), Failure> {
    // SAFETY: by the caller's promise.
    let offsets = unsafe { copied(names[0], offsets, len + 1)? };
    let total = offsets.last().copied().unwrap_or(0);
    if offsets.first() != Some(&0) || !offsets.is_sorted() {
        return Err(disordered(names[0]));
    }
    if total > most as u64 {
        let what = names[1];
        return Err(invalid(format!(
            "{what} are {total} entries, more than the limit of {most}"
        )));
    }
    Ok((offsets, total as usize))
}

/// Most parts of an input or an output.
const MOST_PARTS: u64 = 1 << 10;

/// Copies parts: those that this version knows, and those in JSON. Others are passed over, unless
/// they are critical.
///
/// # Safety
/// As [`checked`], and there are as many parts as it says.
unsafe fn parts(parts: c::Parts) -> Result<Vec<Part>, Failure> {
    if parts.count > MOST_PARTS {
        return Err(invalid(format!("{} parts are too many", parts.count)));
    }
    // SAFETY: by the caller's promise, here and below.
    let list = unsafe { copied("parts", parts.list, parts.count as usize)? };
    let mut known = Vec::new();
    for part in list {
        reserved("part", part.reserved)?;
        let flags = flags("part", part.flags, c::PART_CRITICAL | c::PART_JSON)?;
        // SAFETY: as promised.
        let id = unsafe { string(part.id) };
        let critical = flags & c::PART_CRITICAL != 0;
        if flags & c::PART_JSON == 0 {
            // SAFETY: as promised.
            match unsafe { memory::data_from_c(&id, part.data)? } {
                Some(data) => known.push(Part { id, critical, data }),
                None if critical => {
                    return Err(unsupported(format!("the critical part `{id}` is unknown")));
                }
                None => {}
            }
            continue;
        }
        // SAFETY: the flag says that it is one.
        let json = unsafe { whole("part.data", part.data.cast::<c::Json>())? };
        reserved("part.data", json.reserved)?;
        // SAFETY: as promised.
        let text = unsafe { string(json.text) };
        let value = serde_json::from_str(&text)
            .map_err(|error| invalid(format!("the part `{id}` is not JSON: {error}")))?;
        let data = Data::read(&id, value).map_err(invalid)?;
        known.push(Part { id, critical, data });
    }
    Ok(known)
}

/// Data that C structures point to: they stay where they are until all of them go.
#[derive(Default)]
struct Kept(Vec<Box<dyn Any>>);

// SAFETY: the pointers in what is kept point to other things that are kept, or to what its owner
// keeps, and nothing is written through them.
unsafe impl Send for Kept {}

impl Kept {
    /// Keeps a structure.
    fn one<T: 'static>(&mut self, value: T) -> *const T {
        let kept = Box::new(value);
        let pointer = ptr::from_ref(&*kept);
        self.0.push(kept);
        pointer
    }

    /// Keeps a list; null when it is empty.
    fn list<T: 'static>(&mut self, values: impl Into<Vec<T>>) -> *const T {
        let values: Vec<T> = values.into();
        if values.is_empty() {
            return ptr::null();
        }
        let pointer = values.as_ptr();
        self.0.push(Box::new(values));
        pointer
    }

    /// Keeps a text.
    fn text(&mut self, text: String) -> c::Str {
        let len = text.len();
        c::Str {
            ptr: self.list(text).cast(),
            len,
        }
    }

    /// Keeps parts, whose data stay with their owner.
    fn parts(&mut self, parts: &[Part]) -> c::Parts {
        let raw: Vec<c::Part> = parts
            .iter()
            .map(|part| {
                let (data, form) = match &part.data {
                    Data::Json(value) => {
                        let json = c::Json {
                            struct_size: size_of::<c::Json>(),
                            reserved: 0,
                            text: self.text(value.to_string()),
                        };
                        (self.one(json).cast(), c::PART_JSON)
                    }
                    data => (memory::data_to_c(data, self), 0),
                };
                let critical = if part.critical { c::PART_CRITICAL } else { 0 };
                c::Part {
                    id: self.text(part.id.clone()),
                    data,
                    flags: form | critical,
                    reserved: 0,
                }
            })
            .collect();
        let count = raw.len() as u64;
        c::Parts {
            list: self.list(raw),
            count,
        }
    }
}
