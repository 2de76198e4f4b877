//! Trials of a suite in the studio: listed, opened with their plans, and linked from the report.

use std::fs;

use fleetyard_bench::Store;
use fleetyard_testkit::studio::Studio;
use fleetyard_testkit::{INPUT, SUCCESS, Yard, root, words};
use serde_json::{Value, json};

/// A store with two planners on views of two rooms, and one of them on a map.
fn suite(yard: &Yard, protocol: &str) {
    for file in ["two-rooms.task.json", "two-rooms.world.json"] {
        yard.write(file, fs::read(root().join("maps").join(file)).unwrap());
    }
    let maps = root().join("maps").display().to_string();
    yard.write(
        "rooms.toml",
        format!(
            "name = \"rooms\"\n{protocol}\nbudget.wall = \"1m\"\n[execution]\npolicy = \"adg\"\n\
             [[planner]]\nplugin = \"lacam\"\noptions = {{ anytime = false }}\n\
             [[planner]]\nplugin = \"roadmap-pp\"\n\
             [[instances]]\ntask = \"two-rooms.task.json\"\nviews = [\"grid\", \"S\"]\n\
             [[instances]]\nscen = [\"{maps}/empty-8-8-random-1.scen\"]\nagents = 4\n"
        ),
    );
    yard.run(&words("bench rooms.toml")).expect(SUCCESS);
}

fn trials(studio: &Studio, asked: &str) -> Vec<Value> {
    let list = studio
        .get(&format!("/api/suite/trials?{asked}"))
        .expect(200);
    list.json()["trials"].as_array().unwrap().clone()
}

fn open(studio: &Studio, trial: &Value) -> Value {
    let path = format!("/api/suite/trials/{}/open", trial["trial"]);
    studio.post(&path, &json!({})).expect(200).json()
}

#[test]
fn trials_are_found_and_opened_with_the_digests_of_their_records() {
    let yard = Yard::new();
    suite(&yard, "protocol.keep_plans = true");
    let studio = Studio::start(&yard, ".");
    let about = studio.get("/api/suite").expect(200).json();
    assert_eq!(
        (&about["name"], &about["trials"]),
        (&json!("rooms"), &json!(4))
    );
    assert!(
        about["outcomes"]
            .as_array()
            .unwrap()
            .contains(&json!("unsupported"))
    );
    assert_eq!(trials(&studio, "outcome=success").len(), 3);
    assert_eq!(trials(&studio, "map=empty-8-8").len(), 2);
    assert_eq!(trials(&studio, "map=no/such").len(), 0);
    assert_eq!(trials(&studio, "from=1&count=2").len(), 2);
    assert_eq!(studio.get("/api/suite/trials?count=-1").status, 422);
    let version = studio.get("/api/document").json()["version"].clone();
    for trial in trials(&studio, "outcome=success") {
        // Nothing is started by asking for it.
        let path = format!("/api/suite/trials/{}", trial["trial"]);
        assert_eq!(studio.get(&format!("{path}/open")).status, 405);
        let whole = studio.get(&path).expect(200).json();
        assert_eq!(whole["has_plan"], true, "{whole:#}");
        let opened = open(&studio, &trial);
        assert_eq!(opened["document"]["problems"], json!([]), "{opened:#}");
        let job = studio.wait_for(&opened["job"]);
        assert_eq!(job["state"], "done", "{job:#}");
        let line = job["line"].as_str().unwrap();
        assert!(
            line.starts_with("fleetyard simulate plan.json --") && line.contains("--policy=adg")
        );
        assert_eq!(job["verdict"]["valid"], true, "{job:#}");
        assert_eq!(
            job["execution"]["trace_digest"], whole["columns"]["trace_digest"],
            "{line}"
        );
        let plan = studio.get(&format!("/api/jobs/{}/plan", job["id"])).json();
        assert_eq!(plan["plan_digest"], trial["plan_digest"]);
    }
    assert_ne!(studio.get("/api/document").json()["version"], version);
    let failed = &trials(&studio, "outcome=unsupported")[0];
    let opened = open(&studio, failed);
    assert_eq!(opened["job"], Value::Null);
    assert_eq!(opened["notes"], json!(["the trial ended without a plan"]));
    assert_eq!(studio.get("/api/suite/trials/99").status, 404);
    let report = studio.get("/report").expect(200);
    let policy = report.header("content-security-policy");
    assert!(policy.contains("script-src 'sha256-") && policy.contains("frame-ancestors 'none'"));
    assert!(String::from_utf8_lossy(&report.body).contains("\"in_studio\":true"));
    assert_eq!(studio.with("GET", "/report", &[], b"").status, 401);
    studio.end("INT").expect(SUCCESS);
}

