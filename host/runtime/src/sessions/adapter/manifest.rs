//! The manifest, `planner.toml`: read strictly, so that a mistake is found where
//! it was made and not in a run. `docs/adapters.md` is its reference.

use std::path::{Path, PathBuf};
use std::time::Duration;

use fleetyard_abi::{Capabilities, Capability, Status};
use fleetyard_core::document::{Document, Table, Value};
use fleetyard_core::formats::{Begin, Format, Layout, Major, MapSize};
use fleetyard_core::{GridPlan, InputError, shown};
use regex::bytes::{Regex, RegexBuilder};
use serde_json::{Map, Value as Json};

use super::template::{Slot, Template};
use crate::options::check_options;

/// The largest manifest that is read, in bytes.
pub const MANIFEST_LIMIT: u64 = 1 << 20;

/// The version of the manifest's format.
pub(crate) const FORMAT: i64 = 1;

/// Names of map and scenario in the scratch folder.
pub(super) const MAP_NAME: &str = "map.map";
pub(super) const SCEN_NAME: &str = "agents.scen";

/// What a `planner.toml` says.
#[derive(Debug, Clone)]
pub struct Manifest {
    pub(super) id: String,
    pub(super) name: String,
    pub(super) version: Version,
    pub(super) description: String,
    pub(super) license: String,
    pub(super) homepage: String,
    pub(super) program: Program,
    /// JSON Schema of the options; null when there are none.
    pub(super) options: Json,
    pub(super) input: Input,
    pub(super) output: Output,
    pub(super) exit: Exit,
    pub(super) metrics: Vec<Metric>,
    pub(super) capabilities: Capabilities,
    /// What the solver may read besides itself and the manifest's folder.
    pub(super) read: Vec<PathBuf>,
}

/// How a solver is started.
#[derive(Debug, Clone)]
pub(super) struct Program {
    pub(super) command: String,
    /// Where `command` stands, for messages.
    pub(super) line: u64,
    pub(super) column: u64,
    /// An environment variable that may name the program.
    pub(super) variable: Option<String>,
    pub(super) arguments: Vec<Argument>,
    pub(super) environment: Vec<(String, Template)>,
    pub(super) cwd: Option<Template>,
    /// How to get it.
    pub(super) install: Option<String>,
    /// Kept back from the budget to read the answer.
    pub(super) reserve: Option<Duration>,
    /// The same in nanoseconds per agent and free cell, for what the solver does before
    /// its own clock starts.
    pub(super) reserve_per_agent_cell: u64,
}

/// One argument, or some that are there only under a condition.
#[derive(Debug, Clone)]
pub(super) struct Argument {
    pub(super) when: Option<Condition>,
    pub(super) templates: Vec<Template>,
}

/// When an argument is there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Condition {
    /// The option was given or has a default, and is not `false`.
    Option(String),
    /// The budget limits memory.
    Memory,
    /// The budget limits nodes.
    Nodes,
    /// The budget has one thread.
    OneThread,
    /// The budget has several threads.
    Threads,
}

/// The solver's version.
#[derive(Debug, Clone)]
pub(super) struct Version {
    /// As the manifest has it: what is shown unless the solver says better.
    pub(super) text: String,
    pub(super) query: Option<VersionQuery>,
}

/// How the solver says its version.
#[derive(Debug, Clone)]
pub(super) struct VersionQuery {
    pub(super) arguments: Vec<Template>,
    pub(super) pattern: Regex,
    pub(super) limit: Duration,
    /// What the whole version must match, as the manifest has it.
    pub(super) supported: Option<(String, Regex)>,
}

/// What the solver reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Input {
    /// Whether terrain letters are those of the map, or `.` and `@` alone.
    pub(super) all_letters: bool,
    pub(super) agents: AgentsFormat,
}

/// How starts and goals are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum AgentsFormat {
    /// A MovingAI scenario; with rows before columns, against the format, or not.
    Scenario { row_first: bool },
    /// An instance file of pibt2, which names the map and has the seed.
    Pibt2,
}

impl Default for Input {
    fn default() -> Self {
        Self {
            all_letters: false,
            agents: AgentsFormat::Scenario { row_first: false },
        }
    }
}

