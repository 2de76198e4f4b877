//! Artefacts: what is derived from a document, each kept by the digest of what it was made of.
//!
//! ```text
//! world ─┬─▶ grid ──────┬─▶ instance ─┐
//!        └─▶ problem ───┤             ├─▶ plans, traces, verdicts
//!                       └─▶ roadmap ──┘
//! ```
//!
//! *world* is the world in the plane, *problem* world and agents as planners in the plane are given
//! them, *grid* the cells of the grid view, *instance* these with starts and goals, *roadmap* the
//! roadmap view. Nothing is derived before it is asked for, and nothing twice: an artefact depends on
//! digests of others and on parameters, so that an edit leaves alone what does not depend on it, and a
//! step back finds again what was there. Derived by the operators of the command, they have the same
//! digests.
//!
//! Plans and traces are made elsewhere and registered with the digests of what they were made of; they
//! are stale when the document is another one. A [`KeptPlan`] can be judged against a document that
//! was changed since.

use std::collections::{BTreeMap, VecDeque};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use fleetyard_check::Pace;
use fleetyard_core::formats::UnreadPlan;
use fleetyard_core::{Digest, GridPlan, InputError, RoadmapPlan, TrajectoryPlan, words};
use fleetyard_views::{
    End, Fault, Free, GridSpec, GridTerms, GridView, Judged, Problem, Representation, RoadmapSpec,
    RoadmapView, View, WorldCells, cell_side_m, world_to_roadmap,
};
use fleetyard_world::Workspace;
use serde::Serialize;

use crate::document::{Document, Ground, MOST_CELLS};
use crate::place::radii;

/// Most faults of a document that are told.
pub const MOST_PROBLEMS: usize = 100;

/// Most points of a clearance field.
pub const MOST_POINTS: u64 = 1 << 18;

/// Derived things of a kind that are kept, the latest used.
const KEPT: usize = 4;

/// A state of an artefact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// It is that of the document as it is.
    Fresh,
    /// Its sources have changed since it was made, or it was never made.
    Stale,
    /// None can be made of the document as it is.
    Refused,
}

words!(State {
    Fresh = "fresh";
    Stale = "stale";
    Refused = "refused";
});

/// An artefact as a page lists it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Artefact {
    /// `world`, `problem`, `grid`, `instance`, `roadmap`, or as it was registered.
    pub id: String,
    /// Its digest, where it was made.
    pub digest: Option<Digest>,
    /// Its sources.
    pub from: Vec<String>,
    /// Its state.
    pub state: State,
    /// The reason why there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// A reason why a document cannot be planned for, in the words of the command.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Trouble {
    /// The reason.
    pub error: String,
    /// A way out.
    pub hint: String,
    /// JSON pointer into the document.
    pub place: String,
    /// The agents at fault, ascending.
    pub agents: Vec<usize>,
}

impl From<Fault> for Trouble {
    fn from(fault: Fault) -> Self {
        let end: End = fault.end;
        let agent = fault.agents.first().copied().unwrap_or_default();
        Self {
            error: fault.reason,
            hint: fault.hint.to_owned(),
            place: format!("/agents/{agent}/{end}"),
            agents: fault.agents,
        }
    }
}

/// A world with its digest.
#[derive(Debug)]
pub struct NamedWorld {
    /// The world.
    pub world: Arc<Workspace>,
    /// Its digest.
    pub digest: Digest,
}

/// A document as a problem, and why it is none to plan for.
#[derive(Debug)]
pub struct Whole {
    /// World, robots, starts and goals.
    pub problem: Problem,
    /// The reasons why the command would refuse it, at most [`MOST_PROBLEMS`].
    pub problems: Vec<Trouble>,
    /// The digest of the problem; of the document's JSON where there are reasons.
    pub digest: Digest,
}

impl Whole {
    fn new(document: &Document, world: &Workspace) -> Result<Self, InputError> {
        let problem = document.problem(world)?;
        let mut problems: Vec<Trouble> = Vec::new();
        if problem.task.agents.is_empty() {
            problems.push(Trouble {
                error: "there are no agents".into(),
                hint: "give each a start and a goal".into(),
                place: "/agents".into(),
                agents: Vec::new(),
            });
        }
        let faults = problem.faults(MOST_PROBLEMS).into_iter();
        problems.extend(faults.map(Trouble::from));
        let digest = if problems.is_empty() {
            problem.digest()
        } else {
            document.json_digest()
        };
        Ok(Self {
            problem,
            problems,
            digest,
        })
    }

