//! The adapters in `plugins/adapters`, with the solvers that they are for.
//!
//! Solvers are not ours and not in this repository: a test runs when the manifest's
//! program is on `PATH` or named by its variable, and says that it was skipped
//! otherwise. `docs/solvers.md` says how to get them.

use std::path::PathBuf;

use fleetyard_runtime::adapter::Adapter;
use fleetyard_testkit::{Ended, INPUT, NO_PLAN, SUCCESS, Yard, instance, root, words};
use serde_json::Value;

use crate::adapters_views::ADAPTERS;

/// Peculiarities of a solver.
struct Solver {
    /// Its folder in `plugins/adapters`.
    name: &'static str,
    /// Names its program.
    variable: &'static str,
    /// Options with which it is quick in small cases.
    quick: &'static str,
    /// Its claim about two agents in a lane that would have to pass each other.
    in_a_lane: &'static str,
    /// True if it gives the costs of its plan: the sum, and the makespan.
    says: (bool, bool),
    /// Cases of the conformance kit that it is known to fail.
    fails: &'static [&'static str],
}

const SOLVERS: [Solver; 8] = [
    Solver {
        name: "cbsh2-rtc",
        variable: "CBSH2_RTC",
        quick: "",
        in_a_lane: "timed-out",
        says: (true, false),
        fails: &[],
    },
    Solver {
        name: "eecbs",
        variable: "EECBS",
        quick: "",
        in_a_lane: "timed-out",
        says: (true, false),
        fails: &[],
    },
    Solver {
        name: "lacam2",
        variable: "LACAM2",
        quick: "",
        in_a_lane: "infeasible",
        says: (true, true),
        fails: &[],
    },
    Solver {
        name: "lacam3",
        variable: "LACAM3",
        quick: "--option no-star=true",
        in_a_lane: "infeasible",
        says: (true, true),
        fails: &[],
    },
    Solver {
        name: "mapf-lns2",
        variable: "MAPF_LNS2",
        // The default looks for cells of three neighbours, and crashes without one.
        quick: "--option iterations=20 --option destroy=RandomWalk",
        in_a_lane: "timed-out",
        says: (true, false),
        fails: &[],
    },
    Solver {
        name: "pbs",
        variable: "PBS",
        quick: "",
        in_a_lane: "gave-up",
        says: (true, false),
        fails: &[],
    },
    Solver {
        name: "pibt2",
        variable: "PIBT2",
        quick: "",
        in_a_lane: "gave-up",
        says: (true, true),
        fails: &[],
    },
    Solver {
        name: "pypibt",
        variable: "PYPIBT",
        quick: "",
        in_a_lane: "gave-up",
        says: (false, false),
        fails: &[],
    },
];

/// Map and scenario of three cells in a row, whose agents would have to change places.
const LANE: [&str; 2] = [
    "type octile\nheight 1\nwidth 3\nmap\n...\n",
    "version 1\n0\tlane.map\t3\t1\t0\t0\t2\t0\t2\n0\tlane.map\t3\t1\t2\t0\t0\t0\t2\n",
];

impl Solver {
    fn manifest(&self) -> String {
        let folder = root().join("plugins/adapters").join(self.name);
        folder.display().to_string()
    }

    /// Its program as absolute path; none, and a line why, when it is not there.
    fn program(&self) -> Option<String> {
        match Adapter::open(&PathBuf::from(self.manifest()).join("planner.toml")) {
            Ok(adapter) => Some(adapter.program().display().to_string()),
            Err(fault) => {
                println!("{} is skipped: {fault}", self.name);
                None
            }
        }
    }

    /// Runs it on an instance.
    fn run(&self, budget: &str, instance: &[String], more: &str) -> (Ended, Value) {
        let program = self.program().expect("looked for before");
        let yard = Yard::new().set(self.variable, &program);
        yard.write("lane.map", LANE[0]);
        yard.write("lane.scen", LANE[1]);
        let mut line = words("run --seed 1 --format json --budget");
        line.extend([budget, "--planner", &self.manifest()].map(str::to_owned));
        line.extend_from_slice(instance);
        line.extend(words(more));
        let ended = yard.run(&line);
        let record = ended.json();
        (ended, record)
    }

    fn finds_plans(&self) {
        for agents in [2, 30] {
            let instance = instance("random-32-32-20", agents);
            let (ended, record) = self.run("20s", &instance, self.quick);
            ended.expect(SUCCESS);
            assert_eq!(record["claim"], "solved", "{record}");
            assert_eq!(record["verdict"]["valid"], true, "{record}");
            let (claims, found) = (&record["claimed_metrics"], &record["metrics"]);
            for (says, claim, ours) in [
                (self.says.0, "claimed_sum_of_costs", "soc_steps"),
                (self.says.1, "claimed_makespan", "makespan_steps"),
            ] {
                let claimed = claims[claim].as_f64();
                assert_eq!(claimed.is_some(), says, "{}: {claim}", self.name);
                if says {
                    assert_eq!(claimed, found[ours].as_f64(), "{}: {claim}", self.name);
                }
            }
        }
    }

