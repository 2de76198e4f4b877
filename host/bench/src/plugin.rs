//! Plugins before and while they are asked.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use fleetyard_abi::{Budget, Capability, Descriptor, Kind, Motion, SharedEnvironment};
use fleetyard_check::PathRule;
use fleetyard_core::Digest;
use fleetyard_fleet::{Module, ModuleInfo};
use fleetyard_runtime::{
    Attach, CallReport, Closing, CodeFile, Fault, Found, Identity, Origin, PluginFile, Runtime,
    Session, Standing, check_options, parse_option, plugin_name,
};
use serde_json::{Map, Value};

use crate::trial_error::TrialError;

/// A plugin that was found, how it is attached and its options: all that it takes to start it.
#[derive(Debug, Clone)]
pub struct Plugin {
    /// Its name in messages and tables.
    pub name: String,
    kind: Kind,
    file: PluginFile,
    id: Option<String>,
    identity: Identity,
    standing: Standing,
    attach: Attach,
    options: GivenOptions,
}

/// Options of a plugin, as they were given.
#[derive(Debug, Clone, PartialEq)]
pub enum GivenOptions {
    /// `NAME=VALUE` each, to be read by the plugin's schema.
    Texts(Vec<String>),
    /// Values with their types.
    Values(Map<String, Value>),
}

impl Default for GivenOptions {
    fn default() -> Self {
        Self::Values(Map::new())
    }
}

impl GivenOptions {
    fn read(&self, descriptor: &Descriptor) -> Result<Map<String, Value>, TrialError> {
        let schema = &descriptor.options_schema;
        let mut options = Map::new();
        match self {
            Self::Texts(texts) => {
                for text in texts {
                    options.extend([parse_option(text, schema)?]);
                }
            }
            Self::Values(values) => options.clone_from(values),
        }
        check_options(&options, schema)?;
        Ok(options)
    }
}

impl Plugin {
    /// The plugin of this kind that a search for `name` found, attached as usual and without
    /// options.
    pub fn new(runtime: &Runtime, found: Found, kind: Kind, name: &str) -> Result<Self, Fault> {
        let Found {
            file, origin, id, ..
        } = found;
        let name = match (&origin, file.path().and_then(plugin_name)) {
            (Origin::Path, Some(name)) => name,
            _ => name.to_owned(),
        };
        let identity = runtime.identity(&file)?;
        let standing = runtime.limits().trust.standing(&file);
        Ok(Self {
            name,
            kind,
            attach: file.default_attach(),
            options: GivenOptions::default(),
            file,
            id,
            identity,
            standing,
        })
    }

    /// The same, attached so if a way is given.
    #[must_use]
    pub fn attached(mut self, wanted: Option<Attach>) -> Self {
        self.attach = wanted.unwrap_or(self.attach);
        self
    }

    /// The same with these options.
    #[must_use]
    pub fn with_options(mut self, options: GivenOptions) -> Self {
        self.options = options;
        self
    }

    /// The planner of this program with that identifier.
    pub(crate) fn built_in(runtime: &Runtime, id: &str) -> Result<Self, Fault> {
        let found = Found {
            file: PluginFile::BuiltIn,
            origin: Origin::BuiltIn,
            id: Some(id.to_owned()),
            shadowed: Vec::new(),
        };
        Self::new(runtime, found, Kind::Planner, id)
    }

    /// True if it is a part of this program.
    pub fn is_built_in(&self) -> bool {
        self.file == PluginFile::BuiltIn
    }

    /// Digest of its code; of this program, for built-ins.
    pub fn digest(&self) -> Digest {
        self.identity.digest
    }

    /// All that decides what it does, with its SHA-256; none for built-ins.
    pub fn code(&self) -> &[CodeFile] {
        &self.identity.code
    }

    /// Path of its code; `None` for built-ins.
    pub fn path(&self) -> Option<PathBuf> {
        self.file.path().map(Into::into)
    }

    /// True if the lock file has just this code.
    pub fn is_pinned(&self) -> bool {
        self.standing == Standing::Pinned
    }

    /// The way in which it is attached.
    pub fn attach(&self) -> Attach {
        self.attach
    }

