//! Views of tasks on which a suite asks planners.

use fleetyard_check::Pace;
use fleetyard_core::document::{Place, Value};
use fleetyard_core::{Connectivity, Hasher, InputError, Separation, shown};
use fleetyard_views::{
    Builder, BuilderKind, GridSpec, PlanTerms, Problem, Representation, RoadmapParameters,
    RoadmapSpec, View, ViewName, ViewSpec,
};
use serde_json::{Map, Value as Json};

use super::values::{connectivity, label_of, said, some};

/// A view of tasks, and the rules that it leaves open.
#[derive(Debug, Clone)]
pub struct SuiteView {
    /// Its name in tables; no other view of the tasks has it.
    pub label: String,
    /// Operator and parameters.
    pub spec: ViewSpec,
    /// Distance that robots on a grid keep.
    pub separation: Separation,
    /// Speeds of robots on a roadmap.
    pub pace: Pace,
    /// Duration of a step on a grid in seconds; that of a move where there is none.
    pub step_s: Option<f64>,
    /// Its place in the suite.
    pub place: Place,
}

/// A view of a task that was derived, as planners are asked it.
#[derive(Debug, Clone)]
pub struct AskedView {
    /// The task with its world.
    pub problem: Problem,
    /// The view.
    pub view: View,
    /// The rules that the view leaves open.
    pub terms: PlanTerms,
}

impl SuiteView {
    /// Derives the view from a problem.
    pub fn derive(&self, problem: Problem) -> Result<AskedView, InputError> {
        let view = self.spec.derive(&problem)?;
        Ok(AskedView {
            terms: view.terms(&problem, self.separation, self.pace, self.step_s),
            view,
            problem,
        })
    }

    /// Neighbours of a cell, of a grid.
    pub(super) fn connectivity(&self) -> Option<Connectivity> {
        match self.spec {
            ViewSpec::Grid(spec) => Some(spec.connectivity),
            ViewSpec::Roadmap(_) | ViewSpec::Given(_) | ViewSpec::Continuous => None,
        }
    }

    /// Adds all that plans of the view depend on, but for the task.
    pub(super) fn hash(&self, hasher: &mut Hasher) {
        let Self {
            label: _,
            spec,
            separation,
            pace,
            step_s,
            place: _,
        } = self;
        let bits = |number: Option<f64>| number.map(f64::to_bits);
        hasher.value(&(spec.representation(), separation, pace, bits(*step_s)));
        match spec {
            ViewSpec::Grid(GridSpec {
                connectivity,
                separation,
            }) => hasher.value(&(connectivity.degree(), separation)),
            ViewSpec::Roadmap(RoadmapSpec {
                builder,
                spacing_m,
                seed,
                speed_m_per_s,
            }) => hasher.value(&(builder, bits(*spacing_m), seed, bits(*speed_m_per_s))),
            ViewSpec::Given(given) => {
                hasher.value(&(given.roadmap.digest(), bits(given.speed_m_per_s)));
            }
            ViewSpec::Continuous => {}
        }
    }
}

/// The keys of a grid.
const GRID: &[&str] = &[
    "label",
    "representation",
    "connectivity",
    "separation",
    "step",
];

/// The keys of a roadmap.
const ROADMAP: &[&str] = &[
    "label",
    "representation",
    "spacing",
    "speed",
    "roadmap_seed",
    "pace",
    "density",
    "builder",
    "vertices",
    "neighbors",
    "sampling",
    "side",
    "directions",
    "sides",
];

/// Those of them that say how it is made, of which every builder has its own.
const BUILDER: &[&str] = &[
    "density",
    "builder",
    "vertices",
    "neighbors",
    "sampling",
    "side",
    "directions",
    "sides",
];

/// The keys of the plane.
const CONTINUOUS: &[&str] = &["label", "representation"];