    /// Without an answer it says why, in its own words. The kit has an agent that cannot
    /// reach its goal.
    fn has_no_plan(&self) {
        let lane = words("--map lane.map --scen lane.scen --agents 2");
        let (ended, record) = self.run("2s", &lane, self.quick);
        ended.expect(NO_PLAN);
        // Whoever counts processor time is stopped from outside on a busy machine.
        let claim = record["claim"].as_str();
        let claim = claim.or_else(|| record["termination"].as_str());
        assert_eq!(claim, Some(self.in_a_lane), "{}: {record}", self.name);
        assert_eq!(record["plan_digest"], Value::Null);
    }

    fn keeps_the_contract(&self) {
        let yard = Yard::new().set(self.variable, &self.program().unwrap());
        let mut line = words("plugins check --format json");
        line.push(self.manifest());
        line.extend(words(self.quick));
        let ended = yard.run(&line);
        let report = ended.json();
        let (mut failed, mut passed) = (Vec::new(), 0);
        let plugins = report["plugins"].as_array().into_iter().flatten();
        let cases = plugins.flat_map(|plugin| plugin["cases"].as_array().into_iter().flatten());
        for case in cases {
            match case["outcome"].as_str() {
                Some("passed") => passed += 1,
                Some("skipped") => {}
                _ => failed.push(case["case"].as_str().unwrap().to_owned()),
            }
        }
        assert!(passed > 20, "{}: {ended}", self.name);
        assert_eq!(failed, self.fails, "{}: {ended}", self.name);
    }

    fn works(&self) {
        if self.program().is_none() {
            return;
        }
        self.finds_plans();
        self.has_no_plan();
        self.keeps_the_contract();
    }
}

macro_rules! works {
    ($($test:ident: $at:expr;)*) => {
        $(
            #[test]
            fn $test() {
                SOLVERS[$at].works();
            }
        )*
    };
}

works! {
    cbsh2_rtc: 0;
    eecbs: 1;
    lacam2: 2;
    lacam3: 3;
    mapf_lns2: 4;
    pbs: 5;
    pibt2: 6;
    pypibt: 7;
}

/// Without its program an adapter says how to get it.
#[test]
fn a_missing_program_comes_with_a_way_to_get_it() {
    let grids = SOLVERS.iter().map(|solver| (solver.name, solver.variable));
    for (name, variable) in grids.chain(ADAPTERS) {
        let yard = Yard::new().set("PATH", "/nonexistent");
        let yard = yard.set(variable, "");
        let folder = root().join("plugins/adapters").join(name);
        let ended = yard.run(&["plugins", "info", &folder.display().to_string()]);
        let ended = ended.expect(INPUT);
        let told = format!("the program `{name}` is not on PATH");
        assert!(ended.stderr.contains(&told), "{ended}");
        let hint = ended.stderr.split_once("hint: ");
        let hint = hint.unwrap_or_else(|| panic!("{ended}")).1;
        assert!(hint.contains("docs/solvers.md"), "{ended}");
        let variable = format!("; {variable} may name the program");
        assert!(ended.stderr.contains(&variable), "{ended}");
    }
}

/// The planner of a Start-Kit is compiled, not described: LORR names `lorr.so`.
#[test]
fn lorr() {
    let Some(library) = std::env::var("LORR").ok().filter(|path| !path.is_empty()) else {
        println!("lorr is skipped: LORR does not name a library made by plugins/adapters/lorr");
        return;
    };
    let mut line = words("run --seed 1 --format json --budget 30s --planner");
    line.push(library);
    line.extend(instance("random-32-32-20", 5));
    let record = Yard::new().run(&line).expect(SUCCESS).json();
    assert_eq!(record["verdict"]["valid"], true, "{record}");
}

/// Every adapter is in the table, so that none goes untried.
#[test]
fn every_adapter_is_tried() {
    let folders = std::fs::read_dir(root().join("plugins/adapters")).unwrap();
    let mut names: Vec<String> = folders
        .map(|entry| entry.unwrap())
        .filter(|entry| entry.path().join("planner.toml").exists())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    let others = ADAPTERS.map(|(name, _)| name);
    let mut tried = [&SOLVERS.map(|solver| solver.name)[..], &others].concat();
    tried.sort_unstable();
    assert_eq!(names, tried);
    let guide = std::fs::read_to_string(root().join("docs/solvers.md")).unwrap();
    for name in names {
        let named = format!("plugins/adapters/{name}");
        assert!(guide.contains(&named), "docs/solvers.md lacks {named}");
    }
}
