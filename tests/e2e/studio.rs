//! The page of the studio in a real browser, worked as a person does: the tour of `docs/studio.md`, then the
//! same with keys alone.

use std::fs;
use std::path::PathBuf;

use fleetyard_testkit::browser::chromium;
use fleetyard_testkit::devtools::Page;
use fleetyard_testkit::studio::Studio as Server;
use fleetyard_testkit::{Yard, root};
use serde_json::Value;

/// A studio with a page, both of which end with this.
pub(crate) struct Studio {
    pub(crate) page: Page,
    /// The same as scripts have it.
    pub(crate) server: Server,
    pub(crate) yard: Yard,
}

impl Studio {
    /// None where there is no browser, which is said.
    pub(crate) fn open(files: &[PathBuf], size: [u32; 2]) -> Option<Self> {
        Self::open_in(Yard::new(), files, size)
    }

    /// The same in a folder that has files already.
    pub(crate) fn open_in(yard: Yard, files: &[PathBuf], size: [u32; 2]) -> Option<Self> {
        let Some(browser) = chromium() else {
            eprintln!("skipped: there is no Chromium");
            return None;
        };
        let mut arguments = vec![PathBuf::from("--no-open")];
        arguments.extend_from_slice(files);
        let server = Server::with_arguments(&yard, &arguments);
        let page = Page::open(browser, &yard.path("."), &server.address(), size);
        let mut studio = Self { page, server, yard };
        studio.ready();
        Some(studio)
    }

    pub(crate) fn ready(&mut self) {
        self.page.until("document.documentElement.dataset.ready");
    }

    /// A point of the world in the window.
    pub(crate) fn at(&mut self, [x, y]: [f64; 2]) -> [f64; 2] {
        let script = format!(
            "(() => {{ const box = studio.stage.scene.getBoundingClientRect(); \
             return [box.left + studio.stage.toX({x}), box.top + studio.stage.toY({y})]; }})()"
        );
        let at = self.page.eval(&script);
        [0, 1].map(|axis| at[axis].as_f64().unwrap())
    }

    pub(crate) fn drag(&mut self, from: [f64; 2], to: [f64; 2]) {
        let (from, to) = (self.at(from), self.at(to));
        self.page.drag(from, to);
    }

    /// Waits until the server has all edits.
    pub(crate) fn settled(&mut self) {
        self.page
            .until("studio.store.pending.length === 0 && !studio.store.busy");
        let refusal = self.page.eval("studio.store.refusal?.message ?? null");
        assert!(refusal.is_null(), "{refusal}");
    }

    pub(crate) fn document(&mut self) -> Value {
        self.settled();
        self.page.eval("studio.store.document")
    }

    pub(crate) fn digest(&mut self) -> Value {
        self.settled();
        self.page.eval("studio.store.digest")
    }

    /// Opens a file with the button, and waits for what is then there.
    pub(crate) fn choose(&mut self, files: &[PathBuf], there: &str) {
        self.page.choose("#file", files);
        self.page.until(there);
        self.settled();
    }

    /// Everything that can have the focus says what it is.
    pub(crate) fn is_named(&mut self, place: &str) {
        let found = self.page.focusable();
        assert!(found.len() > 10, "{place}: {found:?}");
        let unnamed: Vec<_> = found
            .iter()
            .filter(|(_, name)| name.trim().is_empty())
            .collect();
        assert!(unnamed.is_empty(), "{place}: {unnamed:?} of {found:?}");
    }

    pub(crate) fn has_no_errors(&self) {
        assert!(self.page.errors.is_empty(), "{:?}", self.page.errors);
    }
}

/// Six robots, three on each side of a door.
const ROBOTS: [[[f64; 2]; 2]; 6] = [
    [[1.25, 1.25], [8.75, 1.25]],
    [[1.25, 2.75], [8.75, 2.75]],
    [[1.25, 4.75], [8.75, 4.75]],
    [[7.75, 1.25], [2.25, 1.25]],
    [[7.75, 2.75], [2.25, 2.75]],
    [[7.75, 4.75], [2.25, 4.75]],
];