#[test]
fn a_trial_of_the_command_line_is_opened_at_once_and_one_without_a_plan_says_how_to_keep_it() {
    let yard = Yard::new();
    suite(&yard, "");
    yard.run(&words("report rooms.sqlite --html r.html"))
        .expect(SUCCESS);
    let report = fs::read_to_string(yard.path("r.html")).unwrap();
    assert!(report.contains("'--trial'") && report.contains("\"value\":\"rooms.sqlite\""));
    let studio = Studio::start(&yard, "rooms.sqlite --trial 0");
    let about = studio.get("/api/suite").json();
    assert_eq!(about["opened"], json!({"trial": 0, "job": null}));
    let document = studio.get("/api/document").json();
    assert_eq!(document["document"]["name"], "two-rooms");
    let trial = studio.get("/api/suite/trials/0").json();
    assert!(
        trial["why_not"]
            .as_str()
            .unwrap()
            .contains("keep_plans = true")
    );
    studio.post("/api/planners", &json!({})).expect(200);
    let job = studio.post("/api/jobs", &trial["again"]).expect(200).json();
    let job = studio.wait_for(&job);
    assert_eq!(
        job["record"]["plan_digest"], trial["plan_digest"],
        "{job:#}"
    );
    studio.end("INT").expect(SUCCESS);
    let told = yard
        .run(&words("studio rooms.sqlite --no-open --trial 99"))
        .expect(INPUT);
    assert!(told.stderr.contains("there is no such trial"), "{told}");
    let told = yard
        .run(&words("studio two-rooms.task.json --no-open --trial 0"))
        .expect(INPUT);
    assert!(told.stderr.contains("fleetyard studio STORE"), "{told}");
}

#[test]
fn a_store_that_lies_has_nothing_else_read() {
    let yard = Yard::new();
    suite(&yard, "protocol.keep_plans = true");
    let honest = Store::open_read_only(&yard.path("rooms.sqlite")).unwrap();
    let (rows, mut meta) = (honest.rows().unwrap(), honest.meta().unwrap());
    yard.write("secret.toml", "name = \"secret\"");
    meta.places.suite = Some(yard.path("secret.toml"));
    let mut lying = Store::create(&yard.path("lies.sqlite"), &meta).unwrap();
    for mut row in rows {
        row.plan = row.plan_digest.as_ref().map(|_| b"no plan".to_vec());
        row.planner = format!("{}{}", "../".repeat(100_000), row.planner);
        row.scenario
            .insert_str(0, if row.trial == 0 { "" } else { "../" });
        lying.insert(&row).unwrap();
    }
    drop(lying);
    let studio = Studio::start(&yard, "lies.sqlite");
    let list = studio.get("/api/suite/trials").expect(200);
    assert!(list.body.len() < 30_000, "{} bytes", list.body.len());
    let refused = |trial: u64| {
        let reply = studio.post(&format!("/api/suite/trials/{trial}/open"), &json!({}));
        assert_eq!(reply.status, 422);
        reply.json()["error"].as_str().unwrap().to_owned()
    };
    // A file that is not the suite is none, whatever is in it.
    fs::rename(yard.path("rooms.toml"), yard.path("elsewhere.toml")).unwrap();
    let said = refused(0);
    assert!(
        said.contains("no file has the suite as this store has it"),
        "{said}"
    );
    // Nor is a value of the store the name of one.
    let mut values: Value = serde_json::from_str(&meta.suite_values).unwrap();
    values["instances"][1]["scen"] = json!(["secret.scen"]);
    meta.places.suite = None;
    meta.suite_values = values.to_string();
    fs::copy(yard.path("elsewhere.toml"), yard.path("suite.toml")).unwrap();
    drop(Store::create(&yard.path("values.sqlite"), &meta).unwrap());
    let row = honest.rows().unwrap().remove(0);
    let mut values = Store::open(&yard.path("values.sqlite")).unwrap();
    values.insert(&row).unwrap();
    drop(values);
    let other = Studio::start(&yard, "values.sqlite");
    let path = format!("/api/suite/trials/{}/open", row.trial);
    let said = other.post(&path, &json!({})).expect(422).json();
    let said = said["error"].as_str().unwrap().to_owned();
    assert!(said.contains("`instances` is another one"), "{said}");
    other.end("INT").expect(SUCCESS);
    // Beside the store it is found. A name is no path, and what was kept no plan.
    fs::rename(yard.path("elsewhere.toml"), yard.path("suite.toml")).unwrap();
    let said = refused(0);
    assert!(said.contains("cannot be unpacked"), "{said}");
    let others = trials(&studio, "");
    let said = refused(others.last().unwrap()["trial"].as_u64().unwrap());
    assert!(
        said.contains("does not make the instance of trial"),
        "{said}"
    );
    studio.end("INT").expect(SUCCESS);
}

