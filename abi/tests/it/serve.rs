//! The served protocol, message by message, and the C ABI of an exported crate.

#![allow(unsafe_code)]

use std::io::{Cursor, Write};
use std::sync::{Arc, Mutex};

use fleetyard_abi::sdk::{Failure, InvocationPolicy, Options, Planner, Plugin, Rejected, Sink};
use fleetyard_abi::{
    Budget, Capabilities, Capability, Descriptor, FleetStatus, GridPlan, Instance, Kind, LogLevel,
    PlanRef, Request, SharedEnvironment, Status, c, convert, serve,
};

#[derive(Default, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
struct StayOptions {
    panic: bool,
}

/// Leaves everybody at their start.
struct Stay(StayOptions);

impl Plugin for Stay {
    fn descriptor() -> Descriptor {
        Descriptor {
            version: "1.2.3".into(),
            capabilities: Capabilities::of(&[Capability::Grid, Capability::Pebble]),
            ..Descriptor::new(Kind::Planner, "stay", "Leaves everybody at their start")
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        Ok(Self(options.parse()?))
    }
}

impl Planner for Stay {
    type Map = ();

    fn prepare(&mut self, _: &SharedEnvironment, _: &Budget, _: &dyn Sink) -> Result<(), Failure> {
        Ok(())
    }

    fn plan(
        &mut self,
        (): &mut (),
        instance: &Instance,
        _: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        assert!(!self.0.panic, "asked to panic");
        sink.metric("agents", instance.agents() as f64);
        let plan = GridPlan::from_paths(instance.starts.iter().map(|cell| [*cell]));
        sink.submit(&plan)?;
        Ok(())
    }
}

struct Always;

impl Plugin for Always {
    fn descriptor() -> Descriptor {
        Descriptor::new(Kind::InvocationPolicy, "always", "Plans at every tick")
    }