#[test]
fn the_tour_goes_from_an_empty_room_to_a_violation_and_back() {
    let Some(mut studio) = Studio::open(&[], [1280, 800]) else {
        return;
    };
    // 1. Two walls leave a door.
    studio.page.key("r");
    studio.drag([4.8, 0.0], [5.2, 2.0]);
    studio.drag([4.8, 4.0], [5.2, 6.0]);
    assert_eq!(
        studio.document()["ground"]["world"]["obstacles"]
            .as_array()
            .unwrap()
            .len(),
        2
    );

    // 2. Six robots; a seventh is taken back.
    studio.page.key("a");
    studio.page.eval("studio.settings.lattice = 0.25");
    for [start, goal] in ROBOTS {
        studio.drag(start, goal);
    }
    let six = studio.digest();
    studio.drag([1.25, 3.75], [8.75, 3.75]);
    assert_eq!(studio.document()["agents"].as_array().unwrap().len(), 7);
    studio.page.key("Ctrl+z");
    assert_eq!(studio.digest(), six);
    studio.page.key("Ctrl+Shift+z");
    assert_ne!(studio.digest(), six);
    studio.page.key("Ctrl+z");
    let document = studio.document();
    assert_eq!(
        document["agents"][0]["start"],
        serde_json::json!([1.25, 1.25])
    );
    assert_eq!(studio.page.eval("studio.store.problems.length"), 0);

    // 3. Views.
    studio.page.keys(&["1", "v"]);
    for (key, layer) in [
        ("Shift+G", "grid"),
        ("Shift+R", "roadmap"),
        ("Shift+C", "clearance"),
    ] {
        studio.page.key(key);
        studio
            .page
            .until(&format!("studio.layers.all.{layer}.data"));
    }
    studio.is_named("the world");

    // 4. Two planners side by side.
    studio.page.key("3");
    studio
        .page
        .until("document.querySelector('#run') && !document.querySelector('#run').disabled");
    studio.page.eval(
        "(() => { while (document.querySelector('[data-key=without-0]')) document.querySelector('[data-key=without-0]').click(); \
         for (const id of ['lacam', 'plane-pp']) { const list = document.querySelector('[data-key=add-planner]'); list.value = id; list.dispatchEvent(new Event('change')); } \
         const budget = document.querySelector('[data-key=budget]'); budget.value = 1; budget.dispatchEvent(new Event('change')); })()",
    );
    studio.is_named("the planners");
    studio.page.click("#run");
    studio.page.until("studio.jobs.list.length === 2 && studio.jobs.list.every((job) => job.state === 'done' && job.record && studio.watch.canShow(job))");
    // They are shown as they come, where one was before.
    studio.page.until(
        "studio.current === 'plan' && studio.watch.panes.length === 2 && studio.watch.clock.now > 0 && document.querySelector('#pane-edit').hidden",
    );
    // Names stand beside verdicts, however long these are.
    let tall = studio.page.eval(
        "Math.max(...[...document.querySelectorAll('.job h3 span:first-child')].map((name) => name.getBoundingClientRect().height))",
    );
    assert!(tall.as_f64().unwrap() < 60.0, "{tall}");
    // On a grid robots follow each other round corners, nearer than their footprints allow.
    studio
        .page
        .until("document.querySelectorAll('.job .state.valid, .job .state.invalid').length === 2");
    let valid = studio
        .page
        .eval("studio.jobs.list.find((job) => job.planner === 'plane-pp').verdict.valid");
    assert_eq!(valid, true);
    let command = studio
        .page
        .eval("document.querySelector('.job .command code').textContent");
    assert!(
        command
            .as_str()
            .unwrap()
            .starts_with("fleetyard run --task "),
        "{command}"
    );

    // 5. Watched on one clock.
    studio
        .page
        .eval("document.querySelector('.job .primary').scrollIntoView()");
    studio.page.click(".job .primary");
    studio.page.until(
        "studio.watch.panes.length === 2 && studio.watch.panes.every(({ scene }) => scene.known)",
    );
    studio.page.click("#play");
    studio.page.until("studio.watch.clock.now > 0.5");
    studio.page.key("Space");
    let moved = studio.page.eval("studio.watch.panes.map(({ recording }) => Math.hypot(recording.fleet.X[0] - 1.25, recording.fleet.Y[0] - 1.25))");
    assert!(
        moved[0].as_f64().unwrap() > 0.1 && moved[1].as_f64().unwrap() > 0.1,
        "{moved}"
    );
    studio.is_named("the recordings");

    // 6. A wall in the door: the plans are judged against it, and a violation leads to its moment.
    studio.page.keys(&["1", "r"]);
    studio.drag([4.8, 2.0], [5.2, 4.0]);
    studio.settled();
    studio.page.key("3");
    studio
        .page
        .until("document.querySelector('.job .violations button')");
    studio.page.click(".job .violations button");
    studio.page.until(
        "studio.current === 'watch' && studio.watch.clock.now > 0 && !studio.watch.clock.playing",
    );
    let time = studio.page.eval("studio.watch.clock.now").as_f64().unwrap();

    // 7. The link leads there again.
    studio.page.until("location.hash.includes('t=')");
    studio.page.until(&format!(
        "Math.abs(Number(new URLSearchParams(location.hash.slice(1)).get('t')) - {time}) < 0.01"
    ));
    let before = studio.page.eval("[studio.current, studio.watch.ids, [...document.querySelectorAll('#tabs [aria-selected=true]')].map((tab) => tab.textContent)]");
    studio.page.reload();
    studio.ready();
    studio.page.until(
        "studio.watch.panes.length > 0 && studio.watch.panes.every(({ scene }) => scene.known)",
    );
    let after = studio.page.eval("[studio.current, studio.watch.ids, [...document.querySelectorAll('#tabs [aria-selected=true]')].map((tab) => tab.textContent)]");
    assert_eq!(before, after);
    let again = studio.page.eval("studio.watch.clock.now").as_f64().unwrap();
    assert!((again - time).abs() < 0.01, "{again}, not {time}");

    // 8. Out and in again: the same problem.
    studio.page.key("Ctrl+z");
    assert_eq!(studio.digest(), six);
    studio.page.click("#export");
    studio.page.until("document.querySelector('.menu button')");
    studio.page.eval("[...document.querySelectorAll('.menu button')].find((item) => item.textContent.startsWith('Task of this project')).click()");
    let world = studio.page.download(|name| name.ends_with(".world.json"));
    let task = studio.page.download(|name| name.ends_with(".task.json"));
    let hall = root().join("maps/hall.world.json");
    studio.choose(&[hall], "studio.store.agents.length === 0");
    assert_ne!(studio.digest(), six);
    studio.choose(&[task, world], "studio.store.agents.length === 6");
    assert_eq!(studio.digest(), six);
    studio.has_no_errors();
}

