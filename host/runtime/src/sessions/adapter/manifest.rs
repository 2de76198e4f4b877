//! The manifest, `planner.toml`: read strictly, so that a mistake is found where
//! it was made and not in a run. `docs/adapters.md` is its reference.

use std::path::{Path, PathBuf};
use std::time::Duration;

use fleetyard_abi::{Capabilities, Capability, Status};
use fleetyard_core::document::{self, Fault, Place, Value, between, nonempty, not_empty, text};
use fleetyard_core::formats::{Begin, Format, Known, Layout, Major, MapSize};
use fleetyard_core::json::with_hint;
use fleetyard_core::{GridPlan, InputError, shown, unmarked};
use regex::bytes::{Regex, RegexBuilder};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Number, Value as Json};

use super::input::{Input, ProblemInput, answer_file};
use super::template::{Slot, Template};
use crate::options::check_options;
use crate::sessions::identity::is_identifier;

/// The largest manifest that is read, in bytes.
pub const MANIFEST_LIMIT: u64 = 1 << 20;

/// The version of the manifest's format.
pub(crate) const FORMAT: u64 = 1;

/// The content of a `planner.toml`.
#[derive(Debug, Clone)]
pub struct Manifest {
    pub(super) head: Head,
    pub(super) version: Version,
    pub(super) program: Program,
    /// JSON Schema of the options; null when there are none.
    pub(super) options: Json,
    pub(super) input: Input,
    pub(super) output: Output,
    pub(super) exit: Exit,
    pub(super) metrics: Vec<Metric>,
    pub(super) capabilities: Capabilities,
}

/// The keys of a manifest of which each stands for itself.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Head {
    /// The version of the format.
    #[serde(rename = "manifest", deserialize_with = "format")]
    _format: (),
    #[serde(deserialize_with = "id")]
    pub(super) id: String,
    #[serde(default)]
    pub(super) name: String,
    #[serde(default)]
    pub(super) description: String,
    #[serde(default)]
    pub(super) license: String,
    #[serde(default)]
    pub(super) homepage: String,
    #[serde(default)]
    pub(super) files: Files,
}

/// Files besides the solver itself and the manifest's folder.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Files {
    #[serde(deserialize_with = "paths")]
    pub(super) read: Vec<PathBuf>,
}

/// The program of a solver, and its start.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Program {
    #[serde(deserialize_with = "path")]
    pub(super) command: String,
    /// Place of `command`, for messages.
    #[serde(skip)]
    pub(super) place: Place,
    /// An environment variable that may name the program.
    #[serde(default, deserialize_with = "variable")]
    pub(super) variable: Option<String>,
    #[serde(skip)]
    pub(super) arguments: Vec<Argument>,
    #[serde(skip)]
    pub(super) environment: Vec<(String, Template)>,
    #[serde(default, deserialize_with = "working_folder")]
    pub(super) cwd: Option<Template>,
    /// Advice on installing it.
    pub(super) install: Option<String>,
    /// Kept back from the budget to read the answer.
    #[serde(default, deserialize_with = "milliseconds", rename = "reserve_ms")]
    pub(super) reserve: Option<Duration>,
    /// The same in nanoseconds per agent and free cell, for what the solver does before
    /// its own clock starts.
    #[serde(
        default,
        deserialize_with = "between::<0, 1_000_000, u64, _, _>",
        rename = "reserve_ns_per_agent_cell"
    )]
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
#[derive(Debug, Clone, Default)]
pub(super) struct Version {
    /// As the manifest has it: what is shown unless the solver says better.
    pub(super) text: String,
    pub(super) query: Option<VersionQuery>,
}

/// The query of the solver's version.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct VersionQuery {
    pub(super) args: Vec<VersionArgument>,
    #[serde(deserialize_with = "pattern::<1, _, _>")]
    pub(super) pattern: Regex,
    #[serde(default = "five", deserialize_with = "between::<1, 30, u64, _, _>")]
    pub(super) seconds: u64,
    /// The version that is shown where the solver prints none.
    otherwise: Option<String>,
    /// Pattern of the whole version, as the manifest has it.
    #[serde(default, deserialize_with = "supported")]
    pub(super) supported: Option<(String, Regex)>,
}

