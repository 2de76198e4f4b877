//! The studio's server: who is let in, what is refused, jobs, recordings, and that nothing is left.

use std::fmt::Write as _;
use std::fs;
use std::io::Read;
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use fleetyard_testkit::studio::{Studio, next_text};
use fleetyard_testkit::{INPUT, SUCCESS, USAGE, Yard, have, root, until, words};
use serde_json::{Value, json};

/// Folders of jobs of all studios of a yard.
fn left(yard: &Yard) -> Vec<PathBuf> {
    let base = yard.path(".cache/fleetyard");
    let entries = fs::read_dir(base).into_iter().flatten();
    entries.map(|entry| entry.unwrap().path()).collect()
}

/// A studio with a copy of two rooms, in the folder of the yard.
fn two_rooms(yard: &Yard) -> Studio {
    copy_rooms(yard);
    Studio::start(yard, ROOMS)
}

/// A studio with so many robots that a planner goes on to better plans for as long as it may.
fn busy_hall(yard: &Yard) -> Studio {
    let map = root().join("maps/random-32-32-20.map");
    let scen = root().join("maps/random-32-32-20-random-1.scen");
    let studio = Studio::start(yard, &format!("{} {}", map.display(), scen.display()));
    studio.edit(&json!({"op": "scatter", "count": 60, "seed": 1, "replace": true}));
    studio
}

const ROOMS: &str = "two-rooms.task.json";

fn copy_rooms(yard: &Yard) {
    for name in [ROOMS, "two-rooms.world.json"] {
        yard.write(name, fs::read(root().join("maps").join(name)).unwrap());
    }
}

fn run(planner: &str, more: &Value) -> Value {
    let mut run = json!({"planner": planner, "view": "grid", "budget_ms": 2000, "seed": 1});
    for (key, value) in more.as_object().unwrap() {
        run[key] = value.clone();
    }
    json!({"run": run})
}

#[test]
fn a_studio_says_its_address_serves_its_page_and_leaves_nothing() {
    let yard = Yard::new();
    let studio = two_rooms(&yard);
    let page = studio.with("GET", "/", &[], b"").expect(200);
    assert_eq!(page.header("set-cookie"), "");
    assert!(
        page.header("content-security-policy")
            .starts_with("default-src 'none';")
    );
    assert_eq!(page.header("x-content-type-options"), "nosniff");
    assert_eq!(page.header("cache-control"), "no-store");
    assert!(String::from_utf8_lossy(&page.body).contains("<html"));
    studio.get("/viewer/stage.js").expect(200);
    let about = studio.get("/api/studio").json();
    assert_eq!(about["protocol"], 1);
    assert_eq!(left(&yard).len(), 1);
    studio.end("INT").expect(SUCCESS);
    assert!(left(&yard).is_empty());
}

#[test]
fn who_has_no_right_to_ask_is_refused() {
    let yard = Yard::new();
    let studio = two_rooms(&yard);
    let token = studio.token.clone();
    let bearer = format!("Bearer {token}");
    let wrong = format!("Bearer {}", token.chars().rev().collect::<String>());
    let cookie = format!("fleetyard-{}={token}", studio.port);
    let cookie = ("Cookie", cookie.as_str());
    let origin = format!("http://127.0.0.1:{}", studio.port);
    let ask = |method: &str, path: &str, headers: &[(&str, &str)]| {
        studio.with(method, path, headers, b"{}").status
    };
    let right = ("Authorization", bearer.as_str());
    // No token, a wrong one, one in the wrong place.
    assert_eq!(ask("POST", "/", &[]), 401);
    assert_eq!(ask("GET", "/report", &[]), 401);
    assert_eq!(ask("GET", "/api/document", &[]), 401);
    assert_eq!(
        ask("GET", "/api/document", &[("Authorization", &wrong)]),
        401
    );
    assert_eq!(
        ask("GET", &format!("/api/document?token={token}"), &[]),
        401
    );
    // Other pages, and names that lead here.
    let elsewhere = ("Origin", "http://evil.example");
    assert_eq!(ask("GET", "/api/document", &[right, elsewhere]), 403);
    // A browser sends cookies to every port of this host, so that they are of no use here.
    let page = ("Origin", origin.as_str());
    assert_eq!(ask("POST", "/api/planners", &[cookie, page]), 401);
    assert_eq!(ask("POST", "/api/planners", &[right, page]), 200);
    let host = |host: &str| {
        let head = format!(
            "GET /api/document HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\nAuthorization: {bearer}\r\n\r\n"
        );
        studio.send(&head, b"").status
    };
    assert_eq!(host(&format!("127.0.0.1:{}", studio.port)), 200);
    assert_eq!(host(&format!("localhost:{}", studio.port)), 200);
    assert_eq!(host(&format!("evil.example:{}", studio.port)), 421);
    assert_eq!(host("127.0.0.1"), 421);
    // A socket from another page, and one of ours, which has a ticket in its address once.
    let upgrade = [
        ("Upgrade", "websocket"),
        ("Connection", "Upgrade"),
        ("Sec-WebSocket-Version", "13"),
        ("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="),
    ];
    let ticket = studio.post("/api/ticket", &json!({})).expect(200).json();
    let feed = format!("/api/feed?ticket={}", ticket["ticket"].as_str().unwrap());
    let with = |header| [&upgrade[..], &[header]].concat();
    assert_eq!(ask("GET", "/api/feed", &with(cookie)), 401);
    assert_eq!(ask("GET", &feed, &with(elsewhere)), 403);
    drop(studio.feed_at(&feed, None));
    assert_eq!(ask("GET", &feed, &with(page)), 401);
    // Paths that lead out, and asking where something would be started.
    for path in [
        "/../Cargo.toml",
        "/..%2fCargo.toml",
        "/viewer/../index.html",
        "/viewer/%2e%2e%2fsecret",
        "/api/recordings/..%2f1/trace",
    ] {
        let status = ask("GET", path, &[right]);
        assert!(status == 404 || status == 400, "{path}: {status}");
    }
    for path in ["/api/edit", "/api/open", "/api/undo", "/api/jobs/1/cancel"] {
        let refused = studio.get(path).expect(405);
        assert_eq!(refused.header("allow"), "POST", "{path}");
        let reason = "this is asked for by another method";
        assert_eq!(refused.json()["error"], reason, "{path}");
    }
    // Whatever is refused is JSON.
    for path in [
        "/api/jobs/seven",
        "/api/feed",
        "/api/jobs/%ff",
        "/api/trials/%ff",
    ] {
        let refused = studio.get(path);
        assert!((400..500).contains(&refused.status), "{path}: {refused:?}");
        assert!(refused.json()["error"].is_string(), "{path}: {refused:?}");
    }
    // What is too large, and what is unknown.
    let large = vec![b' '; 70_000];
    assert_eq!(studio.ask("POST", "/api/jobs", &large).status, 413);
    assert_eq!(ask("GET", "/api/jobs/7", &[right]), 404);
    assert_eq!(ask("POST", "/api/jobs/7/stop", &[right]), 404);
    assert_eq!(ask("DELETE", "/api/jobs/7", &[right]), 404);
    assert_eq!(
        ask("GET", "/api/recordings/7/clip?from_s=0&to_s=1", &[right]),
        404
    );
    assert_eq!(ask("GET", "/api/nothing", &[right]), 404);
    studio.end("TERM").expect(SUCCESS);
}