#[test]
fn trials_with_values_of_the_command_line_are_opened_on_its_terms() {
    let yard = Yard::new();
    suite(&yard, "protocol.keep_plans = true");
    let line = "bench rooms.toml --store set.sqlite --set execution.policy=time --set execution.ticks_hz=20";
    yard.run(&words(line)).expect(SUCCESS);
    let studio = Studio::start(&yard, "set.sqlite");
    let trial = &trials(&studio, "outcome=success")[0];
    let whole = studio.get(&format!("/api/suite/trials/{}", trial["trial"]));
    let opened = open(&studio, trial);
    let job = studio.wait_for(&opened["job"]);
    let line = job["line"].as_str().unwrap();
    assert!(
        line.contains("--ticks-hz=20") && !line.contains("--policy"),
        "{line}"
    );
    assert_eq!(
        job["execution"]["trace_digest"],
        whole.json()["columns"]["trace_digest"],
        "{line}"
    );
    studio.end("INT").expect(SUCCESS);
}

#[test]
fn a_trial_of_a_fleet_shows_its_map_and_drives_again() {
    let yard = Yard::new();
    let hall = root().join("maps/warehouse-3-4-5-1-1-m2-a2-open-e-w3.map");
    yard.write(
        "f.toml",
        format!(
            "name = \"fleets\"\n[fleet]\nduration = \"20s\"\n[[planner]]\nplugin = \"pibt\"\n\
             [[instances]]\nmap = \"{}\"\nagents = [4]\n",
            hall.display()
        ),
    );
    yard.run(&words("bench f.toml")).expect(SUCCESS);
    let studio = Studio::start(&yard, "fleets.sqlite");
    let trial = studio.get("/api/suite/trials/0").json();
    assert!(
        trial["why_not"]
            .as_str()
            .unwrap()
            .starts_with("fleets have no plan to keep")
    );
    let opened = open(&studio, &trial);
    assert_eq!(opened["job"], Value::Null);
    let cells = opened["document"]["document"]["ground"]["map"].is_object();
    assert!(cells, "{:#}", opened["document"]["document"]["ground"]);
    studio.post("/api/planners", &json!({})).expect(200);
    let mut again = trial["again"].clone();
    assert_eq!(again["fleet"]["live"], true);
    again["fleet"]["live"] = false.into();
    let job = studio.post("/api/jobs", &again).expect(200).json();
    let job = studio.wait_for(&job);
    // It had the usual settings of fleets.
    assert_eq!(
        job["fleet"]["execution"]["trace_digest"], trial["columns"]["trace_digest"],
        "{job:#}"
    );
    studio.end("INT").expect(SUCCESS);
}
