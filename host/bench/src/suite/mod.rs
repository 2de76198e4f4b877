//! Suites: planners, instances, seeds and repeats, and the budget of a trial.
//!
//! A suite is a TOML file; `docs/suites.md` is its reference. Reading one
//! ([`load_suite`]) looks at the file alone, so that every fault in it has its place;
//! [`Suite::instances`] then reads the files that it names.

mod fleet;
mod instance;
mod read;
pub(crate) mod recipe;
mod sets;
mod settings;
mod values;
mod view;

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use fleetyard_check::PathRule;
use fleetyard_core::document::{Place, Setting, between};
use fleetyard_core::{Digest, Hasher, InputError, read_file, words};
use fleetyard_runtime::Attach;
use fleetyard_sim::SimConfig;
use serde::Deserialize;
use serde_json::{Map, Value};

use crate::evaluate::{Order, Unit};
use crate::options::{BudgetOptions, Robots, SandboxOptions};
pub use fleet::{FleetPlugin, FleetSetup};
pub use instance::{Question, SuiteInstance};
pub use recipe::{MazeOrigin, Origin};
use sets::InstanceSet;
pub(crate) use sets::{Source, Sources};
pub use values::MOST_INSTANCES;
use values::Paths;
pub use view::{AskedView, SuiteView};

/// The largest suite file that is read, in bytes.
pub const SUITE_LIMIT: u64 = 1 << 20;

/// Most trials of a suite.
pub const MOST_TRIALS: u64 = 10_000_000;

/// The content of a suite file.
#[derive(Debug, Clone)]
pub struct Suite {
    /// Letters, digits, `.`, `_` and `-`: files are named after it.
    pub name: String,
    /// For people.
    pub description: String,
    /// The file as it was.
    pub text: String,
    /// The order of trials, and the rules of their comparison.
    pub protocol: Protocol,
    /// Budget of every call.
    pub budget: BudgetOptions,
    /// Grants and limits of planners. The command decides whose code is trusted.
    pub sandbox: SandboxOptions,
    /// Size of cells and steps, and how plans are executed.
    pub config: SimConfig,
    /// The robots that execute plans; `None` when plans are not executed.
    pub robots: Option<Robots>,
    /// The planners, at least one; no two have the same label.
    pub planners: Vec<PlannerSetup>,
    sets: Vec<InstanceSet>,
    /// The file as a whole.
    place: Place,
    /// Its values, without comments and order.
    normal: Map<String, Value>,
}

/// The order of trials, and the rules of their comparison.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Protocol {
    /// Timed repeats of every trial.
    #[serde(deserialize_with = "between::<1, 1_000_000, u32, _, _>")]
    pub repeats: u32,
    /// Untimed trials of every planner on every instance, before the timed ones.
    #[serde(deserialize_with = "between::<0, 1000, u32, _, _>")]
    pub warm_ups: u32,
    /// Most times that a trial is made again because others disturbed it.
    #[serde(deserialize_with = "between::<0, 1000, u32, _, _>")]
    pub retry_contended: u32,
    /// True if the plans that count are kept in the store.
    pub keep_plans: bool,
    /// Seeds given to planners, all different.
    #[serde(skip_deserializing)]
    pub seeds: Vec<u64>,
    /// Lifetime of a planner's process.
    pub reuse: Reuse,
    /// The time that is compared.
    pub clock: Clock,
    /// The rule by which paths are judged.
    pub path_rule: PathRule,
    /// The order of planners after their success rate.
    pub ranking: Order,
    /// The sampling unit to which results are generalised.
    pub generalise_over: Unit,
}

impl Default for Protocol {
    fn default() -> Self {
        Self {
            repeats: 1,
            warm_ups: 0,
            retry_contended: 0,
            keep_plans: false,
            seeds: vec![0],
            reuse: Reuse::Never,
            clock: Clock::Host,
            path_rule: PathRule::Steps,
            ranking: Order::default(),
            generalise_over: Unit::default(),
        }
    }
}

/// Lifetime of a planner's process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reuse {
    /// For one trial.
    Never,
    /// For all trials of the planner, as long as nothing goes wrong with it.
    Planner,
}

words!(Reuse {
    Never = "never", "";
    Planner = "planner", "";
});