#[test]
fn nothing_is_started_before_somebody_asks() {
    let yard = Yard::new();
    let studio = two_rooms(&yard);
    assert_eq!(studio.get("/api/planners").json(), json!([]));
    assert_eq!(studio.processes().len(), 1);
    let found = studio.post("/api/planners", &json!({})).expect(200).json();
    let cbs = found
        .as_array()
        .unwrap()
        .iter()
        .find(|planner| planner["id"] == "cbs");
    assert_eq!(cbs.unwrap()["representations"], json!(["grid"]));
    assert_eq!(studio.get("/api/planners").json(), found);
    studio.end("INT").expect(SUCCESS);
}

#[test]
fn of_two_who_edit_at_once_one_is_told() {
    let yard = Yard::new();
    let studio = two_rooms(&yard);
    let mut feed = studio.feed();
    assert_eq!(next_text(&mut feed)["type"], "hello");
    let first = studio.get("/api/document").expect(200).json();
    assert_eq!(first["problems"], json!([]));
    let edit = |seed: u64, base: &Value| {
        let asked = json!({"base_version": base, "op": {"op": "set-seed", "seed": seed}});
        studio.post("/api/edit", &asked)
    };
    let second = edit(7, &first["version"]).expect(200).json();
    assert_eq!(second["document"]["seed"], 7);
    let late = edit(8, &first["version"]).expect(409).json();
    assert_eq!(late["version"], second["version"]);
    let news = next_text(&mut feed);
    assert_eq!(
        news,
        json!({"type": "changed", "version": second["version"]})
    );
    // A refusal changes nothing, and says where.
    let asked =
        json!({"base_version": second["version"], "op": {"op": "remove-agents", "indices": [999]}});
    let refused = studio.post("/api/edit", &asked).expect(422).json();
    assert!(
        refused["error"].is_string() && refused["place"].is_string() && refused["hint"].is_string()
    );
    let undone = studio
        .post("/api/undo", &json!({"base_version": second["version"]}))
        .expect(200)
        .json();
    assert_eq!(undone["digest"], first["digest"]);
    assert_eq!(undone["document"]["seed"], first["document"]["seed"]);
    studio.end("INT").expect(SUCCESS);
}

/// Whoever reads the command line of the browser is too late, and no other user's token is of use.
#[test]
fn other_users_of_the_machine_are_refused() {
    if fleetyard_runtime::user() != 0 || !have("python3") {
        eprintln!("skipped: it takes root to be two users, and python3");
        return;
    }
    let yard = Yard::new();
    let studio = two_rooms(&yard);
    let ask = |user: u32| {
        // All is imported before, which another user may not read.
        let script = format!(
            "import os, socket\n\
             os.setuid({user})\n\
             with socket.socket() as ask:\n \
             ask.connect(('127.0.0.1', {port}))\n \
             ask.sendall(b'GET /api/document HTTP/1.1\\r\\nHost: 127.0.0.1:{port}\\r\\nConnection: close\\r\\n'\n  \
             b'Authorization: Bearer {}\\r\\n\\r\\n')\n \
             while part := ask.recv(1 << 16): os.write(1, part)",
            studio.token,
            port = studio.port,
        );
        let told = Command::new("python3").args(["-c", &script]).output();
        let told = told.unwrap();
        assert!(
            told.status.success(),
            "{}",
            String::from_utf8_lossy(&told.stderr)
        );
        String::from_utf8(told.stdout).unwrap()
    };
    let let_in = ask(0);
    assert!(let_in.starts_with("HTTP/1.1 200"), "{let_in}");
    let refused = ask(65_534);
    assert!(refused.starts_with("HTTP/1.1 403"), "{refused}");
    assert!(
        refused.contains("another user of this machine"),
        "{refused}"
    );
    studio.end("INT").expect(SUCCESS);
}

#[test]
fn sockets_that_say_nothing_keep_nobody_out() {
    let yard = Yard::new();
    let studio = two_rooms(&yard);
    let mut page = studio.feed();
    let idle: Vec<TcpStream> = (0..600)
        .map(|_| TcpStream::connect(("127.0.0.1", studio.port)).unwrap())
        .collect();
    // Whoever has the right comes in, and stays.
    let document = studio.get("/api/document").expect(200).json();
    let mut agent = document["document"]["agents"][0].clone();
    agent["goal"] = agent["start"].clone();
    studio.edit(&json!({"op": "set-agent", "index": 0, "agent": agent}));
    while next_text(&mut page)["type"] != "changed" {}
    // The first of the others has gone.
    let gone = (&idle[0]).read(&mut [0]);
    assert!(matches!(gone, Ok(0) | Err(_)), "{gone:?}");
    studio.end("INT").expect(SUCCESS);
}

