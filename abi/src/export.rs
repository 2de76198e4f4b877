//! From the Rust traits to the C ABI: what [`export!`](crate::export!) generates
//! calls these functions, monomorphised per crate so that no function needs a
//! context to find its catalogue.

use std::any::Any;
use std::ffi::c_void;
use std::marker::PhantomData;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;
use std::sync::{Arc, OnceLock};

use crate::c;
use crate::convert::{CSink, invalid, options_json, size_of, string};
use crate::environment::Environment;
#[cfg(feature = "layout")]
use crate::layout;
use crate::model::{Budget, Descriptor, FleetState, FleetStatus, Instance, Kind, Status};
use crate::object::{FailPolicy, InstanceGenerator, InvocationPolicy, Object, Planner, Prepare};
use crate::plan::Plan;
use crate::sdk::{Entry, Failure, Options, StaticCatalog};

/// Lists the plugins of a crate: exports them as a shared library (make the
/// crate a `cdylib`), and gives a function `catalog()` for
/// [`serve_stdio`](crate::serve::serve_stdio), which makes an executable that
/// speaks JSON over stdio. Each type implements [`Plugin`](crate::sdk::Plugin) and the trait of its
/// kind. Panics do not leave the plugin: they become `internal-error`.
#[macro_export]
macro_rules! export {
    ($($list:ident: [$($plugin:ty),* $(,)?]),* $(,)?) => {
        /// The plugins of this crate.
        pub fn catalog() -> &'static $crate::sdk::StaticCatalog {
            static CATALOG: $crate::sdk::StaticCatalog = $crate::sdk::StaticCatalog(&[
                $($($crate::export!(@entry $list $plugin),)*)*
            ]);
            &CATALOG
        }

        /// Marks this crate's catalogue for the exported functions.
        #[doc(hidden)]
        pub struct FleetyardExport;

        impl $crate::export::Export for FleetyardExport {
            fn catalog() -> &'static $crate::sdk::StaticCatalog {
                catalog()
            }

            fn tables() -> &'static $crate::export::Tables {
                static TABLES: $crate::export::Tables = $crate::export::Tables::new();
                &TABLES
            }
        }

        /// The entry point of the plugin contract.
        #[allow(unsafe_code, non_upper_case_globals)]
        #[unsafe(no_mangle)]
        pub static fleetyard_plugin_entry_v1: $crate::c::PluginEntry =
            $crate::export::entry::<FleetyardExport>();
    };
    (@entry planners $plugin:ty) => { $crate::export!(@make Planner planner $plugin) };
    (@entry fail_policies $plugin:ty) => { $crate::export!(@make FailPolicy fail_policy $plugin) };
    (@entry instance_generators $plugin:ty) => {
        $crate::export!(@make InstanceGenerator instance_generator $plugin)
    };
    (@entry invocation_policies $plugin:ty) => {
        $crate::export!(@make InvocationPolicy invocation_policy $plugin)
    };
    (@make $kind:ident $make:ident $plugin:ty) => {
        $crate::sdk::Entry {
            descriptor: || {
                let descriptor = <$plugin as $crate::sdk::Plugin>::descriptor();
                $crate::Descriptor { kind: $crate::Kind::$kind, ..descriptor }
            },
            create: |options| {
                let plugin = <$plugin as $crate::sdk::Plugin>::create(options)?;
                Ok($crate::object::Object::$make(plugin))
            },
        }
    };
}

/// A crate's catalogue, found by type. Implemented by [`export!`](crate::export!).
pub trait Export: 'static {
    /// The plugins.
    fn catalog() -> &'static StaticCatalog;
    /// The C descriptors of the plugins.
    fn tables() -> &'static Tables;
}