/// An argument that needs nothing but the manifest's folder.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct VersionArgument(
    #[serde(deserialize_with = "version_argument")] pub(super) Template,
);

fn five() -> u64 {
    5
}

/// Place and format of the answer.
#[derive(Debug, Clone)]
pub(super) struct Output {
    /// In the scratch folder; absent for standard output.
    pub(super) file: Option<PathBuf>,
    pub(super) written: Written,
}

/// Format of an answer.
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
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Searched {
    /// Standard output and standard error.
    #[default]
    Log,
    Stdout,
    Stderr,
    /// The answer.
    Output,
}

/// Meaning of the end of the solver.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Exit {
    #[serde(skip)]
    pub(super) codes: Vec<(i32, Status)>,
    pub(super) patterns: Vec<Rule>,
}

/// A text that means something.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Rule {
    #[serde(deserialize_with = "pattern::<0, _, _>")]
    pub(super) pattern: Regex,
    #[serde(default)]
    pub(super) from: Searched,
    pub(super) status: Status,
    pub(super) message: Option<String>,
}

/// A figure in a text.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Metric {
    /// With its unit.
    #[serde(skip)]
    pub(super) name: String,
    #[serde(deserialize_with = "pattern::<1, _, _>")]
    pub(super) pattern: Regex,
    #[serde(default)]
    pub(super) from: Searched,
    #[serde(default, deserialize_with = "unit")]
    unit: Option<String>,
}

impl Manifest {
    /// Reads a manifest; `source` is its name in errors.
    pub fn read(text: &str, source: &str) -> Result<Self, InputError> {
        if text.len() as u64 > MANIFEST_LIMIT {
            let reason = format!("a manifest has at most {MANIFEST_LIMIT} bytes");
            return Err(InputError::new(source, reason));
        }
        document::read(source, text, &[], |root| {
            let head: Head = root.clone().apart(&Self::APART).read()?;
            let options = root.optional("options", options)?.unwrap_or_default();
            let program = root.require("program")?;
            if let Some(variable) = program.get("variable") {
                variable.text(|name| own_variable(name, &head.id))?;
            }
            let properties = Options::of(&options);
            let input = root.optional("input", |input| Input::read(input, &properties))?;
            let input = input.unwrap_or_default();
            let output = Output::read(&root.require("output")?, &input)?;
            let claimed = root.optional("capabilities", |table| claims(table, &input.problem))?;
            let capabilities = input.problem.capabilities();
            Ok(Self {
                head,
                version: root.optional("version", Version::read)?.unwrap_or_default(),
                program: Program::read(&program, &properties, &input, &output)?,
                input,
                output,
                options,
                exit: root.optional("exit", Exit::read)?.unwrap_or_default(),
                metrics: root.optional("metrics", metrics)?.unwrap_or_default(),
                capabilities: capabilities.with(claimed.unwrap_or_default()),
            })
        })
    }

    /// The keys beside those of [`Head`]: a table may say more than its type does.
    const APART: [&str; 8] = [
        "version",
        "program",
        "options",
        "input",
        "output",
        "exit",
        "metrics",
        "capabilities",
    ];