    /// The problem, if it is one to plan for; else the first reason why it is none.
    pub fn plannable(&self) -> Result<&Problem, InputError> {
        match self.problems.first() {
            None => Ok(&self.problem),
            Some(Trouble { error, hint, .. }) => {
                let source = self.problem.task.source.as_str();
                Err(InputError::new(source, error.as_str()).hint(hint.as_str()))
            }
        }
    }
}

/// Distances to what stands, at the middles of square cells.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Clearance {
    /// Number of rows, from the top.
    pub rows: u32,
    /// Number of columns.
    pub cols: u32,
    /// The side of a cell in metres; the lower left corner is that of the world.
    pub side_m: f64,
    /// Row by row the distance to the nearest obstacle or edge in centimetres, rounded down; 0 where
    /// it is not free.
    pub values_cm: Vec<u32>,
}

/// The last values that were made, by what they were made of.
#[derive(Debug)]
struct Kept<K, V>(Mutex<VecDeque<(K, V)>>);

impl<K, V> Default for Kept<K, V> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<K: PartialEq, V: Clone> Kept<K, V> {
    fn list(&self) -> MutexGuard<'_, VecDeque<(K, V)>> {
        // What is kept is whole whenever the lock is free.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn find(&self, key: &K) -> Option<V> {
        let mut list = self.list();
        let at = list.iter().position(|(known, _)| known == key)?;
        let entry = list.remove(at)?;
        let value = entry.1.clone();
        list.push_front(entry);
        Some(value)
    }

    /// The value of a key, made if it is not there; meanwhile others may look.
    fn get(&self, key: K, make: impl FnOnce() -> V) -> V {
        if let Some(value) = self.find(&key) {
            return value;
        }
        let value = make();
        let mut list = self.list();
        list.retain(|(known, _)| *known != key);
        list.push_front((key, value.clone()));
        list.truncate(KEPT);
        value
    }
}

/// A ground by identity: copies of a document share it.
#[derive(Debug, Clone)]
struct GroundKey(Ground);

impl PartialEq for GroundKey {
    fn eq(&self, other: &Self) -> bool {
        match (&self.0, &other.0) {
            (Ground::World(a), Ground::World(b)) => Arc::ptr_eq(a, b),
            (
                Ground::Map {
                    grid: a,
                    cell_size_m: size_a,
                },
                Ground::Map {
                    grid: b,
                    cell_size_m: size_b,
                },
            ) => Arc::ptr_eq(a, b) && size_a.to_bits() == size_b.to_bits(),
            _ => false,
        }
    }
}

/// A document by the identity of its parts; what its views are is no part of it.
#[derive(Debug, Clone)]
struct WholeKey(Document);

impl PartialEq for WholeKey {
    fn eq(&self, other: &Self) -> bool {
        let (a, b) = (&self.0, &other.0);
        GroundKey(a.ground.clone()) == GroundKey(b.ground.clone())
            && Arc::ptr_eq(&a.robots, &b.robots)
            && Arc::ptr_eq(&a.agents, &b.agents)
            && (a.name == b.name && a.seed == b.seed && a.tolerances == b.tolerances)
    }
}

type Made<T> = Result<Arc<T>, InputError>;

/// The sources of a grid: digest of the world, bits of the radius, parameters.
type CellsKey = (Digest, u64, GridSpec);

/// A plan with the view that it is of.
#[derive(Debug, Clone)]
pub enum KeptPlan {
    /// Of a grid view.
    Grid {
        /// The cells of each robot.
        plan: GridPlan,
        /// The view that it was made for.
        view: Arc<GridView>,
    },
    /// Of a roadmap view.
    Roadmap {
        /// The visits of each robot.
        plan: RoadmapPlan,
        /// The view that it was made for.
        view: Arc<RoadmapView>,
    },
    /// In the plane.
    Continuous(TrajectoryPlan),
}

/// Something that was made elsewhere.
#[derive(Debug, Clone)]
struct Registered {
    digest: Digest,
    from: Vec<(String, Digest)>,
}

/// Derived things by their sources, and the digests of what was made of them.
#[derive(Debug, Default)]
pub struct Artefacts {
    worlds: Kept<GroundKey, Made<NamedWorld>>,
    wholes: Kept<WholeKey, Made<Whole>>,
    cells: Kept<CellsKey, Made<WorldCells>>,
    instances: Kept<(Digest, GridSpec), Made<GridView>>,
    roadmaps: Kept<(Digest, RoadmapSpec), Made<RoadmapView>>,
    clearances: Kept<(Digest, u64), Made<Clearance>>,
    registered: Mutex<BTreeMap<String, Registered>>,
}