/// Where the answer is and how it is written.
#[derive(Debug, Clone)]
pub(super) struct Output {
    /// In the scratch folder; absent for standard output.
    pub(super) file: Option<PathBuf>,
    pub(super) written: Written,
}

/// How an answer is written.
#[derive(Debug, Clone)]
pub(super) enum Written {
    /// As one of the formats that commands read, too.
    As(Format),
    /// As the manifest describes it.
    So(Box<Layout>),
}

impl Output {
    /// The answer's name in messages.
    pub(super) fn source(&self) -> String {
        match &self.file {
            Some(file) => file.display().to_string(),
            None => "standard output".into(),
        }
    }
}

/// A text that patterns look at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Searched {
    /// Standard output and standard error.
    Log,
    Stdout,
    Stderr,
    /// The answer.
    Output,
}

const FROM: [(&str, Searched); 4] = [
    ("log", Searched::Log),
    ("stdout", Searched::Stdout),
    ("stderr", Searched::Stderr),
    ("output", Searched::Output),
];

/// What the end of the solver means.
#[derive(Debug, Clone, Default)]
pub(super) struct Exit {
    pub(super) codes: Vec<(i32, Status)>,
    pub(super) patterns: Vec<Rule>,
}

/// A text that means something.
#[derive(Debug, Clone)]
pub(super) struct Rule {
    pub(super) pattern: Regex,
    pub(super) from: Searched,
    pub(super) status: Status,
    pub(super) message: Option<String>,
}

/// A figure in a text.
#[derive(Debug, Clone)]
pub(super) struct Metric {
    /// With its unit.
    pub(super) name: String,
    pub(super) pattern: Regex,
    pub(super) from: Searched,
}

const STATUSES: [(&str, Status); 8] = [
    ("solved", Status::Solved),
    ("infeasible", Status::Infeasible),
    ("timed-out", Status::TimedOut),
    ("gave-up", Status::GaveUp),
    ("cancelled", Status::Cancelled),
    ("unsupported", Status::Unsupported),
    ("invalid-input", Status::InvalidInput),
    ("internal-error", Status::InternalError),
];

impl Manifest {
    /// Reads a manifest; `source` is its name in errors.
    pub fn read(text: &str, source: &str) -> Result<Self, InputError> {
        if text.len() as u64 > MANIFEST_LIMIT {
            let reason = format!("a manifest has at most {MANIFEST_LIMIT} bytes");
            return Err(InputError::new(source, reason));
        }
        let document = Document::new(source, text);
        let root = document.parse()?;
        let root = Table::new(
            document,
            "",
            0,
            root.get_ref(),
            &[
                "manifest",
                "id",
                "name",
                "version",
                "description",
                "license",
                "homepage",
                "program",
                "options",
                "input",
                "output",
                "exit",
                "metrics",
                "capabilities",
                "files",
            ],
        )?;
        let format = root.require("manifest")?;
        if format.integer(1, i64::MAX)? != FORMAT {
            return Err(format
                .error("this manifest is written for a newer host")
                .hint(format!(
                    "this host reads manifests with `manifest = {FORMAT}`"
                )));
        }
        let id = root.require("id")?;
        let text = |key| Ok(root.text(key)?.unwrap_or_default().to_owned());
        let options = match root.get("options") {
            Some(value) => options(&value.names("[options]")?)?,
            None => Json::Null,
        };
        let properties = options.get("properties").and_then(Json::as_object);
        let empty = Map::new();
        let properties = properties.unwrap_or(&empty);
        let program = Program::read(&root.require("program")?, properties)?;
        let output = Output::read(&root.require("output")?)?;
        let input = match root.get("input") {
            Some(value) => Input::read(&value)?,
            None => Input::default(),
        };
        program.check_use(input, &output, &root.require("program")?)?;
        Ok(Self {
            id: identifier(id.text()?).map_err(|reason| {
                id.error(reason)
                    .hint("it begins with a-z or 0-9 and goes on with a-z, 0-9, '.', '_' and '-'")
            })?,
            name: text("name")?,
            version: match root.get("version") {
                Some(value) => Version::read(&value)?,
                None => Version {
                    text: String::new(),
                    query: None,
                },
            },
            description: text("description")?,
            license: text("license")?,
            homepage: text("homepage")?,
            program,
            options,
            input,
            output,
            exit: match root.get("exit") {
                Some(value) => Exit::read(&value)?,
                None => Exit::default(),
            },
            metrics: match root.get("metrics") {
                Some(value) => metrics(&value.names("[metrics]")?)?,
                None => Vec::new(),
            },
            capabilities: match root.get("capabilities") {
                Some(value) => capabilities(&value)?,
                None => Capabilities::of(&[Capability::Grid, Capability::Pebble]),
            },
            read: match root.get("files") {
                Some(value) => files(&value)?,
                None => Vec::new(),
            },
        })
    }

