//! Sinks in both directions.

use std::ffi::c_void;
use std::ptr;

use super::memory::{bytes_from_c, bytes_to_c};
use super::{checked, size_of, string};
use crate::annotation::Annotation;
use crate::c;
use crate::clock::monotonic_ns;
use crate::figures::check_figure;
use crate::model::{LogLevel, Request};
use crate::plan::{Plan, PlanRef};
use crate::sdk::{Annotations, Rejected, Sink};

/// Data of a C sink besides the Rust one: the bounds of its checks, and the plugin's explanation of
/// a failure.
pub struct SinkContext<'a> {
    sink: &'a dyn Sink,
    agents: Option<usize>,
    most: usize,
    places: usize,
    message: std::sync::Mutex<Option<String>>,
    fault: std::sync::Mutex<Option<String>>,
}

impl<'a> SinkContext<'a> {
    /// For a call about `agents` agents, if it is about any.
    pub fn new(sink: &'a dyn Sink, agents: Option<usize>, most: usize) -> Self {
        Self {
            sink,
            agents,
            most,
            places: 0,
            message: None.into(),
            fault: None.into(),
        }
    }

    /// On a map of so many places, which annotations may be about.
    #[must_use]
    pub fn on(self, places: usize) -> Self {
        Self { places, ..self }
    }

    /// The C form; valid as long as `self`.
    pub fn to_c(&self) -> c::Sink {
        c::Sink {
            struct_size: size_of::<c::Sink>(),
            reserved: 0,
            context: ptr::from_ref(self).cast_mut().cast(),
            submit_plan: Some(submit_plan),
            submit_request: Some(submit_request),
            cancelled: Some(cancelled),
            now_ns: Some(now_ns),
            fail: Some(fail),
            log: Some(log),
            metric: Some(metric),
            note: Some(note),
            progress: Some(progress),
            get_extension: Some(get_extension),
        }
    }

    /// The plugin's explanation of its status, if it gave one.
    pub fn take_message(&self) -> Option<String> {
        lock(&self.message).take()
    }

    /// The first thing that was submitted and broke the contract.
    pub fn take_fault(&self) -> Option<String> {
        lock(&self.fault).take()
    }

    fn broken(&self, fault: String) -> i32 {
        self.sink.log(LogLevel::Error, &fault);
        lock(&self.fault).get_or_insert(fault);
        c::REJECTED
    }
}