impl Artefacts {
    /// The world of a document.
    pub fn world(&self, document: &Document) -> Made<NamedWorld> {
        self.worlds.get(GroundKey(document.ground.clone()), || {
            let world = document.world()?;
            let digest = world.digest();
            Ok(Arc::new(NamedWorld { world, digest }))
        })
    }

    /// A document as a problem, with its digest and what keeps it from being planned for.
    pub fn whole(&self, document: &Document) -> Made<Whole> {
        self.wholes.get(WholeKey(document.clone()), || {
            let world = self.world(document)?;
            Whole::new(document, &world.world).map(Arc::new)
        })
    }

    fn cells_key(&self, document: &Document) -> Result<(Arc<NamedWorld>, CellsKey), InputError> {
        let world = self.world(document)?;
        let radii = radii(document)?;
        let used = document.agents.iter();
        let used = used.map(|agent| radii[agent.robot as usize]);
        let mut radius_m = used.fold(0.0, f64::max);
        if document.agents.is_empty() {
            // Until there are agents the grid is for any of the kinds.
            radius_m = radii.iter().copied().fold(0.0, f64::max);
        }
        let key = (world.digest, radius_m.to_bits(), document.views.grid);
        Ok((world, key))
    }

    /// The cells of the grid view, without starts and goals.
    pub fn grid(&self, document: &Document) -> Made<WorldCells> {
        let (world, key) = self.cells_key(document)?;
        self.cells.get(key, || {
            let (_, radius, spec) = key;
            let (world, radius_m) = (&world.world, f64::from_bits(radius));
            check_cells(world, radius_m, spec)?;
            WorldCells::new(world, radius_m, spec, "grid").map(Arc::new)
        })
    }

    /// The grid view, as `fleetyard world grid` derives it.
    pub fn instance(&self, document: &Document) -> Made<GridView> {
        let whole = self.whole(document)?;
        let problem = whole.plannable()?;
        self.instances.get((whole.digest, document.views.grid), || {
            self.grid(document)?.view(problem).map(Arc::new)
        })
    }

    /// The roadmap view, as `fleetyard world roadmap` derives it.
    pub fn roadmap(&self, document: &Document) -> Made<RoadmapView> {
        let whole = self.whole(document)?;
        let problem = whole.plannable()?;
        let spec = drawn(document);
        self.roadmaps.get((whole.digest, spec), || {
            world_to_roadmap(problem, spec).map(Arc::new)
        })
    }

    /// The view of a kind.
    pub fn view(&self, document: &Document, kind: Representation) -> Result<View, InputError> {
        Ok(match kind {
            Representation::Grid => {
                View::Grid(Box::new(GridView::clone(&*self.instance(document)?)))
            }
            Representation::Roadmap => {
                View::Roadmap(Box::new(RoadmapView::clone(&*self.roadmap(document)?)))
            }
            Representation::Continuous => View::Continuous,
        })
    }

    /// Distances to what stands, at points `side_m` metres apart.
    pub fn clearance(&self, document: &Document, side_m: f64) -> Made<Clearance> {
        let world = self.world(document)?;
        let key = (world.digest, side_m.to_bits());
        self.clearances
            .get(key, || clearance(&world.world, side_m).map(Arc::new))
    }

    /// Registers what was made elsewhere, with the digests of the artefacts that it was made of.
    pub fn register(&self, id: &str, digest: Digest, from: Vec<(String, Digest)>) {
        let mut registered = self.registered();
        registered.insert(id.to_owned(), Registered { digest, from });
    }

    /// Forgets what was registered.
    pub fn forget(&self, id: &str) {
        self.registered().remove(id);
    }

    fn registered(&self) -> MutexGuard<'_, BTreeMap<String, Registered>> {
        self.registered
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// True if what was registered was made of another document than this one. What has to be derived
    /// to know is derived.
    pub fn is_stale(&self, document: &Document, id: &str) -> bool {
        let derived = |id: &str| match id {
            "world" => self.world(document).ok().map(|world| world.digest),
            "problem" => {
                let whole = self.whole(document).ok();
                whole.and_then(|whole| whole.plannable().is_ok().then_some(whole.digest))
            }
            "grid" => self.grid(document).ok().map(|cells| cells.grid.digest()),
            "instance" => {
                let view = self.instance(document).ok();
                view.map(|view| view.instance.digest())
            }
            "roadmap" => self.roadmap(document).ok().map(|view| view.digest()),
            _ => None,
        };
        let registered = self.registered().clone();
        is_stale(&registered, id, &derived, registered.len())
    }