#[test]
fn a_job_gives_what_the_command_line_gives() {
    let yard = Yard::new();
    let studio = two_rooms(&yard);
    let asked = run(
        "lacam",
        &json!({"execute": {}, "options": {"anytime": false}}),
    );
    let job = studio.post("/api/jobs", &asked).expect(200).json();
    let job = studio.wait_for(&job);
    assert_eq!(
        (&job["state"], &job["exit"]),
        (&json!("done"), &json!(0)),
        "{job}"
    );
    assert_eq!(job["stale"], false);
    assert_eq!(job["verdict"]["valid"], true);
    assert!(!job["incumbents"].as_array().unwrap().is_empty());
    // The same by hand.
    let task = ROOMS;
    let by_hand = yard.line(&format!(
        "run --task {task} --planner lacam --option anytime=false --representation grid --budget 2s \
         --seed 1 --plan-out plan.json --format json"
    ));
    let by_hand = by_hand.expect(SUCCESS).json();
    assert_eq!(job["record"]["instance_digest"], by_hand["instance_digest"]);
    assert_eq!(job["record"]["plan_digest"], by_hand["plan_digest"]);
    let executed = yard.line(&format!(
        "simulate plan.json --task {task} --trace run.trace --format json"
    ));
    let executed = executed.expect(SUCCESS).json();
    assert_eq!(job["execution"]["trace_digest"], executed["trace_digest"]);
    // The recording of it, whole and in windows.
    let id = &job["id"];
    let trace = studio
        .get(&format!("/api/recordings/{id}/trace"))
        .expect(200);
    assert_eq!(trace.body, yard.read("run.trace"));
    let path = format!("/api/recordings/{id}/trace");
    let bearer = format!("Bearer {}", studio.token);
    let range = |range: &str| {
        let headers = [("Authorization", bearer.as_str()), ("Range", range)];
        studio.with("GET", &path, &headers, b"")
    };
    let part = range("bytes=10-19").expect(206);
    assert_eq!(part.body, trace.body[10..20]);
    assert_eq!(
        part.header("content-range"),
        format!("bytes 10-19/{}", trace.body.len())
    );
    assert_eq!(
        range("bytes=-7").expect(206).body[..],
        trace.body[trace.body.len() - 7..]
    );
    range(&format!("bytes={}-", trace.body.len())).expect(416);
    let meta = studio
        .get(&format!("/api/recordings/{id}/meta"))
        .expect(200)
        .json();
    let quick = studio
        .get(&format!("/api/recordings/{id}/meta?quick=true"))
        .expect(200)
        .json();
    assert_eq!(meta["duration_s"], quick["duration_s"]);
    let clip = studio
        .get(&format!("/api/recordings/{id}/clip?from_s=1&to_s=2"))
        .expect(200);
    assert_eq!(&clip.body[..4], b"FYC1");
    let number = |at: usize| u32::from_le_bytes(clip.body[at..at + 4].try_into().unwrap());
    assert_eq!(
        (number(4), number(8)),
        (meta["agents"].as_u64().unwrap() as u32, 11)
    );
    for wrong in [
        "from_s=2&to_s=1",
        "from_s=-1&to_s=1",
        "from_s=0&to_s=1e300",
        "from_s=0&to_s=1&rate=0",
        "from_s=0",
        "from_s=x&to_s=1",
    ] {
        studio
            .get(&format!("/api/recordings/{id}/clip?{wrong}"))
            .expect(422);
    }
    // The document moves on: the plan is of another one.
    let document = studio.get("/api/document").json();
    let mut agent = document["document"]["agents"][0].clone();
    agent["goal"] = agent["start"].clone();
    studio.edit(&json!({"op": "set-agent", "index": 0, "agent": agent}));
    let stale = studio.get(&format!("/api/jobs/{id}")).json();
    assert_eq!(stale["stale"], true);
    assert_eq!(stale["verdict"]["valid"], false);
    studio
        .ask("DELETE", &format!("/api/jobs/{id}"), b"")
        .expect(200);
    studio.get(&format!("/api/jobs/{id}")).expect(404);
    studio.end("INT").expect(SUCCESS);
    assert!(left(&yard).is_empty());
}

#[test]
fn a_job_that_is_stopped_has_its_best_plan_and_one_that_is_cancelled_leaves_nothing() {
    let yard = Yard::new();
    let studio = busy_hall(&yard);
    let asked = run("lacam", &json!({"budget_ms": 600_000}));
    let start = || studio.post("/api/jobs", &asked).expect(200).json();
    let first = start();
    let path = format!("/api/jobs/{}", first["id"]);
    let planned = || {
        !studio.get(&path).json()["incumbents"]
            .as_array()
            .unwrap()
            .is_empty()
    };
    assert!(until(planned));
    studio.ask("POST", &format!("{path}/stop"), b"").expect(200);
    let stopped = studio.wait_for(&first);
    assert_eq!(
        (&stopped["state"], &stopped["exit"]),
        (&json!("done"), &json!(130)),
        "{stopped}"
    );
    assert_eq!(stopped["has"]["plan"], true);
    assert_eq!(stopped["verdict"]["view"]["valid"], true, "{stopped}");
    // Two run and one waits; all are cancelled.
    let jobs = [start(), start(), start()];
    let running =
        |job: &Value| studio.get(&format!("/api/jobs/{}", job["id"])).json()["state"] == "running";
    assert!(until(|| running(&jobs[0]) && running(&jobs[1])));
    assert!(!running(&jobs[2]));
    assert!(studio.processes().len() > 2);
    let busy = format!("/api/jobs/{}", jobs[0]["id"]);
    studio.ask("DELETE", &busy, b"").expect(409);
    for job in jobs.iter().rev() {
        studio
            .ask("POST", &format!("/api/jobs/{}/cancel", job["id"]), b"")
            .expect(200);
    }
    for job in &jobs {
        assert_eq!(studio.wait_for(job)["state"], "cancelled");
    }
    assert_eq!(studio.processes().len(), 1);
    let folders = fs::read_dir(&left(&yard)[0]).unwrap().count();
    assert_eq!(folders, 1, "that of the job that was stopped");
    studio.end("INT").expect(SUCCESS);
}

#[test]
fn a_studio_that_ends_takes_its_jobs_with_it_however_it_ends() {
    for signal in ["INT", "KILL"] {
        let yard = Yard::new();
        let mut studio = busy_hall(&yard);
        let asked = run("lacam", &json!({"budget_ms": 600_000}));
        let job = studio.post("/api/jobs", &asked).expect(200).json();
        let path = format!("/api/jobs/{}", job["id"]);
        assert!(until(|| studio.get(&path).json()["state"] == "running"));
        assert!(until(|| studio.processes().len() > 2));
        if signal == "INT" {
            studio.end("INT").expect(SUCCESS);
            assert!(left(&yard).is_empty());
            continue;
        }
        assert!(!studio.kill().success());
        assert!(until(|| studio.processes().is_empty()));
        // Its folder is removed by the next one.
        assert_eq!(left(&yard).len(), 1);
        let old = left(&yard)[0].clone();
        let next = two_rooms(&yard);
        assert!(!old.exists());
        next.end("TERM").expect(SUCCESS);
        assert!(left(&yard).is_empty());
    }
}

