//! The page of the studio in a real browser, beside the tour: saving, files that are dropped on it, and
//! what those are told who do not see it, or do not see it well.

use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

use fleetyard_testkit::{SUCCESS, Yard, root};
use serde_json::{Value, json};

use crate::studio::Studio;

const ROOMS: &str = "two-rooms.task.json";

/// Two rooms, a plan for them and its recording, in the folder of a yard.
fn rooms() -> Yard {
    let yard = Yard::new();
    for name in [ROOMS, "two-rooms.world.json"] {
        yard.write(name, fs::read(root().join("maps").join(name)).unwrap());
    }
    yard
}

fn planned_rooms() -> Yard {
    let yard = rooms();
    let run =
        "run --task two-rooms.task.json --planner plane-pp --budget 5s --plan-out rooms.plan.json";
    yard.line(run).expect(SUCCESS);
    yard.line("simulate rooms.plan.json --task two-rooms.task.json --trace rooms.trace")
        .expect(SUCCESS);
    yard
}

fn files(yard: &Yard, names: &[&str]) -> Vec<PathBuf> {
    names.iter().map(|name| yard.path(name)).collect()
}

#[test]
fn what_is_saved_is_the_document() {
    let yard = rooms();
    let task = files(&yard, &[ROOMS]);
    let Some(mut studio) = Studio::open_in(yard, &task, [1280, 800]) else {
        return;
    };
    let on_disk = |studio: &Studio| {
        let info = format!("world info {ROOMS} --format json");
        studio.yard.line(&info).expect(SUCCESS).json()["problem_digest"].clone()
    };
    let save = |studio: &mut Studio| {
        studio
            .page
            .eval("document.querySelector('#announce').textContent = ''");
        studio.page.key("Ctrl+s");
        studio
            .page
            .until("document.querySelector('#announce').textContent.startsWith('saved ')");
        studio.digest()
    };
    let first = on_disk(&studio);
    studio.page.key("r");
    studio.drag([1.0, 3.0], [2.0, 3.5]);
    assert_ne!(studio.digest(), first);
    assert_eq!(
        on_disk(&studio),
        first,
        "nothing is saved before that is asked for"
    );
    let saved = save(&mut studio);
    assert_eq!(on_disk(&studio), saved);
    // Somebody else edits the document; this page hears of it, and saves that.
    studio
        .server
        .edit(&json!({"op": "remove-agents", "indices": [0]}));
    studio.page.until("studio.store.agents.length === 2");
    let saved = save(&mut studio);
    assert_eq!(on_disk(&studio), saved);
    let text: Value = serde_json::from_slice(&studio.yard.read(ROOMS)).unwrap();
    assert_eq!(text["agents"].as_array().unwrap().len(), 2);
    // A file that somebody changed meanwhile has the document again.
    let changed = text.to_string().replace("\"seed\":1", "\"seed\":2");
    studio.yard.write(ROOMS, changed);
    let saved = save(&mut studio);
    assert_eq!(on_disk(&studio), saved);
    studio.has_no_errors();
}

#[test]
fn a_new_document_asks_for_a_name_and_before_it_goes() {
    let Some(mut studio) = Studio::open_in(rooms(), &[], [390, 844]) else {
        return;
    };
    // Nothing is lost with an empty one.
    studio.page.key("r");
    studio.page.reload();
    studio.ready();
    assert!(studio.page.questions.is_empty());
    studio.page.key("r");
    studio.drag([1.0, 3.0], [2.0, 3.5]);
    studio.settled();
    studio
        .page
        .until("!document.querySelector('#unsaved').hidden");
    studio.page.reload();
    studio.ready();
    assert_eq!(studio.page.questions, ["beforeunload"]);

    // A name that is taken is taken on demand alone.
    let kept = studio.yard.read("two-rooms.world.json");
    studio.page.key("Ctrl+s");
    studio.page.until(
        "document.querySelector('#save-box').open && document.activeElement.id === 'save-name'",
    );
    studio.page.write("two-rooms");
    studio.page.key("Enter");
    studio
        .page
        .until("document.querySelector('#save-do').textContent === 'Replace'");
    assert_eq!(studio.yard.read("two-rooms.world.json"), kept);
    studio.page.write("-2");
    studio
        .page
        .until("document.querySelector('#save-do').textContent === 'Save'");
    studio.page.key("Enter");
    studio.page.until(
        "!document.querySelector('#save-box').open && document.querySelector('#unsaved').hidden && studio.store.document.name === 'two-rooms-2'",
    );
    assert!(studio.yard.path("two-rooms-2.world.json").exists());
    studio.page.reload();
    studio.ready();
    assert_eq!(studio.page.questions.len(), 1);
    studio.has_no_errors();
}