#[test]
fn everything_can_be_done_with_keys() {
    let Some(mut studio) = Studio::open(&[], [390, 844]) else {
        return;
    };
    let page = &mut studio.page;
    // A wall: the cross goes from the middle of the room, Enter is a click.
    page.keys(&[
        "r",
        "Shift+ArrowDown",
        "ArrowDown",
        "Enter",
        "ArrowRight",
        "ArrowRight",
        "Shift+ArrowUp",
        "Enter",
    ]);
    // A robot on each side of it.
    page.keys(&[
        "a",
        "Shift+ArrowLeft",
        "Enter",
        "Shift+ArrowRight",
        "Shift+ArrowRight",
        "Enter",
    ]);
    let document = studio.document();
    assert_eq!(
        document["ground"]["world"]["obstacles"]
            .as_array()
            .unwrap()
            .len(),
        1
    );
    assert_eq!(document["agents"].as_array().unwrap().len(), 1);
    let start = document["agents"][0]["start"].clone();

    // What is selected moves, is copied and goes.
    let page = &mut studio.page;
    page.keys(&["Escape", "ArrowUp", "ArrowUp"]);
    let moved = studio.document()["agents"][0]["start"].clone();
    let up = moved[1].as_f64().unwrap() - start[1].as_f64().unwrap();
    assert!(moved[0] == start[0] && up > 0.1, "{start} to {moved}");
    studio.page.key("Ctrl+d");
    assert_eq!(studio.document()["agents"].as_array().unwrap().len(), 2);
    studio.page.until("studio.selection.has('s1')");
    studio.page.key("Delete");
    assert_eq!(studio.document()["agents"].as_array().unwrap().len(), 1);

    // The palette, the sheet of keys, and the panels.
    let page = &mut studio.page;
    page.key("Ctrl+k");
    page.write("layer grid");
    page.key("Enter");
    page.until("studio.layers.all.grid.visible && !document.querySelector('dialog[open]')");
    page.key("?");
    page.until("document.querySelector('#sheet').open");
    page.key("Escape");
    page.until("!document.querySelector('dialog[open]')");
    page.key("2");
    page.until("document.activeElement.id === 'to-robots'");
    page.key("ArrowRight");
    page.until("studio.current === 'plan' && document.activeElement.id === 'to-plan'");
    page.until("document.querySelector('#run') && !document.querySelector('#run').disabled");
    studio.is_named("the planners, on a narrow window");
    let page = &mut studio.page;
    page.key("Ctrl+Enter");
    page.until("studio.jobs.list.some((job) => job.state === 'done' && studio.watch.canShow(job))");
    page.tab_to(".job .primary");
    page.key("Enter");
    page.until("studio.watch.open && studio.watch.panes[0].scene.known");
    page.key("Escape");
    page.keys(&["End"]);
    page.until("studio.watch.clock.now === studio.watch.clock.end && studio.watch.clock.end > 0");

    // Nothing is wider than the window.
    let wide = page.eval("document.documentElement.scrollWidth");
    assert!(wide.as_f64().unwrap() <= 390.0, "{wide}");
    studio.has_no_errors();
}