#[test]
fn a_page_that_does_not_read_keeps_nobody_waiting() {
    let yard = Yard::new();
    let studio = two_rooms(&yard);
    let slow: Vec<_> = (0..3).map(|_| studio.feed()).collect();
    let mut reads = studio.feed();
    let mut version = Value::Null;
    for seed in 0..200 {
        version = studio.edit(&json!({"op": "set-seed", "seed": seed}))["version"].take();
    }
    let told = until(|| next_text(&mut reads)["version"] == version);
    assert!(told);
    // What a page says that makes no sense is answered, and the page stays.
    reads.send("{\"type\":\"watch\"}".into()).unwrap();
    assert_eq!(next_text(&mut reads)["type"], "refused");
    reads
        .send("{\"type\":\"control\",\"job\":1,\"do\":{}}".into())
        .unwrap();
    assert_eq!(next_text(&mut reads)["type"], "refused");
    studio.end("INT").expect(SUCCESS);
    let goodbye = until(|| {
        let news = next_text(&mut reads);
        news.is_null() || news["type"] == "goodbye"
    });
    assert!(goodbye);
    drop(slow);
}

/// Changes that nobody has saved are told, and a new document gets files by a name, beside which none is lost.
#[test]
fn a_new_document_is_saved_under_a_name() {
    let yard = Yard::new();
    copy_rooms(&yard);
    let studio = Studio::start(&yard, "");
    let state = || studio.get("/api/document").json();
    let folder = studio.get("/api/studio").json()["folder"].clone();
    assert_eq!(
        folder.as_str().unwrap(),
        yard.path(".").canonicalize().unwrap().to_str().unwrap()
    );
    assert_eq!(
        (&state()["unsaved"], &state()["file"]),
        (&json!(false), &Value::Null)
    );
    let wall = json!({"op": "add-obstacles", "obstacles": [{"polygon": [[4, 0], [5, 0], [5, 2]]}]});
    assert_eq!(studio.edit(&wall)["unsaved"], true);
    studio.post("/api/save", &json!({})).expect(409);
    studio.post("/api/save", &json!({"name": " "})).expect(422);
    studio
        .post("/api/save", &json!({"name": "a", "folder": "/"}))
        .expect(422);

    // Without robots there is no task, but there are walls that nobody wants to lose.
    let saved = studio
        .post("/api/save", &json!({"name": "../my hall"}))
        .expect(200)
        .json();
    let hall = yard.path("my-hall.world.json").canonicalize().unwrap();
    assert_eq!(saved, json!({"files": [hall]}));
    assert_eq!(state()["document"]["name"], "../my hall");
    assert_eq!(state()["unsaved"], false);
    let robot = json!({"op": "add-agents", "agents": [{"start": [1, 1], "goal": [9, 5]}]});
    assert_eq!(studio.edit(&robot)["unsaved"], true);
    studio.ask("POST", "/api/save", b"").expect(200);
    assert_eq!(state()["unsaved"], false);
    let info = yard
        .line("world info my-hall.task.json --format json")
        .expect(SUCCESS)
        .json();
    assert_eq!(info["problem_digest"], state()["digest"]);

    // Back to what was saved, nothing is unsaved.
    let version = studio.edit(&json!({"op": "set-seed", "seed": 9}))["version"].clone();
    let undone = studio
        .post("/api/undo", &json!({"base_version": version}))
        .expect(200)
        .json();
    assert_eq!(undone["unsaved"], false);

    // A file that is there stays, unless it is to go; another document has no files.
    let before = yard.read(ROOMS);
    let kept = studio
        .post("/api/save", &json!({"name": "two-rooms"}))
        .expect(409)
        .json();
    assert_eq!(kept["exists"], true);
    assert_eq!(yard.read(ROOMS), before);
    studio
        .post("/api/save", &json!({"name": "two-rooms", "replace": true}))
        .expect(200);
    assert_ne!(yard.read(ROOMS), before);
    let mut other = state()["document"].clone();
    other["agents"] = json!([]);
    assert_eq!(
        studio.edit(&json!({"op": "replace", "document": other}))["file"],
        Value::Null
    );
    studio.post("/api/save", &json!({})).expect(409);
    studio.end("INT").expect(SUCCESS);
}

/// A task that was sent by somebody names its world as it likes.
#[test]
fn saving_writes_what_was_read_and_asks_before_it_leaves_the_folder() {
    let yard = Yard::new();
    copy_rooms(&yard);
    for folder in ["got", "mine"] {
        fs::create_dir(yard.path(folder)).unwrap();
    }
    let world = || yard.read("two-rooms.world.json");
    let task = String::from_utf8(yard.read(ROOMS)).unwrap();
    let naming = |world: &str| task.replace("two-rooms.world.json", world);
    let robot = json!({"op": "set-seed", "seed": 7});
    let saved = |studio: &Studio, asked: &Value| {
        let reply = studio.post("/api/save", asked);
        (reply.status, reply.json())
    };

    // The world is the one that was given with the task, not what the task names.
    yard.write("mine/.profile", "echo mine\n");
    yard.write("got/a.task.json", naming("../mine/.profile"));
    yard.write("got/a.world.json", world());
    let studio = Studio::start(&yard, "got/a.task.json got/a.world.json");
    studio.edit(&robot);
    let (status, said) = saved(&studio, &json!({}));
    assert_eq!(status, 200, "{said}");
    let files = said["files"].as_array().unwrap();
    assert!(
        files[1].as_str().unwrap().ends_with("got/a.world.json"),
        "{said}"
    );
    assert_eq!(yard.read("mine/.profile"), b"echo mine\n");
    studio.end("INT").expect(SUCCESS);

    // A world outside is written once that was said, whether it is named or a link leads there.
    yard.write("mine/b.world.json", world());
    yard.write("got/b.task.json", naming("../mine/b.world.json"));
    std::os::unix::fs::symlink("../mine/b.world.json", yard.path("got/c.world.json")).unwrap();
    yard.write("got/c.task.json", naming("c.world.json"));
    for task in ["got/b.task.json", "got/c.task.json"] {
        let before = yard.read("mine/b.world.json");
        let studio = Studio::start(&yard, task);
        studio.edit(&json!({"op": "set-name", "name": task}));
        let (status, said) = saved(&studio, &json!({}));
        assert_eq!(status, 409, "{said}");
        let outside = fs::canonicalize(yard.path("mine/b.world.json")).unwrap();
        assert_eq!(said["outside"], json!([outside]));
        assert_eq!(yard.read("mine/b.world.json"), before);
        assert_eq!(saved(&studio, &json!({"outside": true})).0, 200);
        assert_ne!(yard.read("mine/b.world.json"), before);
        studio.end("INT").expect(SUCCESS);
    }

    // What became another file meanwhile stays, as does one that has the name by chance.
    yard.write("got/d.world.json", world());
    yard.write("got/d.task.json", naming("d.world.json"));
    let studio = Studio::start(&yard, "got/d.task.json");
    studio.edit(&robot);
    yard.write("got/d.world.json", "{}");
    let (status, said) = saved(&studio, &json!({}));
    assert_eq!(status, 422, "{said}");
    assert!(
        said["error"]
            .as_str()
            .unwrap()
            .contains("no world of this project"),
        "{said}"
    );
    assert_eq!(yard.read("got/d.world.json"), b"{}");
    yard.write("hall.task.json", "notes");
    let (status, said) = saved(&studio, &json!({"name": "hall", "replace": true}));
    assert_eq!(status, 422, "{said}");
    assert_eq!(yard.read("hall.task.json"), b"notes");
    studio.end("INT").expect(SUCCESS);
}