fn lock<T>(mutex: &std::sync::Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    // A panic while the lock was held leaves a plain value behind.
    mutex
        .lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// # Safety
/// `pointer` came from [`SinkContext::to_c`], and the context is alive.
unsafe fn context<'a>(pointer: *mut c_void) -> &'a SinkContext<'a> {
    // SAFETY: by the caller's promise.
    unsafe { &*pointer.cast::<SinkContext<'a>>() }
}

unsafe extern "C" fn submit_plan(pointer: *mut c_void, plan: *const c::Plan) -> i32 {
    // SAFETY: the plugin passes back the context of the sink it was given.
    let context = unsafe { context(pointer) };
    // SAFETY: the plugin's promise by the header.
    match unsafe { Plan::from_c(plan, context.agents, context.most) } {
        Ok(plan) => code(context.sink.submit_plan(plan.as_ref())),
        Err(failure) => context.broken(failure.message),
    }
}

unsafe extern "C" fn submit_request(pointer: *mut c_void, request: *const c::Request) -> i32 {
    // SAFETY: as above.
    let context = unsafe { context(pointer) };
    // SAFETY: as above.
    match unsafe { Request::from_c(request, context.agents, context.most) } {
        Ok(request) => code(context.sink.submit_request(&request)),
        Err(failure) => context.broken(failure.message),
    }
}

fn code(result: Result<(), Rejected>) -> i32 {
    match result {
        Ok(()) => c::OK,
        Err(Rejected::Malformed) => c::REJECTED,
        Err(Rejected::TooLate) => c::TOO_LATE,
        Err(Rejected::Busy) => c::BUSY,
    }
}

fn result(code: i32) -> Result<(), Rejected> {
    match code {
        c::OK => Ok(()),
        c::TOO_LATE => Err(Rejected::TooLate),
        c::BUSY => Err(Rejected::Busy),
        _ => Err(Rejected::Malformed),
    }
}

unsafe extern "C" fn metric(pointer: *mut c_void, name: c::Str, value: f64) {
    // SAFETY: as above.
    let (context, name) = unsafe { (context(pointer), string(name)) };
    match check_figure(&name, value) {
        Ok(()) => context.sink.metric(&name, value),
        Err(reason) => {
            context.broken(reason);
        }
    }
}

unsafe extern "C" fn log(pointer: *mut c_void, level: i32, text: c::Str) {
    let level = LogLevel::from_code(level).unwrap_or(LogLevel::Info);
    // SAFETY: as above.
    unsafe { context(pointer).sink.log(level, &string(text)) };
}

unsafe extern "C" fn progress(pointer: *mut c_void, done: u64, total: u64) {
    // SAFETY: as above.
    unsafe { context(pointer).sink.progress(done, total) };
}

unsafe extern "C" fn cancelled(pointer: *mut c_void) -> i32 {
    // SAFETY: as above.
    i32::from(unsafe { context(pointer).sink.cancelled() })
}

unsafe extern "C" fn now_ns(_: *mut c_void) -> u64 {
    monotonic_ns()
}

unsafe extern "C" fn note(pointer: *mut c_void, name: c::Str, text: c::Str) {
    // SAFETY: as above.
    let (context, name, text) = unsafe { (context(pointer), string(name), string(text)) };
    context.sink.note(&name, &text);
}

/// The extension by which the host keeps bytes.
static KEEP: c::Keep = c::Keep {
    struct_size: size_of::<c::Keep>(),
    reserved: 0,
    keep: Some(keep),
};

/// The extension for what a plugin wants to show.
static ANNOTATIONS: c::Annotations = c::Annotations {
    struct_size: size_of::<c::Annotations>(),
    reserved: 0,
    annotate: Some(annotate),
};

unsafe extern "C" fn get_extension(pointer: *mut c_void, id: c::Str) -> *const c_void {
    // SAFETY: as above.
    let (context, id) = unsafe { (context(pointer), string(id)) };
    match id.as_str() {
        c::ANNOTATIONS_ID if context.sink.annotations().is_some() => {
            (&raw const ANNOTATIONS).cast()
        }
        // Calls about agents are those that know what was kept.
        c::KEEP_ID if context.agents.is_some() => (&raw const KEEP).cast(),
        _ => ptr::null(),
    }
}

unsafe extern "C" fn keep(pointer: *mut c_void, bytes: *const c::Bytes) -> i32 {
    // SAFETY: as above.
    let context = unsafe { context(pointer) };
    // SAFETY: the plugin's promise by the header.
    match unsafe { bytes_from_c(bytes) } {
        Ok(bytes) => code(context.sink.keep(&bytes)),
        Err(failure) => context.broken(failure.message),
    }
}

unsafe extern "C" fn annotate(pointer: *mut c_void, annotation: *const c::Annotation) -> i32 {
    // SAFETY: as above.
    let context = unsafe { context(pointer) };
    let Some(annotations) = context.sink.annotations() else {
        return c::BUSY;
    };
    let agents = context.agents.unwrap_or(0);
    // SAFETY: as above.
    match unsafe { Annotation::from_c(annotation, agents, context.places) } {
        Ok(annotation) => code(annotations.annotate(&annotation)),
        Err(failure) => context.broken(failure.message),
    }
}

unsafe extern "C" fn fail(pointer: *mut c_void, message: c::Str) {
    // SAFETY: as above.
    let context = unsafe { context(pointer) };
    // SAFETY: as above.
    *lock(&context.message) = Some(unsafe { string(message) });
}

/// A C sink as a Rust one, for plugins written in Rust.
pub struct CSink<'a> {
    raw: &'a c::Sink,
    annotations: Option<&'a c::Annotations>,
}

// SAFETY: the functions of a sink may be called from any thread.
unsafe impl Sync for CSink<'_> {}

