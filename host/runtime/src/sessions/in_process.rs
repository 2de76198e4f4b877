//! A shared library that is called in the host's own process.

use std::time::Duration;

use fleetyard_abi::object::Object;
use fleetyard_abi::sdk::{Catalog, Failure, Options};
use fleetyard_abi::wire::Outcome;
use fleetyard_abi::{
    Budget, FleetState, FleetStatus, Kind, SharedEnvironment, Status, monotonic_ns,
};
use serde_json::Value;

use crate::confinement::promises::{BrokenPromise, Promises};
use crate::confinement::sandbox::SandboxReport;
use crate::interrupt::interrupted_by;
use crate::sessions::attachment::{Attachment, Closing, Generated, no_request};
use crate::sessions::bounds::LOG_BYTES;
use crate::sessions::client::Deadline;
use crate::sessions::collector::{Collected, Collector};
use crate::sessions::log::Log;
use crate::sessions::plan_run::{CallReport, PlanCall, PlanRun, Running, Solver};
use crate::usage::CallUsage;
use crate::{Fault, Library};

/// A library, and the plugin that was made of it.
pub(super) struct InProcess {
    library: Library,
    object: Option<Object>,
    log: Log,
    promises: Promises,
}

impl InProcess {
    /// A library that was loaded under these promises.
    pub(super) fn new(library: Library, promises: Promises) -> Self {
        Self {
            library,
            object: None,
            log: Log::default(),
            promises,
        }
    }

    /// Makes a call that asks for no plan, and has to answer by then. What it breaks of its promises is put back, and its
    /// log is kept.
    fn call<T>(
        &mut self,
        method: &'static str,
        answer_by_ns: u64,
        call: impl FnOnce(&Library, &mut Option<Object>, &Collector) -> Result<T, Failure>,
    ) -> Result<(T, Collected), Fault> {
        let collector = Collector::idle(answer_by_ns);
        let (library, object) = (&self.library, &mut self.object);
        let result = (self.promises).around(method, || call(library, object, &collector));
        let mut collected = collector.into_inner();
        (self.log).append(std::mem::take(&mut collected.log), LOG_BYTES);
        Ok((result.map_err(to_fault(method))?, collected))
    }

    /// Lets the plugin free what a call has left, outside of its time.
    fn tidy(&mut self) {
        if let Some(object) = &mut self.object
            && object.has_leftovers()
        {
            self.promises.around("free", || object.free_leftovers());
        }
    }

    /// Asks for a plan; what it comes to before it is judged.
    fn ask(&mut self, call: &PlanCall<'_>, running: &mut Running) -> Result<Outcome, Fault> {
        let context = call.context()?;
        let method = call.method();
        let (object, instance) = (&mut self.object, call.instance);
        let (budget, collector) = (&running.budget, &running.collector);
        let (result, taken_ns) = self.promises.around(method, || {
            // What stands around the call is not the plugin's time.
            let began_ns = monotonic_ns();
            let result = match (object, call.solver) {
                (Some(Object::Planner(planner)), Solver::Planner) => {
                    planner.plan(instance, budget, collector)
                }
                (Some(Object::FailPolicy(policy)), Solver::FailPolicy(failed)) => {
                    policy.recover(instance, failed, budget, collector)
                }
                _ => Err(wrong_object()),
            };
            (result, monotonic_ns() - began_ns)
        });
        running.timing.round_trip = Some(Duration::from_nanos(taken_ns));
        running.collector.check_forms(&context);
        match result {
            Ok(()) => Ok(Outcome {
                status: Status::Solved,
                message: None,
            }),
            Err(failure) if failure.broke_contract => Err(to_fault(method)(failure)),
            Err(Failure {
                status, message, ..
            }) => Ok(Outcome {
                status,
                message: Some(message),
            }),
        }
    }
}

impl Attachment for InProcess {
    fn create(&mut self, kind: Kind, id: &str, options: Value) -> Result<(), Fault> {
        if self.object.is_some() {
            self.promises.around("destroy", || self.object = None);
        }
        let options = options.to_string();
        let made = self.call("create", u64::MAX, |library, _, collector| {
            library.create(kind, id, Options::new(&options), collector)
        });
        self.promises.settle();
        self.object = Some(made?.0);
        Ok(())
    }

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
    ) -> Result<CallReport, Fault> {
        let started = monotonic_ns();
        let budget = budget.starting(started);
        let prepared = self.call("prepare", budget.answer_by_ns, |_, object, collector| {
            let object = object.as_mut();
            object
                .and_then(|object| object.prepare(environment, &budget, collector))
                .unwrap_or_else(|| Err(wrong_object()))
        });
        let wall = Duration::from_nanos(monotonic_ns() - started);
        self.tidy();
        self.promises.settle();
        prepared?;
        Ok(CallReport {
            wall,
            usage: CallUsage::default(),
        })
    }

    fn set_grace(&mut self, _: Duration) {}

    fn solve(&mut self, call: &PlanCall<'_>, budget: &Budget) -> PlanRun {
        let mut running = Running::begin(call, budget, monotonic_ns);
        let called = self.ask(call, &mut running);
        let mut ended = running.end(monotonic_ns());
        self.tidy();
        self.log.append(ended.take_log(), LOG_BYTES);
        // It ended by itself because it was told to.
        let interrupted = interrupted_by().is_some() && !ended.broke_protocol();
        let called = match called {
            Ok(_) if interrupted => Err(Fault::Interrupted {
                during: call.method().into(),
            }),
            called => called,
        };
        let run = ended.run(called, CallUsage::default(), None);
        // Nobody can stop a library in this process.
        PlanRun {
            stopped: false,
            ..run
        }
    }

    fn generate(&mut self, state: &FleetState, budget: &Budget) -> Result<Generated, Fault> {
        let method = "generate";
        let budget = budget.starting(monotonic_ns());
        let generated = self.call(
            method,
            budget.answer_by_ns,
            |_, object, collector| match object {
                Some(Object::InstanceGenerator(generator)) => {
                    generator.generate(state, &budget, collector)
                }
                _ => Err(wrong_object()),
            },
        );
        self.tidy();
        let ((), collected) = generated?;
        Ok(Generated {
            request: collected.request.ok_or_else(|| no_request(method))?,
            kept: collected.kept,
        })
    }

    fn should_invoke(&mut self, status: &FleetStatus, limit: Duration) -> Result<bool, Fault> {
        let answer_by_ns = Deadline::after(monotonic_ns(), limit).at_ns;
        let (invoke, _) =
            self.call(
                "should_invoke",
                answer_by_ns,
                |_, object, collector| match object {
                    Some(Object::InvocationPolicy(policy)) => {
                        policy.should_invoke(status, collector)
                    }
                    _ => Err(wrong_object()),
                },
            )?;
        Ok(invoke)
    }

    fn sandbox(&self) -> Option<&SandboxReport> {
        None
    }

    fn broken_promises(&mut self) -> &[BrokenPromise] {
        self.promises.settle();
        self.promises.broken()
    }

    fn close(&mut self) -> Closing {
        self.promises.around("destroy", || self.object = None);
        Closing {
            broken_promises: self.broken_promises().to_vec(),
            log: self.log.take(),
            ..Closing::default()
        }
    }
}

fn to_fault(method: &str) -> impl Fn(Failure) -> Fault + '_ {
    move |failure| {
        if failure.broke_contract {
            return Fault::protocol(method, failure.message);
        }
        Fault::reported(method, failure.status, Some(failure.message))
    }
}

fn wrong_object() -> Failure {
    Failure::new(
        Status::InvalidInput,
        "the call is not for a plugin of this kind",
    )
}