#[test]
fn what_the_server_refuses_is_said_and_taken_back() {
    let maze = root().join("maps/two-rooms.task.json");
    let Some(mut studio) = Studio::open(&[maze], [1280, 800]) else {
        return;
    };
    let before = studio.document();
    let refused = studio.page.eval(
        "studio.store.edit({ op: 'set-agents', indices: [0], agents: [{ robot: 'cart', start: [-5, 1], goal: [9, 5] }] })",
    );
    assert_eq!(refused, false);
    studio
        .page
        .until("!document.querySelector('#refusal').hidden");
    let said = studio
        .page
        .eval("document.querySelector('#refusal').textContent");
    let said = said.as_str().unwrap();
    assert!(said.contains("Robot 0, its start"), "{said}");
    assert!(!said.contains("agent"), "{said}");
    assert_eq!(studio.page.eval("studio.store.document"), before);

    // A robot in a wall is no such edit: it is marked, and nothing is planned for.
    studio.page.eval("studio.store.edit({ op: 'set-agents', indices: [0], agents: [{ robot: 'cart', start: [5, 1], goal: [9, 5] }] })");
    studio.page.until("studio.store.problems.length > 0 && document.querySelector('#problems').className === 'some'");
    // What was refused before is history.
    studio
        .page
        .until("document.querySelector('#refusal').hidden");
    studio.page.key("3");
    studio
        .page
        .until("document.querySelector('#run')?.disabled");
    studio.page.click("#problems");
    studio
        .page
        .until("document.querySelector('#problem-list button')");
    studio.page.click("#problem-list button");
    studio.page.until("studio.selection.has('s0')");
    studio.has_no_errors();
}

