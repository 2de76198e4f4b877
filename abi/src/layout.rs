//! Layout check for Rust plugins, by abi_stable.
//!
//! A plugin that was built with this crate answers the factory identifier
//! [`RUST_LAYOUT_ID`] with the layouts of all C structures as it compiled them.
//! The host compares them with its own: a plugin built against a changed copy of
//! the contract is refused with the place where they differ, rather than crashing
//! later. None of abi_stable's types is in a signature, so plugins in other
//! languages need none of it.

use std::ffi::c_void;

use abi_stable::StableAbi;
use abi_stable::abi_stability::abi_checking::check_layout_compatibility;
use abi_stable::type_layout::TypeLayout;

use crate::c;
use crate::convert::size_of;

/// Factory identifier of [`RustLayout`].
pub const RUST_LAYOUT_ID: &str = "fleetyard.rust-layout/1";

/// The release of abi_stable whose layout description this is. Two releases may
/// describe the same layout differently, so only equal ones are compared.
pub const ABI_STABLE_RELEASE: [u16; 3] = [0, 11, 3];

/// What a Rust plugin answers to [`RUST_LAYOUT_ID`].
#[repr(C)]
pub struct RustLayout {
    /// Size of this structure.
    pub struct_size: u32,
    /// Release of abi_stable.
    pub abi_stable: [u16; 3],
    /// Layout of [`Contract`].
    pub layout: &'static TypeLayout,
}

/// Every structure of the contract, so that one layout covers them all.
#[repr(C)]
#[derive(StableAbi)]
pub struct Contract {
    /// The entry and all that `init` can reach.
    pub entry: c::PluginEntry,
    /// Planners.
    pub planners: c::PlannerFactory,
    /// Fail policies.
    pub fail_policies: c::FailPolicyFactory,
    /// Instance generators.
    pub instance_generators: c::InstanceGeneratorFactory,
    /// Invocation policies.
    pub invocation_policies: c::InvocationPolicyFactory,
    /// Behind `Environment::view`.
    pub grid: c::Grid,
}

/// The layouts as this build of the crate has them.
pub fn rust_layout() -> &'static RustLayout {
    const LAYOUT: &RustLayout = &RustLayout {
        struct_size: size_of::<RustLayout>(),
        abi_stable: ABI_STABLE_RELEASE,
        layout: Contract::LAYOUT,
    };
    LAYOUT
}

/// What the check found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LayoutCheck {
    /// The layouts are equal.
    Same,
    /// They cannot be compared; the reason.
    NotComparable(String),
    /// They differ; a few lines that say where.
    Differs(String),
}

/// Compares a plugin's layouts with the host's.
///
/// # Safety
/// `pointer` is what the plugin answered to [`RUST_LAYOUT_ID`]: it points to a
/// [`RustLayout`] of whatever release.
pub unsafe fn check(pointer: *const c_void) -> LayoutCheck {
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
    match check_layout_compatibility(Contract::LAYOUT, theirs.layout) {
        Ok(()) => LayoutCheck::Same,
        Err(errors) => LayoutCheck::Differs(summary(&errors.to_string())),
    }
}

/// The lines of abi_stable's report that name a type or say what differs, at most
/// eight of them: the whole report repeats every nesting level.
fn summary(report: &str) -> String {
    const MOST: usize = 8;
    let mut lines: Vec<&str> = Vec::new();
    for line in report.lines() {
        let text = line.trim();
        let telling = [
            "Expected",
            "Found",
            "expected",
            "found",
            "Layout of",
            "field",
            "type",
        ];
        if telling.iter().any(|word| text.contains(word)) && !lines.contains(&text) {
            lines.push(text);
        }
        if lines.len() == MOST {
            break;
        }
    }
    lines.join("\n")
}