#[test]
fn files_are_opened_exported_and_saved() {
    let yard = Yard::new();
    let studio = two_rooms(&yard);
    let first = studio.get("/api/document").json();
    let exported = studio
        .get("/api/export?as=task&all=true")
        .expect(200)
        .json();
    assert_eq!(exported["files"].as_array().unwrap().len(), 2);
    let map = fs::read(root().join("maps/random-32-32-20.map")).unwrap();
    let scen = fs::read(root().join("maps/random-32-32-20-random-1.scen")).unwrap();
    let opened = studio
        .ask("POST", "/api/open?name=random-32-32-20.map", &map)
        .expect(200)
        .json();
    assert_eq!(opened["document"]["document"]["ground"]["map"]["rows"], 32);
    let opened = studio
        .ask("POST", "/api/open?name=a.scen", &scen)
        .expect(200)
        .json();
    assert!(
        !opened["document"]["document"]["agents"]
            .as_array()
            .unwrap()
            .is_empty()
    );
    // It has no files of its own.
    studio.ask("POST", "/api/save", b"").expect(409);
    let version = &opened["document"]["version"];
    let undone = studio
        .post("/api/undo", &json!({"base_version": version}))
        .expect(200)
        .json();
    studio
        .post("/api/undo", &json!({"base_version": undone["version"]}))
        .expect(200);
    assert_eq!(
        studio.get("/api/document").json()["digest"],
        first["digest"]
    );
    for wrong in ["", ".", "..", "a/b", "a%2fb", ".hidden"] {
        studio
            .ask("POST", &format!("/api/open?name={wrong}"), b"x")
            .expect(422);
    }
    studio
        .ask("POST", "/api/open?name=a.map", b"\xff\xfe")
        .expect(422);
    let layers = studio.get("/api/artefacts").expect(200).json();
    assert_eq!(layers[0]["id"], "world");
    studio.get("/api/grid").expect(200);
    studio.get("/api/roadmap").expect(200);
    studio.get("/api/clearance?side=0.5").expect(200);
    studio.get("/api/clearance?side=0").expect(422);
    studio.end("INT").expect(SUCCESS);
}

#[test]
fn a_studio_ends_when_its_standard_input_closes() {
    let yard = Yard::new();
    let started = yard.start_with(
        fleetyard_testkit::fleetyard(),
        &words("studio --no-open"),
        |command| {
            command.stdin(Stdio::piped());
        },
    );
    let ended = started.wait_by(|started| {
        drop(started.child.stdin.take());
        started.child.wait().ok()
    });
    ended.expect(SUCCESS);
    assert!(left(&yard).is_empty());
}

#[test]
fn a_studio_says_why_it_does_not_begin() {
    let yard = Yard::new();
    yard.line("studio --no-open missing.task.json")
        .expect(INPUT);
    yard.write("bad.task.json", "{\"format\": \"fleetyard.task/1\"");
    let ended = yard.line("studio --no-open bad.task.json").expect(INPUT);
    assert!(
        ended.stderr.contains("bad.task.json") && ended.stderr.contains("hint:"),
        "{ended}"
    );
    let studio = two_rooms(&yard);
    let ended = yard
        .line(&format!("studio --no-open --port {}", studio.port))
        .expect(INPUT);
    assert!(ended.stderr.contains("--port"), "{ended}");
    studio.end("INT").expect(SUCCESS);
}

/// Twelve robots in two rooms, which meet at the doors.
fn twelve(yard: &Yard) -> Studio {
    let studio = two_rooms(yard);
    studio.edit(&json!({"op": "scatter", "count": 12, "seed": 1, "replace": true}));
    studio
}

fn done(studio: &Studio, asked: &Value) -> Value {
    let job = studio.post("/api/jobs", asked).expect(200).json();
    let job = studio.wait_for(&job);
    assert_eq!(job["state"], "done", "{job}");
    job["id"].clone()
}