    fn create(_: Options<'_>) -> Result<Self, Failure> {
        Ok(Self)
    }
}

impl InvocationPolicy for Always {
    fn should_invoke(&mut self, _: &FleetStatus, _: &dyn Sink) -> Result<bool, Failure> {
        Ok(true)
    }
}

fleetyard_abi::export! { planners: [Stay], invocation_policies: [Always] }

#[derive(Clone, Default)]
struct Shared(Arc<Mutex<Vec<u8>>>);

impl Write for Shared {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().unwrap().write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

fn converse(requests: &[&str]) -> Vec<String> {
    let output = Shared::default();
    let input = Cursor::new(requests.join("\n").into_bytes());
    serve::serve(catalog(), input, output.clone(), || ());
    let bytes = output.0.lock().unwrap().clone();
    String::from_utf8(bytes)
        .unwrap()
        .lines()
        .map(str::to_owned)
        .collect()
}

const PREPARE: &str = r#"{"jsonrpc":"2.0","id":2,"method":"prepare","params":{"environment":{"representation":"grid","name":"m","grid":{"rows":1,"cols":3,"connectivity":4,"cell_size_m":1.0,"step_s":1.0,"passable":["..@"]}},"budget":{"deadline_monotonic_ns":18446744073709551615,"answer_by_ns":18446744073709551615,"wall_ns":1}}}"#;
const PLAN: &str = r#"{"jsonrpc":"2.0","id":3,"method":"plan","params":{"instance":{"starts":[0,1],"goals":[[0],[1]]},"budget":{"deadline_monotonic_ns":18446744073709551615,"answer_by_ns":18446744073709551615,"wall_ns":1}}}"#;

fn create(options: &str) -> String {
    format!(
        r#"{{"jsonrpc":"2.0","id":1,"method":"create","params":{{"kind":"planner","plugin":"stay","options":{options}}}}}"#
    )
}

#[test]
fn a_session_from_create_to_plan() {
    let answers = converse(&[&create("{}"), PREPARE, PLAN]);
    let answers: Vec<String> = answers.iter().map(|answer| without_time(answer)).collect();
    insta::assert_snapshot!(answers.join("\n"), @r#"
    {"jsonrpc":"2.0","id":1,"result":{"status":"solved"}}
    {"jsonrpc":"2.0","id":2,"result":{"status":"solved"}}
    {"jsonrpc":"2.0","method":"metric","params":{"name":"agents","value":2.0}}
    {"jsonrpc":"2.0","method":"incumbent","params":{"paths":["",""]}}
    {"jsonrpc":"2.0","id":3,"result":{"status":"solved","call_ns":…}}
    "#);
}

/// An answer without the duration in it.
fn without_time(answer: &str) -> String {
    let Some((before, after)) = answer.split_once("\"call_ns\":") else {
        return answer.to_owned();
    };
    let rest = after.trim_start_matches(|c: char| c.is_ascii_digit());
    assert!(rest.len() < after.len(), "{answer}");
    format!("{before}\"call_ns\":…{rest}")
}

#[test]
fn faults_are_answered_and_the_session_goes_on() {
    let cases = [
        (PLAN.to_owned(), "`plan` came before a successful `create`"),
        ("{".to_owned(), "EOF while parsing"),
        (r#"{"jsonrpc":"2.0","id":9,"method":"dance"}"#.to_owned(), "there is no method `dance`"),
        (
            r#"{"jsonrpc":"2.0","id":9,"method":"initialize","params":{"protocol_versions":[7],"host":{"name":"h","version":"1"}}}"#.to_owned(),
            "this plugin speaks protocol 1, not [7]",
        ),
        (create(r#"{"speed":1}"#), "unknown field `speed`"),
        (create("[]"), "invalid type: sequence, expected a map"),
    ];
    for (request, expected) in cases {
        let answers = converse(&[&request, &create("{}")]);
        assert_eq!(answers.len(), 2, "{answers:?}");
        assert!(answers[0].contains(expected), "{expected}: {answers:?}");
        assert!(answers[1].contains(r#""status":"solved""#), "{answers:?}");
    }
}

#[test]
fn a_new_plugin_does_not_know_the_map_of_the_one_before() {
    let answers = converse(&[&create("{}"), PREPARE, &create("{}"), PLAN]);
    assert!(
        answers[3].contains("the call came before a successful `prepare`"),
        "{answers:?}"
    );
}

#[test]
fn starts_are_at_places_or_in_the_plane() {
    let both = [
        r#"{"starts":[0,1],"goals":[[0],[1]],"start_states":[[0.5,1]]}"#,
        r#"{"starts":[0,1],"goals":[[0],[1]],"goal_states":[[[0.5,1]]]}"#,
    ];
    for instance in both {
        let instance: Instance = serde_json::from_str(instance).unwrap();
        for places in [Some(3), None] {
            let reason = instance.check(places).unwrap_err();
            assert!(
                reason.contains("both at places and in the plane"),
                "{reason}"
            );
        }
    }
}

#[test]
fn states_in_the_plane_have_a_position() {
    for (robot, start, least) in [
        (r#""state_limits":[[null,null]]"#, "[0.5]", 2),
        (
            r#""has_heading":true,"state_limits":[[null,null],[null,null]]"#,
            "[0.5,1]",
            3,
        ),
    ] {
        let text = format!(
            r#"{{"start_states":[{start}],"goal_states":[[]],"robots":[{{"footprint":{{"radius_m":0.1}},{robot}}}]}}"#
        );
        let instance: Instance = serde_json::from_str(&text).unwrap();
        let reason = instance.check(None).unwrap_err();
        assert!(
            reason.contains(&format!("position and heading are {least}")),
            "{reason}"
        );
    }
}

#[test]
fn instances_that_do_not_fit_the_map_are_refused() {
    for (from, to, expected) in [
        ("[0,1]", "[0,3]", "cell 3 is not on a map of 3 cells"),
        ("[0,1]", "[0]", "1 starts but 2 goal lists"),
        (
            "[[0],[1]]",
            "[[0],[]]",
            "the instance needs the capability `idle`",
        ),
    ] {
        let answers = converse(&[&create("{}"), PREPARE, &PLAN.replace(from, to)]);
        assert!(answers[2].contains(expected), "{expected}: {answers:?}");
    }
}

#[test]
fn numbers_cross_the_wire_to_the_last_bit() {
    // serde_json reads these to the nearest number but one, unless it is asked not to.
    for radius_m in [
        9.274_748_156_681_489e-6,
        90.409_453_826_572_35,
        123.282_990_167_800_49,
    ] {
        let sent = Instance {
            radius_m,
            ..Instance::one_shot(vec![0], vec![1])
        };
        let text = serde_json::to_string(&sent).unwrap();
        assert_eq!(serde_json::from_str::<Instance>(&text).unwrap(), sent);
    }
}

#[test]
fn a_panic_is_an_answer() {
    let answers = converse(&[&create(r#"{"panic":true}"#), PREPARE, PLAN]);
    assert!(
        answers[2].contains("the plugin panicked: asked to panic"),
        "{answers:?}"
    );
}

#[test]
fn the_c_abi_lists_what_the_crate_exports() {
    let entry = &fleetyard_plugin_entry_v1;
    assert_eq!(entry.struct_size, convert::size_of::<c::PluginEntry>());
    let get_factory = entry.get_factory.unwrap();
    for (kind, id) in [(Kind::Planner, "stay"), (Kind::InvocationPolicy, "always")] {
        // SAFETY: factories of all kinds begin alike, and this one is alive.
        let factory =
            unsafe { &*get_factory(c::Str::new(kind.factory_id())).cast::<c::PlannerFactory>() };
        // SAFETY: the functions of a factory may be called at any time.
        let (count, first, second) = unsafe {
            let descriptor = factory.descriptor.unwrap();
            let context = factory.context;
            let (first, second) = (descriptor(context, 0), descriptor(context, 1));
            (factory.count.unwrap()(context), first, second)
        };
        assert_eq!(count, 1);
        assert!(second.is_null());
        // SAFETY: descriptors are static.
        assert_eq!(unsafe { convert::string((*first).id) }, id);
    }
    // SAFETY: as above.
    assert!(unsafe { get_factory(c::Str::new("somebody.else/1")) }.is_null());
}

#[test]
fn too_little_room_for_an_object_is_refused_without_a_write() {
    let get_factory = fleetyard_plugin_entry_v1.get_factory.unwrap();
    let whole = convert::size_of::<c::Planner>();
    // SAFETY: the factory is that of planners and alive, and all that `create` gets lives through
    // the call.
    unsafe {
        let factory = &*get_factory(c::Str::new(c::PLANNER_FACTORY_ID)).cast::<c::PlannerFactory>();
        let options = convert::COptions::new("{}");
        for (room, status) in [
            (0, c::STATUS_UNSUPPORTED),
            (whole - 1, c::STATUS_UNSUPPORTED),
            (whole, c::STATUS_SOLVED),
            (whole + 8, c::STATUS_SOLVED),
        ] {
            let context = convert::SinkContext::new(&Silent, None, 0);
            let sink = context.to_c();
            let mut out: c::Planner = std::mem::zeroed();
            (out.struct_size, out.reserved) = (room, 0xABCD);
            let create = factory.create.unwrap();
            let made = create(
                factory.context,
                0,
                options.raw(),
                &raw const sink,
                &raw mut out,
            );
            assert_eq!(made, status, "{room} bytes");
            if made == c::STATUS_SOLVED {
                assert_eq!(out.struct_size, whole);
                out.destroy.unwrap()(out.context);
            } else {
                let message = context.take_message().unwrap();
                assert!(message.contains("older than this plugin"), "{message}");
                assert_eq!((out.struct_size, out.reserved), (room, 0xABCD));
                assert!(out.context.is_null() && out.plan.is_none());
            }
        }
    }
}

/// Takes nothing.
struct Silent;

impl Sink for Silent {
    fn submit_plan(&self, _: PlanRef<'_>) -> Result<(), Rejected> {
        Err(Rejected::Malformed)
    }

    fn submit_request(&self, _: &Request) -> Result<(), Rejected> {
        Err(Rejected::Malformed)
    }

    fn metric(&self, _: &str, _: f64) {}

    fn note(&self, _: &str, _: &str) {}

    fn log(&self, _: LogLevel, _: &str) {}

    fn progress(&self, _: u64, _: u64) {}

    fn cancelled(&self) -> bool {
        false
    }
}

#[cfg(feature = "layout")]
#[test]
fn the_c_abi_tells_the_layouts_of_the_contract() {
    use fleetyard_abi::layout;
    let get_factory = fleetyard_plugin_entry_v1.get_factory.unwrap();
    // SAFETY: the text is static, and the answer is a layout table.
    let same = unsafe { layout::check(get_factory(c::Str::new(layout::RUST_LAYOUT_ID))) };
    assert_eq!(same, layout::LayoutCheck::Same);
}

#[test]
fn statuses_keep_their_codes() {
    for code in 0..8 {
        assert_eq!(Status::from_code(code).map(Status::code), Some(code));
    }
    assert_eq!(Status::from_code(8), None);
}
