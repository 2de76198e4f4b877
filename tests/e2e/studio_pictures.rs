//! Pictures of the stage, in the studio and on a replay page, beside those that the program draws of the same
//! moments itself: colours are compared on a lattice of places, so that neither smoothing nor a browser's
//! version matters.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};

use fleetyard_sim::TraceReader;
use fleetyard_testkit::devtools::Page;
use fleetyard_testkit::{SUCCESS, Yard, root};
use fleetyard_view::{Outline, Still, World, base64, png};
use serde_json::{Value, json};

use crate::studio::Studio;

const TIMES_S: [f64; 3] = [1.0, 3.3, 6.0];

/// The still picture of a moment, as a script on the page has it, and where robots are in it.
struct Moment {
    told: Value,
    robots: Vec<[f64; 2]>,
    goals: Vec<[f64; 2]>,
}

fn moment(trace: &Path, at_s: f64) -> Moment {
    let file = BufReader::new(File::open(trace).unwrap());
    let reader = TraceReader::open(file, "rooms.trace").unwrap();
    let header = reader.header().clone();
    let mut still = Still::new(&header, Some(at_s));
    reader.replay(&mut still).unwrap();
    let world = World::of_trace("rooms", &header);
    let mut picture = still.picture(&world);
    // Ground, walls and robots alone: the rest has another look on the page.
    picture.paths.clear();
    picture.goals.clear();
    picture.contacts.clear();
    let robots: Vec<_> = picture.bodies.iter().map(|body| body.at_m).collect();
    let radii = picture.bodies.iter().map(|body| match body.outline {
        Outline::Disc { radius_m } => radius_m,
        Outline::Polygon { .. } => panic!("two rooms have discs"),
    });
    let bodies: Vec<_> = (robots.iter().zip(radii))
        .map(|([x, y], radius)| [*x, *y, radius])
        .collect();
    let png = png(&picture.svg(), Some(1200)).unwrap();
    Moment {
        told: json!({"png": base64(&png), "left": world.bounds.min[0], "bottom": world.bounds.min[1],
                     "right": world.bounds.max[0], "top": world.bounds.max[1], "bodies": bodies}),
        goals: header.scene.goals_m.clone(),
        robots,
    }
}

/// Functions of the page: `pixels` of an image, `placed` gives the pixel of a place in metres, and `compared` is
/// what a picture of the stage has to do with a still one. Places near an edge of the still picture
/// do not count.
const TOOLS: &str = "globalThis.proof = {
  pixels(image) {
    const canvas = Object.assign(document.createElement('canvas'), { width: image.width, height: image.height });
    const pen = canvas.getContext('2d', { willReadFrequently: true });
    pen.drawImage(image, 0, 0);
    return pen.getImageData(0, 0, image.width, image.height);
  },
  around({ data, width, height }, px, py, by) {
    const sum = [0, 0, 0], low = [255, 255, 255], high = [0, 0, 0];
    let count = 0;
    for (let y = Math.max(py - by, 0); y <= Math.min(py + by, height - 1); y++) {
      for (let x = Math.max(px - by, 0); x <= Math.min(px + by, width - 1); x++, count++) {
        for (let c = 0; c < 3; c++) {
          const value = data[4 * (y * width + x) + c];
          sum[c] += value;
          low[c] = Math.min(low[c], value);
          high[c] = Math.max(high[c], value);
        }
      }
    }
    return { mean: sum.map((value) => value / count), spread: Math.max(...high.map((value, c) => value - low[c])) };
  },
  placed({ camera, picture }, x, y) {
    return [(x - camera.x) * camera.scale + picture.width / 2, (camera.y - y) * camera.scale + picture.height / 2].map(Math.round);
  },
  async compared(seen, { png, left, bottom, right, top, bodies }) {
    const bytes = Uint8Array.from(atob(png), (letter) => letter.charCodeAt(0));
    const still = proof.pixels(await createImageBitmap(new Blob([bytes]))), page = proof.pixels(seen.picture);
    const per = still.width / (right - left), wrong = [], robots = bodies.map(() => [0, 0]);
    let places = 0;
    for (let x = left + 0.05; x < right; x += 0.05) {
      for (let y = bottom + 0.05; y < top; y += 0.05) {
        const there = proof.around(still, Math.round((x - left) * per), Math.round((top - y) * per), 4);
        if (there.spread > 16) continue;
        const here = proof.around(page, ...proof.placed(seen, x, y), 1);
        const ok = Math.max(...here.mean.map((value, c) => Math.abs(value - there.mean[c]))) < 40;
        places++;
        if (!ok) wrong.push([x, y].map((value) => +value.toFixed(2)));
        bodies.forEach(([bx, by, r], at) => {
          if (Math.hypot(x - bx, y - by) > 0.7 * r) return;
          robots[at][0]++;
          if (ok) robots[at][1]++;
        });
      }
    }
    return { places, wrong: wrong.length, some: wrong.slice(0, 20), robots };
  },
  // Pixels that differ, near each of some places, and elsewhere.
  changed(before, after, seen, places, radius) {
    const near = places.map(() => 0), at = places.map(([x, y]) => proof.placed(seen, x, y));
    let elsewhere = 0;
    for (let p = 0; p < before.data.length; p += 4) {
      if (Math.abs(before.data[p] - after.data[p]) + Math.abs(before.data[p + 1] - after.data[p + 1]) + Math.abs(before.data[p + 2] - after.data[p + 2]) < 12) continue;
      const x = p / 4 % before.width, y = Math.floor(p / 4 / before.width);
      let one = false;
      at.forEach(([px, py], i) => {
        if (Math.hypot(x - px, y - py) > radius * seen.camera.scale) return;
        near[i]++;
        one = true;
      });
      if (!one) elsewhere++;
    }
    return { near, elsewhere };
  },
}";

