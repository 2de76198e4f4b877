//! The JSON wire: what the host reads of a plugin, and what a plugin reads of the host.

use std::sync::Arc;

use fleetyard_abi::moves::OFF_MAP;
use fleetyard_abi::paths::{PathContext, PathsReader, PlanContext, WritePaths, WritePlan};
use fleetyard_abi::wire::{
    self, AnnotationParams, CancelParams, CreateParams, Envelope, GenerateParams, GenerateResult,
    IncumbentParams, InitializeParams, InitializeResult, LogParams, MetricParams, NoteParams,
    Outcome, PlanParams, PlanResult, PlanText, PrepareParams, ProgressParams, RecoverParams,
    Request, Response, ShouldInvokeParams, ShouldInvokeResult,
};
use fleetyard_abi::{
    Environment, FleetState, GridPlan, Instance, PathEncoding, Plan, Request as NextRequest, View,
    WorkspaceEnvironment, plain_moves,
};
use fleetyard_runtime::message::{self, Message};
use fleetyard_runtime::plan_from_abi;
use serde::de::DeserializeSeed;
use serde_json::value::RawValue;

use super::abi;

/// Messages, one a line: reads each as the host does and as a plugin does, then lets a
/// server of plugins answer them all.
pub fn run(data: &[u8]) {
    for line in data.split(|byte| *byte == b'\n') {
        heard(line);
        message(line);
    }
    server::converse(data);
}

/// Reads a value, writes it, reads that, and writes it again: the same text. A macro,
/// because some types borrow from the text.
macro_rules! round_trip {
    ($text:expr, $type:ty) => {{
        let value = serde_json::from_str::<$type>($text).ok();
        if let Some(value) = &value {
            let written = serde_json::to_string(value).expect("a value can be written");
            let read = serde_json::from_str::<$type>(&written).expect("what was written");
            assert_eq!(serde_json::to_string(&read).expect("the same"), written);
        }
        value
    }};
}

/// A line as the host reads it: what breaks the protocol is explained in few words, and
/// an answer that is written again is the same.
fn heard(line: &[u8]) {
    let (id, result) = match message::read(line) {
        Err(reason) => {
            assert!(
                !reason.is_empty() && reason.chars().count() < 600,
                "{reason}"
            );
            return;
        }
        Ok(Message::Answer { id, result }) => (id, result),
        Ok(Message::Metric(metric)) => return assert!(metric.value.is_finite()),
        Ok(Message::Incumbent(found)) => {
            assert!(found.is_there());
            return plan(&found);
        }
        Ok(_) => return,
    };
    let again = match (id, &result) {
        (Some(id), Ok(result)) => {
            let result: &RawValue = serde_json::from_str(result).expect("JSON");
            wire::line(&Response::result(id, result))
        }
        (None, Ok(_)) => panic!("nobody was answered"),
        (id, Err(error)) => wire::line(&Response::error(id, error.code, &error.message)),
    };
    match (message::read(&again), result) {
        (
            Ok(Message::Answer {
                id: same,
                result: Ok(again),
            }),
            Ok(result),
        ) => {
            assert_eq!((same, again), (id, result));
        }
        (
            Ok(Message::Answer {
                id: same,
                result: Err(again),
            }),
            Err(error),
        ) => {
            assert_eq!(
                (same, again.code, again.message),
                (id, error.code, error.message)
            );
        }
        (again, _) => panic!("{again:?}"),
    }
}

fn message(line: &[u8]) {
    let Ok(text) = std::str::from_utf8(line.trim_ascii()) else {
        return;
    };
    let Ok(envelope) = serde_json::from_str::<Envelope<'_>>(text) else {
        return;
    };
    if let Some(params) = envelope.params {
        let method = envelope.method.as_deref().unwrap_or_default();
        parameters(params.get());
        let again = match envelope.id {
            Some(id) => wire::line(&Request::new(id, method, params)),
            None => wire::line(&Request::notification(method, params)),
        };
        let again = one_line(&again);
        let again: Envelope<'_> = serde_json::from_str(again).expect("a message");
        assert_eq!((again.id, again.jsonrpc.as_ref()), (envelope.id, "2.0"));
        assert_eq!(again.method.as_deref(), Some(method));
        assert_eq!(again.params.map(RawValue::get), Some(params.get()));
    }
    if let Some(result) = envelope.result {
        results(result.get());
        let again = wire::line(&Response::result(7, result));
        let again: Envelope<'_> = serde_json::from_str(one_line(&again)).expect("a message");
        assert_eq!((again.id, again.method), (Some(7), None));
        assert_eq!(again.result.map(RawValue::get), Some(result.get()));
    }
    if let Some(error) = envelope.error {
        let again = wire::line(&Response::error(envelope.id, error.code, &error.message));
        let again: Envelope<'_> = serde_json::from_str(one_line(&again)).expect("a message");
        assert_eq!(again.id, envelope.id);
        let again = again.error.expect("the error");
        assert_eq!((again.code, again.message), (error.code, error.message));
    }
}