/// The C descriptors of a crate's plugins, made once on first use.
pub struct Tables(OnceLock<[Vec<(&'static Entry, c::Descriptor)>; 4]>);

impl Tables {
    /// Nothing yet.
    pub const fn new() -> Self {
        Self(OnceLock::new())
    }
}

impl Default for Tables {
    fn default() -> Self {
        Self::new()
    }
}

fn table<E: Export>(kind: Kind) -> &'static [(&'static Entry, c::Descriptor)] {
    let tables = E::tables().0.get_or_init(|| {
        Kind::ALL.map(|kind| {
            let described = E::catalog()
                .0
                .iter()
                .map(|entry| (entry, (entry.descriptor)()));
            let of_kind = described.filter(|(_, descriptor)| descriptor.kind == kind);
            of_kind
                .map(|(entry, descriptor)| (entry, descriptor_to_c(descriptor)))
                .collect()
        })
    });
    &tables[kind as usize]
}

/// Descriptors are static by contract, so their text is leaked, once.
fn descriptor_to_c(descriptor: Descriptor) -> c::Descriptor {
    let text = |text: String| c::Str::new(Box::leak(text.into_boxed_str()));
    let schema = match descriptor.options_schema {
        serde_json::Value::Null => String::new(),
        schema => schema.to_string(),
    };
    let features: Vec<c::Str> = descriptor.features.into_iter().map(text).collect();
    c::Descriptor {
        struct_size: size_of::<c::Descriptor>(),
        feature_count: features.len() as u32,
        features: Vec::leak(features).as_ptr(),
        id: text(descriptor.id),
        name: text(descriptor.name),
        version: text(descriptor.version),
        description: text(descriptor.description),
        license: text(descriptor.license),
        options_schema: text(schema),
        capabilities: descriptor.capabilities.bits(),
    }
}

/// The entry structure of a crate.
pub const fn entry<E: Export>() -> c::PluginEntry {
    c::PluginEntry {
        struct_size: size_of::<c::PluginEntry>(),
        abi_major: c::ABI_MAJOR,
        abi_minor: c::ABI_MINOR,
        init: None,
        deinit: None,
        get_factory: Some(get_factory::<E>),
    }
}

struct Factories<E>(PhantomData<E>);

macro_rules! factory {
    ($factory:ident, $kind:ident, $count:ident, $descriptor:ident, $create:ident) => {
        c::$factory {
            struct_size: size_of::<c::$factory>(),
            reserved: 0,
            context: ptr::null_mut(),
            count: Some($count::<E, { Kind::$kind as u8 }>),
            descriptor: Some($descriptor::<E, { Kind::$kind as u8 }>),
            create: Some($create::<E>),
        }
    };
}

impl<E: Export> Factories<E> {
    const PLANNER: &'static c::PlannerFactory =
        &factory!(PlannerFactory, Planner, count, descriptor, create_planner);
    const FAIL_POLICY: &'static c::FailPolicyFactory = &factory!(
        FailPolicyFactory,
        FailPolicy,
        count,
        descriptor,
        create_fail_policy
    );
    const INSTANCE_GENERATOR: &'static c::InstanceGeneratorFactory = &factory!(
        InstanceGeneratorFactory,
        InstanceGenerator,
        count,
        descriptor,
        create_instance_generator
    );
    const INVOCATION_POLICY: &'static c::InvocationPolicyFactory = &factory!(
        InvocationPolicyFactory,
        InvocationPolicy,
        count,
        descriptor,
        create_invocation_policy
    );
}

unsafe extern "C" fn get_factory<E: Export>(id: c::Str) -> *const c_void {
    // SAFETY: the host's text lives through the call.
    match unsafe { string(id) }.as_str() {
        c::PLANNER_FACTORY_ID => ptr::from_ref(Factories::<E>::PLANNER).cast(),
        c::FAIL_POLICY_FACTORY_ID => ptr::from_ref(Factories::<E>::FAIL_POLICY).cast(),
        c::INSTANCE_GENERATOR_FACTORY_ID => {
            ptr::from_ref(Factories::<E>::INSTANCE_GENERATOR).cast()
        }
        c::INVOCATION_POLICY_FACTORY_ID => ptr::from_ref(Factories::<E>::INVOCATION_POLICY).cast(),
        #[cfg(feature = "layout")]
        layout::RUST_LAYOUT_ID => ptr::from_ref(layout::rust_layout()).cast(),
        _ => ptr::null(),
    }
}