    /// Identifier of the planner.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// The format of answers, unless the manifest describes one.
    pub fn format(&self) -> Option<Format> {
        match self.output.written {
            Written::As(format) => Some(format),
            Written::So(_) => None,
        }
    }

    /// Reads a solver's answer in the declared format: paths of so many agents on a map
    /// of so many rows and columns.
    pub fn read_answer(
        &self,
        answer: &[u8],
        (rows, cols): (u32, u32),
        agents: usize,
    ) -> Result<GridPlan, InputError> {
        self.read_paths(answer, MapSize { rows, cols }, agents)
    }

    pub(super) fn read_paths(
        &self,
        answer: &[u8],
        size: MapSize,
        agents: usize,
    ) -> Result<GridPlan, InputError> {
        let source = self.output.source();
        let format = match &self.output.written {
            Written::So(layout) => return layout.read(&source, answer, size, Some(agents)),
            Written::As(format) => *format,
        };
        let file = format.read_plan(&source, answer, Some(size), Some(agents))?;
        let fault = |reason: String| Err(InputError::new(source.as_str(), reason));
        if (file.rows, file.cols) != (size.rows, size.cols) {
            return fault(format!(
                "it is of a map of {} × {} cells, but the map has {} × {}",
                file.rows, file.cols, size.rows, size.cols
            ));
        }
        if file.plan.agents() != agents {
            let found = file.plan.agents();
            return fault(format!("{found} paths for {agents} agents"));
        }
        Ok(file.plan)
    }
}

fn identifier(text: &str) -> Result<String, String> {
    let first = |letter: u8| letter.is_ascii_lowercase() || letter.is_ascii_digit();
    let fits = text
        .bytes()
        .enumerate()
        .all(|(at, letter)| first(letter) || at > 0 && matches!(letter, b'.' | b'_' | b'-'));
    if text.is_empty() || !fits || text.len() > 100 {
        return Err(format!("\"{}\" is no identifier", shown(text)));
    }
    Ok(text.to_owned())
}

/// A name as part of a placeholder or a figure.
fn name(text: &str, what: &str, table: &Table<'_, '_>, at: usize) -> Result<(), InputError> {
    identifier(text).map(drop).map_err(|_| {
        let reason = format!("`{}` cannot be the name of {what}", shown(text));
        table
            .document
            .error(at, reason)
            .hint("a name begins with a-z or 0-9 and goes on with a-z, 0-9, '.', '_' and '-'")
    })
}

/// A pattern with so many groups, none of them optional to say.
fn pattern(value: &Value<'_, '_>, groups: usize) -> Result<Regex, InputError> {
    const LONGEST: usize = 1000;
    let text = value.nonempty()?;
    if text.len() > LONGEST {
        return Err(value.error(format!("a pattern has at most {LONGEST} bytes")));
    }
    let regex = RegexBuilder::new(text)
        .multi_line(true)
        .crlf(true)
        .size_limit(1 << 20)
        .dfa_size_limit(1 << 20)
        .build()
        .map_err(|error| {
            let told = error.to_string();
            let last = told.lines().last().unwrap_or_default();
            let reason = last.trim_start_matches("error: ");
            value
                .error(format!("the pattern cannot be used: {reason}"))
                .hint("patterns are regular expressions as the Rust crate `regex` reads them")
        })?;
    let found = regex.captures_len() - 1;
    if found != groups {
        let reason = format!("the pattern has {found} groups in parentheses, expected {groups}");
        let error = value.error(reason);
        return Err(match groups {
            0 => error.hint("write (?:…) for a group that is not taken out"),
            _ => error.hint("one group takes out the value; write (?:…) for others"),
        });
    }
    Ok(regex)
}