    /// All artefacts, the derived ones first. Of these none is derived for the list.
    pub fn list(&self, document: &Document) -> Vec<Artefact> {
        let world = self.world(document);
        let whole = self.whole(document);
        let plannable = whole.as_ref().map_err(Clone::clone);
        let plannable = plannable.and_then(|whole| {
            whole.plannable()?;
            Ok(whole.digest)
        });
        let grid = self
            .cells_key(document)
            .map(|(_, key)| self.cells.find(&key));
        let key = |digest: &Digest| (*digest, document.views.grid);
        let instance = plannable
            .as_ref()
            .map(|digest| self.instances.find(&key(digest)));
        let key = |digest: &Digest| (*digest, drawn(document));
        let roadmap = plannable
            .as_ref()
            .map(|digest| self.roadmaps.find(&key(digest)));
        let refused = |error: &InputError| Some(Err(error.clone()));
        let derived = [
            ("world", &[][..], Some(world.map(|world| world.digest))),
            ("problem", &["world"][..], Some(plannable.clone())),
            (
                "grid",
                &["world"][..],
                match grid {
                    Ok(found) => found.map(|made| made.map(|cells| cells.grid.digest())),
                    Err(error) => refused(&error),
                },
            ),
            (
                "instance",
                &["problem", "grid"][..],
                match instance {
                    Ok(found) => found.map(|made| made.map(|view| view.instance.digest())),
                    Err(error) => refused(error),
                },
            ),
            (
                "roadmap",
                &["problem"][..],
                match roadmap {
                    Ok(found) => found.map(|made| made.map(|view| view.digest())),
                    Err(error) => refused(error),
                },
            ),
        ];
        let digests: BTreeMap<&str, Digest> = derived
            .iter()
            .filter_map(|(id, _, made)| Some((*id, *made.as_ref()?.as_ref().ok()?)))
            .collect();
        let own = derived.iter().map(|(id, from, made)| {
            let (digest, state, error) = match made {
                None => (None, State::Stale, None),
                Some(Ok(digest)) => (Some(*digest), State::Fresh, None),
                Some(Err(error)) => (None, State::Refused, Some(error.reason.clone())),
            };
            Artefact {
                id: (*id).to_owned(),
                digest,
                from: from.iter().map(|id| (*id).to_owned()).collect(),
                state,
                error,
            }
        });
        let registered = self.registered().clone();
        let known = |id: &str| digests.get(id).copied();
        let made = registered.iter().map(|(id, made)| Artefact {
            id: id.clone(),
            digest: Some(made.digest),
            from: made.from.iter().map(|(id, _)| id.clone()).collect(),
            state: if is_stale(&registered, id, &known, registered.len()) {
                State::Stale
            } else {
                State::Fresh
            },
            error: None,
        });
        own.chain(made).collect()
    }

    /// Reads the plan of a planner that was given a view of a document.
    pub fn plan(
        &self,
        document: &Document,
        path: PathBuf,
        bytes: Vec<u8>,
    ) -> Result<KeptPlan, InputError> {
        let file = UnreadPlan::new(path, bytes, None)?;
        Ok(match Representation::of_plans(file.format()) {
            Representation::Grid => {
                let view = self.instance(document)?;
                KeptPlan::Grid {
                    plan: view.read(&file)?.plan,
                    view,
                }
            }
            Representation::Roadmap => {
                let view = self.roadmap(document)?;
                KeptPlan::Roadmap {
                    plan: view.read(&file)?.plan,
                    view,
                }
            }
            Representation::Continuous => {
                let whole = self.whole(document)?;
                KeptPlan::Continuous(whole.plannable()?.read(&file)?.plan)
            }
        })
    }

