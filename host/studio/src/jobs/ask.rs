//! Requests for jobs, and the command lines that they become.
//!
//! A word of a command line is never a page's own text: it is a name that is known here, or a number
//! or a word that was read and is written again. No shell reads it.

use fleetyard_bench::Robots;
use fleetyard_core::words;
use fleetyard_runtime::Level;
use fleetyard_sim::motion::PRESETS;
use fleetyard_sim::noise::{Delay, Messages, TwistNoise, VelocityNoise};
use fleetyard_sim::{Policy, Tier};
use fleetyard_views::Representation;
use serde::Deserialize;
use serde_json::{Map, Value};

use crate::answer::{Refused, Result};
use crate::planners::Planner;

/// Files that commands write into the folder of a job.
pub(crate) const PLAN: &str = "plan.json";
pub(crate) const TRACE: &str = "execution.trace";
pub(crate) const ANNOTATIONS: &str = "annotations.json";
pub(crate) const RECORDING: &str = "fleet.jsonl";

/// A day.
const LONGEST_MS: u64 = 86_400_000;
/// Most robots of a fleet.
const MOST_ROBOTS: u32 = 100_000;
/// Largest side of a cell in metres.
const LARGEST_CELL_M: f64 = 1e3;
/// Least and most memory of a planner, in bytes.
const MEMORY: std::ops::RangeInclusive<u64> = 1 << 20..=1 << 46;

/// A request for a job: one of its kinds, and the group of jobs that are shown side by side.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a job: an object with run, simulate or fleet"
)]
pub struct Asked {
    run: Option<Run>,
    simulate: Option<Simulate>,
    fleet: Option<Fleet>,
    /// Jobs with the same number are shown side by side.
    pub(crate) group: Option<u32>,
}

/// A planner is to plan.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Run {
    planner: String,
    #[serde(default)]
    options: Map<String, Value>,
    view: Option<Representation>,
    budget_ms: u64,
    memory: Option<u64>,
    sandbox: Option<Level>,
    #[serde(default)]
    seed: u64,
    #[serde(default)]
    annotations: bool,
    execute: Option<Conduct>,
}

/// The plan of a job is to be executed.
#[derive(Debug, Clone, PartialEq, Deserialize)]
struct Simulate {
    plan: u32,
    /// The keys of a [`Conduct`], which refuses others.
    #[serde(flatten)]
    conduct: Map<String, Value>,
}

impl Simulate {
    fn conduct(&self) -> serde_json::Result<Conduct> {
        Conduct::deserialize(Value::Object(self.conduct.clone()))
    }
}

/// The terms of an execution.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Conduct {
    policy: Option<Policy>,
    tier: Option<Tier>,
    delay: Option<String>,
    velocity_noise: Option<String>,
    messages: Option<String>,
    twist_noise: Option<String>,
    seed: Option<u64>,
}

/// A fleet is to drive on and on.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Fleet {
    planner: String,
    #[serde(default)]
    options: Map<String, Value>,
    agents: u32,
    duration_s: f64,
    model: Option<String>,
    /// That of the document's map or grid where none is given.
    cell_size_m: Option<f64>,
    /// The time limit of a call.
    limit_ms: Option<u64>,
    delay: Option<String>,
    #[serde(default)]
    seed: u64,
    /// It goes on in step with the clock, and takes commands.
    #[serde(default)]
    live: bool,
}

/// The kinds of jobs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Run,
    Simulate,
    Fleet,
}

words!(Kind {
    Run = "run";
    Simulate = "simulate";
    Fleet = "fleet";
});

/// A command of a job.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Command {
    pub(crate) kind: Kind,
    /// Its arguments, the name of the command first.
    pub(crate) words: Vec<String>,
    /// It prints lines while it goes on, and hears commands.
    pub(crate) live: bool,
}

/// The things that a request can be about.
#[derive(Clone, Copy)]
pub(crate) struct Given<'a> {
    pub(crate) planners: &'a [Planner],
    /// The files of the document in the folder of the job.
    pub(crate) task: &'a str,
    /// Its map, or that of its grid.
    pub(crate) map: &'a str,
    /// The side of a cell of that, in metres.
    pub(crate) cell_m: f64,
    /// The map is the grid of a world, whose cells are as large as its own robots are.
    pub(crate) is_grid: bool,
    /// Parameters of views, as the document has them.
    pub(crate) views: &'a Value,
    /// The arguments that say which plugins may run.
    pub(crate) trust: &'a [String],
    /// The view of the plan of a job, if it has one.
    pub(crate) view_of: &'a dyn Fn(u32) -> Result<Representation>,
}

