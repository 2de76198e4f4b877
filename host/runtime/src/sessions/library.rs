//! Shared libraries: from the C ABI back to the Rust traits.

use std::ffi::c_void;
use std::path::Path;
use std::ptr;

use fleetyard_abi::convert::{
    CEnvironment, CFleetState, CInstance, COptions, SinkContext, checked, size_of, string,
};
use fleetyard_abi::layout::{self, LayoutCheck};
use fleetyard_abi::object::{
    FailPolicy, InstanceGenerator, InvocationPolicy, Object, Planner, Prepare,
};
use fleetyard_abi::sdk::{Catalog, Failure, Options, Sink};
use fleetyard_abi::{
    Budget, Capabilities, Descriptor, FleetState, FleetStatus, Instance, Kind, PathEncoding, Plan,
    SharedEnvironment, Status, c,
};
use fleetyard_core::shown;

use crate::Fault;
use crate::sessions::bounds::{PLAN_CELLS, plan_cells};
use crate::sessions::identity::introduced;

/// Most plugins of one kind that a library may claim to have.
const MOST_PLUGINS: u32 = 1024;

/// The plugins of one shared library, or of several entries that are linked in.
pub struct Library {
    entries: Vec<&'static c::PluginEntry>,
    descriptors: Vec<Located>,
}

struct Located {
    entry: &'static c::PluginEntry,
    index: u32,
    descriptor: Descriptor,
}

unsafe extern "C" fn no_extension(_: *mut c_void, _: c::Str) -> *const c_void {
    ptr::null()
}

impl Library {
    /// Loads a library and reads its descriptors. Runs code of the library, its
    /// constructors first. Libraries are never unloaded.
    pub fn open(path: &Path) -> Result<Self, Fault> {
        use libloading::os::unix::Library as Loaded;
        let flags = libc::RTLD_NOW | libc::RTLD_LOCAL | libc::RTLD_NODELETE;
        let name = path.display();
        // SAFETY: loading runs foreign code; in the host's own process only when
        // the user asked for that, else in a worker.
        let loaded =
            unsafe { Loaded::open(Some(path), flags) }.map_err(|error| Fault::Refused {
                reason: format!("{name} is no shared library that can be loaded: {error}"),
                hint: Some(
                    "a plugin is an ELF library for this machine, with its libraries".into(),
                ),
            })?;
        // SAFETY: the symbol is a `PluginEntry` by the contract; its size and
        // version are checked before anything else is read.
        let entry = unsafe { loaded.get::<*const c::PluginEntry>(b"fleetyard_plugin_entry_v1") }
            .map(|symbol| symbol.as_raw_ptr().cast::<c::PluginEntry>().cast_const())
            .map_err(|_| Fault::Refused {
                reason: format!(
                    "{name} is no Fleetyard plugin: it exports no fleetyard_plugin_entry_v1"
                ),
                hint: Some("is the symbol declared `FLEETYARD_EXPORT` and compiled as C?".into()),
            })?;
        std::mem::forget(loaded);
        // SAFETY: as above; the library stays loaded.
        unsafe { Self::from_raw(&[entry], &name.to_string()) }
    }