#[test]
fn the_server_tells_who_waits_for_whom() {
    let yard = Yard::new();
    let studio = twelve(&yard);
    let conduct = json!({"policy": "adg", "delay": "bernoulli:0.3,3s", "seed": 1});
    let execute = |conduct: &Value| {
        let more = json!({"options": {"anytime": false}, "execute": conduct});
        done(&studio, &run("lacam", &more))
    };
    let id = execute(&conduct);
    let ask = |id: &Value, from: f64, to: f64| {
        let path = format!("/api/recordings/{id}/waits?from_s={from}&to_s={to}");
        studio.get(&path).expect(200).json()
    };
    let changes = |from: f64, to: f64| ask(&id, from, to)["changes"].as_array().unwrap().clone();
    let all = changes(0.0, 1000.0);
    assert!(all.len() > 10, "{all:?}");
    let time = |change: &Value| change[0].as_f64().unwrap();
    assert!(all.is_sorted_by(|a, b| time(a) <= time(b)));
    for change in &all {
        let (agent, other) = (&change[1], &change[2]);
        assert!(agent.as_u64().unwrap() < 12);
        assert!(
            other.is_null() || (other.as_u64().unwrap() < 12 && other != agent),
            "{change}"
        );
    }
    // A window begins with the waits that hold then, and goes on with those that begin in it.
    let standing = |changes: &[Value], at: f64| {
        let mut standing = std::collections::BTreeMap::new();
        for change in changes.iter().filter(|change| time(change) <= at) {
            match &change[2] {
                Value::Null => standing.remove(&change[1].as_u64()),
                _ => standing.insert(change[1].as_u64(), change.clone()),
            };
        }
        standing
    };
    let end = time(all.last().unwrap());
    for from in [0.0, 0.25 * end, 0.5 * end, end, end + 10.0] {
        let window = changes(from, from + 2.0);
        for at in [from, from + 1.0, from + 2.0] {
            assert_eq!(standing(&window, at), standing(&all, at), "{at} in {from}");
        }
        assert!(
            window
                .iter()
                .all(|change| time(change) <= from + 2.0 + 0.02)
        );
    }
    assert!(standing(&all, end).is_empty(), "all arrive");
    // By time nobody waits for anybody, which is said; so it is of a trace that was opened.
    let by_time = execute(&json!({"policy": "time"}));
    let told = ask(&by_time, 0.0, 10.0);
    assert!(
        told["why"].as_str().unwrap().contains("times of the plan"),
        "{told}"
    );
    let trace = studio.get(&format!("/api/recordings/{id}/trace")).body;
    let opened = studio
        .ask("POST", "/api/open?name=a.trace", &trace)
        .expect(200)
        .json();
    assert_eq!(
        ask(&opened["recording"]["id"], 0.0, 1000.0)["changes"],
        json!(all)
    );
    for wrong in [
        "from_s=2&to_s=1",
        "from_s=0",
        "from_s=0&to_s=nan",
        "from_s=0&to_s=1&rate=1",
    ] {
        studio
            .get(&format!("/api/recordings/{id}/waits?{wrong}"))
            .expect(422);
    }
    studio
        .get("/api/recordings/99/waits?from_s=0&to_s=1")
        .expect(404);
    studio.end("INT").expect(SUCCESS);
}

#[test]
fn the_server_tells_what_a_plan_reserves() {
    let yard = Yard::new();
    let studio = twelve(&yard);
    let document = studio.get("/api/document").json()["document"].clone();
    let end = |agent: usize, end: &str| {
        [0, 1].map(|axis| document["agents"][agent][end][axis].as_f64().unwrap())
    };
    let near = |place: &Value, at: [f64; 2], far: f64| {
        (0..2).all(|axis| (place[3 + axis].as_f64().unwrap() - at[axis]).abs() <= far)
    };
    for (planner, view) in [("lacam", "grid"), ("roadmap-pp", "roadmap")] {
        let id = done(&studio, &run(planner, &json!({"view": view})));
        let ask = |from: f64, to: f64| {
            let path = format!("/api/jobs/{id}/reservations?from_s={from}&to_s={to}");
            let told = studio.get(&path).expect(200).json();
            assert_eq!(
                (&told["view"], &told["complete"]),
                (&json!(view), &json!(true))
            );
            told
        };
        let begin = ask(0.0, 0.0);
        let far = begin["side_m"].as_f64().map_or(1e-6, |side| 0.51 * side);
        let held = |told: &Value, agent: usize| -> Vec<Value> {
            let own = told["held"].as_array().unwrap().iter();
            own.filter(|place| place[0] == agent).cloned().collect()
        };
        let late = ask(1e6, 1e6 + 1.0);
        let middle = ask(2.0, 5.0);
        for agent in 0..12 {
            let places = held(&begin, agent);
            assert!(
                places
                    .iter()
                    .any(|place| near(place, end(agent, "start"), far)),
                "{places:?}"
            );
            let places = held(&late, agent);
            assert_eq!(places.len(), 1, "{view}: {places:?}");
            assert!(near(&places[0], end(agent, "goal"), far), "{places:?}");
            // Somewhere at any time: what is held follows on what was held.
            let mut until = 2.0;
            for place in held(&middle, agent) {
                let [from, to] = [1, 2].map(|at| place[at].as_f64().unwrap());
                assert!(
                    from <= until + 1e-9 && from <= to,
                    "{view}, {agent}: {place}"
                );
                until = f64::max(until, to);
            }
            assert!((until - 5.0).abs() < 1e-9, "{view}, {agent}: {until}");
        }
        let edges = middle["held"].as_array().unwrap().iter();
        let edges = edges
            .filter(|place| place.as_array().unwrap().len() == 7)
            .count();
        assert_eq!(edges > 0, view == "roadmap");
        studio
            .get(&format!("/api/jobs/{id}/reservations?from_s=3&to_s=2"))
            .expect(422);
    }
    let plane = done(&studio, &run("plane-pp", &json!({"view": "continuous"})));
    let refused = studio.get(&format!("/api/jobs/{plane}/reservations?from_s=0&to_s=1"));
    assert!(refused.expect(422).json()["hint"].is_string());
    studio
        .get("/api/jobs/99/reservations?from_s=0&to_s=1")
        .expect(404);
    studio.end("INT").expect(SUCCESS);
}

/// A file of many parts is sent part by part: the studio never has all of it in memory.
#[cfg(target_os = "linux")]
#[test]
fn a_large_trace_is_not_read_into_memory() {
    use std::io::{Read, Write};

    const WHOLE: u64 = 300 << 20;
    let yard = Yard::new();
    copy_rooms(&yard);
    yard.line(&format!(
        "run --task {ROOMS} --planner plane-pp --budget 5s --plan-out plan.json"
    ))
    .expect(SUCCESS);
    yard.line(&format!(
        "simulate plan.json --task {ROOMS} --trace long.trace"
    ))
    .expect(SUCCESS);
    // What follows a trace is damage, which is no reason not to hand the file out.
    let file = fs::File::options()
        .write(true)
        .open(yard.path("long.trace"));
    file.unwrap().set_len(WHOLE).unwrap();
    let studio = Studio::start(&yard, "long.trace");
    let id = studio.get("/api/recordings").json()[0]["id"].clone();
    let mut stream = std::net::TcpStream::connect(("127.0.0.1", studio.port)).unwrap();
    let head = format!(
        "GET /api/recordings/{id}/trace HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nConnection: close\r\nAuthorization: Bearer {}\r\n\r\n",
        studio.port, studio.token
    );
    stream.write_all(head.as_bytes()).unwrap();
    let (mut buffer, mut read) = (vec![0; 1 << 20], 0);
    loop {
        match stream.read(&mut buffer).unwrap() {
            0 => break,
            some => read += some as u64,
        }
    }
    assert!(read > WHOLE, "{read}");
    let status = fs::read_to_string(format!("/proc/{}/status", studio.process())).unwrap();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let peak = peak.unwrap().split_whitespace().next().unwrap();
    let peak_kb: u64 = peak.parse().unwrap();
    assert!(peak_kb < WHOLE / 2048, "{peak_kb} KiB");
    studio.end("INT").expect(SUCCESS);
}