/// A request that was looked through.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Order {
    pub(crate) kind: Kind,
    pub(crate) planner: Option<String>,
    pub(crate) view: Option<Representation>,
    /// The job whose plan is needed.
    pub(crate) plan_of: Option<u32>,
    /// The name of the file of which the plan is, if it was opened.
    pub(crate) opened: Option<String>,
    pub(crate) commands: Vec<Command>,
}

impl Asked {
    /// Reads a request.
    pub fn read(bytes: &[u8]) -> std::result::Result<Self, String> {
        let asked: Self = serde_json::from_slice(bytes).map_err(|error| error.to_string())?;
        if let Some(simulate) = &asked.simulate {
            simulate.conduct().map_err(|error| error.to_string())?;
        }
        Ok(asked)
    }

    /// The request to execute the plan of a job as usual.
    pub(crate) fn execution(plan: u32) -> Self {
        Self {
            run: None,
            simulate: Some(Simulate {
                plan,
                conduct: Map::new(),
            }),
            fleet: None,
            group: None,
        }
    }

    /// The command that executes a plan with arguments that were made here: on a task's view, or on a map.
    pub(crate) fn kept(given: &Given<'_>, view: Representation, terms: &[String]) -> Order {
        let mut line = Line::new("simulate");
        line.words.push(PLAN.into());
        if given.map.is_empty() {
            line.pair("--task", given.task);
            line.view(view, given.views);
        } else {
            line.pair("--map", given.map);
        }
        line.words.extend(terms.iter().cloned());
        line.pair("--trace", TRACE);
        Order {
            kind: Kind::Simulate,
            planner: None,
            view: Some(view),
            plan_of: None,
            opened: None,
            commands: vec![line.command(Kind::Simulate)],
        }
    }

    /// The kind of the job, if it is one.
    pub(crate) fn kind(&self) -> Result<Kind> {
        match (&self.run, &self.simulate, &self.fleet) {
            (Some(_), None, None) => Ok(Kind::Run),
            (None, Some(_), None) => Ok(Kind::Simulate),
            (None, None, Some(_)) => Ok(Kind::Fleet),
            _ => Err(Refused::value("a job is one of run, simulate and fleet")),
        }
    }

    /// Makes commands of it, or says what makes no sense.
    pub(crate) fn order(&self, given: &Given<'_>) -> Result<Order> {
        self.kind()?;
        if let Some(run) = &self.run {
            return run.order(given);
        }
        if let Some(simulate) = &self.simulate {
            let view = (given.view_of)(simulate.plan)?;
            let conduct = simulate.conduct();
            let conduct = conduct.map_err(|error| Refused::value(error.to_string()))?;
            return Ok(Order {
                kind: Kind::Simulate,
                planner: None,
                view: Some(view),
                plan_of: Some(simulate.plan),
                opened: None,
                commands: vec![conduct.command(given, view, "/simulate")?],
            });
        }
        self.fleet.as_ref().map_or_else(
            || Err(Refused::unknown("kind of job")),
            |fleet| fleet.order(given),
        )
    }
}