/// The same picture: nearly all places, and nearly all of those on each robot.
fn is_same(found: &Value) -> bool {
    let number = |value: &Value| value.as_f64().unwrap();
    assert!(number(&found["places"]) > 5000.0, "{found}");
    let robots = found["robots"].as_array().unwrap();
    assert!(!robots.is_empty(), "{found}");
    number(&found["wrong"]) < 0.005 * number(&found["places"])
        && robots.iter().all(|robot| {
            assert!(number(&robot[0]) > 15.0, "{found}");
            number(&robot[1]) > 0.9 * number(&robot[0])
        })
}

fn compared(page: &mut Page, seen: &str, moment: &Moment) -> Value {
    page.eval(&format!("proof.compared({seen}, {})", moment.told))
}

fn recorded_rooms() -> (Yard, PathBuf) {
    let yard = Yard::new();
    for name in ["two-rooms.task.json", "two-rooms.world.json"] {
        yard.write(name, fs::read(root().join("maps").join(name)).unwrap());
    }
    for line in [
        "run --task two-rooms.task.json --planner plane-pp --budget 5s --plan-out plan.json",
        "simulate plan.json --task two-rooms.task.json --trace rooms.trace",
        "trace export rooms.trace --html rooms.html",
    ] {
        yard.line(line).expect(SUCCESS);
    }
    let trace = yard.path("rooms.trace");
    (yard, trace)
}

