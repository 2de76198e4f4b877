//! Layout check for Rust plugins, by abi_stable.
//!
//! A plugin that was built with the feature `layout` of this crate answers the factory identifier
//! [`RUST_LAYOUT_ID`] with the layouts of all C structures as it compiled them.
//! The host compares them with its own: a plugin built against a changed copy of
//! the contract is refused with the place where they differ, rather than crashing
//! later. None of abi_stable's types is in a signature, so plugins in other
//! languages need none of it.

use std::ffi::c_void;

use abi_stable::StableAbi;
use abi_stable::abi_stability::abi_checking::{
    AbiInstability, AbiInstabilityError, check_layout_compatibility,
};
use abi_stable::type_layout::{TLFieldOrFunction, TypeLayout};

use crate::c;
use crate::convert::{size_of, string};

/// Factory identifier of [`RustLayout`].
pub const RUST_LAYOUT_ID: &str = "fleetyard.rust-layout/1";

/// The release of abi_stable whose layout description this is. Two releases may
/// describe the same layout differently, so only equal ones are compared.
pub const ABI_STABLE_RELEASE: [u16; 3] = [0, 11, 3];

/// The answer of a Rust plugin to [`RUST_LAYOUT_ID`].
#[repr(C)]
pub struct RustLayout {
    /// Size of this structure.
    pub struct_size: u32,
    /// Release of abi_stable.
    pub abi_stable: [u16; 3],
    /// Number of layouts.
    pub count: usize,
    /// The layouts.
    pub layouts: *const NamedLayout,
}

// SAFETY: a read-only table of static data.
unsafe impl Sync for RustLayout {}

/// The layout of a structure, found by its name, so that a version of the contract with more
/// structures goes together with one that has fewer.
#[repr(C)]
pub struct NamedLayout {
    /// The name of the structure.
    pub name: c::Str,
    /// Its layout, with those of all that it reaches by typed pointers.
    pub layout: &'static TypeLayout,
}

// SAFETY: as above.
unsafe impl Sync for NamedLayout {}

macro_rules! layouts {
    ($($name:ident),* $(,)?) => {
        &[$(NamedLayout {
            name: c::Str::new(stringify!($name)),
            layout: <c::$name as StableAbi>::LAYOUT,
        }),*]
    };
}

/// Every structure of the contract that no other one reaches.
const LAYOUTS: &[NamedLayout] = layouts![
    PluginEntry,
    PlannerFactory,
    FailPolicyFactory,
    InstanceGeneratorFactory,
    InvocationPolicyFactory,
    Grid,
    Roadmap,
    Workspace,
    Cells,
    Visits,
    Trajectories,
    Json,
    Traffic,
    RestOfPlan,
    GoalTasks,
    Guidance,
    Bytes,
    Keep,
    Annotation,
    Annotations,
    Leftovers,
];

/// The layouts as this build of the crate has them.
pub fn rust_layout() -> &'static RustLayout {
    static LAYOUT: RustLayout = RustLayout {
        struct_size: size_of::<RustLayout>(),
        abi_stable: ABI_STABLE_RELEASE,
        count: LAYOUTS.len(),
        layouts: LAYOUTS.as_ptr(),
    };
    &LAYOUT
}

/// Result of the layout check.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LayoutCheck {
    /// The layouts are equal.
    Same,
    /// They cannot be compared; the reason.
    NotComparable(String),
    /// They differ; a few lines that say where.
    Differs(String),
}

/// Most structures that a plugin may describe.
const MOST_LAYOUTS: usize = 1 << 10;

