//! `fleetyard maps guide`: the same factors for the same arguments, and what happens when it is
//! interrupted or cannot help.

use fleetyard_core::{load_guidance, load_map};
use fleetyard_testkit::{NO_PLAN, SUCCESS, Yard, is_ignored, map, until};

fn line(more: &str) -> String {
    let map = map("empty-8-8.map");
    format!("maps guide --map {map} --agents 10 --duration 20s --seed 3 --attach in-process {more}")
}

#[test]
fn factors_depend_on_arguments_alone_and_are_tested_on_other_seeds() {
    let yard = Yard::new();
    let search = |threads: u32, out: &str| {
        let more = "--evaluations 15 --runs 1 --updates 2 --tests 3 --format json";
        let ended = yard.line(&line(&format!("{more} --threads {threads} --out {out}")));
        let ended = ended.expect(SUCCESS);
        let better = ended.json()["better"].as_bool().unwrap();
        assert_ne!(
            ended.stderr.contains("the guidance is not better"),
            better,
            "{ended}"
        );
        assert!(ended.stderr.contains("15/15 evaluations: "), "{ended}");
        let mut found = ended.json();
        assert_eq!(found["file"], out);
        found.as_object_mut().unwrap().remove("file");
        found
    };
    let one = search(1, "one.json");
    assert_eq!(search(3, "three.json"), one);
    assert_eq!(yard.read("one.json"), yard.read("three.json"));
    let grid = load_map(map("empty-8-8.map")).unwrap();
    let guidance = load_guidance(yard.path("one.json"), &grid).unwrap();
    assert!(guidance.moves.iter().any(|factor| *factor != 100));
    for of in ["without", "with"] {
        let [low, mean, high] = ["low", "mean", "high"].map(|key| one[of][key].as_f64().unwrap());
        assert!(low <= mean && mean <= high && mean > 0.0, "{one}");
    }
    // What was compared can be had again.
    let fleet = format!(
        "fleet --map {} --agents 10 --duration 20s --planner pibt --guidance one.json --format json",
        map("empty-8-8.map")
    );
    let fleet = yard.line(&fleet).expect(SUCCESS);
    assert!(fleet.json()["guidance_digest"].is_string());
}

#[test]
fn a_planner_that_reads_no_guidance_is_refused() {
    let yard = Yard::new();
    let refused = yard
        .line(&line("--planner lacam --out a.json"))
        .expect(NO_PLAN);
    assert!(
        refused.stderr.contains("planner `lacam` reads no guidance"),
        "{refused}"
    );
    assert!(
        refused.stderr.contains("hint: take `pibt` or `epibt`"),
        "{refused}"
    );
    assert!(!yard.path("a.json").exists());
}

#[test]
fn an_interrupt_leaves_a_whole_file() {
    if is_ignored("INT") {
        return;
    }
    let yard = Yard::new().in_own_group();
    let line = line("--evaluations 100000 --runs 1 --out a.json");
    let run = yard.start(&line.split(' ').collect::<Vec<_>>());
    assert!(until(|| yard.path("a.json").exists()));
    let host = run
        .processes()
        .into_iter()
        .find(|process| process.id == run.child.id());
    host.unwrap().signal_group("INT");
    let mut ended = run.wait();
    // Plugins end with their supervisors, which notice it a moment later.
    ended.left.clear();
    let ended = ended.expect(130);
    assert!(
        ended
            .stderr
            .contains("a.json has the factors of the last whole generation"),
        "{ended}"
    );
    let grid = load_map(map("empty-8-8.map")).unwrap();
    assert!(load_guidance(yard.path("a.json"), &grid).is_ok());
}