/// The time that is compared; none is the plugin's word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clock {
    /// Around the call, transport included.
    Host,
    /// Less what an empty call takes.
    LessEmpty,
    /// Processor time of the call, whatever else the machine did.
    Cpu,
}

words!(Clock {
    Host = "host", "";
    LessEmpty = "call", "";
    Cpu = "cpu", "";
});

/// A planner of a suite.
#[derive(Debug, Clone)]
pub struct PlannerSetup {
    /// Its name in tables; no other planner of the suite has it.
    pub label: String,
    /// An identifier, the path of a library or program, or `PATH:ID`.
    pub plugin: String,
    /// The way of attaching it, if not as usual.
    pub attach: Option<Attach>,
    /// Its options, not yet checked against its schema.
    pub options: Map<String, Value>,
    /// The fleet that it plans for, in a suite of fleets.
    pub fleet: Option<FleetSetup>,
    /// Place of `plugin` in the suite.
    pub plugin_place: Place,
    /// Place of `options`, or of the planner where it has none.
    pub options_place: Place,
}

/// Reads a suite file.
pub fn load_suite(path: impl AsRef<Path>) -> Result<Suite, InputError> {
    Suite::load_with(path, &[])
}

/// The text of a suite with these values.
pub(crate) fn to_toml(values: &Value) -> Result<String, InputError> {
    toml::to_string_pretty(values).map_err(|error| {
        let reason = format!("the values of the suite cannot be written: {error}");
        InputError::new("suite", reason)
    })
}

impl Suite {
    /// A suite that is in no file: the planners of a command line by their labels. Its plugins and
    /// instances are given to the [experiment](crate::Experiment::of_parts); all else is as in a
    /// suite that says nothing of it.
    pub fn in_memory(name: &str, labels: impl IntoIterator<Item = String>) -> Self {
        let planner = |label| PlannerSetup {
            label,
            plugin: String::new(),
            attach: None,
            options: Map::new(),
            fleet: None,
            plugin_place: Place::outside("--planner"),
            options_place: Place::outside("--planner"),
        };
        Self {
            name: name.to_owned(),
            description: String::new(),
            text: String::new(),
            protocol: Protocol::default(),
            budget: BudgetOptions::default(),
            sandbox: SandboxOptions::default(),
            config: SimConfig::default(),
            robots: None,
            planners: labels.into_iter().map(planner).collect(),
            sets: Vec::new(),
            place: Place::outside(name),
            normal: Map::new(),
        }
    }

    /// Reads a suite file, with values from the command line in place of its own.
    ///
    /// Paths in it are relative to its folder, and `${NAME}` in them stands for an
    /// environment variable.
    pub fn load_with(path: impl AsRef<Path>, settings: &[Setting]) -> Result<Self, InputError> {
        let variable = |name: &str| std::env::var(name).ok();
        Self::load_in(path.as_ref(), settings, &variable)
    }