impl<'a> CSink<'a> {
    /// # Safety
    /// As [`checked`].
    pub unsafe fn new(pointer: *const c::Sink) -> Result<Self, String> {
        // SAFETY: by the caller's promise.
        let raw = unsafe { checked("sink", pointer)? };
        let annotations = raw.get_extension.map_or(ptr::null(), |get_extension| {
            // SAFETY: the sink is the host's.
            unsafe { get_extension(raw.context, c::Str::new(c::ANNOTATIONS_ID)) }
        });
        let annotations: *const c::Annotations = annotations.cast();
        Ok(Self {
            raw,
            annotations: if annotations.is_null() {
                None
            } else {
                // SAFETY: the pointer is the answer to that identifier.
                Some(unsafe { checked("annotations", annotations)? })
            },
        })
    }

    /// Explains the status that the call is about to return.
    pub fn fail(&self, message: &str) {
        if let Some(fail) = self.raw.fail {
            // SAFETY: the sink is the host's, and the text lives through the call.
            unsafe { fail(self.raw.context, c::Str::new(message)) };
        }
    }
}

impl Sink for CSink<'_> {
    fn submit_plan(&self, plan: PlanRef<'_>) -> Result<(), Rejected> {
        let submit = self.raw.submit_plan.ok_or(Rejected::Malformed)?;
        // SAFETY: the plan lives through the call.
        result(plan.with_c(|raw| unsafe { submit(self.raw.context, raw) }))
    }

    fn submit_request(&self, request: &Request) -> Result<(), Rejected> {
        let submit = self.raw.submit_request.ok_or(Rejected::Malformed)?;
        // SAFETY: the request lives through the call.
        result(request.with_c(|raw| unsafe { submit(self.raw.context, raw) }))
    }

    fn keep(&self, bytes: &[u8]) -> Result<(), Rejected> {
        let get_extension = self.raw.get_extension.ok_or(Rejected::Malformed)?;
        // SAFETY: the sink is the host's, and the text is static.
        let found = unsafe { get_extension(self.raw.context, c::Str::new(c::KEEP_ID)) };
        // SAFETY: the host answers with the structure of that identifier, or null.
        let extension = unsafe { checked("keep", found.cast::<c::Keep>()) };
        let extension = extension.map_err(|_| Rejected::Malformed)?;
        let keep = extension.keep.ok_or(Rejected::Malformed)?;
        let bytes = bytes_to_c(bytes);
        // SAFETY: the bytes live through the call.
        result(unsafe { keep(self.raw.context, &raw const bytes) })
    }

    fn note(&self, name: &str, text: &str) {
        if let Some(note) = self.raw.note {
            // SAFETY: the texts live through the call.
            unsafe { note(self.raw.context, c::Str::new(name), c::Str::new(text)) };
        }
    }

    fn metric(&self, name: &str, value: f64) {
        if let Some(metric) = self.raw.metric {
            // SAFETY: the text lives through the call.
            unsafe { metric(self.raw.context, c::Str::new(name), value) };
        }
    }

    fn log(&self, level: LogLevel, text: &str) {
        if let Some(log) = self.raw.log {
            // SAFETY: the text lives through the call.
            unsafe { log(self.raw.context, level.code(), c::Str::new(text)) };
        }
    }

    fn progress(&self, done: u64, total: u64) {
        if let Some(progress) = self.raw.progress {
            // SAFETY: the sink is the host's.
            unsafe { progress(self.raw.context, done, total) };
        }
    }

    fn cancelled(&self) -> bool {
        // SAFETY: the sink is the host's.
        self.raw
            .cancelled
            .is_some_and(|cancelled| unsafe { cancelled(self.raw.context) } != 0)
    }

    fn annotations(&self) -> Option<&dyn Annotations> {
        self.annotations.map(|_| self as &dyn Annotations)
    }
}

impl Annotations for CSink<'_> {
    fn annotate(&self, annotation: &Annotation) -> Result<(), Rejected> {
        let annotate = self
            .annotations
            .and_then(|annotations| annotations.annotate)
            .ok_or(Rejected::Busy)?;
        // SAFETY: the annotation lives through the call.
        let code = annotation.with_c(|raw| unsafe { annotate(self.raw.context, raw) });
        code.map_or(Err(Rejected::Malformed), result)
    }
}