    /// Identifier of the planner.
    pub fn id(&self) -> &str {
        &self.head.id
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
        let answer = unmarked(&source, answer)?;
        let format = match &self.output.written {
            Written::So(layout) => return layout.read(&source, answer, size, Some(agents)),
            Written::As(format) => *format,
        };
        let file = format.read_plan(&source, answer, Known::size(Some(size)), Some(agents))?;
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

/// Reads the version of the format.
fn format<'de, D: Deserializer<'de>>(deserializer: D) -> Result<(), D::Error> {
    let version: u64 = between::<1, { i64::MAX as u64 }, u64, _, _>(deserializer)?;
    if version == FORMAT {
        return Ok(());
    }
    let hint = format!("this host reads manifests with `manifest = {FORMAT}`");
    let reason = "this manifest is written for a newer host";
    Err(with_hint(&reason, Some(&hint)))
}

fn id<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    text(deserializer, "", |text| {
        if is_identifier(text) {
            return Ok(text.to_owned());
        }
        let fault = Fault::new(format!("\"{}\" is no identifier", shown(text)));
        Err(fault.hint("it begins with a-z or 0-9 and goes on with a-z, 0-9, '.', '_' and '-'"))
    })
}

/// A name as part of a placeholder or a figure.
fn name(text: &str, what: &str) -> Result<String, Fault> {
    if is_identifier(text) {
        return Ok(text.to_owned());
    }
    let fault = Fault::new(format!("it cannot be the name of {what}"));
    Err(fault.hint("a name begins with a-z or 0-9 and goes on with a-z, 0-9, '.', '_' and '-'"))
}

/// The name of an environment variable.
fn variable_name(text: &str) -> Result<String, Fault> {
    let fits = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
    if text.is_empty()
        || !text.chars().all(fits)
        || text.starts_with(|letter: char| letter.is_ascii_digit())
    {
        let text = shown(text);
        let reason = format!("`{text}` cannot be the name of an environment variable");
        return Err(Fault::new(reason));
    }
    Ok(text.to_owned())
}

/// The name of a variable that is this planner's: its value is given to the planner, and whatever else the
/// host's user has in the environment is none of its business.
fn own_variable(text: &str, id: &str) -> Result<(), Fault> {
    let capital = |letter: char| match letter {
        'a'..='z' | '0'..='9' => letter.to_ascii_uppercase(),
        _ => '_',
    };
    let own: String = id.chars().map(capital).collect();
    variable_name(text)?;
    let rest = text.strip_prefix(&own);
    if rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('_')) {
        return Ok(());
    }
    let reason = format!("`{}` is no variable of `{id}`", shown(text));
    Err(Fault::new(reason).hint(format!(
        "call it {own}, or something that begins with {own}_"
    )))
}

fn variable<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<String>, D::Error> {
    text(deserializer, "", |text| variable_name(not_empty(text)?)).map(Some)
}

fn path<'de, D: Deserializer<'de>, T: From<String>>(deserializer: D) -> Result<T, D::Error> {
    text(deserializer, "", |text| match not_empty(text)? {
        text if text.contains('\0') => Err(Fault::new("a NUL character cannot be part of a path")),
        text => Ok(text.to_owned().into()),
    })
}

fn paths<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<PathBuf>, D::Error> {
    #[derive(Deserialize)]
    struct Item(#[serde(deserialize_with = "path")] PathBuf);
    let items: Vec<Item> = Vec::deserialize(deserializer)?;
    Ok(items.into_iter().map(|item| item.0).collect())
}

fn milliseconds<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Duration>, D::Error> {
    let number: u64 = between::<0, 60_000, u64, _, _>(deserializer)?;
    Ok(Some(Duration::from_millis(number)))
}

fn working_folder<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<Template>, D::Error> {
    text(deserializer, "", |text| {
        let template = template(text, &[])?;
        let fits = |slot: &Slot| matches!(slot, Slot::Scratch | Slot::ManifestDir);
        if template.slots().all(fits) {
            return Ok(Some(template));
        }
        let reason = "the working folder is made from `{scratch}` and `{manifest_dir}`";
        Err(Fault::new(reason))
    })
}

/// A pattern with so many groups, none of them optional to say.
fn regex(text: &str, groups: usize) -> Result<Regex, Fault> {
    const LONGEST: usize = 1000;
    if not_empty(text)?.len() > LONGEST {
        return Err(Fault::new(format!("a pattern has at most {LONGEST} bytes")));
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
            Fault::new(format!("the pattern cannot be used: {reason}"))
                .hint("patterns are regular expressions as the Rust crate `regex` reads them")
        })?;
    let found = regex.captures_len() - 1;
    if found != groups {
        let reason = format!("the pattern has {found} groups in parentheses, expected {groups}");
        return Err(Fault::new(reason).hint(match groups {
            0 => "write (?:…) for a group that is not taken out",
            _ => "one group takes out the value; write (?:…) for others",
        }));
    }
    Ok(regex)
}

fn pattern<'de, const GROUPS: usize, T: From<Regex>, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<T, D::Error> {
    text(deserializer, "", |text| Ok(regex(text, GROUPS)?.into()))
}

fn template(text: &str, options: &[&str]) -> Result<Template, Fault> {
    if text.contains('\0') {
        return Err(Fault::new("a NUL character cannot be part of an argument"));
    }
    Template::parse(text, options).map_err(|error| Fault::new(error.reason).hint(error.hint))
}