/// Views by words, or by tables of parameters.
pub(super) fn views(value: &Value<'_>) -> Result<Vec<SuiteView>, InputError> {
    let mut views: Vec<SuiteView> = Vec::new();
    for item in some(value)? {
        let view = view(&item)?;
        if views.iter().any(|known| known.label == view.label) {
            let reason = format!("two views are called \"{}\"", shown(&view.label));
            return Err(item.error(reason).hint("give each a `label` of its own"));
        }
        views.push(view);
    }
    Ok(views)
}

fn view(value: &Value<'_>) -> Result<SuiteView, InputError> {
    let grid = GridSpec {
        connectivity: Connectivity::Four,
        separation: Separation::default(),
    };
    let plain = |label: String, spec: ViewSpec| SuiteView {
        label,
        spec,
        separation: Separation::default(),
        pace: Pace::default(),
        step_s: None,
        place: value.place(),
    };
    if !value.is_table() {
        let name: ViewName = value.read()?;
        return Ok(plain(name.to_string(), name.spec(grid, None)));
    }
    let representation: Representation = value.require("representation")?.read()?;
    let table = value
        .clone()
        .named(&format!("a view of the representation `{representation}`"));
    let table = &table;
    let spec = match representation {
        Representation::Grid => {
            table.only(GRID)?;
            let moves = table.optional("connectivity", connectivity)?;
            let separation = table.optional("separation", Value::read)?;
            ViewSpec::Grid(GridSpec {
                connectivity: moves.unwrap_or(grid.connectivity),
                separation: separation.unwrap_or_default(),
            })
        }
        Representation::Roadmap => {
            let builder = builder(table)?;
            ViewSpec::Roadmap(RoadmapSpec {
                spacing_m: table.optional("spacing", |value| {
                    positive(value, "a distance in metres, or 0 for none", true)
                })?,
                seed: table.optional("roadmap_seed", |seed| seed.whole(0, u64::MAX))?,
                speed_m_per_s: table.optional("speed", |value| {
                    positive(value, "a speed above 0, in m/s", false)
                })?,
                ..RoadmapSpec::new(builder)
            })
        }
        Representation::Continuous => {
            table.only(CONTINUOUS)?;
            ViewSpec::Continuous
        }
    };
    let mut parameters: Map<String, Json> = table.read()?;
    let named = label_of(table)?;
    for key in ["label", "representation"] {
        parameters.remove(key);
    }
    let label = named.unwrap_or_else(|| said(representation.name(), &parameters));
    Ok(SuiteView {
        separation: match &spec {
            ViewSpec::Grid(spec) => spec.separation,
            _ => Separation::default(),
        },
        pace: table.optional("pace", Value::read)?.unwrap_or_default(),
        step_s: table.optional("step", |value| {
            positive(value, "a duration above 0, in seconds", false)
        })?,
        ..plain(label, spec)
    })
}

/// The builder of a roadmap: a density, or a kind with its own parameters.
fn builder(table: &Value<'_>) -> Result<Builder, InputError> {
    table.only(ROADMAP)?;
    let only = |own: &[&str], who: &str, hint: &str| {
        let mut others = BUILDER.iter().filter(|key| !own.contains(key));
        let Some(other) = others.find_map(|key| table.get(key)) else {
            return Ok(());
        };
        let reason = format!("`{}` is no parameter of {who}", other.key());
        Err(other.error(reason).hint(hint))
    };
    if let Some(density) = table.get("density") {
        let hint = "leave it out, or `density`";
        only(&["density"], "a density, which has all of its own", hint)?;
        let name: &str = density.read()?;
        return Builder::preset(name).ok_or_else(|| {
            let names: Vec<&str> = Builder::presets().collect();
            let reason = format!("\"{}\" is no density", shown(name));
            let hint = format!("densities are {}", names.join(", "));
            density.error(reason).hint(hint)
        });
    }
    let kind: Option<BuilderKind> = table.optional("builder", Value::read)?;
    let kind = kind.unwrap_or_default();
    let own: &[&str] = match kind {
        BuilderKind::Prm => &["builder", "vertices", "neighbors", "sampling"],
        BuilderKind::PrmStar | BuilderKind::Delaunay => &["builder", "vertices", "sampling"],
        BuilderKind::Lattice => &["builder", "side", "directions"],
        BuilderKind::Tangent => &["builder", "sides"],
    };
    let hint = format!("its parameters are {}", own[1..].join(", "));
    only(own, &format!("the builder `{kind}`"), &hint)?;
    if kind == BuilderKind::Lattice {
        table.require("side")?;
    }
    let parameters: RoadmapParameters = table.part(BUILDER).read()?;
    Ok(parameters.builder())
}