/// Only `--bind` opens a studio to others, and says what that means.
#[cfg(target_os = "linux")]
#[test]
fn a_studio_is_open_to_others_only_where_that_is_asked_for() {
    let yard = Yard::new();
    let studio = two_rooms(&yard);
    let elsewhere = |port: u16| std::net::TcpStream::connect(("127.0.0.2", port));
    assert!(elsewhere(studio.port).is_err());
    let named = |studio: &Studio| {
        let head = format!(
            "GET /api/studio HTTP/1.1\r\nHost: 127.0.0.2:{}\r\nConnection: close\r\nAuthorization: Bearer {}\r\n\r\n",
            studio.port, studio.token
        );
        studio.send(&head, b"")
    };
    let refused = named(&studio).expect(421).json();
    assert!(refused["error"].is_string() && refused["hint"].is_string());
    let ended = studio.end("INT").expect(SUCCESS);
    assert_eq!(ended.stderr, "");

    let studio = Studio::start(&yard, &format!("--bind 0.0.0.0 {ROOMS}"));
    assert!(elsewhere(studio.port).is_ok());
    named(&studio).expect(200);
    // Nobody gets in without the token there, either.
    assert_eq!(studio.with("GET", "/api/studio", &[], b"").status, 401);
    let ended = studio.end("INT").expect(SUCCESS);
    assert!(
        ended.stderr.contains("0.0.0.0") && ended.stderr.contains("can do here what you can"),
        "{ended}"
    );
    yard.line("studio --no-open --bind 203.0.113.7")
        .expect(INPUT);
    yard.line("studio --no-open --bind everywhere")
        .expect(USAGE);
}

/// The browser is what `xdg-open` starts. It gets an address that lets in once.
#[cfg(target_os = "linux")]
#[test]
fn a_studio_opens_a_browser_or_says_that_there_is_none() {
    use std::os::unix::fs::PermissionsExt;

    for works in [true, false] {
        let yard = Yard::new();
        let folder = yard.path("programs");
        fs::create_dir(&folder).unwrap();
        let opener = yard.write(
            "programs/xdg-open",
            format!("#!/bin/sh\nprintf %s \"$*\" > opened.part\nmv opened.part opened\n{works}\n"),
        );
        fs::set_permissions(&opener, fs::Permissions::from_mode(0o755)).unwrap();
        let usual = std::env::var("PATH").unwrap();
        let yard = yard.set("PATH", &format!("{}:{usual}", folder.display()));
        copy_rooms(&yard);
        let studio = Studio::with_arguments(&yard, &[ROOMS]);
        assert!(until(|| yard.path("opened").exists()));
        let address = String::from_utf8(yard.read("opened")).unwrap();
        assert!(!address.contains(&studio.token), "{address}");
        let origin = format!("http://127.0.0.1:{}", studio.port);
        let first = address.strip_prefix(&format!("{origin}/#token=")).unwrap();
        let with = |path: &str, key: &str| {
            let bearer = format!("Bearer {key}");
            studio.with("POST", path, &[("Authorization", &bearer)], b"")
        };
        // It opens the door, once, and nothing else.
        assert_eq!(with("/api/planners", first).status, 401);
        let key = with("/api/enter", first).expect(200).json();
        let key = key["key"].as_str().unwrap();
        assert!(![first, &studio.token].contains(&key));
        with("/api/planners", key).expect(200);
        assert_eq!(with("/api/enter", first).status, 401);
        // Somebody else's page does not come in unseen.
        let mut feed = studio.feed();
        assert_eq!(next_text(&mut feed)["type"], "hello");
        with("/api/enter", &studio.token).expect(200);
        assert_eq!(next_text(&mut feed), json!({"type": "newcomer"}));
        let newcomer = "note: another browser came in; if that was not you, end the studio\n";
        if works {
            let ended = studio.end("INT").expect(SUCCESS);
            assert_eq!(ended.stderr, newcomer);
            continue;
        }
        // It is said as soon as the opener has ended.
        assert!(until(|| studio.processes().len() == 1));
        std::thread::sleep(std::time::Duration::from_millis(300));
        let ended = studio.end("INT").expect(SUCCESS);
        assert!(
            ended.stderr.contains("no browser could be started"),
            "{ended}"
        );
    }
}

/// Leaves out of an answer what differs between runs and builds.
fn masked(value: &mut Value) {
    match value {
        Value::String(text) => {
            let digest = text.len() == 32 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
            if digest || text == env!("CARGO_PKG_VERSION") {
                *text = "…".into();
            }
        }
        Value::Array(values) => values.iter_mut().for_each(masked),
        Value::Object(values) => {
            for (key, value) in values {
                match key.as_str() {
                    "at_ms" | "elapsed_ms" | "solve_time_ms" => *value = 0.into(),
                    "record" | "execution" | "values_cm" | "vertices" | "edges" | "columns"
                    | "key" | "store" | "folder" => {
                        *value = "…".into();
                    }
                    _ => masked(value),
                }
            }
        }
        _ => {}
    }
}

/// A request and its answer, as the golden file has them; returns the answer whole.
fn exchange(
    studio: &Studio,
    told: &mut String,
    (method, path): (&str, &str),
    body: &Value,
) -> Value {
    let sent = if body.is_null() {
        String::new()
    } else {
        body.to_string()
    };
    let reply = studio.ask(method, path, sent.as_bytes());
    let mut answer = reply.json();
    let whole = answer.clone();
    masked(&mut answer);
    let status = reply.status;
    let _ = write!(told, "{method} {path}\n{sent}\n{status}\n{answer:#}\n\n");
    whole
}