    /// The plugins that are linked into this program.
    pub fn from_entries(entries: &[&'static c::PluginEntry]) -> Result<Self, Fault> {
        let entries: Vec<_> = entries.iter().map(|entry| ptr::from_ref(*entry)).collect();
        // SAFETY: references are valid.
        unsafe { Self::from_raw(&entries, "the built-in plugins") }
    }

    /// # Safety
    /// The pointers point to entries that live for ever, whatever their size.
    unsafe fn from_raw(entries: &[*const c::PluginEntry], name: &str) -> Result<Self, Fault> {
        let mut library = Self {
            entries: Vec::new(),
            descriptors: Vec::new(),
        };
        for entry in entries {
            // SAFETY: by the caller's promise.
            unsafe { library.add(*entry, name)? };
        }
        Ok(library)
    }

    /// # Safety
    /// As [`Library::from_raw`].
    unsafe fn add(&mut self, entry: *const c::PluginEntry, name: &str) -> Result<(), Fault> {
        if !entry.is_aligned() {
            return Err(Fault::refused(format!(
                "{name}: fleetyard_plugin_entry_v1 is not aligned"
            )));
        }
        // The first eight bytes, size and version, are the same in all versions.
        // SAFETY: by the caller's promise.
        let (major, minor) = unsafe {
            let words = entry.cast::<u16>();
            (words.add(2).read(), words.add(3).read())
        };
        if major != c::ABI_MAJOR {
            return Err(Fault::Refused {
                reason: format!(
                    "{name} was built for version {major}.{minor} of the plugin ABI; this host has \
                     {}.{}",
                    c::ABI_MAJOR,
                    c::ABI_MINOR
                ),
                hint: Some("build it with the fleetyard.h of this host".into()),
            });
        }
        // SAFETY: by the caller's promise.
        let entry = unsafe { checked("fleetyard_plugin_entry_v1", entry) }
            .map_err(|reason| Fault::refused(format!("{name}: {reason}")))?;
        let get_factory = entry
            .get_factory
            .ok_or_else(|| Fault::refused(format!("{name}: get_factory is null")))?;
        if let Some(init) = entry.init {
            let host = c::Host {
                struct_size: size_of::<c::Host>(),
                abi_major: c::ABI_MAJOR,
                abi_minor: c::ABI_MINOR,
                context: ptr::null_mut(),
                name: c::Str::new("fleetyard"),
                version: c::Str::new(env!("CARGO_PKG_VERSION")),
                get_extension: Some(no_extension),
            };
            // The host structure is valid until `deinit`, so it is never freed.
            let host: &'static c::Host = Box::leak(Box::new(host));
            // SAFETY: `init` is called once, before anything else.
            let code = unsafe { init(host, c::Str::new(name)) };
            if code != c::OK {
                return Err(Fault::refused(format!(
                    "{name}: init failed with code {code}"
                )));
            }
        }
        // SAFETY: the function is the library's, and the text is static.
        let layouts = unsafe { get_factory(c::Str::new(layout::RUST_LAYOUT_ID)) };
        if !layouts.is_null() {
            // SAFETY: the pointer is the answer to that identifier.
            if let LayoutCheck::Differs(report) = unsafe { layout::check(layouts) } {
                return Err(Fault::Refused {
                    reason: format!("{name} was built against another layout of the contract"),
                    hint: Some(format!(
                        "rebuild it with this release of fleetyard-abi\n{report}"
                    )),
                });
            }
        }
        for kind in Kind::ALL {
            // SAFETY: the library is initialised.
            unsafe { self.add_kind(entry, get_factory, kind) }
                .map_err(|reason| Fault::refused(format!("{name}: {kind}: {reason}")))?;
        }
        self.entries.push(entry);
        Ok(())
    }

    /// # Safety
    /// The library is initialised.
    unsafe fn add_kind(
        &mut self,
        entry: &'static c::PluginEntry,
        get_factory: unsafe extern "C" fn(c::Str) -> *const c_void,
        kind: Kind,
    ) -> Result<(), String> {
        // SAFETY: by the caller's promise, here and below.
        let factory = unsafe { get_factory(c::Str::new(kind.factory_id())) };
        if factory.is_null() {
            return Ok(());
        }
        // Factories of all kinds differ in the type of `create` alone.
        // SAFETY: the pointer is the answer to that identifier.
        let factory = unsafe { checked("factory", factory.cast::<c::PlannerFactory>())? };
        if factory.reserved != 0 {
            let reserved = factory.reserved;
            return Err(format!("factory.reserved is {reserved}, not 0"));
        }
        let (Some(count), Some(descriptor), Some(_)) =
            (factory.count, factory.descriptor, factory.create)
        else {
            return Err("a function of the factory is null".into());
        };
        // SAFETY: a function of the factory.
        let count = unsafe { count(factory.context) };
        if count > MOST_PLUGINS {
            return Err(format!("claims to have {count} plugins"));
        }
        for index in 0..count {
            // SAFETY: the index is in range.
            let raw = unsafe { checked("descriptor", descriptor(factory.context, index)) }?;
            // SAFETY: descriptors and their texts are static.
            let descriptor = unsafe { descriptor_from_c(kind, raw)? };
            self.descriptors.push(Located {
                entry,
                index,
                descriptor,
            });
        }
        Ok(())
    }

    /// Calls `deinit`; nothing may be used afterwards.
    pub fn deinit(self) {
        for entry in self.entries {
            if let Some(deinit) = entry.deinit {
                // SAFETY: called once, after all objects are gone.
                unsafe { deinit() };
            }
        }
    }
}

/// # Safety
/// The texts are alive.
unsafe fn descriptor_from_c(kind: Kind, raw: &c::Descriptor) -> Result<Descriptor, String> {
    // SAFETY: by the caller's promise.
    let text = |text: c::Str| unsafe { string(text) };
    let id = text(raw.id);
    let schema = text(raw.options_schema);
    let options_schema = match schema.as_str() {
        "" => serde_json::Value::Null,
        schema => serde_json::from_str(schema).map_err(|error| {
            format!(
                "the options schema of `{}` is not JSON: {error}",
                shown(&id)
            )
        })?,
    };
    introduced(Descriptor {
        kind,
        name: text(raw.name),
        version: text(raw.version),
        description: text(raw.description),
        license: text(raw.license),
        capabilities: Capabilities::from_bits(raw.capabilities),
        options_schema,
        features: unsafe { features(raw)? },
        path_encoding: PathEncoding::Moves,
        id,
    })
}

/// Most features that a plugin may list.
const MOST_FEATURES: u32 = 1 << 10;

/// # Safety
/// The texts are alive.
unsafe fn features(raw: &c::Descriptor) -> Result<Vec<String>, String> {
    let (list, count) = (raw.features, raw.feature_count);
    if count == 0 {
        return Ok(Vec::new());
    }
    if count > MOST_FEATURES || list.is_null() || !list.is_aligned() {
        return Err(format!("lists {count} features, or they are nowhere"));
    }
    // SAFETY: by the caller's promise.
    let list = unsafe { std::slice::from_raw_parts(list, count as usize) };
    // SAFETY: by the caller's promise.
    Ok(list.iter().map(|text| unsafe { string(*text) }).collect())
}

impl Catalog for Library {
    fn abi_version(&self) -> Option<[u16; 2]> {
        let entry = self.entries.first()?;
        Some([entry.abi_major, entry.abi_minor])
    }