/// Planners as they describe themselves, for the script of a page.
const PLANNERS: &str = "[['astar', ['grid'], ['agents:1']], ['db-cbs', ['continuous'], ['dynamics:fleetyard.car/1', 'dynamics:fleetyard.car-trailer/1']], \
    ['empty', ['grid'], ['for:measuring']], ['lacam', ['grid'], []], ['pbs', ['grid'], []], ['plane-pp', ['continuous'], []]] \
    .map(([id, representations, features]) => ({ id, representations, features, capabilities: id === 'astar' ? [] : ['windowed'] }))";

#[test]
fn cars_have_their_trailers_and_the_planners_that_know_them() {
    let yard = root().join("maps/yard.task.json");
    let Some(mut studio) = Studio::open(&[yard], [1280, 800]) else {
        return;
    };
    // A trailer is selected, moved and removed with its car.
    let before = studio.document()["agents"][0]["start"].clone();
    assert_eq!(before, serde_json::json!([0.9, 0.7, 0, 0]));
    studio.drag([0.4, 0.7], [0.6, 1.0]);
    assert_eq!(
        studio.document()["agents"][0]["start"],
        serde_json::json!([1.1, 1, 0, 0])
    );
    assert_eq!(
        studio.page.eval("[...studio.selection.keys]"),
        serde_json::json!(["s0"])
    );
    // It turns with the car's handle, which is the first.
    let handle = studio.page.eval("studio.tools.handles()[0].at");
    let handle = [0, 1].map(|axis| handle[axis].as_f64().unwrap());
    studio.drag(handle, [1.1, 2.0]);
    let start = &studio.document()["agents"][0]["start"];
    for heading in [&start[2], &start[3]] {
        let heading = heading.as_f64().unwrap();
        assert!(
            (heading - std::f64::consts::FRAC_PI_2).abs() < 1e-3,
            "{start}"
        );
    }
    studio.page.key("Delete");
    assert_eq!(studio.document()["agents"].as_array().unwrap().len(), 1);
    studio.page.key("Ctrl+z");
    studio.page.until("studio.store.agents.length === 2");
    // In a recording the trailer is no robot of its own.
    let found = studio.page.eval(
        "import('/viewer/fleet.js').then(({ Fleet }) => { const fleet = new Fleet({ outlines: [{ r: 0.3 }], agents: 2, bodies: 4, cars: [[2, 0]] }); \
         fleet.X.set([0, 5, 1, 9]); fleet.moved(); return [fleet.at(1, 0), fleet.at(5, 0), fleet.at(9, 0), fleet.train(0), [...fleet.owners]]; })",
    );
    assert_eq!(found, serde_json::json!([0, 1, -1, [0, 2], [0, 1, 0, -1]]));

    // Cars are for planners that know them, teams for those that plan for teams.
    let offered = |studio: &mut Studio, document: &str| {
        studio.page.eval(&format!(
            "import('/planners.js').then(({{ offered }}) => offered({PLANNERS}, {document}, studio.kinds).map(([title, all]) => [title, ...all.map(({{ id }}) => id)]))"
        ))
    };
    assert_eq!(
        offered(&mut studio, "studio.store.document"),
        serde_json::json!([["Recommended", "db-cbs"]])
    );
    let team = "{ ground: { map: {} }, robots: {}, agents: [] }";
    assert_eq!(
        offered(&mut studio, team),
        serde_json::json!([
            ["Recommended", "lacam", "pbs"],
            ["In the plane", "db-cbs", "plane-pp"]
        ])
    );
    let one = "{ ground: { map: {} }, robots: { a: 'agv' }, agents: [{ robot: 'a' }] }";
    assert_eq!(
        offered(&mut studio, one)[1],
        serde_json::json!(["On the grid", "astar"])
    );
    let fleets = studio.page.eval(&format!(
        "import('/planners.js').then(({{ offeredToFleets }}) => offeredToFleets({PLANNERS}).map(({{ id }}) => id))"
    ));
    assert_eq!(fleets, serde_json::json!(["pbs", "lacam"]));
    studio.has_no_errors();
}