fn one_line(line: &[u8]) -> &str {
    let text = std::str::from_utf8(line).expect("UTF-8");
    let text = text.strip_suffix('\n').expect("a line");
    assert!(!text.contains('\n'));
    text
}

fn parameters(text: &str) {
    round_trip!(text, LogParams);
    round_trip!(text, NoteParams);
    round_trip!(text, ProgressParams);
    round_trip!(text, CancelParams);
    round_trip!(text, InitializeParams);
    round_trip!(text, CreateParams);
    if let Some(metric) = round_trip!(text, MetricParams) {
        assert!(metric.value.is_finite());
        let written = serde_json::to_string(&metric.value).expect("a number");
        assert_eq!(written.parse(), Ok(metric.value));
    }
    if let Some(annotation) = round_trip!(text, AnnotationParams) {
        abi::annotation_by_c(&annotation);
    }
    if let Some(found) = round_trip!(text, IncumbentParams<'_>) {
        plan(&found);
    }
    if let Some(PlanParams {
        instance: found, ..
    }) = round_trip!(text, PlanParams)
    {
        instance(&found);
    }
    if let Some(recover) = round_trip!(text, RecoverParams<'_>) {
        instance(&recover.instance);
        let failed = recover.failed_plan.map_or("null", RawValue::get);
        if let Some(failed) = round_trip!(failed, PlanText<'_>) {
            plan(&failed);
        }
    }
    if let Some(GenerateParams { state: found, .. }) = round_trip!(text, GenerateParams) {
        state(&found);
    }
    if let Some(ShouldInvokeParams { status }) = round_trip!(text, ShouldInvokeParams) {
        abi::status_by_c(&status);
    }
    if let Some(prepare) = round_trip!(text, PrepareParams) {
        environment(prepare.environment, text.len());
    }
}

fn results(text: &str) {
    round_trip!(text, InitializeResult);
    round_trip!(text, Outcome);
    round_trip!(text, ShouldInvokeResult);
    if let Some(result) = round_trip!(text, PlanResult<'_>) {
        plan(&result.plan());
    }
    if let Some(GenerateResult {
        request: Some(found),
        ..
    }) = round_trip!(text, GenerateResult)
    {
        request(&found);
    }
}

/// An environment that can be read is as the rest of the host relies on, and no larger than
/// its text; by the C ABI it is the same.
fn environment(found: Environment, len: usize) {
    assert_eq!(found.check(), Ok(()));
    match &found.view {
        View::Grid(grid) => {
            let cells = u64::from(grid.rows) * u64::from(grid.cols);
            let free = plain_moves(grid.rows, grid.cols, grid.connectivity, &grid.passable);
            for list in [&grid.passable, &grid.terrain, &grid.moves] {
                assert_eq!(list.len() as u64, cells);
            }
            assert!(cells > 0 && grid.passable.len() <= len);
            let mut masks = grid.moves.iter().zip(&free);
            assert!(masks.all(|(mask, free)| mask & !free == 0));
            assert_eq!(grid.is_plain(), grid.moves == free);
        }
        View::Roadmap(roadmap) => {
            let (vertices, edges) = (roadmap.vertices(), roadmap.edges.items());
            assert!(vertices > 0 && vertices + edges.len() <= len);
            assert_eq!(
                (roadmap.y_m.len(), roadmap.edges.len()),
                (vertices, vertices)
            );
            assert!(edges.iter().all(|target| (*target as usize) < vertices));
            for list in [&roadmap.length_m, &roadmap.duration_s] {
                assert_eq!(list.len(), edges.len());
                assert!(list.iter().all(|number| number.is_finite()));
            }
            roadmap.is_symmetric();
            if let Some(within) = &roadmap.workspace {
                workspace(within, len);
            }
        }
        View::Workspace(found) => workspace(found, len),
    }
    abi::environment_by_c(&Arc::new(found));
}