    fn descriptors(&self) -> Vec<Descriptor> {
        self.descriptors
            .iter()
            .map(|located| located.descriptor.clone())
            .collect()
    }

    fn create(
        &self,
        kind: Kind,
        id: &str,
        options: Options<'_>,
        sink: &dyn Sink,
    ) -> Result<Object, Failure> {
        let located = self
            .descriptors
            .iter()
            .find(|located| located.descriptor.kind == kind && located.descriptor.id == id)
            .ok_or_else(|| {
                Failure::new(Status::Unsupported, format!("there is no {kind} `{id}`"))
            })?;
        let options = COptions::new(options.json());
        let options = options.raw();
        Ok(match kind {
            Kind::Planner => Object::Planner(Box::new(Foreign::<c::Planner>::create(
                located, options, sink,
            )?)),
            Kind::FailPolicy => Object::FailPolicy(Box::new(Foreign::<c::FailPolicy>::create(
                located, options, sink,
            )?)),
            Kind::InstanceGenerator => {
                Object::InstanceGenerator(Box::new(Foreign::<c::InstanceGenerator>::create(
                    located, options, sink,
                )?))
            }
            Kind::InvocationPolicy => {
                Object::InvocationPolicy(Box::new(Foreign::<c::InvocationPolicy>::create(
                    located, options, sink,
                )?))
            }
        })
    }
}

/// The object structures of the C ABI.
trait Raw: Copy {
    type Factory;
    const KIND: Kind;
    fn create_of(factory: &Self::Factory) -> Option<(*mut c_void, Create<Self>)>;
    /// Room for one, which says so.
    fn room() -> Self;
    fn context(&self) -> *mut c_void;
    fn destroy(&self) -> Option<unsafe extern "C" fn(*mut c_void)>;
    fn get_extension(&self) -> Option<GetExtension>;
    /// True if size and reserved field are right and no function that must be there is missing.
    fn whole(&self) -> bool;
}

type Create<T> =
    unsafe extern "C" fn(*mut c_void, u32, *const c::Options, *const c::Sink, *mut T) -> i32;

type GetExtension = unsafe extern "C" fn(*mut c_void, c::Str) -> *const c_void;

macro_rules! raw {
    ($kind:ident, $factory:ident, $($call:ident),*) => {
        impl Raw for c::$kind {
            type Factory = c::$factory;
            const KIND: Kind = Kind::$kind;

            fn create_of(factory: &c::$factory) -> Option<(*mut c_void, Create<Self>)> {
                Some((factory.context, factory.create?))
            }

            fn room() -> Self {
                Self {
                    struct_size: size_of::<Self>(),
                    reserved: 0,
                    context: ptr::null_mut(),
                    $($call: None,)*
                    destroy: None,
                    get_extension: None,
                }
            }

            fn context(&self) -> *mut c_void {
                self.context
            }

            fn destroy(&self) -> Option<unsafe extern "C" fn(*mut c_void)> {
                self.destroy
            }

            fn get_extension(&self) -> Option<GetExtension> {
                self.get_extension
            }

            fn whole(&self) -> bool {
                self.struct_size >= size_of::<Self>()
                    && self.reserved == 0
                    $(&& self.$call.is_some())*
            }
        }
    };
}

raw!(Planner, PlannerFactory, prepare, plan);
raw!(FailPolicy, FailPolicyFactory, prepare, recover);
raw!(
    InstanceGenerator,
    InstanceGeneratorFactory,
    prepare,
    generate
);
raw!(InvocationPolicy, InvocationPolicyFactory, should_invoke);

/// An object that lives in a library.
struct Foreign<T: Raw> {
    raw: T,
    /// The functions that free what calls have left, if it has them.
    leftovers: Option<c::Leftovers>,
    environment: Option<CEnvironment>,
    /// Of the map.
    cells: usize,
}

// SAFETY: the contract lets an object be used from any one thread at a time.
unsafe impl<T: Raw> Send for Foreign<T> {}

fn failure(status: Status, message: impl Into<String>) -> Failure {
    Failure::new(status, message)
}

/// Turns what a call returned and said into a result.
fn result(code: i32, context: &SinkContext<'_>) -> Result<(), Failure> {
    if let Some(fault) = context.take_fault() {
        return Err(Failure::broke_contract(fault));
    }
    match Status::from_code(code) {
        Some(Status::Solved) => Ok(()),
        Some(status) => Err(failure(
            status,
            context
                .take_message()
                .unwrap_or_else(|| "it did not say why".into()),
        )),
        None => Err(Failure::broke_contract(format!(
            "it returned {code}, which is no status"
        ))),
    }
}

impl<T: Raw> Foreign<T> {
    fn create(
        located: &Located,
        options: *const c::Options,
        sink: &dyn Sink,
    ) -> Result<Self, Failure> {
        let internal = |reason: &str| failure(Status::InternalError, reason);
        let get_factory = located
            .entry
            .get_factory
            .ok_or_else(|| internal("no factory"))?;
        // SAFETY: the library was initialised when it was loaded.
        let factory = unsafe { get_factory(c::Str::new(T::KIND.factory_id())) };
        // It was checked then, but it need not be the same one.
        // SAFETY: the pointer is the answer to that identifier.
        let factory = unsafe { checked("factory", factory.cast::<T::Factory>()) };
        let factory = factory.map_err(Failure::broke_contract)?;
        let (owner, create) = T::create_of(factory).ok_or_else(|| internal("no factory"))?;
        let context = SinkContext::new(sink, None, PLAN_CELLS);
        let sink = context.to_c();
        let mut raw = T::room();
        // SAFETY: all arguments live through the call.
        let code = unsafe { create(owner, located.index, options, &raw const sink, &raw mut raw) };
        result(code, &context)?;
        if !raw.whole() {
            return Err(Failure::broke_contract(
                "`create` left a structure of the wrong size or without functions",
            ));
        }
        let mut made = Self {
            raw,
            leftovers: None,
            environment: None,
            cells: 0,
        };
        made.leftovers = made.leftovers().map_err(Failure::broke_contract)?;
        Ok(made)
    }

