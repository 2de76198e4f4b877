//! A plugin in Rust that was built against a changed contract: its `Budget` has a
//! field more than the host's. Nothing of it is in the entry or in a factory; the
//! budget is behind a pointer that an argument of a function pointer leads to. The
//! host must refuse the library and say what differs. A fixture for tests of the host.

#![allow(unsafe_code, reason = "a plugin's entry is a symbol of its own name")]

use std::ffi::c_void;

use fleetyard_abi::c::{PluginEntry, Str};
use fleetyard_abi::convert::{size_of, string};
use fleetyard_abi::layout::{ABI_STABLE_RELEASE, RUST_LAYOUT_ID, RustLayout};

macro_rules! changed {
    ($(#[doc = $doc:literal])* $name:ident) => {
        $(#[doc = $doc])*
        pub mod $name {
            use abi_stable::StableAbi;
            use abi_stable::type_layout::TypeLayout;
            use fleetyard_abi::convert::size_of;
            use fleetyard_abi::layout::{ABI_STABLE_RELEASE, NamedLayout, RustLayout};

            #[allow(
                missing_docs,
                dead_code,
                unreachable_pub,
                clippy::struct_field_names,
                reason = "not our text"
            )]
            mod c {
                include!(concat!(env!("OUT_DIR"), "/", stringify!($name), ".rs"));
            }

            const fn named(name: &'static str, layout: &'static TypeLayout) -> NamedLayout {
                NamedLayout {
                    name: fleetyard_abi::c::Str::new(name),
                    layout,
                }
            }

            const LAYOUTS: &[NamedLayout] = &[
                named("PluginEntry", c::PluginEntry::LAYOUT),
                named("PlannerFactory", c::PlannerFactory::LAYOUT),
                named("FailPolicyFactory", c::FailPolicyFactory::LAYOUT),
                named("Grid", c::Grid::LAYOUT),
            ];

            /// The layouts that a plugin built with the changed contract would show.
            pub static LAYOUT: RustLayout = RustLayout {
                struct_size: size_of::<RustLayout>(),
                abi_stable: ABI_STABLE_RELEASE,
                count: LAYOUTS.len(),
                layouts: LAYOUTS.as_ptr(),
            };
        }
    };
}

changed! {
    /// `Budget` has a field more.
    added
}
changed! {
    /// `Budget::wall_ns` is a floating-point number.
    retyped
}
changed! {
    /// `Instance::window_steps` has another name.
    renamed
}
changed! {
    /// Nothing is changed, but the crate is another one, as every plugin's is.
    same
}

/// Described by another release of `abi_stable`: not comparable.
pub static OTHER_RELEASE: RustLayout = RustLayout {
    struct_size: size_of::<RustLayout>(),
    abi_stable: [ABI_STABLE_RELEASE[0], ABI_STABLE_RELEASE[1] + 1, 0],
    count: added::LAYOUT.count,
    layouts: added::LAYOUT.layouts,
};

unsafe extern "C" fn get_factory(id: Str) -> *const c_void {
    // SAFETY: the host's text lives through the call.
    if unsafe { string(id) } == RUST_LAYOUT_ID {
        (&raw const added::LAYOUT).cast()
    } else {
        // The host must not come so far.
        std::ptr::null()
    }
}

/// The entry point of the plugin contract.
#[unsafe(no_mangle)]
#[allow(non_upper_case_globals, reason = "the contract says so")]
pub static fleetyard_plugin_entry_v1: PluginEntry = PluginEntry {
    struct_size: size_of::<PluginEntry>(),
    abi_major: fleetyard_abi::c::ABI_MAJOR,
    abi_minor: fleetyard_abi::c::ABI_MINOR,
    init: None,
    deinit: None,
    get_factory: Some(get_factory),
};