#[test]
fn the_stage_shows_what_the_program_draws() {
    let (yard, trace) = recorded_rooms();
    let moments = TIMES_S.map(|time_s| moment(&trace, time_s));
    let files = [trace.clone()];
    let Some(mut studio) = Studio::open_in(yard, &files, [1280, 800]) else {
        return;
    };
    studio.page.eval(&format!("void ({TOOLS})"));
    studio
        .page
        .eval("studio.watch.show([...studio.watch.files.keys()])");
    studio.page.until("studio.watch.panes[0].scene.known");
    let stage = "studio.watch.panes[0].stage";
    studio.page.eval(
        "for (const name of Object.keys(studio.watch.show_)) studio.watch.overlay(name, false); \
         studio.watch.panes[0].scene.show('scale', false)",
    );
    let seen = format!("{{ picture: {stage}.picture(), camera: {stage}.camera }}");
    let seek = |page: &mut Page, time_s: f64| {
        page.eval(&format!("studio.watch.clock.seek({time_s})"));
        page.until(&format!(
            "({stage}.draw(), studio.watch.panes[0].scene.known)"
        ));
    };
    for (time_s, moment) in TIMES_S.iter().zip(&moments) {
        seek(&mut studio.page, *time_s);
        let found = compared(&mut studio.page, &seen, moment);
        assert!(is_same(&found), "at {time_s} s: {found}");
    }
    // What is wrong is found: another time, no robots, no walls.
    let page = &mut studio.page;
    assert!(!is_same(&compared(page, &seen, &moments[0])));
    seek(page, TIMES_S[2] + 0.3);
    assert!(!is_same(&compared(page, &seen, &moments[2])));
    seek(page, TIMES_S[2]);
    for layers in [
        "[studio.watch.panes[0].scene.bodies]",
        "studio.watch.panes[0].scene.ground",
    ] {
        let show = |page: &mut Page, on: bool| {
            page.eval(&format!(
                "(() => {{ for (const layer of {layers}) {{ layer.kept ??= layer.visible ?? true; layer.visible = {on} && layer.kept; }} \
                 {stage}.invalidate('ground'); }})()"
            ));
        };
        show(page, false);
        // A painter that is not asked leaves its last picture.
        page.eval("document.querySelectorAll('.slot canvas').forEach((canvas) => { canvas.width = canvas.width; })");
        assert!(!is_same(&compared(page, &seen, &moments[2])), "{layers}");
        show(page, true);
    }
    assert!(is_same(&compared(page, &seen, &moments[2])));

    // Each overlay changes the picture where it has something to show.
    let [then, now, _] = &moments;
    seek(page, TIMES_S[1]);
    page.eval(&format!(
        "void (globalThis.before = proof.pixels({stage}.picture()))"
    ));
    let soon = moment(&trace, TIMES_S[1] + 1.5);
    for (name, places, radius, alone) in [
        ("trails", &then.robots, 0.12, false),
        ("paths", &soon.robots, 0.12, false),
        ("reservations", &soon.robots, 0.2, false),
        ("goals", &now.goals, 0.5, true),
        ("numbers", &now.robots, 0.5, true),
        ("usage", &then.robots, 0.3, false),
    ] {
        page.eval(&format!("studio.watch.overlay('{name}', true)"));
        page.until("!studio.watch.panes[0].surveying");
        page.eval(&format!(
            "new Promise((done) => requestAnimationFrame(() => {{ {stage}.draw(); done(); }}))"
        ));
        let changed = page.eval(&format!(
            "proof.changed(before, proof.pixels({stage}.picture()), {seen}, {}, {radius})",
            json!(places)
        ));
        let near = changed["near"].as_array().unwrap();
        assert!(
            near.iter().all(|count| count.as_u64() > Some(20)),
            "{name}: {changed}"
        );
        assert!(!alone || changed["elsewhere"] == 0, "{name}: {changed}");
        page.eval(&format!("studio.watch.overlay('{name}', false)"));
    }

    // The replay page of the same recording, by either painter.
    for renderer in ["2d", "webgl2"] {
        let page = &mut studio.page;
        page.go("about:blank");
        page.until("location.href === 'about:blank'");
        let address = studio.yard.path("rooms.html");
        page.go(&format!("file://{}#renderer={renderer}", address.display()));
        page.until("globalThis.replay && document.readyState === 'complete'");
        assert_eq!(page.eval("replay.state.renderer"), renderer);
        page.eval(&format!("void ({TOOLS})"));
        page.eval("for (const box of document.querySelectorAll('[id^=show-]')) if (box.checked) box.click()");
        let seen = "{ picture: replay.picture(), camera: replay.state }";
        for (time_s, moment) in TIMES_S.iter().zip(&moments) {
            page.eval(&format!("replay.seek({time_s})"));
            let found = compared(page, seen, moment);
            assert!(is_same(&found), "{renderer} at {time_s} s: {found}");
        }
        assert!(!is_same(&compared(page, seen, &moments[0])));
    }
    studio.has_no_errors();
}