/// After a change of the protocol that is meant: `SNAPSHOTS=overwrite`, look, and think of its version.
#[test]
fn the_protocol_is_as_it_was() {
    let yard = Yard::new();
    let studio = two_rooms(&yard);
    let mut told = String::new();
    let mut ask =
        |method: &str, path: &str, body: &Value| exchange(&studio, &mut told, (method, path), body);
    let none = Value::Null;
    ask("GET", "/api/studio", &none);
    ask("GET", "/api/document", &none);
    let op = json!({"op": "add-agents", "agents": [{"robot": "nobody", "start": [1, 1], "goal": [2, 2]}]});
    ask("POST", "/api/edit", &json!({"base_version": 0, "op": op}));
    ask(
        "POST",
        "/api/edit",
        &json!({"base_version": 0, "op": {"op": "set-seed", "seed": 3}}),
    );
    ask(
        "POST",
        "/api/edit",
        &json!({"base_version": 0, "op": {"op": "set-seed", "seed": 4}}),
    );
    ask("POST", "/api/edit", &json!({"base_version": 1}));
    ask("POST", "/api/undo", &json!({"base_version": 1}));
    ask("POST", "/api/undo", &json!({"base_version": 2}));
    ask("GET", "/api/artefacts", &none);
    ask("GET", "/api/grid", &none);
    ask("GET", "/api/roadmap", &none);
    ask("GET", "/api/clearance?side=1", &none);
    ask("POST", "/api/save", &json!({}));
    ask("POST", "/api/jobs", &run("nobody", &json!({})));
    let job = ask(
        "POST",
        "/api/jobs",
        &run("pibt", &json!({"execute": {"policy": "adg"}})),
    );
    studio.wait_for(&job);
    let path = format!("/api/jobs/{}", job["id"]);
    ask("GET", &path, &none);
    ask(
        "GET",
        &format!("/api/recordings/{}/meta?quick=true", job["id"]),
        &none,
    );
    ask(
        "GET",
        &format!("/api/recordings/{}/waits?from_s=0&to_s=2", job["id"]),
        &none,
    );
    ask(
        "GET",
        &format!("{path}/reservations?from_s=0&to_s=0.25"),
        &none,
    );
    ask("GET", "/api/artefacts", &none);
    ask("DELETE", &path, &none);
    ask("GET", "/api/jobs", &none);
    ask("GET", "/api/recordings", &none);
    ask("GET", "/api/suite", &none);
    ask("GET", "/api/suite/trials", &none);
    ask("POST", "/api/suite/trials/0/open", &json!({}));
    ask("GET", "/api/jobs/1/doing", &none);
    studio.end("INT").expect(SUCCESS);
    yard.write(
        "one.toml",
        "name = \"one\"\nprotocol.keep_plans = true\n[[planner]]\nplugin = \"pibt\"\n\
         [[instances]]\ntask = \"two-rooms.task.json\"\nviews = [\"grid\"]\n",
    );
    yard.run(&words("bench one.toml")).expect(SUCCESS);
    let studio = Studio::start(&yard, "one.sqlite");
    let mut ask =
        |method: &str, path: &str, body: &Value| exchange(&studio, &mut told, (method, path), body);
    ask("GET", "/api/suite", &none);
    ask("GET", "/api/suite/trials?planner=PIBT&count=1", &none);
    ask("GET", "/api/suite/trials?planners=PIBT", &none);
    ask("GET", "/api/suite/trials/0", &none);
    ask("GET", "/api/suite/trials/1", &none);
    let opened = ask("POST", "/api/suite/trials/0/open", &json!({}));
    let job = studio.wait_for(&opened["job"]);
    exchange(
        &studio,
        &mut told,
        ("GET", &format!("/api/jobs/{}", job["id"])),
        &none,
    );
    studio.end("INT").expect(SUCCESS);
    let expected = root().join("tests/expected/studio-protocol.txt");
    let expected = snapbox::Data::read_from(&expected, Some(snapbox::data::DataFormat::Text));
    snapbox::Assert::new()
        .action_env("SNAPSHOTS")
        .eq(told, expected);
}

/// The example of `docs/studio-protocol.md`, as a script.
#[test]
fn the_script_of_the_page_drives_a_studio() {
    if !have("python3") {
        return;
    }
    let page = fs::read_to_string(root().join("docs/studio-protocol.md")).unwrap();
    let (_, script) = page.split_once("```python\n").unwrap();
    let (script, _) = script.split_once("```").unwrap();
    let yard = Yard::new();
    yard.write("drive.py", script);
    copy_rooms(&yard);
    let ended = yard.shell("python3 drive.py").expect(SUCCESS);
    assert!(ended.stdout.contains("valid: True"), "{ended}");
    assert!(left(&yard).is_empty());
}

#[test]
fn plans_of_other_tools_are_opened_for_as_many_robots_as_they_have() {
    let yard = Yard::new();
    let [map, scen] = ["random-32-32-20.map", "random-32-32-20-random-1.scen"]
        .map(|name| root().join("maps").join(name).display().to_string());
    let ground = format!("--map {map} --scen {scen}");
    let line = format!("run {ground} --agents 10 --planner pibt --plan-out plan.json");
    yard.run(&words(&line)).expect(SUCCESS);
    let studio = Studio::start(&yard, &format!("{map} {scen}"));
    let open = |name: &str| {
        let path = format!("/api/open?name={name}");
        studio.ask("POST", &path, &yard.read(name))
    };
    let refused = open("plan.json").expect(409).json();
    let told = |key: &str| refused[key].as_str().unwrap();
    assert!(told("error").contains("of 10 robots"), "{refused}");
    assert!(told("hint").contains("keep the first 10"), "{refused}");
    let document = studio.get("/api/document").json();
    let agents = document["document"]["agents"].as_array().unwrap().len();
    let others: Vec<usize> = (10..agents).collect();
    studio.edit(&json!({"op": "remove-agents", "indices": others}));
    let mut costs = None;
    for (format, name) in [
        ("plan", "plan.json"),
        ("lacam", "result.txt"),
        ("paths-txt", "paths.txt"),
        ("mapf-visualizer", "viewer.txt"),
        ("planviz", "planviz.json"),
        ("libmrp-schedule", "schedule.yaml"),
    ] {
        if name != "plan.json" {
            let line = format!("convert plan.json {name} --to {format} {ground} --agents 10");
            yard.run(&words(&line)).expect(SUCCESS);
        }
        let opened = open(name).expect(200).json();
        let job = studio.wait_for(&opened["job"]);
        assert_eq!(job["opened"], name);
        assert_eq!(job["verdict"]["view"]["valid"], true, "{format}: {job:#}");
        // It is the same plan in other words, of which some write waits at goals.
        let own = job["verdict"]["costs"].clone();
        assert_eq!(costs.get_or_insert(own.clone()), &own, "{format}");
    }
    studio.end("INT").expect(SUCCESS);
}