#[test]
fn files_of_every_kind_can_be_dropped() {
    let Some(mut studio) = Studio::open_in(planned_rooms(), &[], [1280, 800]) else {
        return;
    };
    let middle = studio.at([5.0, 3.0]);
    let drop = |studio: &mut Studio, files: &[PathBuf], there: &str| {
        studio.page.drop_files(middle, files);
        studio.page.until(there);
    };
    let map = root().join("maps/random-32-32-20.map");
    drop(&mut studio, &[map], "studio.store.map?.rows === 32");
    let world = root().join("maps/hall.world.json");
    drop(
        &mut studio,
        &[world],
        "studio.store.world && !studio.store.agents.length",
    );
    studio.settled();

    // What is no such file is said, by its name, and nothing of it is done.
    let before = studio.document();
    for (name, bytes) in [
        ("garbage.map", &b"\xff\x00type octile"[..]),
        ("garbage.task.json", b"{\"format\": 1, "),
        ("garbage.trace", b"\x89FYT and then nothing"),
        ("garbage.bin", b"\x7fELF"),
        ("empty.world.json", b""),
    ] {
        studio.yard.write(name, bytes);
        let file = files(&studio.yard, &[name]);
        drop(
            &mut studio,
            &file,
            "!document.querySelector('#refusal').hidden",
        );
        let said = studio
            .page
            .eval("document.querySelector('#refusal').textContent");
        assert!(said.as_str().unwrap().len() > 20, "{name}: {said}");
        assert_eq!(studio.page.eval("studio.store.document"), before, "{name}");
        studio.page.click("#refusal button");
        studio
            .page
            .until("document.querySelector('#refusal').hidden");
    }
    studio.page.eval("studio.store.refusal = null");

    let rooms = files(&studio.yard, &[ROOMS, "two-rooms.world.json"]);
    drop(&mut studio, &rooms, "studio.store.agents.length === 3");
    studio.settled();
    let plan = files(&studio.yard, &["rooms.plan.json"]);
    let done =
        "studio.jobs.list.some((job) => job.opened === 'rooms.plan.json' && job.state === 'done')";
    drop(&mut studio, &plan, done);
    let trace = files(&studio.yard, &["rooms.trace"]);
    let shown = "studio.current === 'watch' && studio.watch.panes.some(({ scene }) => scene.known)";
    drop(&mut studio, &trace, shown);
    studio.has_no_errors();
}

/// Text whose contrast with what is behind it is less than 4.5, and identifiers that two elements have.
const SURVEY: &str = "(() => {
  const probe = document.createElement('canvas').getContext('2d', { willReadFrequently: true });
  probe.canvas.width = probe.canvas.height = 1;
  const rgba = (color) => {
    probe.clearRect(0, 0, 1, 1);
    probe.fillStyle = color;
    probe.fillRect(0, 0, 1, 1);
    const [r, g, b, a] = probe.getImageData(0, 0, 1, 1).data;
    return [r, g, b, a / 255];
  };
  const over = ([r, g, b, a], below) => [r, g, b].map((value, at) => a * value + (1 - a) * below[at]);
  const behind = (node) => {
    if (!node) return rgba(getComputedStyle(document.body).backgroundColor).slice(0, 3);
    const color = rgba(getComputedStyle(node).backgroundColor);
    return color[3] === 1 ? color.slice(0, 3) : over(color, behind(node.parentElement));
  };
  const light = (color) => {
    const [r, g, b] = color.map((value) => value / 255 <= 0.04045 ? value / 255 / 12.92 : ((value / 255 + 0.055) / 1.055) ** 2.4);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const faint = [];
  let texts = 0;
  for (const node of document.querySelectorAll('body *')) {
    const own = [...node.childNodes].filter((child) => child.nodeType === 3).map((child) => child.data.trim()).join('');
    const text = own || (['INPUT', 'SELECT'].includes(node.tagName) && !['checkbox', 'radio', 'range', 'color', 'file'].includes(node.type) ? node.value : '');
    if (!text || !node.checkVisibility({ visibilityProperty: true }) || node.closest('.unseen, svg, noscript, option, [disabled], [aria-disabled=true]')) continue;
    // What cannot be used need not be read, nor that which stands below an open dialog.
    let opacity = 1;
    for (let at = node; at; at = at.parentElement) opacity *= Number(getComputedStyle(at).opacity);
    const ground = behind(node), [r, g, b, a] = rgba(getComputedStyle(node).color);
    const ink = over([r, g, b, a * opacity], ground);
    const [low, high] = [light(ink), light(ground)].sort((a, b) => a - b);
    texts++;
    if ((high + 0.05) / (low + 0.05) < 4.5) faint.push([text.slice(0, 40), node.tagName, node.className, ((high + 0.05) / (low + 0.05)).toFixed(2)]);
  }
  const ids = [...document.querySelectorAll('[id]')].map(({ id }) => id);
  return { texts, faint, twice: ids.filter((id, at) => ids.indexOf(id) !== at) };
})()";