fn template(value: &Value<'_, '_>, options: &[&str]) -> Result<Template, InputError> {
    let text = value.text()?;
    if text.contains('\0') {
        return Err(value.error("a NUL character cannot be part of an argument"));
    }
    Template::parse(text, options).map_err(|error| value.error(error.reason).hint(error.hint))
}

impl Program {
    fn read(value: &Value<'_, '_>, options: &Map<String, Json>) -> Result<Self, InputError> {
        let table = value.table(
            "[program]",
            &[
                "command",
                "variable",
                "args",
                "env",
                "cwd",
                "install",
                "reserve_ms",
                "reserve_ns_per_agent_cell",
            ],
        )?;
        let command = table.require("command")?;
        let place = command.error("");
        let names: Vec<&str> = options.keys().map(String::as_str).collect();
        let arguments = table.require("args")?;
        let arguments = arguments
            .list()?
            .iter()
            .map(|argument| Argument::read(argument, options, &names))
            .collect::<Result<_, _>>()?;
        let environment = match table.get("env") {
            Some(value) => environment(&value.names("[program.env]")?, options, &names)?,
            None => Vec::new(),
        };
        let cwd = table.get("cwd").map(|value| {
            let template = template(&value, &[])?;
            let mut slots = template.slots();
            if slots.any(|slot| !matches!(slot, Slot::Scratch | Slot::ManifestDir)) {
                return Err(
                    value.error("the working folder is made from `{scratch}` and `{manifest_dir}`")
                );
            }
            drop(slots);
            Ok(template)
        });
        let variable = table.get("variable").map(|value| {
            let name = value.nonempty()?;
            variable_name(name).map_err(|reason| value.error(reason))?;
            Ok(name.to_owned())
        });
        let reserve = table.get("reserve_ms").map(|value| {
            let ms = value.integer(0, 60_000)?;
            Ok(Duration::from_millis(ms as u64))
        });
        let reserve_per_agent_cell = match table.get("reserve_ns_per_agent_cell") {
            Some(value) => value.integer(0, 1_000_000)? as u64,
            None => 0,
        };
        let text = command.nonempty()?;
        if text.contains('\0') {
            return Err(command.error("a NUL character cannot be part of a path"));
        }
        Ok(Self {
            command: text.to_owned(),
            line: place.line.unwrap_or_default(),
            column: place.column.unwrap_or_default(),
            variable: variable.transpose()?,
            arguments,
            environment,
            cwd: cwd.transpose()?,
            install: table.text("install")?.map(str::to_owned),
            reserve: reserve.transpose()?,
            reserve_per_agent_cell,
        })
    }

    /// Whether the solver is told what to solve and where to write.
    fn check_use(
        &self,
        input: Input,
        output: &Output,
        value: &Value<'_, '_>,
    ) -> Result<(), InputError> {
        let used = |wanted: &Slot| {
            let arguments = self
                .arguments
                .iter()
                .flat_map(|argument| &argument.templates);
            let environment = self.environment.iter().map(|(_, template)| template);
            arguments
                .chain(environment)
                .any(|template| template.slots().any(|slot| slot == wanted))
        };
        let names_map = input.agents == AgentsFormat::Pibt2;
        for (slot, name) in [(Slot::Map, "map"), (Slot::Scen, "scen")] {
            if !used(&slot) && (slot != Slot::Map || !names_map) {
                return Err(value
                    .error(format!("no argument uses `{{{name}}}`"))
                    .hint("the solver needs the files of map and scenario to know what to solve"));
            }
        }
        if used(&Slot::Output) && output.file.is_none() {
            return Err(value
                .error("an argument uses `{output}`, but the answer is on standard output")
                .hint("name other files as in `{scratch}/stats.csv`"));
        }
        Ok(())
    }
}

fn variable_name(text: &str) -> Result<(), String> {
    let fits = text
        .bytes()
        .all(|letter| letter.is_ascii_alphanumeric() || letter == b'_');
    if fits && !text.is_empty() && !text.starts_with(|letter: char| letter.is_ascii_digit()) {
        Ok(())
    } else {
        let text = shown(text);
        Err(format!(
            "`{text}` cannot be the name of an environment variable"
        ))
    }
}