fn workspace(found: &WorkspaceEnvironment, len: usize) {
    assert!(found.obstacles.items().len() <= len);
    assert!(found.obstacles.iter().all(|corners| corners.len() > 2));
    assert!(found.movers.iter().all(|mover| !mover.knots.is_empty()));
}

/// Numbers of places of maps on which instances are; none in the plane.
const PLACES: [Option<usize>; 5] = [Some(0), Some(1), Some(12), Some(1 << 20), None];

/// An instance that passes the checks is as the rest of the host relies on; by the C ABI it is
/// the same.
fn instance(instance: &Instance) {
    for places in PLACES {
        if instance.check(places).is_err() {
            continue;
        }
        let agents = instance.agents();
        assert!(agents > 0);
        if let Some(places) = places {
            assert_eq!(
                (instance.starts.len(), instance.goals.len()),
                (agents, agents)
            );
            let all = instance.starts.iter().chain(instance.goals.items());
            assert!(all.into_iter().all(|place| (*place as usize) < places));
            // A larger map has the same places and more.
            assert!(instance.check(Some(places + 1)).is_ok());
            assert!(instance.check(None).is_err());
        } else {
            let all = instance.start_states.iter().enumerate();
            assert_eq!(instance.goal_states.len(), agents);
            for (agent, start) in all.clone() {
                let robot = instance.robot(agent).expect("a robot");
                let goals = &instance.goal_states[agent];
                let mut states = goals.iter().chain([start]);
                assert!(states.all(|state| state.0.len() == robot.state_limits.len()));
                assert!(start.0.len() >= 2);
            }
            assert_eq!(all.count(), agents);
        }
        assert!(instance.needs().iter().next().is_some());
        assert!(instance.needs_features().is_sorted());
        abi::instance_by_c(instance);
    }
}

/// The state of a fleet, by the C ABI the same.
fn state(found: &FleetState) {
    let next = &found.next;
    instance(next);
    if PLACES.iter().any(|places| next.check(*places).is_ok()) {
        abi::state_by_c(found);
        let same = found.instance(&found.request(next.goals.clone()));
        assert_eq!(format!("{same:?}"), format!("{next:?}"));
    }
}

/// A request that passes the checks is as the rest of the host relies on; by the C ABI it is
/// the same.
fn request(found: &NextRequest) {
    let agents = found.goals.len();
    for places in PLACES.into_iter().flatten() {
        if found.check(agents, places).is_ok() {
            let mut goals = found.goals.items().iter();
            assert!(goals.all(|place| (*place as usize) < places));
            let mut given = found.assignments.iter();
            assert!(given.all(|given| (given.agent as usize) < agents));
        }
        assert!(found.check(agents + 1, places).is_err());
    }
    abi::request_by_c(found);
}

/// Most visits and knots of plans, of few and of many.
const MOST: [usize; 2] = [5, 1 << 20];

/// A plan is read in the form that the map takes, and in no other.
fn plan(found: &PlanText<'_>) {
    if let Some(text) = found.paths {
        paths(text);
    }
    let fields = [
        ("paths", found.paths),
        ("visits", found.visits),
        ("trajectories", found.trajectories),
    ];
    let [few, many] = MOST;
    let (rows, cols, starts) = MAPS[0];
    let on_grid = PlanContext::Paths(PathContext {
        rows,
        cols,
        starts,
        max_cells: many,
    });
    let limited = [PlanContext::Visits(few), PlanContext::Trajectories(few)];
    let contexts = [
        on_grid,
        PlanContext::Visits(many),
        PlanContext::Trajectories(many),
    ];
    for context in contexts {
        let is_own = |name: &str| name == context.field();
        let there = fields.iter().filter(|(_, text)| text.is_some());
        let others = there.clone().any(|(name, _)| !is_own(name));
        let own = there.clone().find(|(name, _)| is_own(name));
        match context.read(found) {
            Ok(read) => {
                assert!(!others && read.is_some() == own.is_some());
                let (Some(plan), Some((_, Some(text)))) = (read, own) else {
                    continue;
                };
                assert!(plan.agents() + plan.as_ref().entries() <= text.get().len());
                for small in limited
                    .iter()
                    .filter(|small| small.field() == context.field())
                {
                    // The limit is on the sum.
                    let fits = plan.as_ref().entries() <= few;
                    assert_eq!(small.read(found).is_ok(), fits);
                }
                kept(context, &plan);
            }
            Err(reason) => assert!(!reason.is_empty() && (others || own.is_some())),
        }
    }
}