    /// The verdict on a plan in a document as that is now, by the rules of the plan's view and in the
    /// world; at most `limit` violations of each are described. It is an error if the document is no
    /// problem to plan for, or has no view any more that the plan could be of.
    pub fn verdict(
        &self,
        document: &Document,
        plan: &KeptPlan,
        limit: usize,
    ) -> Result<Judged, InputError> {
        let whole = self.whole(document)?;
        let problem = whole.plannable()?;
        match plan {
            KeptPlan::Grid { plan, view } => {
                let now = self.instance(document)?;
                let frame = |view: &GridView| {
                    let grid = view.instance.grid();
                    (
                        grid.rows(),
                        grid.cols(),
                        view.cell_m.to_bits(),
                        view.corner_m,
                    )
                };
                if frame(&now) != frame(view) {
                    let grid = view.instance.grid();
                    let reason = format!(
                        "the plan is on a grid of {} by {} cells of {} m, which the document has no longer",
                        grid.cols(),
                        grid.rows(),
                        view.cell_m
                    );
                    let hint = "plan again";
                    return Err(InputError::new(problem.task.source.as_str(), reason).hint(hint));
                }
                let view = View::Grid(Box::new(GridView::clone(&now)));
                let terms = view.terms(problem, now.spec.separation, Pace::default(), None);
                let terms = GridTerms {
                    separation: terms.separation,
                    step_s: terms.step_s,
                };
                Ok(now.judge(problem, plan, terms, limit))
            }
            KeptPlan::Roadmap { plan, view } => {
                let view = view.of(problem)?;
                view.judge(problem, plan, Pace::default(), limit)
            }
            KeptPlan::Continuous(plan) => Ok(problem.judge(plan, limit)),
        }
    }
}

/// The roadmap's parameters with the seed that it is drawn by.
fn drawn(document: &Document) -> RoadmapSpec {
    let spec = document.views.roadmap.spec();
    RoadmapSpec {
        seed: spec.seed.or(Some(document.seed)),
        ..spec
    }
}

/// True if what was registered was made of something else than what there is, however far back.
/// Nothing is further back than there are things.
fn is_stale(
    registered: &BTreeMap<String, Registered>,
    id: &str,
    derived: &impl Fn(&str) -> Option<Digest>,
    most: usize,
) -> bool {
    let Some(made) = registered.get(id) else {
        return true;
    };
    made.from
        .iter()
        .any(|(from, digest)| match registered.get(from) {
            Some(other) => {
                other.digest != *digest
                    || most == 0
                    || is_stale(registered, from, derived, most.saturating_sub(1))
            }
            None => derived(from) != Some(*digest),
        })
}

/// Refuses a grid of more cells than a page is shown.
pub(crate) fn check_cells(
    world: &Workspace,
    radius_m: f64,
    spec: GridSpec,
) -> Result<(), InputError> {
    let side_m = cell_side_m(spec, radius_m);
    let bounds = &world.bounds;
    let [cols, rows] = [0, 1].map(|axis| ((bounds.max[axis] - bounds.min[axis]) / side_m).ceil());
    if cols * rows <= MOST_CELLS as f64 {
        return Ok(());
    }
    let reason =
        format!("the grid has {cols} by {rows} cells of {side_m} m, too many for the studio");
    Err(InputError::new("grid", reason).hint(format!(
        "the studio takes {MOST_CELLS}; use larger robots or a smaller world"
    )))
}

fn clearance(world: &Workspace, side_m: f64) -> Result<Clearance, InputError> {
    let (min, max) = (world.bounds.min, world.bounds.max);
    let sizes = [0, 1].map(|axis| max[axis] - min[axis]);
    let refuse = |reason: String, hint: String| Err(InputError::new("side", reason).hint(hint));
    if !(side_m.is_finite() && side_m > 0.0) {
        let reason = format!("points cannot be {side_m} m apart");
        return refuse(reason, "give a distance in metres".into());
    }
    let [cols, rows] = sizes.map(|size| (size / side_m - 1e-9).ceil().max(1.0));
    if cols * rows > MOST_POINTS as f64 {
        let reason = format!("a field of {cols} by {rows} points is too large");
        let least = (sizes[0] * sizes[1] / MOST_POINTS as f64).sqrt();
        let least = least.max(sizes[0].max(sizes[1]) / MOST_POINTS as f64);
        let hint = format!(
            "a field has {MOST_POINTS} points at most: give at least {:.3} m",
            least * 1.01
        );
        return refuse(reason, hint);
    }
    let (rows, cols) = (rows as u32, cols as u32);
    let free = Free::new(world);
    let mut values_cm = Vec::with_capacity((rows * cols) as usize);
    for row in 0..rows {
        let y = min[1] + (f64::from(rows - 1 - row) + 0.5) * side_m;
        for col in 0..cols {
            let at = [min[0] + (f64::from(col) + 0.5) * side_m, y];
            let clearance_m = if free.is_inside(at) {
                free.clearance_m(at)
            } else {
                0.0
            };
            values_cm.push((100.0 * clearance_m) as u32);
        }
    }
    Ok(Clearance {
        rows,
        cols,
        side_m,
        values_cm,
    })
}