/// Compares a plugin's layouts with the host's, where both have one of a name.
///
/// # Safety
/// `pointer` is what the plugin answered to [`RUST_LAYOUT_ID`]: it points to a
/// [`RustLayout`] of whatever release.
pub unsafe fn check(pointer: *const c_void) -> LayoutCheck {
    if !pointer.cast::<RustLayout>().is_aligned() {
        return LayoutCheck::NotComparable("its layout table is not aligned".into());
    }
    // SAFETY: every release begins with the size.
    let size = unsafe { pointer.cast::<u32>().read() };
    if size != size_of::<RustLayout>() {
        return LayoutCheck::NotComparable("its layout table has another size".into());
    }
    // SAFETY: the table is whole by its size.
    let theirs = unsafe { &*pointer.cast::<RustLayout>() };
    if theirs.abi_stable != ABI_STABLE_RELEASE {
        let [major, minor, patch] = theirs.abi_stable;
        return LayoutCheck::NotComparable(format!(
            "its layouts are described by abi_stable {major}.{minor}.{patch}"
        ));
    }
    if theirs.count > MOST_LAYOUTS || theirs.layouts.is_null() || !theirs.layouts.is_aligned() {
        return LayoutCheck::NotComparable("its layout table is none".into());
    }
    // SAFETY: the table has as many entries as it says.
    let theirs = unsafe { std::slice::from_raw_parts(theirs.layouts, theirs.count) };
    let mut lines = Vec::new();
    for ours in LAYOUTS {
        // SAFETY: names are static, on both sides.
        let name = |layout: &NamedLayout| unsafe { string(layout.name) };
        let own = name(ours);
        for theirs in theirs.iter().filter(|theirs| name(theirs) == own) {
            if let Err(report) = check_layout_compatibility(ours.layout, theirs.layout) {
                lines.extend(
                    report
                        .errors
                        .iter()
                        .flat_map(|error| differences(&own, error)),
                );
            }
        }
    }
    if lines.is_empty() {
        LayoutCheck::Same
    } else {
        LayoutCheck::Differs(shortened(lines))
    }
}

/// The differences of two layouts, a line each: the type, the path to it, and the layouts that the
/// host expected and found. abi_stable's own report repeats every level of nesting and is pages
/// long.
fn differences(of: &str, error: &AbiInstabilityError) -> Vec<String> {
    let mut path: Vec<&str> = Vec::new();
    let mut in_type = of;
    for level in &error.stack_trace {
        match &level.expected {
            TLFieldOrFunction::Field(field) => {
                // Pointers and options have fields of their own, without a meaning here.
                if !field.name().starts_with("__") && !field.name().starts_with(char::is_numeric) {
                    path.push(field.name());
                }
                in_type = field.layout().name();
            }
            TLFieldOrFunction::Function(_) => {}
        }
    }
    let place = if path.is_empty() {
        in_type.to_owned()
    } else {
        format!("{in_type} ({})", path.join("."))
    };
    let line = |expected: &dyn std::fmt::Display, found: &dyn std::fmt::Display, unit: &str| {
        Some(format!("{place}: {expected}{unit} expected, {found} found"))
    };
    let describe = |difference: &AbiInstability| match difference {
        // The contract has versions of its own: that the crates differ says nothing.
        AbiInstability::PackageVersion(_) | AbiInstability::PackageVersionParseError(_) => None,
        AbiInstability::FieldCountMismatch(count) => line(&count.expected, &count.found, " fields"),
        AbiInstability::Size(size) => line(&size.expected, &size.found, " bytes"),
        AbiInstability::Alignment(size) => line(&size.expected, &size.found, " bytes of alignment"),
        AbiInstability::UnexpectedField(field) => {
            let quoted = |name: &str| format!("`{name}`");
            let (expected, found) = (field.expected.name(), field.found.name());
            line(&format!("field {}", quoted(expected)), &quoted(found), "")
        }
        AbiInstability::Name(name) => {
            let [expected, found] = [&name.expected, &name.found].map(|name| one_line(name));
            line(&format!("type {expected}"), &found, "")
        }
        AbiInstability::Package(name) => line(
            &format!("a type of the crate {}", name.expected),
            &name.found,
            "",
        ),
        other => {
            let text = one_line(&format_args!("{other:?}"));
            let kind = text.split(['(', ' ', '{']).next().unwrap_or_default();
            Some(format!("{place}: {kind}"))
        }
    };
    error.errs.iter().filter_map(describe).collect()
}

fn one_line(text: &dyn std::fmt::Display) -> String {
    text.to_string()
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

/// At most eight lines.
fn shortened(mut lines: Vec<String>) -> String {
    const MOST: usize = 8;
    lines.dedup();
    if lines.len() > MOST {
        let more = lines.len() - (MOST - 1);
        lines.truncate(MOST - 1);
        lines.push(format!("and {more} more"));
    }
    lines.join("\n")
}