/// The options of a planner, which placeholders and conditions name.
pub(super) struct Options<'o>(Option<&'o Map<String, Json>>);

impl<'o> Options<'o> {
    /// Those of a JSON Schema.
    fn of(schema: &'o Json) -> Self {
        Self(schema.get("properties").and_then(Json::as_object))
    }

    fn get(&self, name: &str) -> Option<&Json> {
        self.0?.get(name)
    }

    /// A template. An option without a default may have no value, so that only a condition
    /// can guard its use.
    pub(super) fn template(
        &self,
        value: &Value<'_>,
        when: Option<&Condition>,
    ) -> Result<Template, InputError> {
        let names = self.0.into_iter().flat_map(Map::keys);
        let names: Vec<&str> = names.map(String::as_str).collect();
        let template = value.text(|text| template(text, &names))?;
        for slot in template.slots() {
            let Slot::Option(name) = slot else {
                continue;
            };
            let default = self.get(name).and_then(|option| option.get("default"));
            let guarded = matches!(when, Some(Condition::Option(guard)) if guard == name);
            if default.is_none() && !guarded {
                let reason = format!("the option `{name}` has no default");
                return Err(value.error(reason).hint(format!(
                    "give it one, or write {{ when = \"option.{name}\", args = [\"…\"] }}"
                )));
            }
        }
        Ok(template)
    }

    fn argument(&self, value: &Value<'_>) -> Result<Argument, InputError> {
        if !value.is_table() {
            return Ok(Argument {
                when: None,
                templates: vec![self.template(value, None)?],
            });
        }
        value.only(&["when", "args"])?;
        let when = value.require("when")?.text(|text| self.condition(text))?;
        let templates = value.require("args")?.list()?;
        let templates = templates
            .iter()
            .map(|item| self.template(item, Some(&when)));
        Ok(Argument {
            templates: templates.collect::<Result<_, _>>()?,
            when: Some(when),
        })
    }

    fn condition(&self, text: &str) -> Result<Condition, Fault> {
        match (text, text.strip_prefix("option.")) {
            ("memory_mb", _) => Ok(Condition::Memory),
            ("nodes", _) => Ok(Condition::Nodes),
            ("one_thread", _) => Ok(Condition::OneThread),
            ("threads", _) => Ok(Condition::Threads),
            (_, Some(name)) if self.get(name).is_some() => Ok(Condition::Option(name.into())),
            _ => Err(
                Fault::new(format!("\"{}\" is no condition", shown(text))).hint(
                    "a condition is \"option.NAME\", \"memory_mb\", \"nodes\", \"one_thread\" or \
                     \"threads\"; the option stands in [options]",
                ),
            ),
        }
    }
}

impl Program {
    fn read(
        table: &Value<'_>,
        options: &Options<'_>,
        input: &Input,
        output: &Output,
    ) -> Result<Self, InputError> {
        let mut program: Self = table.clone().apart(&["args", "env"]).read()?;
        program.place = table.require("command")?.place();
        let arguments = table.require("args")?.list()?;
        let arguments = arguments.iter().map(|argument| options.argument(argument));
        program.arguments = arguments.collect::<Result<_, _>>()?;
        if let Some(environment) = table.get("env") {
            for (name, value) in environment.entries()? {
                let name = name.text(variable_name)?;
                let template = options.template(&value, None)?;
                program.environment.push((name, template));
            }
        }
        program.check_use(input, output, table)?;
        Ok(program)
    }

    /// Refuses a program that is not told what to solve, or not where to write.
    fn check_use(
        &self,
        input: &Input,
        output: &Output,
        table: &Value<'_>,
    ) -> Result<(), InputError> {
        let arguments = self
            .arguments
            .iter()
            .flat_map(|argument| &argument.templates);
        let environment = self.environment.iter().map(|(_, template)| template);
        let files = input.files.iter().map(|(_, template)| template);
        let used: Vec<&Slot> = (arguments.chain(environment).chain(files))
            .flat_map(Template::slots)
            .collect();
        let known = input.problem.slots();
        if let Some((slot, _)) = known
            .iter()
            .find(|(slot, needed)| *needed && !used.contains(&slot))
        {
            return Err(table
                .error(format!("no argument uses `{{{}}}`", slot.name()))
                .hint("the solver needs the names of its input's files to know what to solve"));
        }
        let other = |slot: &&&Slot| slot.is_problem() && known.iter().all(|own| own.0 != ***slot);
        if let Some(slot) = used.iter().find(other) {
            let own: Vec<String> = known
                .iter()
                .map(|(own, _)| format!("`{{{}}}`", own.name()))
                .collect();
            return Err(table
                .error(format!("`{{{}}}` is no file of this input", slot.name()))
                .hint(format!("its files are {}", own.join(" and "))));
        }
        if used.contains(&&Slot::Output) && output.file.is_none() {
            return Err(table
                .error("an argument uses `{output}`, but the answer is on standard output")
                .hint("name other files as in `{scratch}/stats.csv`"));
        }
        Ok(())
    }
}