/// A number above 0, or not below it.
fn positive(value: &Value<'_>, wanted: &str, or_zero: bool) -> Result<f64, InputError> {
    let number: f64 = value.read()?;
    if number.is_finite() && (number > 0.0 || (or_zero && number == 0.0)) {
        return Ok(number);
    }
    let reason = format!("`{}` is {number}", shown(value.key()));
    Err(value.error(reason).hint(format!("give {wanted}")))
}

#[cfg(test)]
mod tests {
    use fleetyard_core::Digest;
    use fleetyard_views::Sampling;

    use super::*;

    fn view(spec: ViewSpec) -> SuiteView {
        SuiteView {
            label: "view".into(),
            spec,
            separation: Separation::Rules,
            pace: Pace::StopGo,
            step_s: None,
            place: Place::outside("test"),
        }
    }

    fn digest(view: &SuiteView) -> Digest {
        let mut hasher = Hasher::new("test");
        view.hash(&mut hasher);
        hasher.finish()
    }

    #[test]
    fn views_that_differ_have_digests_that_differ() {
        let grid = |connectivity, separation| {
            view(ViewSpec::Grid(GridSpec {
                connectivity,
                separation,
            }))
        };
        let plain = RoadmapSpec::new(Builder::Lattice {
            side_m: 0.5,
            directions: 8,
        });
        let roadmap = |spec| view(ViewSpec::Roadmap(spec));
        let of = |builder| roadmap(RoadmapSpec::new(builder));
        let prm = |sampling, vertices, neighbors| Builder::Prm {
            sampling,
            vertices,
            neighbors,
        };
        let lattice = |side_m, directions| Builder::Lattice { side_m, directions };
        let continuous = view(ViewSpec::Continuous);
        let views = [
            grid(Connectivity::Four, Separation::Rules),
            grid(Connectivity::Four, Separation::Strict),
            grid(Connectivity::Eight, Separation::Rules),
            of(prm(Sampling::Uniform, 100, 5)),
            of(prm(Sampling::Halton, 100, 5)),
            of(prm(Sampling::Uniform, 5, 100)),
            of(Builder::Tangent { sides: 8 }),
            roadmap(plain),
            // The next number.
            of(lattice(f64::from_bits(0.5f64.to_bits() + 1), 8)),
            of(lattice(0.5, 16)),
            roadmap(RoadmapSpec {
                spacing_m: Some(1.0),
                ..plain
            }),
            roadmap(RoadmapSpec {
                speed_m_per_s: Some(1.0),
                ..plain
            }),
            roadmap(RoadmapSpec {
                seed: Some(1),
                ..plain
            }),
            SuiteView {
                pace: Pace::Slower,
                ..roadmap(plain)
            },
            SuiteView {
                separation: Separation::Strict,
                ..continuous.clone()
            },
            SuiteView {
                step_s: Some(1.0),
                ..continuous.clone()
            },
            continuous,
        ];
        for (index, one) in views.iter().enumerate() {
            for other in &views[..index] {
                assert_ne!(digest(one), digest(other), "{one:?} {other:?}");
            }
            let renamed = SuiteView {
                label: "another name".into(),
                ..one.clone()
            };
            assert_eq!(digest(one), digest(&renamed));
        }
    }
}