#[test]
fn everybody_is_told_what_is_there() {
    let Some(mut studio) = Studio::open_in(planned_rooms(), &[], [1280, 800]) else {
        return;
    };
    let rooms = files(&studio.yard, &[ROOMS, "two-rooms.world.json"]);
    studio.choose(&rooms, "studio.store.agents.length === 3");
    let plan = files(&studio.yard, &["rooms.plan.json"]);
    studio.choose(
        &plan,
        "studio.jobs.list.some((job) => job.state === 'done' && studio.watch.canShow(job))",
    );
    studio
        .page
        .eval("studio.watch.show([studio.jobs.list[0].id])");
    studio.page.until("studio.watch.panes[0].scene.known");
    // A refusal, and robots that are selected, have texts of their own.
    studio.page.eval("studio.selection.set(['s0'])");
    for scheme in ["dark", "light"] {
        studio.page.prefer(scheme);
        for tab in ["world", "robots", "plan", "watch"] {
            let place = format!("{tab}, {scheme}");
            studio.page.eval(&format!("studio.tab('{tab}')"));
            if tab == "plan" {
                studio.page.until(
                    "document.querySelector('#run') && !document.querySelector('#run').disabled",
                );
            }
            // Transitions of colours end.
            studio.page.eval("Promise.all(document.getAnimations().map(({ finished }) => finished.catch(() => {})))");
            let found = studio.page.eval(SURVEY);
            assert!(found["texts"].as_u64().unwrap() > 15, "{place}: {found}");
            assert_eq!(found["faint"], json!([]), "{place}");
            assert_eq!(found["twice"], json!([]), "{place}");
            let told = studio.page.focusable();
            assert!(told.len() > 10, "{place}: {told:?}");
            let roles: BTreeSet<_> = told.iter().map(|(role, _)| role.as_str()).collect();
            for nothing in ["", "none", "generic", "GenericContainer"] {
                assert!(!roles.contains(nothing), "{place}: {told:?}");
            }
            studio.is_named(&place);
        }
    }

    // Dialogs have the focus alone, say what they are, and give it back.
    studio.page.eval("studio.tab('world')");
    studio.page.tab_to("#export");
    for (key, dialog) in [
        ("Ctrl+k", "palette"),
        ("?", "sheet"),
        ("Shift+P", "problem-box"),
    ] {
        studio.page.key(key);
        let held = format!(
            "document.querySelector('#{dialog}').matches(':modal') && document.querySelector('#{dialog}').contains(document.activeElement)"
        );
        studio.page.until(&held);
        for _ in 0..3 {
            studio.page.key("Tab");
            // From the last one the focus may go to the browser's own controls, but to none of the page's.
            let lost = format!(
                "!document.activeElement || document.activeElement === document.body || document.querySelector('#{dialog}').contains(document.activeElement)"
            );
            assert_eq!(studio.page.eval(&lost), true, "{dialog}");
        }
        let told = studio.page.focusable();
        assert!(
            told.iter()
                .all(|(role, name)| !role.is_empty() && !name.trim().is_empty()),
            "{dialog}: {told:?}"
        );
        let named = studio.page.eval(&format!(
            "(() => {{ const node = document.querySelector('#{dialog}'), by = node.getAttribute('aria-labelledby'); \
             return node.getAttribute('aria-label') ?? document.getElementById(by)?.textContent; }})()"
        ));
        assert!(!named.as_str().unwrap_or_default().is_empty(), "{dialog}");
        assert_eq!(studio.page.eval(SURVEY)["faint"], json!([]), "{dialog}");
        studio.page.eval(&format!(
            "document.querySelector('#{dialog} button, #{dialog} input')?.focus()"
        ));
        studio.page.key("Escape");
        studio.page.until("!document.querySelector('dialog[open]')");
        assert_eq!(
            studio.page.eval("document.activeElement.id"),
            "export",
            "{dialog}"
        );
    }
    // So does a menu.
    studio.page.key("Enter");
    studio.page.until("document.activeElement.closest('.menu')");
    studio.page.key("Escape");
    studio.page.until("document.activeElement.id === 'export'");
    studio.has_no_errors();
}