fn environment(
    table: &Table<'_, '_>,
    options: &Map<String, Json>,
    names: &[&str],
) -> Result<Vec<(String, Template)>, InputError> {
    let mut found = Vec::new();
    for (key, value) in table.values() {
        variable_name(key).map_err(|reason| value.error(reason))?;
        let template = template(&value, names)?;
        check_options_used(&template, None, options, &value)?;
        found.push((key.to_owned(), template));
    }
    Ok(found)
}

/// An option without a default may have no value, so that only a condition can
/// guard its use.
fn check_options_used(
    template: &Template,
    when: Option<&Condition>,
    options: &Map<String, Json>,
    value: &Value<'_, '_>,
) -> Result<(), InputError> {
    for slot in template.slots() {
        let Slot::Option(name) = slot else {
            continue;
        };
        let has_default = options
            .get(name)
            .is_some_and(|option| option.get("default").is_some());
        let guarded = when.is_some_and(|when| *when == Condition::Option(name.clone()));
        if !has_default && !guarded {
            return Err(value
                .error(format!("the option `{name}` has no default"))
                .hint(format!(
                    "give it one, or write {{ when = \"option.{name}\", args = [\"…\"] }}"
                )));
        }
    }
    Ok(())
}

impl Argument {
    fn read(
        value: &Value<'_, '_>,
        options: &Map<String, Json>,
        names: &[&str],
    ) -> Result<Self, InputError> {
        if !value.is_table() {
            let template = template(value, names)?;
            check_options_used(&template, None, options, value)?;
            return Ok(Self {
                when: None,
                templates: vec![template],
            });
        }
        let table = value.table("a conditional argument", &["when", "args"])?;
        let when = table.require("when")?;
        let condition = match when.text()? {
            "memory_mb" => Condition::Memory,
            "nodes" => Condition::Nodes,
            "one_thread" => Condition::OneThread,
            "threads" => Condition::Threads,
            text => match text.strip_prefix("option.") {
                Some(option) if options.contains_key(option) => Condition::Option(option.into()),
                _ => {
                    let reason = format!("\"{}\" is no condition", shown(text));
                    return Err(when.error(reason).hint(
                        "a condition is \"option.NAME\", \"memory_mb\", \"nodes\", \"one_thread\" or \
                         \"threads\"; the option stands in [options]",
                    ));
                }
            },
        };
        let arguments = table.require("args")?;
        let mut templates = Vec::new();
        for argument in arguments.list()? {
            let template = template(&argument, names)?;
            check_options_used(&template, Some(&condition), options, &argument)?;
            templates.push(template);
        }
        Ok(Self {
            when: Some(condition),
            templates,
        })
    }
}

impl Version {
    /// What the version must match, if that is said.
    pub(super) fn supported(&self) -> Option<&(String, Regex)> {
        self.query.as_ref()?.supported.as_ref()
    }

    fn read(value: &Value<'_, '_>) -> Result<Self, InputError> {
        if !value.is_table() {
            let text = value.text()?.to_owned();
            return Ok(Self { text, query: None });
        }
        let keys = ["args", "pattern", "seconds", "otherwise", "supported"];
        let table = value.table("[version]", &keys)?;
        let mut arguments = Vec::new();
        for argument in table.require("args")?.list()? {
            let template = template(&argument, &[])?;
            if template.slots().any(|slot| *slot != Slot::ManifestDir) {
                return Err(argument.error("here the only placeholder is `{manifest_dir}`"));
            }
            arguments.push(template);
        }
        let seconds = match table.get("seconds") {
            Some(value) => value.integer(1, 30)?,
            None => 5,
        };
        let supported = match table.get("supported") {
            Some(value) => {
                pattern(&value, 0)?;
                let text = value.nonempty()?;
                let whole = Regex::new(&format!(r"\A(?:{text})\z"));
                let whole = whole.map_err(|_| value.error("the pattern cannot be used"))?;
                Some((text.to_owned(), whole))
            }
            None => None,
        };
        let otherwise = table.get("otherwise");
        if let (Some(_), Some(otherwise)) = (&supported, &otherwise) {
            return Err(otherwise
                .error("`otherwise` lets any program pass, `supported` does not")
                .hint("remove one of them"));
        }
        Ok(Self {
            text: table.text("otherwise")?.unwrap_or_default().to_owned(),
            query: Some(VersionQuery {
                arguments,
                pattern: pattern(&table.require("pattern")?, 1)?,
                limit: Duration::from_secs(seconds as u64),
                supported,
            }),
        })
    }
}