impl Run {
    fn order(&self, given: &Given<'_>) -> Result<Order> {
        let planner = planner(given, &self.planner, "/run/planner")?;
        let view = self.view.or(planner.representations.first().copied());
        let view = view.unwrap_or(Representation::Grid);
        if !(1..=LONGEST_MS).contains(&self.budget_ms) {
            let reason = format!("a budget of {} ms", self.budget_ms);
            return Err(Refused::value(reason)
                .at("/run/budget_ms")
                .hint("give 1 to 86400000 ms, which is a day"));
        }
        let mut line = Line::new("run");
        line.pair("--task", given.task);
        line.own("--planner", &self.planner);
        for option in planner.options(&self.options)? {
            line.own("--option", &option);
        }
        line.view(view, given.views);
        line.pair("--budget", &format!("{}ms", self.budget_ms));
        line.pair("--seed", &self.seed.to_string());
        if let Some(memory) = self.memory {
            if !MEMORY.contains(&memory) {
                let reason = format!("{memory} bytes of memory");
                return Err(Refused::value(reason).at("/run/memory"));
            }
            line.pair("--memory", &format!("{memory}B"));
        }
        if let Some(level) = self.sandbox {
            if level == Level::None {
                return Err(Refused::value("no page switches the sandbox off")
                    .at("/run/sandbox")
                    .hint("run the planner by `fleetyard run --sandbox none`"));
            }
            line.pair("--sandbox", level.name());
        }
        line.words.extend(given.trust.iter().cloned());
        line.pair("--plan-out", PLAN);
        if self.annotations {
            line.pair("--annotations", ANNOTATIONS);
        }
        line.words.push("--follow".into());
        let mut commands = vec![line.command(Kind::Run)];
        if let Some(conduct) = &self.execute {
            commands.push(conduct.command(given, view, "/run/execute")?);
        }
        Ok(Order {
            kind: Kind::Run,
            planner: Some(self.planner.clone()),
            view: Some(view),
            plan_of: None,
            opened: None,
            commands,
        })
    }
}

impl Conduct {
    fn command(&self, given: &Given<'_>, view: Representation, place: &str) -> Result<Command> {
        let mut line = Line::new("simulate");
        line.words.push(PLAN.into());
        line.pair("--task", given.task);
        line.view(view, given.views);
        if let Some(policy) = self.policy {
            line.pair("--policy", policy.name());
        }
        if let Some(tier) = self.tier {
            line.pair("--tier", tier.name());
        }
        let texts = [
            ("delay", &self.delay),
            ("velocity_noise", &self.velocity_noise),
            ("messages", &self.messages),
            ("twist_noise", &self.twist_noise),
        ];
        for (name, text) in texts {
            if let Some(text) = text {
                disturbance(name, text).map_err(|refused| refused.at(format!("{place}/{name}")))?;
                line.own(&flag(name), text);
            }
        }
        if let Some(seed) = self.seed {
            line.pair("--seed", &seed.to_string());
        }
        line.pair("--trace", TRACE);
        Ok(line.command(Kind::Simulate))
    }
}

impl Fleet {
    fn order(&self, given: &Given<'_>) -> Result<Order> {
        let planner = planner(given, &self.planner, "/fleet/planner")?;
        if !(1..=MOST_ROBOTS).contains(&self.agents) {
            let reason = format!("a fleet of {} robots", self.agents);
            return Err(Refused::value(reason).at("/fleet/agents"));
        }
        if !(self.duration_s > 0.0 && self.duration_s <= LONGEST_MS as f64 / 1e3) {
            let reason = format!("a duration of {} s", self.duration_s);
            return Err(Refused::value(reason).at("/fleet/duration_s"));
        }
        let mut line = Line::new("fleet");
        line.pair("--map", given.map);
        line.own("--planner", &self.planner);
        for option in planner.options(&self.options)? {
            line.own("--option", &option);
        }
        line.pair("--agents", &self.agents.to_string());
        line.pair(
            "--duration",
            &format!("{}ms", (self.duration_s * 1e3).ceil()),
        );
        line.pair("--seed", &self.seed.to_string());
        if let Some(model) = &self.model {
            if !PRESETS.iter().any(|preset| preset.name == model) {
                let reason = format!("there is no model {model:?}");
                return Err(Refused::value(reason).at("/fleet/model"));
            }
            line.pair("--model", model);
        }
        let cell_m = self.cell_size_m.unwrap_or(given.cell_m);
        if !(cell_m > 0.0 && cell_m <= LARGEST_CELL_M) {
            let reason = format!("cells of {cell_m} m");
            return Err(Refused::value(reason).at("/fleet/cell_size_m"));
        }
        line.pair("--cell-size", &cell_m.to_string());
        if given.is_grid {
            // Others have to fit in.
            let radius_m = Robots::DRIVEN_RADIUS_CELLS * cell_m;
            line.pair("--radius", &radius_m.to_string());
        }
        if let Some(limit_ms) = self.limit_ms {
            if !(1..=LONGEST_MS).contains(&limit_ms) {
                let reason = format!("a limit of {limit_ms} ms");
                return Err(Refused::value(reason).at("/fleet/limit_ms"));
            }
            line.pair("--limit", &format!("{limit_ms}ms"));
        }
        if let Some(delay) = &self.delay {
            disturbance("delay", delay).map_err(|refused| refused.at("/fleet/delay"))?;
            line.own("--delay", delay);
        }
        line.words.extend(given.trust.iter().cloned());
        line.pair("--record", RECORDING);
        line.pair("--trace", TRACE);
        if self.live {
            line.words.push("--live".into());
        }
        let mut command = line.command(Kind::Fleet);
        command.live = self.live;
        Ok(Order {
            kind: Kind::Fleet,
            planner: Some(self.planner.clone()),
            view: Some(Representation::Grid),
            plan_of: None,
            opened: None,
            commands: vec![command],
        })
    }
}