    /// The extension that frees what calls have left.
    fn leftovers(&self) -> Result<Option<c::Leftovers>, String> {
        let Some(get_extension) = self.raw.get_extension() else {
            return Ok(None);
        };
        // SAFETY: the object is alive, and the text is static.
        let found = unsafe { get_extension(self.raw.context(), c::Str::new(c::LEFTOVERS_ID)) };
        if found.is_null() {
            return Ok(None);
        }
        // SAFETY: the pointer is the answer to that identifier.
        unsafe { checked("leftovers", found.cast::<c::Leftovers>()) }.map(|raw| Some(*raw))
    }

    /// Calls a `prepare` function.
    fn learn(
        &mut self,
        prepare: Option<PrepareFn>,
        environment: &SharedEnvironment,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let prepare = prepare.ok_or_else(|| failure(Status::InternalError, "no `prepare`"))?;
        let cells = environment.places().unwrap_or(0);
        let environment = CEnvironment::new(environment);
        // The old map stays alive through the call, and is forgotten whatever comes of it.
        let _old = self.environment.take();
        // SAFETY: all arguments live through the call.
        self.ask(None, budget, sink, |context, budget, sink| unsafe {
            prepare(context, environment.raw(), budget, sink)
        })?;
        self.environment = Some(environment);
        self.cells = cells;
        Ok(())
    }