/// The JSON Schema that the options' tables stand for.
fn options(table: &Table<'_, '_>) -> Result<Json, InputError> {
    const KEYS: [&str; 6] = [
        "type",
        "description",
        "default",
        "minimum",
        "maximum",
        "enum",
    ];
    let mut properties = Map::new();
    for ((key, at), (_, value)) in table.keys().zip(table.values()) {
        name(key, "an option", table, at)?;
        let option = value.table(format!("[options.{key}]"), &KEYS)?;
        let kind = option.require("type")?;
        let types = ["integer", "number", "boolean", "string"];
        let kind = kind.choice(&types.map(|name| (name, name)))?;
        let mut property = Map::new();
        property.insert("type".into(), kind.into());
        if let Some(text) = option.text("description")? {
            property.insert("description".into(), text.into());
        }
        for key in ["minimum", "maximum"] {
            let Some(value) = option.get(key) else {
                continue;
            };
            let limit = value.json()?;
            if !limit.is_number() || !matches!(kind, "integer" | "number") {
                return Err(value.error(format!("`{key}` is a number, for options that are")));
            }
            property.insert(key.into(), limit);
        }
        if let Some(value) = option.get("enum") {
            let values = value.list()?;
            if values.is_empty() {
                return Err(value.error("`enum` is empty"));
            }
            let values: Result<Vec<Json>, _> = values.iter().map(Value::json).collect();
            property.insert("enum".into(), values?.into());
        }
        let default = option.get("default");
        if let Some(value) = &default {
            property.insert("default".into(), value.json()?);
        }
        let mut one = Map::new();
        one.insert(key.to_owned(), Json::Object(property.clone()));
        if let Some(value) = default {
            let given = Map::from_iter([(key.to_owned(), value.json()?)]);
            check_options(&given, &schema(&one)).map_err(|error| {
                let fault = value.error(format!("the default of {}", error.reason));
                match error.hint {
                    Some(hint) => fault.hint(hint),
                    None => fault,
                }
            })?;
        }
        properties.insert(key.to_owned(), Json::Object(property));
    }
    Ok(schema(&properties))
}

fn schema(properties: &Map<String, Json>) -> Json {
    serde_json::json!({
        "type": "object",
        "properties": properties,
        "additionalProperties": false,
    })
}

impl Input {
    fn read(value: &Value<'_, '_>) -> Result<Self, InputError> {
        let table = value.table("[input]", &["map", "scen", "letters", "order"])?;
        if let Some(value) = table.get("map") {
            value.choice(&[("movingai", ())])?;
        }
        let choice = |key, choices: &[(&str, bool)]| match table.get(key) {
            Some(value) => value.choice(choices),
            None => Ok(false),
        };
        let row_first = choice("order", &[("x-y", false), ("row-col", true)])?;
        let pibt2 = choice("scen", &[("movingai", false), ("pibt2", true)])?;
        if let (true, Some(order)) = (pibt2, table.get("order")) {
            return Err(order
                .error("the order in instances of pibt2 is fixed")
                .hint("remove `order`; it is for scenarios"));
        }
        Ok(Self {
            all_letters: choice("letters", &[("plain", false), ("all", true)])?,
            agents: if pibt2 {
                AgentsFormat::Pibt2
            } else {
                AgentsFormat::Scenario { row_first }
            },
        })
    }
}