/// The planner of an identifier that somebody has installed.
fn planner<'a>(given: &Given<'a>, id: &str, place: &str) -> Result<&'a Planner> {
    let found = given.planners.iter().find(|planner| planner.id == id);
    found.ok_or_else(|| {
        let names = given.planners.iter().map(|planner| planner.id.as_str());
        let meant = fleetyard_core::nearest(id, names, 3);
        let hint = meant.map_or("look for planners again".to_owned(), |meant| {
            format!("did you mean `{meant}`?")
        });
        let reason = format!("there is no planner {:?}", fleetyard_core::shown(id));
        Refused::value(reason).at(place).hint(hint)
    })
}

/// Refuses a text that the command would not read.
fn disturbance(name: &str, text: &str) -> Result<()> {
    let read = match name {
        "delay" => text.parse::<Delay>().map(|_| ()),
        "velocity_noise" => text.parse::<VelocityNoise>().map(|_| ()),
        "messages" => text.parse::<Messages>().map(|_| ()),
        _ => text.parse::<TwistNoise>().map(|_| ()),
    };
    read.map_err(|error| {
        let refused = Refused::value(error.to_string());
        match error.hint() {
            Some(hint) => refused.hint(hint),
            None => refused,
        }
    })
}

/// The argument of a name.
fn flag(name: &str) -> String {
    format!("--{}", name.replace('_', "-"))
}

/// Arguments of a command.
struct Line {
    words: Vec<String>,
}

impl Line {
    fn new(command: &str) -> Self {
        Self {
            words: vec![command.to_owned()],
        }
    }

    fn pair(&mut self, flag: &str, value: &str) {
        self.words.extend([flag.to_owned(), value.to_owned()]);
    }

    /// A value that may begin as an argument does.
    fn own(&mut self, flag: &str, value: &str) {
        self.words.push(format!("{flag}={value}"));
    }

    /// The kind of a view with the parameters that the document gives it.
    fn view(&mut self, view: Representation, views: &Value) {
        self.pair("--representation", view.name());
        let names: &[(&str, &str)] = match view {
            Representation::Grid => &[
                ("connectivity", "--connectivity"),
                ("separation", "--separation"),
                ("step", "--step"),
            ],
            Representation::Roadmap => &[
                ("density", "--density"),
                ("builder", "--builder"),
                ("vertices", "--vertices"),
                ("neighbors", "--neighbors"),
                ("sampling", "--sampling"),
                ("side", "--side"),
                ("directions", "--directions"),
                ("sides", "--sides"),
                ("spacing", "--spacing"),
                ("speed", "--speed"),
                ("seed", "--roadmap-seed"),
                ("roadmap_seed", "--roadmap-seed"),
                ("pace", "--pace"),
            ],
            Representation::Continuous => &[],
        };
        for (name, flag) in names {
            match &views[view.name()][name] {
                Value::String(text) => self.own(flag, text),
                Value::Number(number) => self.own(flag, &number.to_string()),
                _ => {}
            }
        }
    }