fn version_argument<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Template, D::Error> {
    text(deserializer, "", |text| {
        let template = template(text, &[])?;
        if template.slots().any(|slot| *slot != Slot::ManifestDir) {
            return Err(Fault::new("here the only placeholder is `{manifest_dir}`"));
        }
        Ok(template)
    })
}

/// A pattern and the same for a whole text.
fn supported<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<(String, Regex)>, D::Error> {
    text(deserializer, "", |text| {
        regex(text, 0)?;
        let whole = Regex::new(&format!(r"\A(?:{text})\z"));
        let whole = whole.map_err(|_| Fault::new("the pattern cannot be used"))?;
        Ok(Some((text.to_owned(), whole)))
    })
}

impl Version {
    /// Pattern of the version, if there is one.
    pub(super) fn supported(&self) -> Option<&(String, Regex)> {
        self.query.as_ref()?.supported.as_ref()
    }

    fn read(value: &Value<'_>) -> Result<Self, InputError> {
        if !value.is_table() {
            let text = value.read()?;
            return Ok(Self { text, query: None });
        }
        let query: VersionQuery = value.read()?;
        if query.supported.is_some() && query.otherwise.is_some() {
            let reason = "`otherwise` lets any program pass, `supported` does not";
            return Err(value
                .error_at("otherwise", reason)
                .hint("remove one of them"));
        }
        Ok(Self {
            text: query.otherwise.clone().unwrap_or_default(),
            query: Some(query),
        })
    }
}

/// A table of `[options]`, and its JSON Schema.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct OptionTable {
    r#type: OptionType,
    #[serde(skip_serializing_if = "Option::is_none")]
    description: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    default: Option<Scalar>,
    #[serde(skip_serializing_if = "Option::is_none")]
    minimum: Option<Number>,
    #[serde(skip_serializing_if = "Option::is_none")]
    maximum: Option<Number>,
    #[serde(skip_serializing_if = "Option::is_none")]
    r#enum: Option<Vec<Scalar>>,
}

#[derive(Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
enum OptionType {
    Integer,
    Number,
    Boolean,
    String,
}

#[derive(Clone, Deserialize, Serialize)]
#[serde(untagged, expecting = "it is neither a string, a number nor a boolean")]
enum Scalar {
    Boolean(bool),
    Number(Number),
    Text(String),
}

/// The JSON Schema that the options' tables stand for.
fn options(table: &Value<'_>) -> Result<Json, InputError> {
    let mut properties = Map::new();
    for (key, value) in table.entries()? {
        let name = key.text(|text| name(text, "an option"))?;
        let option: OptionTable = value.read()?;
        let numeric = matches!(option.r#type, OptionType::Integer | OptionType::Number);
        for limit in ["minimum", "maximum"] {
            if let Some(given) = value.get(limit).filter(|_| !numeric) {
                let reason = format!("`{limit}` is a number, for options that are");
                return Err(given.error(reason));
            }
        }
        if option.r#enum.as_ref().is_some_and(Vec::is_empty) {
            return Err(value.error_at("enum", "`enum` is empty"));
        }
        let property = serde_json::json!({ name.as_str(): &option });
        if let Some(default) = &option.default {
            let given = Map::from_iter([(name.clone(), serde_json::json!(default))]);
            check_options(&given, &schema(&property)).map_err(|error| {
                let reason = format!("the default of {}", error.reason);
                let fault = value.error_at("default", reason);
                match error.hint {
                    Some(hint) => fault.hint(hint),
                    None => fault,
                }
            })?;
        }
        properties.insert(name, serde_json::json!(option));
    }
    Ok(schema(&properties.into()))
}