/// A plan is the same when it is written again, and by the C ABI.
fn kept(context: PlanContext<'_>, plan: &Plan) {
    assert_eq!(context.check(plan.as_ref()), Ok(()));
    for encoding in PathEncoding::ALL {
        let written = serde_json::to_string(&WritePlan {
            plan: plan.as_ref(),
            context,
            encoding,
        });
        let written = written.expect("a plan can be written");
        let text: PlanText<'_> = serde_json::from_str(&written).expect("what was written");
        let again = context.read(&text);
        let same = matches!(&again, Ok(Some(again)) if abi::is_same_plan(again, plan));
        assert!(same, "{plan:?} as {written} is {again:?}");
    }
    abi::plan_by_c(plan);
}

/// Rows, columns and starts of maps on which paths are read.
const MAPS: [(u32, u32, &[u32]); 6] = [
    (3, 4, &[0, 5, 11]),
    (1, 1, &[0]),
    (5, 1, &[4, 0, 9]),
    (2, 0, &[0]),
    (0, 0, &[]),
    (1 << 15, 1 << 15, &[(1 << 30) - 1, 1 << 30, OFF_MAP]),
];

fn paths(text: &RawValue) {
    for (rows, cols, starts) in MAPS {
        let [few, many] = [5, 1 << 20].map(|max_cells| PathContext {
            rows,
            cols,
            starts,
            max_cells,
        });
        let cells = rows * cols;
        pieces_are_the_whole(many, text.get());
        if let Ok(plan) = read(many, text.get()) {
            assert!(plan.agents() <= text.get().len());
            assert!(plan.cells().len() <= text.get().len());
            let on_map = |cell: &u32| *cell < cells || *cell == OFF_MAP;
            assert!(plan.cells().iter().all(on_map));
            through_every_encoding(many, &plan);
            let kept = plan_from_abi(&plan, cells);
            assert!(kept.paths().eq(plan.paths()));
            // The limit is on the sum, whatever the encoding.
            let fits = plan.cells().len() <= few.max_cells;
            let limited = read(few, text.get());
            assert_eq!(limited.is_ok(), fits);
            assert!(!fits || limited.is_ok_and(|limited| limited == plan));
        } else {
            assert!(read(few, text.get()).is_err());
        }
        // As a library hands it over: any numbers.
        if let Ok(numbers) = serde_json::from_str::<Vec<Vec<u32>>>(text.get()) {
            through_every_encoding(many, &GridPlan::from_paths(numbers));
        }
    }
}

fn read(context: PathContext<'_>, text: &str) -> serde_json::Result<GridPlan> {
    context.deserialize(&mut serde_json::Deserializer::from_str(text))
}

/// A plan that comes in pieces is the one that comes at once, for the agents that there are.
fn pieces_are_the_whole(context: PathContext<'_>, text: &str) {
    let whole = read(context, text);
    for size in [1, 13, usize::MAX] {
        let mut paths = PathsReader::new();
        let mut pieces = text.as_bytes().chunks(size);
        let read = pieces.all(|piece| paths.feed(&context, piece) == Ok(piece.len()));
        let found = (read && paths.is_done()).then(|| paths.finish());
        match (&whole, found) {
            (Ok(whole), Some(Ok((plan, paths)))) => {
                assert_eq!(paths, whole.agents());
                let kept = whole.paths().take(context.starts.len());
                assert_eq!(plan, GridPlan::from_paths(kept));
            }
            (Err(_), None | Some(Err(_))) => {}
            (whole, found) => panic!("{text} by {size}: {whole:?} {found:?}"),
        }
    }
}

/// A plan is the same by every encoding, and by none at all as in process; positions
/// outside the map are [`OFF_MAP`].
fn through_every_encoding(context: PathContext<'_>, plan: &GridPlan) {
    let kept = plan_from_abi(plan, context.rows * context.cols);
    for encoding in PathEncoding::ALL {
        let written = serde_json::to_string(&WritePaths {
            plan,
            context,
            encoding,
        });
        let written = written.expect("paths can be written");
        let again = read(context, &written).expect("what was written can be read");
        assert!(
            again.paths().eq(kept.paths()),
            "{plan:?} as {written} is {again:?}"
        );
    }
}