#[test]
fn waits_reservations_delays_and_priorities_are_drawn_and_told() {
    let task = root().join("maps/two-rooms.task.json");
    let Some(mut studio) = Studio::open(&[task], [1280, 800]) else {
        return;
    };
    let page = &mut studio.page;
    page.eval("studio.store.edit({ op: 'scatter', count: 12, seed: 1, replace: true })");
    page.until("studio.store.agents.length === 12");
    page.eval(
        "(() => { window.ask = (path, body) => import('/api.js').then(({ api }) => body ? api.post(path, body) : api.get(path)); \
         return ask('/planners', {}).then(() => ask('/jobs', { run: { planner: 'pp', view: 'grid', budget_ms: 2000, annotations: true, execute: { policy: 'adg', delay: 'bernoulli:0.3,3s', seed: 1 } } })); })()",
    );
    page.until("studio.jobs.list.length === 1 && studio.jobs.list[0].state === 'done' && studio.watch.canShow(studio.jobs.list[0])");
    page.eval("studio.watch.show([studio.jobs.list[0].id])");
    page.until("studio.watch.panes[0]?.scene.known");

    // A moment at which somebody waits for somebody: an arrow, and words.
    let change = page.eval(
        "ask(`/recordings/${studio.watch.ids[0]}/waits?from_s=0&to_s=1000`).then(({ changes }) => changes.find(([time, , other]) => time > 0 && other !== null))",
    );
    let (time, agent, other) = (&change[0], &change[1], &change[2]);
    let picture = "studio.watch.stage.draw(), studio.watch.stage.over.toDataURL()";
    page.eval(&format!(
        "(studio.watch.clock.seek({time}), studio.watch.select({agent}, false))"
    ));
    let without = page.eval(picture);
    page.eval("studio.watch.overlay('waits', true)");
    page.until(&format!(
        "document.querySelector('#chain').textContent.startsWith('Robot {agent} waits for {other}')"
    ));
    assert_ne!(page.eval(picture), without);
    page.until("/^\\d+ of 12 robots? waits?/.test(document.querySelector('#waits').textContent)");
    page.click(&format!("#waits [data-key=wait-{other}]"));
    page.until(&format!(
        "studio.watch.panes[0].recording.ids[studio.watch.panes[0].scene.selected] === {other}"
    ));
    page.eval("studio.watch.clock.seek(studio.watch.clock.end)");
    page.until("document.querySelector('#waits').textContent.startsWith('Nobody waits')");

    // A cycle is no recording of this simulator: it is marked where one comes from elsewhere.
    let cycle = page.eval(
        "import('/waits.js').then(({ chainOf, cyclesOf, inWords }) => { const all = new Map([[4, 9], [9, 2], [2, 4], [7, 9], [3, 'message'], [1, 3]]); \
         return [cyclesOf(all), inWords(chainOf(all, 7)), inWords(chainOf(all, 1)), inWords(chainOf(all, 5))]; })",
    );
    let told = serde_json::json!([
        [[2, 4, 9]],
        "waits for 9, which waits for 2, which waits for 4, which waits for 9: a cycle",
        "waits for 3, which waits for a message",
        "waits for nobody"
    ]);
    assert_eq!(cycle, told);

    // Reservations are those of the plan.
    page.eval("(studio.watch.clock.seek(1), studio.watch.overlay('reservations', true))");
    page.until("studio.watch.panes[0].reserved?.view === 'grid' && document.querySelector('#tab-watch').textContent.includes('Cells that the plan keeps')");

    // Colours by delay and by priority, with what they mean at both ends, and the robot's own in words.
    page.eval("studio.watch.color('delay')");
    page.until("studio.watch.panes[0].scene.coloring === 'delay'");
    page.eval("studio.watch.clock.seek(studio.watch.clock.end)");
    page.until("/^\\d/.test(document.querySelector('#longest').textContent) && /so far$/.test(document.querySelector('#own-wait').textContent)");
    // The words come before the next frame, which has the colours.
    page.until("new Set(studio.watch.panes[0].scene.bodies.colors).size > 1");
    page.until("studio.watch.colorings.includes('priority')");
    page.eval("studio.watch.color('priority')");
    let ranks = page
        .eval("[...studio.watch.panes[0].recording.priorities.of.values()].sort((a, b) => a - b)");
    assert_eq!(ranks, serde_json::json!((0..12).collect::<Vec<_>>()));
    page.until("document.querySelector('#tab-watch').textContent.includes('first: 1')");
    studio.is_named("the overlays");
    studio.has_no_errors();
}