fn schema(properties: &Json) -> Json {
    serde_json::json!({
        "type": "object",
        "properties": properties,
        "additionalProperties": false,
    })
}

/// `[output]`
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OutputTable {
    #[serde(default)]
    from: AnswerIn,
    #[serde(default, deserialize_with = "answer_file")]
    file: Option<PathBuf>,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum AnswerIn {
    #[default]
    File,
    Stdout,
}

/// The word for a format that the manifest describes.
const CUSTOM: &str = "custom";

/// The format of an answer by its name; none where the manifest describes it.
fn answer_format(text: &str, problem: &ProblemInput) -> Result<Option<Format>, Fault> {
    let takes = |format: &&Format| problem.takes(**format);
    let found = Format::by_name(text).filter(|format| problem.takes(*format));
    let described = matches!(problem, ProblemInput::Grid(_));
    match found {
        Some(format) => Ok(Some(format)),
        None if text == CUSTOM && described => Ok(None),
        None => {
            let formats = Format::ALL.iter().filter(takes);
            let mut names: Vec<&str> = formats.map(|format| format.name()).collect();
            names.extend(described.then_some(CUSTOM));
            Err(Fault::word(text, &names))
        }
    }
}

impl Output {
    fn read(table: &Value<'_>, input: &Input) -> Result<Self, InputError> {
        let said: OutputTable = table.clone().apart(&["format", CUSTOM]).read()?;
        let format = table.require("format")?;
        let format = format.text(|text| answer_format(text, &input.problem))?;
        let file = match (said.from, said.file) {
            (AnswerIn::Stdout, Some(_)) => {
                let reason = "there is no file: the answer is on standard output";
                return Err(table.error_at("file", reason));
            }
            (AnswerIn::Stdout, None) => None,
            (AnswerIn::File, file) => Some(file.unwrap_or_else(|| "output.txt".into())),
        };
        let taken = |file: &PathBuf| input.files.iter().any(|(name, _)| file == Path::new(name));
        if let Some(file) = file.as_ref().filter(|file| taken(file)) {
            let reason = format!("{} is a file of the input", file.display());
            return Err(table.error_at("file", reason).hint("name another file"));
        }
        let written = match (format, table.get(CUSTOM)) {
            (Some(named), None) => Written::As(named),
            (None, Some(described)) => Written::So(custom(&described)?.into()),
            (Some(_), Some(described)) => {
                return Err(described
                    .error("the format is a named one, so it is not described")
                    .hint("write `format = \"custom\"`, or remove the table"));
            }
            (None, None) => {
                let formats = Format::ALL.iter();
                let named = formats.filter(|format| input.problem.takes(**format));
                let named: Vec<&str> = named.map(|format| format.name()).collect();
                return Err(table
                    .error_at("format", "a custom format is described in [output.custom]")
                    .hint(format!("add the table, or use one of {}", named.join(", "))));
            }
        };
        Ok(Self { file, written })
    }
}

/// `[output.custom]`
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CustomTable {
    layout: Major,
    line: Option<String>,
    order: Option<PositionOrder>,
    #[serde(default, deserialize_with = "nonempty")]
    position: Option<String>,
    separator: Option<String>,
    #[serde(default, deserialize_with = "between::<0, 1, u32, _, _>")]
    coordinates_from: i64,
    #[serde(default, deserialize_with = "between::<0, 1, u32, _, _>")]
    index_from: i64,
    #[serde(default, deserialize_with = "between::<0, 1_000_000, u64, _, _>")]
    skip_lines: u64,
    #[serde(default, deserialize_with = "pattern::<0, _, _>")]
    begin: Option<Regex>,
    #[serde(default, deserialize_with = "pattern::<0, _, _>")]
    end: Option<Regex>,
    #[serde(default, deserialize_with = "pattern::<0, _, _>")]
    ignore: Option<Regex>,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum PositionOrder {
    RowCol,
    XY,
    Cell,
}

fn custom(table: &Value<'_>) -> Result<Layout, InputError> {
    let said: CustomTable = table.read()?;
    let rows = said.layout == Major::Row;
    let position = match (&said.order, &said.position) {
        (Some(order), None) => match (order, rows) {
            (PositionOrder::RowCol, true) => "{row},{col}",
            (PositionOrder::RowCol, false) => "({row},{col})",
            (PositionOrder::XY, true) => "{x},{y}",
            (PositionOrder::XY, false) => "({x},{y})",
            (PositionOrder::Cell, _) => "{cell}",
        },
        (None, Some(position)) => position,
        (Some(_), Some(_)) => {
            return Err(table
                .error_at("position", "`order` and `position` say the same thing")
                .hint("remove one of them"));
        }
        (None, None) => {
            return Err(table
                .error("neither `order` nor `position` says how a position is written")
                .hint("as in `order = \"x-y\"` or `position = \"[{row} {col}]\"`"));
        }
    };
    if rows && said.separator.is_some() {
        let reason = "a row has one position, so nothing stands between positions";
        return Err(table
            .error_at("separator", reason)
            .hint("remove `separator`; what is between the fields of a row stands in `line`"));
    }
    let usual = if rows {
        "{agent},{time},{position}"
    } else {
        "{path}"
    };
    let line = said.line.as_deref().unwrap_or(usual);
    let separator = said.separator.as_deref().unwrap_or(",");
    let mut layout = Layout::new(said.layout, line, position, separator)
        .map_err(|error| table.error_at(error.part, error.reason).hint(error.hint))?;
    layout.coordinates_from = said.coordinates_from;
    layout.index_from = said.index_from;
    layout.skip_lines = said.skip_lines;
    layout.begin = said.begin.map(Begin::Pattern);
    layout.end = said.end;
    layout.ignore = said.ignore;
    Ok(layout)
}

impl Exit {
    fn read(table: &Value<'_>) -> Result<Self, InputError> {
        let mut exit: Self = table.clone().apart(&["codes"]).read()?;
        if let Some(codes) = table.get("codes") {
            for (code, status) in codes.entries()? {
                let code = code.text(exit_code)?;
                exit.codes.push((code, status.read()?));
            }
        }
        Ok(exit)
    }
}

fn exit_code(text: &str) -> Result<i32, Fault> {
    let code = text.parse::<u8>().ok();
    match code.filter(|code| code.to_string() == text) {
        Some(code) => Ok(code.into()),
        None => Err(Fault::new("it is no exit code").hint("exit codes are 0 to 255")),
    }
}

fn unit<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<String>, D::Error> {
    text(deserializer, "", |text| {
        if is_identifier(not_empty(text)?) {
            return Ok(Some(text.to_owned()));
        }
        let fault = Fault::new(format!("\"{}\" is no unit", shown(text)));
        Err(fault.hint("as in \"ms\", \"s\", \"mb\" or \"steps\""))
    })
}

fn metrics(table: &Value<'_>) -> Result<Vec<Metric>, InputError> {
    let mut found = Vec::new();
    for (key, value) in table.entries()? {
        let name = key.text(|text| name(text, "a figure"))?;
        let mut metric: Metric = value.read()?;
        metric.name = match &metric.unit {
            Some(unit) => format!("{name}_{unit}"),
            None => name,
        };
        found.push(metric);
    }
    Ok(found)
}

/// The capabilities that a manifest claims beside those of its input.
fn claims(table: &Value<'_>, problem: &ProblemInput) -> Result<Capabilities, InputError> {
    let mut claimed = Vec::new();
    for (key, value) in table.entries()? {
        let capability = key.text(|text| claim(text, problem.claims()))?;
        if value.read()? {
            claimed.push(capability);
        }
    }
    Ok(Capabilities::of(&claimed))
}

fn claim(text: &str, claims: &[Capability]) -> Result<Capability, Fault> {
    let named = |known: &&Capability| known.as_str() == text;
    if let Some(claim) = claims.iter().find(named) {
        return Ok(*claim);
    }
    let names: Vec<&str> = claims.iter().map(|claim| claim.as_str()).collect();
    let reason = if Capability::ALL.iter().any(|known| named(&known)) {
        format!("an adapter cannot claim `{text}`")
    } else {
        format!("unknown capability `{}`", shown(text))
    };
    Err(Fault::new(reason).hint(format!("it may claim {}", names.join(", "))))
}