    /// Starts the plugin and reads its options; it is not made yet.
    pub fn start(&self, runtime: &Runtime) -> Result<Running, TrialError> {
        let mut session = runtime.open(&self.file, self.attach)?;
        // What the record says of the code has to be true of every trial.
        let own = self.file.own_code(&runtime.limits().policy.hidden)?;
        let known = self.identity.own();
        if own != known {
            session.close();
            let changed = own.iter().chain(known);
            let changed = changed
                .filter(|file| !(own.contains(file) && known.contains(file)))
                .map(|file| file.path.clone());
            return Err(TrialError::CodeChanged {
                name: self.name.clone(),
                file: changed.min(),
            });
        }
        let descriptor = self.choose(session.descriptors())?;
        let options = self.options.read(&descriptor)?;
        Ok(Running {
            session,
            descriptor,
            options,
            trials: 0,
            environment: None,
        })
    }

    /// Starts and makes the plugin for a run of a fleet.
    pub fn module(&self, runtime: &Runtime) -> Result<Module, TrialError> {
        let Running {
            mut session,
            descriptor,
            options,
            ..
        } = self.start(runtime)?;
        let (kind, id, attach) = (self.kind, descriptor.id, self.attach);
        session.create(kind, &id, Value::Object(options.clone()))?;
        let info = ModuleInfo {
            kind,
            name: self.name.clone(),
            id: id.clone(),
            version: descriptor.version,
            attach: attach.name().to_owned(),
            digest: Some(self.identity.digest),
            options: options.clone(),
            memory: fleetyard_fleet::memory_of(&descriptor.features),
        };
        let file = self.file.clone();
        let start = move |runtime: &Runtime| {
            let mut session = runtime.open(&file, attach)?;
            session.create(kind, &id, Value::Object(options.clone()))?;
            Ok(session)
        };
        Ok(Module::new(
            info,
            descriptor.capabilities,
            session,
            runtime.clone(),
            Box::new(start),
        ))
    }

    fn choose(&self, descriptors: &[Descriptor]) -> Result<Descriptor, TrialError> {
        let kind = self.kind;
        let plugins: Vec<_> = descriptors
            .iter()
            .filter(|descriptor| descriptor.kind == kind)
            .collect();
        let ids = || plugins.iter().map(|plugin| plugin.id.clone()).collect();
        let chosen = match (&self.id, plugins.as_slice()) {
            (Some(id), plugins) => plugins.iter().find(|plugin| plugin.id == *id).copied(),
            (None, [only]) => Some(*only),
            (None, []) => None,
            (None, _) => {
                return Err(TrialError::SeveralPlugins {
                    file: self.name.clone(),
                    kind,
                    ids: ids(),
                });
            }
        };
        chosen.cloned().ok_or_else(|| TrialError::NoPlugin {
            file: self.name.clone(),
            kind,
            wanted: self.id.clone(),
            ids: ids(),
        })
    }
}

/// The motion that a planner is asked for where paths are judged by this rule: straight lines if
/// the rule allows them and the planner can.
pub(crate) fn motion(descriptor: &Descriptor, rule: PathRule) -> Motion {
    let any_angle = descriptor.capabilities.has(Capability::AnyAngle);
    if any_angle && rule != PathRule::Steps {
        Motion::AnyAngle
    } else {
        Motion::Pebble
    }
}

/// A planner that cannot be asked for plans.
pub(crate) struct Unready {
    /// The reason.
    pub(crate) fault: Fault,
    /// The time for which it had been learning the map; none if it was not made.
    pub(crate) after: Option<Duration>,
}

/// A planner that was started and can be asked.
pub struct Running {
    pub(crate) session: Session,
    /// Its descriptor.
    pub descriptor: Descriptor,
    /// Its options, all of them known and well typed.
    pub options: Map<String, Value>,
    /// Number of instances that it was asked to solve.
    pub(crate) trials: u64,
    /// The map that it learnt last.
    pub(crate) environment: Option<SharedEnvironment>,
}

impl Running {
    /// Makes the planner and lets it learn the map, unless it has and knows it.
    pub(crate) fn ready(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
    ) -> Result<Option<CallReport>, Unready> {
        if self.trials == 0 {
            let options = Value::Object(self.options.clone());
            let id = self.descriptor.id.clone();
            let made = self.session.create(Kind::Planner, &id, options);
            made.map_err(|fault| Unready { fault, after: None })?;
        }
        self.trials += 1;
        let known = self.environment.as_ref();
        if known.is_some_and(|known| known == environment) {
            return Ok(None);
        }
        let started = Instant::now();
        let report = self.session.prepare(environment, budget);
        let report = report.map_err(|fault| Unready {
            fault,
            after: Some(started.elapsed()),
        })?;
        self.environment = Some(SharedEnvironment::clone(environment));
        Ok(Some(report))
    }

    /// Ends it.
    pub fn close(mut self) -> Closing {
        self.session.close()
    }
}