/// The pictures of `docs/studio.md`, made anew with `FLEETYARD_UPDATE=1`.
#[test]
fn pictures_of_the_page_are_made_by_a_command() {
    if std::env::var_os("FLEETYARD_UPDATE").is_none() {
        return;
    }
    let task = root().join("maps/two-rooms.task.json");
    let Some(mut studio) = Studio::open(&[task], [1180, 720]) else {
        return;
    };
    let shoot = |studio: &mut Studio, name: &str| {
        // Fonts and canvases come to rest.
        studio
            .page
            .eval("new Promise((done) => setTimeout(done, 400))");
        let png = decoded(&studio.page.picture());
        fs::write(root().join("docs/images").join(name), png).unwrap();
    };
    studio.page.key("Shift+C");
    studio.page.until("studio.layers.all.clearance.data");
    studio.page.eval("studio.selection.set(['o3'])");
    shoot(&mut studio, "studio.png");
    studio.page.eval("studio.selection.set([])");
    studio.page.key("3");
    studio
        .page
        .until("document.querySelector('#run') && !document.querySelector('#run').disabled");
    studio.page.eval(
        "(() => { while (document.querySelector('[data-key=without-0]')) document.querySelector('[data-key=without-0]').click(); \
         for (const id of ['lacam', 'plane-pp']) { const list = document.querySelector('[data-key=add-planner]'); list.value = id; list.dispatchEvent(new Event('change')); } })()",
    );
    studio.page.click("#run");
    studio.page.until("studio.jobs.list.length === 2 && studio.jobs.list.every((job) => job.state === 'done' && job.record && studio.watch.canShow(job))");
    studio.page.click(".job .primary");
    studio.page.until(
        "studio.watch.panes.length === 2 && studio.watch.panes.every(({ scene }) => scene.known)",
    );
    studio.page.eval("(studio.watch.clock.seek(4), studio.watch.overlay('goals', true), studio.watch.overlay('reservations', true))");
    shoot(&mut studio, "studio-watch.png");
}

/// Bytes of base64, as browsers write it.
pub(crate) fn decoded(text: &str) -> Vec<u8> {
    const LETTERS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut count) = (0u32, 0);
    for letter in text.bytes() {
        let Some(value) = LETTERS.iter().position(|known| *known == letter) else {
            continue;
        };
        bits = bits << 6 | value as u32;
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
            bits &= (1 << count) - 1;
        }
    }
    bytes
}