impl Output {
    fn read(value: &Value<'_, '_>) -> Result<Self, InputError> {
        let table = value.table("[output]", &["from", "file", "format", "custom"])?;
        let stdout = match table.get("from") {
            Some(value) => value.choice(&[("file", false), ("stdout", true)])?,
            None => false,
        };
        let file = match (table.get("file"), stdout) {
            (Some(value), true) => {
                return Err(value.error("there is no file: the answer is on standard output"));
            }
            (Some(value), false) => Some(scratch_file(&value)?),
            (None, true) => None,
            (None, false) => Some("output.txt".into()),
        };
        let format = table.require("format")?;
        let formats = Format::ALL.iter().copied();
        let formats = formats.filter(|format| format.carries_plan());
        let mut choices: Vec<_> = formats.map(|named| (named.name(), Some(named))).collect();
        choices.push(("custom", None));
        let written = match (format.choice(&choices)?, table.get("custom")) {
            (Some(named), None) => Written::As(named),
            (None, Some(value)) => Written::So(custom(&value)?.into()),
            (Some(_), Some(value)) => {
                return Err(value
                    .error("the format is a named one, so it is not described")
                    .hint("write `format = \"custom\"`, or remove the table"));
            }
            (None, None) => {
                let named: Vec<_> = choices.iter().map(|(name, _)| *name).collect();
                let named = &named[..named.len() - 1];
                return Err(format
                    .error("a custom format is described in [output.custom]")
                    .hint(format!("add the table, or use one of {}", named.join(", "))));
            }
        };
        Ok(Self { file, written })
    }
}

/// A name in the scratch folder that leads nowhere else.
fn scratch_file(value: &Value<'_, '_>) -> Result<PathBuf, InputError> {
    let text = value.nonempty()?;
    let plain = !text.contains(['/', '\0']) && !matches!(text, "." | ".." | MAP_NAME | SCEN_NAME);
    if plain {
        Ok(text.into())
    } else {
        let reason = format!("\"{}\" is no name for a file of the answer", shown(text));
        Err(value
            .error(reason)
            .hint("it is a name without folders; the file is in `{scratch}`"))
    }
}

fn custom(value: &Value<'_, '_>) -> Result<Layout, InputError> {
    let table = value.table(
        "[output.custom]",
        &[
            "layout",
            "line",
            "order",
            "position",
            "separator",
            "coordinates_from",
            "index_from",
            "skip_lines",
            "begin",
            "end",
            "ignore",
        ],
    )?;
    let major = table.require("layout")?.choice(&[
        ("agent-major", Major::Agent),
        ("time-major", Major::Time),
        ("rows", Major::Row),
    ])?;
    let rows = major == Major::Row;
    let position = match (table.get("order"), table.get("position")) {
        (Some(order), None) => order.choice(&[
            (
                "row-col",
                if rows { "{row},{col}" } else { "({row},{col})" },
            ),
            ("x-y", if rows { "{x},{y}" } else { "({x},{y})" }),
            ("cell", "{cell}"),
        ])?,
        (None, Some(position)) => position.nonempty()?,
        (Some(_), Some(position)) => {
            return Err(position
                .error("`order` and `position` say the same thing")
                .hint("remove one of them"));
        }
        (None, None) => {
            return Err(table
                .error("neither `order` nor `position` says how a position is written")
                .hint("as in `order = \"x-y\"` or `position = \"[{row} {col}]\"`"));
        }
    };
    if let (true, Some(separator)) = (rows, table.get("separator")) {
        return Err(separator
            .error("a row has one position, so nothing stands between positions")
            .hint("remove `separator`; what is between the fields of a row stands in `line`"));
    }
    let line = table.text("line")?.unwrap_or(if rows {
        "{agent},{time},{position}"
    } else {
        "{path}"
    });
    let separator = table.text("separator")?.unwrap_or(",");
    let mut layout = Layout::new(major, line, position, separator).map_err(|error| {
        let fault = match table.get(error.part) {
            Some(value) => value.error(error.reason),
            None => table.error(error.reason),
        };
        fault.hint(error.hint)
    })?;
    let integer = |key, most| match table.get(key) {
        Some(value) => value.integer(0, most),
        None => Ok(0),
    };
    let regex = |key| table.get(key).map(|value| pattern(&value, 0)).transpose();
    layout.coordinates_from = integer("coordinates_from", 1)?;
    layout.index_from = integer("index_from", 1)?;
    layout.skip_lines = integer("skip_lines", 1_000_000)? as u64;
    layout.begin = regex("begin")?.map(Begin::Pattern);
    layout.end = regex("end")?;
    layout.ignore = regex("ignore")?;
    Ok(layout)
}