fn kind_of(index: u8) -> Kind {
    Kind::ALL[index as usize]
}

unsafe extern "C" fn count<E: Export, const KIND: u8>(_: *mut c_void) -> u32 {
    catch_unwind(|| table::<E>(kind_of(KIND)).len() as u32).unwrap_or(0)
}

unsafe extern "C" fn descriptor<E: Export, const KIND: u8>(
    _: *mut c_void,
    index: u32,
) -> *const c::Descriptor {
    let find = || {
        table::<E>(kind_of(KIND))
            .get(index as usize)
            .map(|(_, c)| ptr::from_ref(c))
    };
    catch_unwind(find).ok().flatten().unwrap_or(ptr::null())
}

/// The message of a panic.
pub fn panic_message(payload: &(dyn Any + Send)) -> &str {
    payload
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| payload.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("a panic without a message")
}

/// Runs a call of the plugin: no panic leaves it, and failures are explained to
/// the sink.
///
/// # Safety
/// `sink` is the sink of the call.
unsafe fn guarded(
    sink: *const c::Sink,
    call: impl FnOnce(&CSink<'_>) -> Result<(), Failure>,
) -> i32 {
    // SAFETY: by the caller's promise.
    let Ok(sink) = (unsafe { CSink::new(sink) }) else {
        return c::STATUS_INVALID_INPUT;
    };
    match catch_unwind(AssertUnwindSafe(|| call(&sink))) {
        Ok(Ok(())) => c::STATUS_SOLVED,
        Ok(Err(failure)) => {
            sink.fail(&failure.message);
            failure.status.code()
        }
        Err(payload) => {
            sink.fail(&format!(
                "the plugin panicked: {}",
                panic_message(payload.as_ref())
            ));
            c::STATUS_INTERNAL_ERROR
        }
    }
}

/// A plugin as the context of a C object.
fn into_context<T: ?Sized>(plugin: Box<T>) -> *mut c_void {
    Box::into_raw(Box::new(plugin)).cast()
}

/// # Safety
/// `context` came from [`into_context`] of the same type, and was not destroyed.
unsafe fn of<'a, T: ?Sized>(context: *mut c_void) -> &'a mut T {
    // SAFETY: by the caller's promise; the host calls from one thread at a time.
    unsafe { &mut *context.cast::<Box<T>>() }
}

unsafe extern "C" fn destroy<T: ?Sized>(context: *mut c_void) {
    if !context.is_null() {
        // SAFETY: the host passes back what `create` gave, once.
        let made = unsafe { Box::from_raw(context.cast::<Box<T>>()) };
        // A panic in a destructor has nobody left to hear of it.
        let _ = catch_unwind(AssertUnwindSafe(move || drop(made)));
    }
}

/// Creates plugin `index` of a kind and hands its object to `store`.
///
/// # Safety
/// `options` and `sink` are those of a `create` call.
unsafe fn create<E: Export>(
    kind: Kind,
    index: u32,
    options: *const c::Options,
    sink: *const c::Sink,
    store: impl FnOnce(Object) -> bool,
) -> i32 {
    let make = |_: &CSink<'_>| {
        let (entry, _) = table::<E>(kind)
            .get(index as usize)
            .ok_or_else(|| invalid(format!("there is no {kind} number {index}")))?;
        // SAFETY: the host's options live through the call.
        let options = unsafe { options_json(options)? };
        let object = (entry.create)(Options::new(&options))?;
        if store(object) {
            return Ok(());
        }
        Err(Failure::new(
            Status::Unsupported,
            "the host has no room for an object of this kind: it is older than this plugin",
        ))
    };
    // SAFETY: by the caller's promise.
    unsafe { guarded(sink, make) }
}

/// Says if there is room for a structure.
///
/// # Safety
/// `out` is null or points to a `u32` that says how many bytes there are.
unsafe fn has_room<T>(out: *const T) -> bool {
    // SAFETY: by the caller's promise.
    !out.is_null() && unsafe { out.cast::<u32>().read() } >= size_of::<T>()
}