#[test]
fn a_fleet_is_watched_and_worked_while_it_drives() {
    let map = root().join("maps/warehouse-4-6-6-2-1.map");
    let Some(mut studio) = Studio::open(&[map], [1280, 800]) else {
        return;
    };
    studio.page.click("#to-plan");
    // The panel grows once it is known what is installed.
    studio
        .page
        .until("document.querySelector('[data-key=\"fleet-run\"]')?.disabled === false");
    // On a map without robots it is what is asked for, on the terms of the command.
    studio.page.click("[data-key=\"fleet-run\"]");
    // It is shown as soon as it drives, and time goes on.
    studio
        .page
        .until("studio.watch.live && studio.watch.clock.now > 1");
    let job = studio.page.eval("studio.watch.live.job.id");
    let line = studio.page.eval("studio.watch.live.job.line");
    let line = line.as_str().unwrap();
    assert!(
        line.contains("--model agv --cell-size 1 --limit 1000ms"),
        "{line}"
    );
    // Its throughput is drawn meanwhile.
    studio
        .page
        .until("document.querySelector('#tab-watch canvas.chart')?.width > 0");

    // Goals of all robots, and who waits for whom, are asked for once somebody looks.
    let toggle = |overlay: &str| format!("studio.watch.overlay('{overlay}', true)");
    studio.page.eval(&toggle("goals"));
    studio.page.until("studio.watch.live.goals.size > 0");
    studio
        .page
        .until("studio.watch.panes[0].recording.goalAt(3, studio.watch.clock.now)?.x > 0");
    studio.page.eval(&toggle("waits"));
    studio
        .page
        .until("document.querySelector('#waits')?.textContent.includes('wait')");

    // A robot is broken by a click, and stands from then on.
    let click = |studio: &mut Studio, wanted: &str, what: &str| {
        let choose = format!(
            "(() => {{ const list = document.querySelector('[data-key=\"live-click\"]'); list.value = '{wanted}'; \
             list.dispatchEvent(new Event('change')); }})()"
        );
        studio.page.eval(&choose);
        let at = studio.page.eval(&format!(
            "(() => {{ const pane = studio.watch.panes[0], box = pane.stage.scene.getBoundingClientRect(), [x, y] = {what}; \
             return [box.left + pane.stage.toX(x), box.top + pane.stage.toY(y)]; }})()"
        ));
        let at = [0, 1].map(|axis| at[axis].as_f64().unwrap());
        studio.page.click_at(at);
    };
    studio.page.key("Space");
    studio.page.until("studio.watch.live.job.live.paused");
    click(
        &mut studio,
        "break",
        "[pane.recording.fleet.X[3], pane.recording.fleet.Y[3]]",
    );
    // A cell is blocked: the one at the foot of the first free column.
    let cell = "studio.watch.live.recording.meta.cells && (() => { const { rows, side } = studio.watch.live.cells; \
                return [2.5 * side, (rows - 1.5) * side]; })()";
    click(&mut studio, "close", cell);
    studio.page.key("Space");
    studio
        .page
        .until("studio.watch.live.job.live.interventions.length >= 1");
    let done = studio
        .page
        .eval("studio.watch.live.job.live.interventions[0].what.hold.agent");
    assert_eq!(done, 3);
    studio
        .page
        .until("studio.watch.live.effects(studio.watch.clock.end).held.has(3)");
    // A frame of a fleet that stands still is one block.
    studio.page.key("Space");
    studio.page.until("studio.watch.live.job.live.paused");
    let before = studio.page.eval("studio.watch.clock.end").as_f64().unwrap();
    studio.page.key(".");
    studio
        .page
        .until(&format!("studio.watch.clock.end > {before}"));
    let _ = studio.page.picture();

    // Its end is a recording, with what was done to it.
    studio.page.click("#end-fleet");
    studio.page.until(&format!(
        "!studio.watch.live && studio.watch.panes[0]?.id === {job}"
    ));
    studio.page.until("studio.watch.panes[0].scene.known");
    let end = studio.page.eval("studio.watch.clock.end").as_f64().unwrap();
    assert!(end >= before, "{end} s, after {before} s were seen");
    studio.has_no_errors();
}