impl Exit {
    fn read(value: &Value<'_, '_>) -> Result<Self, InputError> {
        let table = value.table("[exit]", &["codes", "patterns"])?;
        let mut exit = Self::default();
        if let Some(codes) = table.get("codes") {
            for (key, value) in codes.names("[exit.codes]")?.values() {
                let code = key
                    .parse::<u8>()
                    .ok()
                    .filter(|code| code.to_string() == key);
                let Some(code) = code else {
                    let reason = format!("`{}` is no exit code", shown(key));
                    return Err(value.error(reason).hint("exit codes are 0 to 255"));
                };
                exit.codes.push((code.into(), value.choice(&STATUSES)?));
            }
        }
        if let Some(patterns) = table.get("patterns") {
            for value in patterns.list()? {
                let keys = ["pattern", "from", "status", "message"];
                let table = value.table("[[exit.patterns]]", &keys)?;
                exit.patterns.push(Rule {
                    pattern: pattern(&table.require("pattern")?, 0)?,
                    from: from(&table)?,
                    status: table.require("status")?.choice(&STATUSES)?,
                    message: table.text("message")?.map(str::to_owned),
                });
            }
        }
        Ok(exit)
    }
}

fn from(table: &Table<'_, '_>) -> Result<Searched, InputError> {
    match table.get("from") {
        Some(value) => value.choice(&FROM),
        None => Ok(Searched::Log),
    }
}

fn metrics(table: &Table<'_, '_>) -> Result<Vec<Metric>, InputError> {
    let mut found = Vec::new();
    for ((key, at), (_, value)) in table.keys().zip(table.values()) {
        name(key, "a figure", table, at)?;
        let metric = value.table(format!("[metrics.{key}]"), &["pattern", "from", "unit"])?;
        let mut full_name = key.to_owned();
        if let Some(value) = metric.get("unit") {
            let unit = value.nonempty()?;
            name(unit, "a unit", &metric, 0).map_err(|_| {
                value
                    .error(format!("\"{}\" is no unit", shown(unit)))
                    .hint("as in \"ms\", \"s\", \"mb\" or \"steps\"")
            })?;
            full_name = format!("{key}_{unit}");
        }
        found.push(Metric {
            name: full_name,
            pattern: pattern(&metric.require("pattern")?, 1)?,
            from: from(&metric)?,
        });
    }
    Ok(found)
}

fn capabilities(value: &Value<'_, '_>) -> Result<Capabilities, InputError> {
    /// What a solver behind an adapter can show.
    const ALLOWED: [Capability; 6] = [
        Capability::EightConnected,
        Capability::DuplicateGoals,
        Capability::CollidingPlans,
        Capability::KRobust,
        Capability::Deterministic,
        Capability::Threads,
    ];
    let table = value.names("[capabilities]")?;
    let mut claimed = vec![Capability::Grid, Capability::Pebble];
    let mut first_fault: Option<(usize, InputError)> = None;
    for ((key, at), (_, value)) in table.keys().zip(table.values()) {
        if let Some(capability) = ALLOWED.iter().find(|known| known.as_str() == key) {
            if value.flag()? {
                claimed.push(*capability);
            }
        } else if first_fault.as_ref().is_none_or(|(first, _)| at < *first) {
            let names = ALLOWED.map(Capability::as_str).join(", ");
            let known = Capability::ALL.iter().any(|known| known.as_str() == key);
            let reason = if known {
                format!("an adapter cannot claim `{key}`")
            } else {
                format!("unknown capability `{}`", shown(key))
            };
            let fault = table.document.error(at, reason);
            first_fault = Some((at, fault.hint(format!("it may claim {names}"))));
        }
    }
    match first_fault {
        Some((_, fault)) => Err(fault),
        None => Ok(Capabilities::of(&claimed)),
    }
}

fn files(value: &Value<'_, '_>) -> Result<Vec<PathBuf>, InputError> {
    let table = value.table("[files]", &["read"])?;
    let mut found = Vec::new();
    if let Some(list) = table.get("read") {
        for value in list.list()? {
            let text = value.nonempty()?;
            if text.contains('\0') {
                return Err(value.error("a NUL character cannot be part of a path"));
            }
            found.push(Path::new(text).to_owned());
        }
    }
    Ok(found)
}