mod server {
    //! The plugin's side, with one well-behaved plugin of every kind.

    use std::io::{Cursor, Write};
    use std::sync::{Arc, Mutex, PoisonError};

    use fleetyard_abi::object::{
        FailPolicy, InstanceGenerator, InvocationPolicy, Object, Planner, Prepare,
    };
    use fleetyard_abi::sdk::{Entry, Failure, Options, Sink, StaticCatalog};
    use fleetyard_abi::wire::{CancelParams, Envelope};
    use fleetyard_abi::{
        Assignment, Budget, Descriptor, FleetState, FleetStatus, Goals, GridPlan, Instance, Kind,
        Knot, KnotPlan, LogLevel, Plan, SharedEnvironment, State, View, Visit, VisitPlan, serve,
    };

    /// Knows the map, in whichever representation.
    #[derive(Default)]
    struct Calm(Option<SharedEnvironment>);

    impl Calm {
        /// The form of plans is that of the map. The server lets no call through before it.
        fn view(&self) -> &View {
            &self.0.as_ref().expect("a map").view
        }
    }

    impl Prepare for Calm {
        fn prepare(
            &mut self,
            environment: &SharedEnvironment,
            _: &Budget,
            sink: &dyn Sink,
        ) -> Result<(), Failure> {
            assert_eq!(environment.check(), Ok(()));
            assert_ne!(environment.places(), Some(0));
            sink.log(LogLevel::Info, &environment.name);
            sink.note("map", &environment.digest);
            self.0 = Some(SharedEnvironment::clone(environment));
            Ok(())
        }
    }

    /// A leap to each goal, and past the end of the map.
    fn leaps(instance: &Instance) -> impl Iterator<Item = Vec<u32>> {
        (0..instance.agents()).map(|agent| {
            let start = instance.starts[agent];
            let mut path = vec![start, start.wrapping_add(1)];
            path.extend_from_slice(&instance.goals[agent]);
            path
        })
    }

    fn visit((second, vertex): (usize, u32)) -> Visit {
        Visit {
            vertex,
            arrival_s: second as f64,
            departure_s: second as f64 + 0.5,
        }
    }

    fn knot((second, state): (usize, &State)) -> Knot {
        Knot {
            time_s: second as f64,
            x_m: state.0[0],
            y_m: state.0[1],
            heading_rad: state.0.get(2).copied().unwrap_or(f64::NAN),
        }
    }

    impl Planner for Calm {
        fn plan(
            &mut self,
            instance: &Instance,
            budget: &Budget,
            sink: &dyn Sink,
        ) -> Result<(), Failure> {
            sink.metric("agents", instance.agents() as f64);
            sink.metric("radius", instance.radius_m);
            sink.progress(budget.seed, budget.nodes);
            match self.view() {
                View::Grid(_) => {
                    assert_eq!(instance.goals.len(), instance.agents());
                    sink.submit(&GridPlan::from_paths(leaps(instance)))?;
                }
                View::Roadmap(_) => {
                    let visits =
                        leaps(instance).map(|path| path.into_iter().enumerate().map(visit));
                    sink.submit(&visits.collect::<VisitPlan>())?;
                }
                View::Workspace(_) => {
                    assert_eq!(instance.goal_states.len(), instance.agents());
                    let starts = instance.start_states.iter();
                    let knots = starts
                        .zip(instance.goal_states.iter())
                        .map(|(start, goals)| {
                            let states = [start].into_iter().chain(goals);
                            // Any number will do, but JSON has to have it.
                            let states =
                                states.filter(|state| !state.0[..2].iter().any(|n| n.is_nan()));
                            states.enumerate().map(knot)
                        });
                    sink.submit(&knots.collect::<KnotPlan>())?;
                }
            }
            Ok(())
        }
    }