    fn command(mut self, kind: Kind) -> Command {
        self.pair("--format", "json");
        Command {
            kind,
            words: self.words,
            live: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn order(asked: &Value) -> Result<Order> {
        let planners = [Planner::for_tests(
            "pibt",
            &json!({
                "type": "object",
                "properties": {"restarts": {"type": "integer", "minimum": 0}, "name": {"type": "string"}},
                "additionalProperties": false,
            }),
        )];
        let asked = Asked::read(asked.to_string().as_bytes()).map_err(Refused::value)?;
        asked.order(&Given {
            planners: &planners,
            task: "rooms.task.json",
            map: "rooms.map",
            cell_m: 0.5,
            is_grid: true,
            views: &json!({"grid": {"connectivity": 8, "separation": "swap", "other": 7}}),
            trust: &["--locked".to_owned()],
            view_of: &|job| match job {
                3 => Ok(Representation::Roadmap),
                _ => Err(Refused::unknown("plan")),
            },
        })
    }

    #[test]
    fn a_run_is_a_command_line_of_checked_words() {
        let order = order(&json!({"run": {
            "planner": "pibt",
            "options": {"restarts": 3, "name": "--sandbox=off; rm -rf /"},
            "view": "grid",
            "budget_ms": 1500,
            "seed": 7,
            "annotations": true,
            "execute": {"policy": "adg", "delay": "bernoulli:0.1,2"},
        }}))
        .unwrap();
        let lines: Vec<String> = order
            .commands
            .iter()
            .map(|command| command.words.join(" "))
            .collect();
        assert_eq!(
            lines,
            [
                "run --task rooms.task.json --planner=pibt --option=name=--sandbox=off; rm -rf / \
                 --option=restarts=3 --representation grid --connectivity=8 --separation=swap \
                 --budget 1500ms --seed 7 --locked --plan-out plan.json --annotations \
                 annotations.json --follow --format json",
                "simulate plan.json --task rooms.task.json --representation grid --connectivity=8 \
                 --separation=swap --policy adg --delay=bernoulli:0.1,2 --trace execution.trace \
                 --format json",
            ]
        );
    }

    #[test]
    fn a_fleet_drives_on_cells_of_the_size_that_the_document_has() {
        let fleet = |more: Value| {
            let mut fleet =
                json!({"planner": "pibt", "agents": 5, "duration_s": 9.0, "model": "agv"});
            for (key, value) in more.as_object().unwrap() {
                fleet[key] = value.clone();
            }
            order(&json!({"fleet": fleet})).unwrap().commands[0]
                .words
                .join(" ")
        };
        let usual = fleet(json!({}));
        assert!(
            usual.contains("--model agv --cell-size 0.5 --radius 0.15 --locked"),
            "{usual}"
        );
        let given = fleet(json!({"cell_size_m": 1.4, "limit_ms": 2500}));
        assert!(
            given.contains("--cell-size 1.4 --radius 0.42 --limit 2500ms"),
            "{given}"
        );
    }

    #[test]
    fn what_makes_no_sense_is_refused_at_its_place() {
        let run = |more: Value| {
            let mut run = json!({"planner": "pibt", "budget_ms": 1000});
            for (key, value) in more.as_object().unwrap() {
                run[key] = value.clone();
            }
            json!({"run": run})
        };
        for wrong in [
            json!({}),
            json!({"run": {"planner": "pibt", "budget_ms": 1}, "simulate": {"plan": 3}}),
            json!({"shell": "true"}),
            json!({"simulate": {"plan": 4}}),
            json!({"simulate": {"plan": 3, "model": "agv"}}),
            json!({"fleet": {"planner": "pibt", "agents": 0, "duration_s": 10.0}}),
            json!({"fleet": {"planner": "pibt", "agents": 5, "duration_s": -1.0}}),
            json!({"fleet": {"planner": "pibt", "agents": 5, "duration_s": 9.0, "model": "no"}}),
            json!({"fleet": {"planner": "pibt", "agents": 5, "duration_s": 9.0, "cell_size_m": 0.0}}),
            json!({"fleet": {"planner": "pibt", "agents": 5, "duration_s": 9.0, "limit_ms": 0}}),
            run(json!({"planner": "/bin/sh"})),
            run(json!({"planner": "../pibt"})),
            run(json!({"budget_ms": 0})),
            run(json!({"budget_ms": 1e18})),
            run(json!({"memory": 1})),
            run(json!({"options": {"restarts": -1}})),
            run(json!({"options": {"unknown": 1}})),
            run(json!({"view": "sphere"})),
            run(json!({"sandbox": "none"})),
            run(json!({"sandbox": "none of it"})),
            run(json!({"execute": {"delay": "always"}})),
            run(json!({"execute": {"allow_read": "/"}})),
            run(json!({"allow_network": true})),
        ] {
            let refused = order(&wrong).unwrap_err();
            assert_eq!(refused.status().as_u16() / 100, 4, "{wrong}");
        }
        assert!(order(&json!({"simulate": {"plan": 3, "policy": "time"}})).is_ok());
    }
}