macro_rules! create_fn {
    ($name:ident, $kind:ident, $object:ident, $table:expr) => {
        unsafe extern "C" fn $name<E: Export>(
            _: *mut c_void,
            index: u32,
            options: *const c::Options,
            sink: *const c::Sink,
            out: *mut c::$kind,
        ) -> i32 {
            let store = |object| match object {
                // SAFETY: room begins with its size.
                Object::$kind(plugin) if unsafe { has_room(out) } => {
                    let context = into_context::<dyn $kind>(plugin);
                    let table: fn(*mut c_void) -> c::$kind = $table;
                    // SAFETY: the host gives room for one structure.
                    unsafe { out.write(table(context)) };
                    true
                }
                _ => false,
            };
            // SAFETY: the arguments are those of the call.
            unsafe { create::<E>(Kind::$kind, index, options, sink, store) }
        }
    };
}

create_fn!(create_planner, Planner, Planner, |context| c::Planner {
    struct_size: size_of::<c::Planner>(),
    reserved: 0,
    context,
    prepare: Some(prepare::<dyn Planner>),
    plan: Some(plan),
    destroy: Some(destroy::<dyn Planner>),
    get_extension: Some(get_extension::<dyn Planner>),
});
create_fn!(create_fail_policy, FailPolicy, FailPolicy, |context| {
    c::FailPolicy {
        struct_size: size_of::<c::FailPolicy>(),
        reserved: 0,
        context,
        prepare: Some(prepare::<dyn FailPolicy>),
        recover: Some(recover),
        destroy: Some(destroy::<dyn FailPolicy>),
        get_extension: Some(get_extension::<dyn FailPolicy>),
    }
});
create_fn!(
    create_instance_generator,
    InstanceGenerator,
    InstanceGenerator,
    |context| {
        c::InstanceGenerator {
            struct_size: size_of::<c::InstanceGenerator>(),
            reserved: 0,
            context,
            prepare: Some(prepare::<dyn InstanceGenerator>),
            generate: Some(generate),
            destroy: Some(destroy::<dyn InstanceGenerator>),
            get_extension: Some(get_extension::<dyn InstanceGenerator>),
        }
    }
);
create_fn!(
    create_invocation_policy,
    InvocationPolicy,
    InvocationPolicy,
    |context| {
        c::InvocationPolicy {
            struct_size: size_of::<c::InvocationPolicy>(),
            reserved: 0,
            context,
            should_invoke: Some(should_invoke),
            destroy: Some(destroy::<dyn InvocationPolicy>),
            get_extension: None,
        }
    }
);

/// The leftovers of a kind of object.
struct LeftoversOf<T: ?Sized>(PhantomData<T>);

impl<T: Prepare + ?Sized> LeftoversOf<T> {
    const TABLE: &'static c::Leftovers = &c::Leftovers {
        struct_size: size_of::<c::Leftovers>(),
        reserved: 0,
        any: Some(has_leftovers::<T>),
        free: Some(free_leftovers::<T>),
    };
}

unsafe extern "C" fn has_leftovers<T: Prepare + ?Sized>(context: *mut c_void) -> i32 {
    // SAFETY: the host passes back the context.
    unsafe { of::<T>(context) }.has_leftovers().into()
}

unsafe extern "C" fn free_leftovers<T: Prepare + ?Sized>(context: *mut c_void) {
    // SAFETY: the host passes back the context.
    let plugin = unsafe { of::<T>(context) };
    // As in `destroy`.
    let _ = catch_unwind(AssertUnwindSafe(|| plugin.free_leftovers()));
}

unsafe extern "C" fn get_extension<T: Prepare + ?Sized>(
    _: *mut c_void,
    id: c::Str,
) -> *const c_void {
    // SAFETY: the host's text lives through the call.
    match unsafe { string(id) }.as_str() {
        c::LEFTOVERS_ID => ptr::from_ref(LeftoversOf::<T>::TABLE).cast(),
        _ => ptr::null(),
    }
}