    /// The same where the environment is this.
    pub(crate) fn load_in(
        path: &Path,
        settings: &[Setting],
        variable: &dyn Fn(&str) -> Option<String>,
    ) -> Result<Self, InputError> {
        let source = path.display().to_string();
        let bytes = read_file(path, SUITE_LIMIT)?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let valid = error.utf8_error().valid_up_to();
            let lines = error.as_bytes()[..valid].split(|byte| *byte == b'\n');
            InputError::new(source.as_str(), "this is not UTF-8 text").at_line(lines.count() as u64)
        })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::read(&source, &text, settings, folder, variable)
    }

    /// Reads the text of a suite; `source` is its name in errors, paths in it are
    /// relative to `folder`, and `variable` is the environment that they may name.
    pub fn read(
        source: &str,
        text: &str,
        settings: &[Setting],
        folder: &Path,
        variable: &dyn Fn(&str) -> Option<String>,
    ) -> Result<Self, InputError> {
        read::suite(source, text, settings, &Paths { folder, variable })
    }

    /// Reads a suite from its values as [`Suite::normal`] has them; the rest is as for [`Suite::read`].
    pub(crate) fn of_values(
        source: &str,
        values: &Value,
        folder: &Path,
        variable: &dyn Fn(&str) -> Option<String>,
    ) -> Result<Self, InputError> {
        Self::read(source, &to_toml(values)?, &[], folder, variable)
    }

    /// The files that the suite names and that say what planners will be asked: they are not
    /// for planners to read.
    pub fn files(&self) -> Result<Vec<PathBuf>, InputError> {
        let mut files = Vec::new();
        for set in &self.sets {
            files.extend(set.files()?);
        }
        if let Some(Robots::File(name, _)) = &self.robots {
            files.push(name.into());
        }
        Ok(files)
    }

    /// The suite as JSON, without comments and with keys in order: the values of the command line
    /// are in it, defaults are not.
    pub fn normal(&self) -> String {
        format!("{:#}", Value::Object(self.normal.clone()))
    }

    /// The suite as JSON values.
    pub(crate) fn values(&self) -> &Map<String, Value> {
        &self.normal
    }

    /// Every file and folder that the suite names to be read by the host, as it names them.
    pub(crate) fn named(&self) -> Vec<PathBuf> {
        let mut named: Vec<PathBuf> = self.sets.iter().flat_map(InstanceSet::named).collect();
        if let Some(Robots::File(name, _)) = &self.robots {
            named.push(name.into());
        }
        named
    }

    /// Digest of what the suite says, names and descriptions apart. What the files say
    /// that it names is not in it: see [`SuiteInstance::digest`].
    pub fn digest(&self) -> Digest {
        let mut said = self.normal.clone();
        said.remove("name");
        said.remove("description");
        let mut hasher = Hasher::new("fleetyard.suite/1");
        hasher.bytes(Value::Object(said).to_string().as_bytes());
        hasher.finish()
    }

    /// Number of timed trials of so many instances.
    fn trials(&self, instances: u64) -> Result<u64, InputError> {
        let parts = [
            (self.planners.len() as u64, "planner"),
            (instances, "instance"),
            (self.protocol.seeds.len() as u64, "seed"),
            (u64::from(self.protocol.repeats), "repeat"),
        ];
        let product = parts
            .iter()
            .try_fold(1, |product: u64, (count, _)| product.checked_mul(*count));
        match product {
            Some(trials) if trials <= MOST_TRIALS && instances <= MOST_INSTANCES => Ok(trials),
            _ => {
                let parts = parts.map(|(count, what)| match count {
                    1 => format!("1 {what}"),
                    _ => format!("{count} {what}s"),
                });
                let total = product.map_or("too many".to_owned(), |trials| trials.to_string());
                let reason = format!("the suite has {} = {total} trials", parts.join(" × "));
                Err(self.place.error(reason).hint(format!(
                    "a suite has at most {MOST_INSTANCES} instances and {MOST_TRIALS} trials; \
                     split it"
                )))
            }
        }
    }

    /// Every instance, in the order of the file: set by set; in a set by map or maze, then
    /// scenario, then connectivity, then team size; of tasks by task, then view, then team size.
    ///
    /// Scenarios, maps and tasks are read here, mazes and generated maps are made and views are derived
    /// when they are asked for ([`SuiteInstance::question`]); of each set one is made here, so that
    /// what cannot be made is found.
    pub fn instances(&self) -> Result<Vec<SuiteInstance>, InputError> {
        Ok(self.instances_and_sources()?.0)
    }

    /// The instances, and set by set the files that they are read from.
    pub(crate) fn instances_and_sources(
        &self,
    ) -> Result<(Vec<SuiteInstance>, Vec<Sources>), InputError> {
        let mut library = sets::Library::default();
        let mut found = Vec::new();
        for set in &self.sets {
            found.push(set.find(&mut library)?);
        }
        let count = found
            .iter()
            .try_fold(0, |sum: u64, set| sum.checked_add(set.count()?));
        self.trials(count.unwrap_or(u64::MAX))?;
        let sources = found.iter().map(sets::FoundSet::sources).collect();
        let mut seen = HashSet::new();
        let mut instances = Vec::new();
        for set in found {
            set.instances(self.protocol.path_rule, &mut seen, &mut instances)?;
        }
        if instances.is_empty() {
            let reason = "the suite has no instance: every team is larger than its scenario";
            return Err(self.place.error(reason));
        }
        Ok((instances, sources))
    }
}