    /// Makes a call that has a budget and a sink, and turns its status into a
    /// result. `call` gets the context and both in their C form. Where a plan or a request is
    /// asked for, it is for so many agents and has so many cells or goals at most: others are
    /// refused before they are read.
    fn ask(
        &self,
        asked: Option<(usize, usize)>,
        budget: &Budget,
        sink: &dyn Sink,
        call: impl FnOnce(*mut c_void, &c::Budget, &c::Sink) -> i32,
    ) -> Result<(), Failure> {
        let (agents, most) = asked.unzip();
        let context = SinkContext::new(sink, agents, most.unwrap_or(PLAN_CELLS)).on(self.cells);
        let code = call(self.raw.context(), &budget.to_c(), &context.to_c());
        result(code, &context)
    }

    /// The agents of the plans that are asked for, and the most cells of one. Without that
    /// limit a wrong length would make this process allocate until it is aborted.
    fn plans(&self, instance: &Instance) -> (usize, usize) {
        (instance.agents(), plan_cells(instance, self.cells))
    }

    fn environment(&self) -> Result<*const c::Environment, Failure> {
        match &self.environment {
            Some(environment) => Ok(environment.raw()),
            None => Err(failure(
                Status::InvalidInput,
                "the call came before `prepare`",
            )),
        }
    }
}

type PrepareFn = unsafe extern "C" fn(
    *mut c_void,
    *const c::Environment,
    *const c::Budget,
    *const c::Sink,
) -> i32;

impl<T: Raw> Drop for Foreign<T> {
    fn drop(&mut self) {
        if let Some(destroy) = self.raw.destroy() {
            // SAFETY: called once, with the object's own context.
            unsafe { destroy(self.raw.context()) };
        }
    }
}

fn missing(name: &str) -> Failure {
    failure(
        Status::InternalError,
        format!("the function `{name}` is null"),
    )
}

macro_rules! prepares {
    ($($kind:ident),*) => {$(
        impl Prepare for Foreign<c::$kind> {
            fn has_leftovers(&self) -> bool {
                let any = self.leftovers.and_then(|leftovers| leftovers.any);
                // SAFETY: the object is alive.
                any.is_some_and(|any| unsafe { any(self.raw.context) } != 0)
            }

            fn free_leftovers(&mut self) {
                if let Some(free) = self.leftovers.and_then(|leftovers| leftovers.free) {
                    // SAFETY: the object is alive, and no call of it is running.
                    unsafe { free(self.raw.context) };
                }
            }

            fn prepare(
                &mut self,
                environment: &SharedEnvironment,
                budget: &Budget,
                sink: &dyn Sink,
            ) -> Result<(), Failure> {
                self.learn(self.raw.prepare, environment, budget, sink)
            }
        }
    )*};
}

prepares!(Planner, FailPolicy, InstanceGenerator);

impl Planner for Foreign<c::Planner> {
    fn plan(
        &mut self,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let plan = self.raw.plan.ok_or_else(|| missing("plan"))?;
        let plans = Some(self.plans(instance));
        let instance = CInstance::new(instance, self.environment()?);
        // SAFETY: all arguments live through the call.
        self.ask(plans, budget, sink, |context, budget, sink| unsafe {
            plan(context, instance.raw(), budget, sink)
        })
    }
}

impl FailPolicy for Foreign<c::FailPolicy> {
    fn recover(
        &mut self,
        instance: &Instance,
        failed: Option<&Plan>,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let recover = self.raw.recover.ok_or_else(|| missing("recover"))?;
        let plans = Some(self.plans(instance));
        let instance = CInstance::new(instance, self.environment()?);
        let ask = |failed| {
            // SAFETY: all arguments live through the call.
            self.ask(plans, budget, sink, |context, budget, sink| unsafe {
                recover(context, instance.raw(), failed, budget, sink)
            })
        };
        match failed {
            Some(failed) => failed.as_ref().with_c(ask),
            None => ask(ptr::null()),
        }
    }
}

impl InstanceGenerator for Foreign<c::InstanceGenerator> {
    fn generate(
        &mut self,
        state: &FleetState,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let generate = self.raw.generate.ok_or_else(|| missing("generate"))?;
        let asked = Some((state.next.agents(), PLAN_CELLS));
        let state = CFleetState::new(state, self.environment()?);
        // SAFETY: all arguments live through the call.
        self.ask(asked, budget, sink, |context, budget, sink| unsafe {
            generate(context, state.raw(), budget, sink)
        })
    }
}

impl InvocationPolicy for Foreign<c::InvocationPolicy> {
    fn should_invoke(&mut self, status: &FleetStatus, sink: &dyn Sink) -> Result<bool, Failure> {
        let should_invoke = self
            .raw
            .should_invoke
            .ok_or_else(|| missing("should_invoke"))?;
        let context = SinkContext::new(sink, None, PLAN_CELLS);
        let (status, sink) = (status.to_c(), context.to_c());
        let mut invoke = 0;
        // SAFETY: all arguments live through the call.
        let code = unsafe {
            should_invoke(
                self.raw.context,
                &raw const status,
                &raw const sink,
                &raw mut invoke,
            )
        };
        result(code, &context)?;
        match invoke {
            0 => Ok(false),
            1 => Ok(true),
            other => Err(Failure::broke_contract(format!(
                "it answered {other}, which is neither 0 nor 1"
            ))),
        }
    }
}