unsafe extern "C" fn prepare<T: Prepare + ?Sized>(
    context: *mut c_void,
    environment: *const c::Environment,
    budget: *const c::Budget,
    sink: *const c::Sink,
) -> i32 {
    let call = |sink: &CSink<'_>| {
        // SAFETY: the host passes back the context, and borrows the rest to us.
        let plugin = unsafe { of::<T>(context) };
        // SAFETY: as above.
        let environment = unsafe { Environment::from_c(environment) }?;
        // SAFETY: as above.
        let budget = unsafe { Budget::from_c(budget) }?;
        plugin.prepare(&Arc::new(environment), &budget, sink)
    };
    // SAFETY: the sink is that of the call.
    unsafe { guarded(sink, call) }
}

unsafe extern "C" fn plan(
    context: *mut c_void,
    instance: *const c::Instance,
    budget: *const c::Budget,
    sink: *const c::Sink,
) -> i32 {
    let call = |sink: &CSink<'_>| {
        // SAFETY: as in `prepare`.
        let plugin = unsafe { of::<dyn Planner>(context) };
        // SAFETY: as in `prepare`.
        let instance = unsafe { Instance::from_c(instance) }?;
        // SAFETY: as in `prepare`.
        let budget = unsafe { Budget::from_c(budget) }?;
        plugin.plan(&instance, &budget, sink)
    };
    // SAFETY: the sink is that of the call.
    unsafe { guarded(sink, call) }
}

unsafe extern "C" fn recover(
    context: *mut c_void,
    instance: *const c::Instance,
    failed_plan: *const c::Plan,
    budget: *const c::Budget,
    sink: *const c::Sink,
) -> i32 {
    let call = |sink: &CSink<'_>| {
        // SAFETY: as in `prepare`.
        let plugin = unsafe { of::<dyn FailPolicy>(context) };
        // SAFETY: as in `prepare`.
        let instance = unsafe { Instance::from_c(instance) }?;
        // SAFETY: as in `prepare`.
        let budget = unsafe { Budget::from_c(budget) }?;
        let failed = if failed_plan.is_null() {
            None
        } else {
            let agents = Some(instance.agents());
            // SAFETY: as in `prepare`.
            Some(unsafe { Plan::from_c(failed_plan, agents, usize::MAX) }?)
        };
        plugin.recover(&instance, failed.as_ref(), &budget, sink)
    };
    // SAFETY: the sink is that of the call.
    unsafe { guarded(sink, call) }
}

unsafe extern "C" fn generate(
    context: *mut c_void,
    state: *const c::FleetState,
    budget: *const c::Budget,
    sink: *const c::Sink,
) -> i32 {
    let call = |sink: &CSink<'_>| {
        // SAFETY: as in `prepare`.
        let plugin = unsafe { of::<dyn InstanceGenerator>(context) };
        // SAFETY: as in `prepare`.
        let state = unsafe { FleetState::from_c(state) }?;
        // SAFETY: as in `prepare`.
        let budget = unsafe { Budget::from_c(budget) }?;
        plugin.generate(&state, &budget, sink)
    };
    // SAFETY: the sink is that of the call.
    unsafe { guarded(sink, call) }
}

unsafe extern "C" fn should_invoke(
    context: *mut c_void,
    status: *const c::FleetStatus,
    sink: *const c::Sink,
    out: *mut i32,
) -> i32 {
    let call = |sink: &CSink<'_>| {
        // SAFETY: as in `prepare`.
        let plugin = unsafe { of::<dyn InvocationPolicy>(context) };
        // SAFETY: as in `prepare`.
        let status = unsafe { FleetStatus::from_c(status) }?;
        let invoke = plugin.should_invoke(&status, sink)?;
        // SAFETY: the host gives room for the answer.
        unsafe { out.write(invoke.into()) };
        Ok(())
    };
    // SAFETY: the sink is that of the call.
    unsafe { guarded(sink, call) }
}