    impl FailPolicy for Calm {
        fn recover(
            &mut self,
            instance: &Instance,
            failed: Option<&Plan>,
            _: &Budget,
            sink: &dyn Sink,
        ) -> Result<(), Failure> {
            let stay = || {
                let starts = instance.starts.iter().copied();
                match self.view() {
                    View::Grid(_) => GridPlan::from_paths(starts.map(|cell| [cell])).into(),
                    View::Roadmap(_) => {
                        let visits = starts.map(|vertex| [visit((0, vertex))]);
                        Plan::Visits(visits.collect())
                    }
                    View::Workspace(_) => {
                        let knots = instance.start_states.iter().map(|state| [knot((0, state))]);
                        knots.collect::<KnotPlan>().into()
                    }
                }
            };
            sink.submit(&failed.cloned().unwrap_or_else(stay))?;
            Ok(())
        }
    }

    impl InstanceGenerator for Calm {
        fn generate(
            &mut self,
            state: &FleetState,
            _: &Budget,
            sink: &dyn Sink,
        ) -> Result<(), Failure> {
            let mut request = state.request(Goals::single(state.next.starts.clone()));
            request
                .assignments
                .extend(state.tasks.first().map(|task| Assignment {
                    agent: 0,
                    task: task.id,
                }));
            sink.submit_request(&request)?;
            Ok(())
        }
    }

    impl InvocationPolicy for Calm {
        fn should_invoke(&mut self, status: &FleetStatus, _: &dyn Sink) -> Result<bool, Failure> {
            Ok(status.actions_left.iter().any(|left| *left < 3))
        }
    }

    fn options(options: Options<'_>) -> Result<(), Failure> {
        options.parse::<serde_json::Map<_, _>>().map(drop)
    }

    static CATALOG: StaticCatalog = StaticCatalog(&[
        Entry {
            descriptor: || Descriptor::new(Kind::Planner, "calm", "Leaps"),
            create: |given| options(given).map(|()| Object::Planner(Box::new(Calm::default()))),
        },
        Entry {
            descriptor: || Descriptor::new(Kind::FailPolicy, "calm", "Stays"),
            create: |given| options(given).map(|()| Object::FailPolicy(Box::new(Calm::default()))),
        },
        Entry {
            descriptor: || Descriptor::new(Kind::InstanceGenerator, "calm", "Asks for nothing"),
            create: |given| {
                options(given).map(|()| Object::InstanceGenerator(Box::new(Calm::default())))
            },
        },
        Entry {
            descriptor: || Descriptor::new(Kind::InvocationPolicy, "calm", "Plans early"),
            create: |given| {
                options(given).map(|()| Object::InvocationPolicy(Box::new(Calm::default())))
            },
        },
    ]);

    #[derive(Clone, Default)]
    struct Output(Arc<Mutex<Vec<u8>>>);

    impl Write for Output {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            kept.extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    /// Every line is answered once and in order, whatever it is, until `exit`, the end,
    /// or a line that is no text.
    pub(super) fn converse(data: &[u8]) {
        let output = Output::default();
        serve::serve(&CATALOG, Cursor::new(data.to_vec()), output.clone(), || ());
        let bytes = output.0.lock().unwrap_or_else(PoisonError::into_inner);
        let text = std::str::from_utf8(&bytes).expect("answers are UTF-8");
        let mut answers = Vec::new();
        for line in text.lines() {
            let envelope: Envelope<'_> = serde_json::from_str(line).expect("answers are messages");
            assert_eq!(envelope.jsonrpc, "2.0");
            if let Some(error) = &envelope.error {
                let panicked = error.message.starts_with("the plugin panicked");
                assert!(!panicked, "{}", error.message);
            }
            if envelope.method.is_none() {
                answers.push(envelope.id);
            }
        }
        assert_eq!(answers, expected(data));
    }

    /// The identifiers of the answers that are due.
    fn expected(data: &[u8]) -> Vec<Option<u64>> {
        let mut due = Vec::new();
        for line in data.split_inclusive(|byte| *byte == b'\n') {
            let Ok(line) = std::str::from_utf8(line) else {
                break;
            };
            let envelope = serde_json::from_str::<Envelope<'_>>(line).ok();
            // Longer ones are not heard.
            if line.len() <= 256
                && let Some(envelope) = &envelope
            {
                match envelope.method.as_deref() {
                    Some("exit") => break,
                    Some("$/cancel") if envelope.params::<CancelParams>().is_ok() => continue,
                    _ => {}
                }
            }
            due.push(envelope.and_then(|envelope| envelope.id));
        }
        due
    }
}
