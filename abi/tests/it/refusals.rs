//! Structures that a reader refuses: `unsupported` for what a later version may allow,
//! `invalid-input` for what none does. Longer structures are read.

#![allow(unsafe_code)]

use std::ffi::c_void;
use std::sync::Arc;

use fleetyard_abi::convert::{CEnvironment, CInstance, size_of};
use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{
    Annotation, ControlPlan, Environment, GridEnvironment, GridPlan, Guidance, Instance, Knot,
    KnotPlan, Lists, Plan, RoadmapEnvironment, Robot, Shape, State, Status, Visit, VisitPlan,
    WorkspaceEnvironment, c,
};

fn grid() -> Environment {
    GridEnvironment::four_connected(1, 2, vec![1, 1]).into()
}

fn roadmap() -> Environment {
    let edges: Lists<u32> = [vec![1], vec![0]].into_iter().collect();
    RoadmapEnvironment::straight(vec![0.0, 1.0], vec![0.0, 0.0], edges, 1.0, 0.5).into()
}

fn workspace() -> Environment {
    WorkspaceEnvironment {
        min_m: [0.0, 0.0],
        max_m: [2.0, 1.0],
        obstacles: Lists::default(),
        movers: Vec::new(),
    }
    .into()
}

fn in_plane() -> Instance {
    let text = r#"{"footprint":{"radius_m":0.3},"state_limits":[[null,null],[null,null]]}"#;
    let robot: Robot = serde_json::from_str(text).unwrap();
    let at = |x: f64| State(vec![x, 0.5]);
    Instance {
        start_states: vec![at(0.5)],
        goal_states: [[at(1.5)]].into_iter().collect(),
        robots: vec![robot],
        ..Instance::default()
    }
}

/// Reads an environment after a change of its structure, and of that of its view.
fn environment<V: Copy>(
    sent: Environment,
    change: impl Fn(&mut c::Environment, &mut V),
) -> Result<Environment, Failure> {
    let sent = CEnvironment::new(&Arc::new(sent));
    // SAFETY: an environment in its C form is whole, and its view of this type.
    unsafe {
        let mut raw = *sent.raw();
        let mut view = *raw.view.cast::<V>();
        raw.view = (&raw const view).cast();
        change(&mut raw, &mut view);
        Environment::from_c(&raw const raw)
    }
}

fn instance(sent: &Instance, change: impl Fn(&mut c::Instance)) -> Result<Instance, Failure> {
    let sent = CInstance::new(sent, std::ptr::null());
    // SAFETY: an instance in its C form is whole.
    unsafe {
        let mut raw = *sent.raw();
        change(&mut raw);
        Instance::from_c(&raw const raw)
    }
}

fn robot(change: impl Fn(&mut c::Robot)) -> Result<Instance, Failure> {
    let sent = in_plane();
    let sent = CInstance::new(&sent, std::ptr::null());
    // SAFETY: as above, and there is one robot.
    unsafe {
        let mut raw = *sent.raw();
        let mut own = **raw.robots;
        change(&mut own);
        let list = [&raw const own];
        raw.robots = list.as_ptr();
        Instance::from_c(&raw const raw)
    }
}

/// Reads a plan after a change of its structure, and of that of its body.
fn plan<B: Copy>(
    sent: impl Into<Plan>,
    change: impl Fn(&mut c::Plan, &mut B),
) -> Result<Plan, Failure> {
    let sent = sent.into();
    sent.as_ref().with_c(|raw| {
        // SAFETY: a plan in its C form is whole, and its body of this type.
        unsafe {
            let mut raw = *raw;
            let mut body = *raw.body.cast::<B>();
            raw.body = (&raw const body).cast();
            change(&mut raw, &mut body);
            Plan::from_c(&raw const raw, Some(1), 10)
        }
    })
}

/// Reads an annotation of two agents on nine places after a change of its structure.
fn annotation(
    sent: &Annotation,
    change: impl Fn(&mut c::Annotation),
) -> Result<Annotation, Failure> {
    sent.with_c(|raw| {
        // SAFETY: an annotation in its C form is whole.
        unsafe {
            let mut raw = *raw;
            change(&mut raw);
            Annotation::from_c(&raw const raw, 2, 9)
        }
    })
    .expect("its lists agree")
}

fn cells() -> Plan {
    GridPlan::from_paths([[0, 1]]).into()
}

fn visits() -> Plan {
    let visit = Visit {
        vertex: 0,
        arrival_s: 0.0,
        departure_s: 0.0,
    };
    VisitPlan::single(vec![visit]).into()
}

fn knots() -> Plan {
    let knot = Knot {
        time_s: 0.0,
        x_m: 0.5,
        y_m: 0.5,
        heading_rad: 0.0,
    };
    KnotPlan::single(vec![knot]).into()
}

#[track_caller]
fn refused<T: std::fmt::Debug>(read: Result<T, Failure>, status: Status, message: &str) {
    let failure = read.unwrap_err();
    assert_eq!(failure.status, status, "{failure}");
    assert!(failure.message.contains(message), "{failure}");
}

/// A part that is no JSON, with flags.
fn part(flags: u32, reserved: u32) -> c::Part {
    c::Part {
        id: c::Str::new("org.example.dust/1"),
        data: (&raw const NUMBER).cast::<c_void>(),
        flags,
        reserved,
    }
}

static NUMBER: u32 = 4;

fn with(part: &c::Part) -> c::Parts {
    c::Parts {
        list: std::ptr::from_ref(part),
        count: 1,
    }
}

#[test]
fn codes_that_are_unknown_are_unsupported_and_zero_is_invalid() {
    let codes = [
        (99, Status::Unsupported),
        (-1, Status::Unsupported),
        (0, Status::InvalidInput),
    ];
    for (code, status) in codes {
        let read = environment::<c::Grid>(grid(), |raw, _| raw.representation = code);
        refused(read, status, "representation");
        let one_shot = Instance::one_shot(vec![0], vec![1]);
        refused(
            instance(&one_shot, |raw| raw.motion = code),
            status,
            "motion",
        );
        refused(
            instance(&one_shot, |raw| raw.objective = code),
            status,
            "objective",
        );
        let read = plan::<c::Cells>(cells(), |raw, _| raw.form = code);
        refused(read, status, "plan.form");
    }
    let read = environment::<c::Grid>(grid(), |_, grid| grid.connectivity = 6);
    refused(read, Status::Unsupported, "6 neighbours");
    let one_shot = Instance::one_shot(vec![0], vec![1]);
    let headings = [7_i8];
    let read = instance(&one_shot, |raw| raw.start_headings = headings.as_ptr());
    refused(read, Status::InvalidInput, "heading 7");
}

#[test]
fn annotations_that_lie_are_refused_with_the_place() {
    static DESCENDING: [u64; 3] = [0, 9, 3];
    static MANY: [u64; 3] = [0, 9, 1 << 40];
    static OUTSIDE: [u32; 3] = [0, 9, 0];
    static INFINITE: [f64; 2] = [1.0, f64::INFINITY];
    let places = Annotation::places("a", [vec![0, 1], vec![8]]);
    let lines = Annotation::lines("a", [[[0.0, 0.0], [1.0, 1.0]]]);
    assert_eq!(annotation(&places, |_| {}), Ok(places.clone()));
    // What contradicts itself has no C form: nobody reads beyond its lists.
    for odd in [
        Annotation {
            shape: Shape::Points,
            ..places.clone()
        },
        Annotation {
            shape: Shape::Places,
            ..lines.clone()
        },
        Annotation {
            values: vec![1.0; 3],
            ..places.clone()
        },
    ] {
        assert!(odd.check(2, 9).is_err());
        assert_eq!(odd.with_c(|_| ()), None);
    }
    let unsupported = annotation(&places, |raw| raw.shape = 5);
    refused(unsupported, Status::Unsupported, "annotation.shape 5");
    let invalid = |sent: &Annotation, change: fn(&mut c::Annotation), message: &str| {
        refused(annotation(sent, change), Status::InvalidInput, message);
    };
    invalid(
        &places,
        |raw| raw.struct_size = 8,
        "annotation.struct_size is 8",
    );
    invalid(&places, |raw| raw.shape = 0, "annotation.shape is 0");
    invalid(&places, |raw| raw.count = u32::MAX, "at most 32768 may be");
    invalid(
        &places,
        |raw| raw.offsets = DESCENDING.as_ptr(),
        "out of order",
    );
    invalid(
        &places,
        |raw| raw.offsets = MANY.as_ptr(),
        "more than the limit of 32768",
    );
    invalid(
        &places,
        |raw| raw.offsets = std::ptr::null(),
        "offsets is null",
    );
    invalid(
        &places,
        |raw| raw.places = std::ptr::null(),
        "places is null",
    );
    invalid(&lines, |raw| raw.y_m = std::ptr::null(), "y_m is null");
    invalid(
        &places,
        |raw| raw.layer.len = 0,
        "its name must be 1 to 64 bytes",
    );
    invalid(
        &places,
        |raw| raw.layer.len = 65,
        "annotation.layer has 65 bytes",
    );
    invalid(
        &places,
        |raw| raw.text.len = 1025,
        "annotation.text has 1025 bytes",
    );
    let outside = "`a`: shape 0 has place 9, but there are 9";
    invalid(&places, |raw| raw.places = OUTSIDE.as_ptr(), outside);
    invalid(
        &places,
        |raw| raw.agent = 2,
        "about agent 2, but there are 2",
    );
    invalid(&places, |raw| raw.from_s = -1.0, "from -1 s to inf s");
    invalid(&places, |raw| raw.from_s = f64::NAN, "from NaN s");
    invalid(
        &places,
        |raw| (raw.from_s, raw.to_s) = (2.0, 1.0),
        "from 2 s to 1 s",
    );
    invalid(
        &places,
        |raw| raw.values = INFINITE.as_ptr(),
        "value 1 is inf",
    );
    let not_finite = "shape 0 has the point (1, inf), which is not finite";
    invalid(&lines, |raw| raw.y_m = INFINITE.as_ptr(), not_finite);
}

#[test]
fn flags_that_are_unknown_are_unsupported() {
    let read = environment::<c::Roadmap>(roadmap(), |_, roadmap| roadmap.flags |= 1 << 20);
    refused(
        read,
        Status::Unsupported,
        "roadmap has the unknown flags 0x100000",
    );
    let read = instance(&in_plane(), |raw| raw.flags |= 1 << 9);
    refused(
        read,
        Status::Unsupported,
        "instance has the unknown flags 0x200",
    );
    refused(
        robot(|robot| robot.flags |= 1 << 8),
        Status::Unsupported,
        "robot has",
    );
}

#[test]
fn reserved_fields_are_zero() {
    let invalid = Status::InvalidInput;
    let read = environment::<c::Roadmap>(roadmap(), |_, roadmap| roadmap.reserved = 1);
    refused(read, invalid, "roadmap.reserved is 1");
    refused(
        instance(&in_plane(), |raw| raw.reserved = 2),
        invalid,
        "instance.reserved is 2",
    );
    refused(
        robot(|robot| robot.reserved = 3),
        invalid,
        "robot.reserved is 3",
    );
    let read = plan::<c::Visits>(visits(), |raw, _| raw.reserved = 4);
    refused(read, invalid, "plan.reserved is 4");
    let odd = part(0, 1);
    let read = environment::<c::Grid>(grid(), |raw, _| raw.parts = with(&odd));
    refused(read, invalid, "part.reserved is 1");
}

#[test]
fn factors_of_guidance_are_within_their_bounds() {
    let factors: [u16; 4] = [100, 10, 10_000, 99];
    let mut raw = c::Guidance {
        struct_size: size_of::<c::Guidance>(),
        places: 2,
        move_count: 4,
        moves: factors.as_ptr(),
        waits: factors.as_ptr(),
    };
    let read = |raw: &c::Guidance| {
        let mut part = part(0, 0);
        part.id = c::Str::new(c::GUIDANCE_ID);
        part.data = (&raw const *raw).cast();
        instance(&Instance::default(), |instance| {
            instance.parts = with(&part);
        })
    };
    let found = read(&raw).unwrap();
    assert_eq!(found.guidance().unwrap().waits, [100, 10]);
    for (hostile, message) in [(9, "moves[3] is 9"), (10_001, "moves[3] is 10001")] {
        let factors = [100, 10, 10_000, hostile];
        raw.moves = factors.as_ptr();
        refused(read(&raw), Status::InvalidInput, message);
    }
    raw.moves = std::ptr::null();
    refused(read(&raw), Status::InvalidInput, "guidance.moves");
    let json = |data: serde_json::Value| {
        let part = serde_json::json!({ "id": c::GUIDANCE_ID, "data": data });
        serde_json::from_value::<fleetyard_abi::Part>(part).map_err(|error| error.to_string())
    };
    for (data, message) in [
        (
            serde_json::json!({ "moves": [0], "waits": [] }),
            "moves[0] is 0",
        ),
        (
            serde_json::json!({ "moves": [], "waits": [100, 65535] }),
            "waits[1] is 65535",
        ),
        (serde_json::json!({ "moves": [-1], "waits": [] }), "-1"),
        (serde_json::json!({ "moves": [1.5], "waits": [] }), "1.5"),
        (serde_json::json!({ "moves": [null], "waits": [] }), "null"),
        (serde_json::json!({ "moves": [] }), "waits"),
    ] {
        let error = json(data).unwrap_err();
        assert!(error.contains(message), "{error}");
    }
    let guidance = Guidance::neutral(8, 2);
    assert_eq!(guidance.check_size(8, 2), Ok(()));
    assert!(
        guidance
            .check_size(4, 1)
            .unwrap_err()
            .contains("8 factors of moves")
    );
}

#[test]
fn parts_that_are_unknown_are_passed_over_unless_they_are_critical() {
    let (ignorable, critical) = (part(0, 0), part(c::PART_CRITICAL, 0));
    let message = "the critical part `org.example.dust/1` is unknown";
    for sent in [grid(), roadmap(), workspace()] {
        let read = |part| {
            let sent = CEnvironment::new(&Arc::new(sent.clone()));
            // SAFETY: an environment in its C form is whole.
            unsafe {
                let mut raw = *sent.raw();
                raw.parts = with(part);
                Environment::from_c(&raw const raw)
            }
        };
        assert_eq!(read(&ignorable).unwrap(), sent);
        refused(read(&critical), Status::Unsupported, message);
    }
    for sent in [Instance::one_shot(vec![0], vec![1]), in_plane()] {
        assert_eq!(
            instance(&sent, |raw| raw.parts = with(&ignorable)).unwrap(),
            sent
        );
        refused(
            instance(&sent, |raw| raw.parts = with(&critical)),
            Status::Unsupported,
            message,
        );
    }
    let read = |part| plan::<c::Trajectories>(knots(), |raw, _| raw.parts = with(part));
    assert_eq!(read(&ignorable).unwrap(), knots());
    refused(read(&critical), Status::Unsupported, message);
}

#[test]
fn structures_of_zeros_are_invalid() {
    let invalid = Status::InvalidInput;
    // SAFETY: zeros are a value of each of these structures, and pointers to nothing are refused.
    unsafe {
        let raw: c::Environment = std::mem::zeroed();
        refused(
            Environment::from_c(&raw const raw),
            invalid,
            "environment.struct_size is 0",
        );
        let raw: c::Instance = std::mem::zeroed();
        refused(
            Instance::from_c(&raw const raw),
            invalid,
            "instance.struct_size is 0",
        );
        let raw: c::Plan = std::mem::zeroed();
        refused(
            Plan::from_c(&raw const raw, None, 9),
            invalid,
            "plan.struct_size is 0",
        );
        // The same of the right size.
        let raw = c::Environment {
            struct_size: size_of::<c::Environment>(),
            ..std::mem::zeroed()
        };
        refused(
            Environment::from_c(&raw const raw),
            invalid,
            "representation is 0",
        );
        let raw = c::Instance {
            struct_size: size_of::<c::Instance>(),
            ..std::mem::zeroed()
        };
        refused(Instance::from_c(&raw const raw), invalid, "motion is 0");
        let raw = c::Plan {
            struct_size: size_of::<c::Plan>(),
            ..std::mem::zeroed()
        };
        refused(
            Plan::from_c(&raw const raw, None, 9),
            invalid,
            "plan.form is 0",
        );
    }
    let read = environment::<c::Roadmap>(roadmap(), |_, view| view.struct_size = 0);
    refused(read, invalid, "roadmap.struct_size is 0");
    let read = environment::<c::Workspace>(workspace(), |_, view| view.struct_size -= 8);
    refused(read, invalid, "workspace.struct_size is");
    let read = plan::<c::Visits>(visits(), |_, body| body.struct_size = 8);
    refused(read, invalid, "plan.body.struct_size is 8");
}

#[test]
fn numbers_of_plans_are_finite_but_for_headings_that_are_not_there() {
    let invalid = Status::InvalidInput;
    let odd = [f64::NAN];
    let read = plan::<c::Visits>(visits(), |_, body| body.departure_s = odd.as_ptr());
    refused(read, invalid, "plan.departure_s has NaN");
    let read = plan::<c::Trajectories>(knots(), |_, body| body.x_m = odd.as_ptr());
    refused(read, invalid, "plan.x_m has NaN");
    let read = plan::<c::Trajectories>(knots(), |_, body| body.heading_rad = odd.as_ptr());
    assert!(read.is_ok());
    let endless = [f64::INFINITY];
    let read = plan::<c::Trajectories>(knots(), |_, body| body.heading_rad = endless.as_ptr());
    refused(read, invalid, "plan.heading_rad has inf");
}

/// A change of columns, and what a reader says of it.
type Lie<'a> = (&'a dyn Fn(&mut c::Trajectories), &'a str);

/// Two controls of two numbers.
fn controls() -> Plan {
    let mut controls = ControlPlan::default();
    let segments = [(0.5, [1.0, 0.0]), (1.5, [0.0, 2.0])];
    controls.push_agent(segments).unwrap();
    Plan::Trajectories(controls.into())
}

#[test]
fn columns_of_controls_fit_together() {
    let read = |change: &dyn Fn(&mut c::Trajectories)| {
        plan::<c::Trajectories>(controls(), |_, body| change(body))
    };
    assert_eq!(read(&|_| {}).unwrap(), controls());
    let (odd, none) = ([f64::NAN; 9], [0.0; 0]);
    let (zeros, many, three, back) = ([0, 0], [0, 1 << 30], [0, 3], [1, 0]);
    let invalid = Status::InvalidInput;
    let lies: [Lie<'_>; 8] = [
        (
            &|body| body.duration_s = std::ptr::null(),
            "plan.duration_s is null",
        ),
        (
            &|body| body.duration_s = odd.as_ptr(),
            "plan.duration_s has NaN",
        ),
        (
            &|body| body.controls = odd.as_ptr(),
            "plan.controls has NaN",
        ),
        (
            &|body| body.control_offsets = std::ptr::null(),
            "plan.control_offsets is null",
        ),
        (
            &|body| body.segment_offsets = many.as_ptr(),
            "plan.duration_s are 1073741824 entries",
        ),
        (
            &|body| body.control_offsets = many.as_ptr(),
            "plan.controls are 1073741824 entries",
        ),
        (
            &|body| body.control_offsets = three.as_ptr(),
            "agent 0 has 3 numbers of controls for 2 segments",
        ),
        (
            &|body| body.segment_offsets = back.as_ptr(),
            "do not begin with 0",
        ),
    ];
    for (lie, message) in lies {
        refused(read(lie), invalid, message);
    }
    // Without segments there is nothing to point at.
    let read = plan::<c::Trajectories>(knots(), |_, body| {
        body.segment_offsets = zeros.as_ptr();
        body.control_offsets = zeros.as_ptr();
        body.duration_s = none.as_ptr();
    });
    assert_eq!(read.unwrap(), knots());
}

/// A structure of a later version: with more at its end.
#[repr(C)]
struct Longer<T> {
    known: T,
    more: [u64; 5],
}

fn longer<T>(known: T) -> Longer<T> {
    Longer {
        known,
        more: [u64::MAX; 5],
    }
}

#[test]
fn longer_structures_are_read() {
    let sent = CEnvironment::new(&Arc::new(roadmap()));
    // SAFETY: all are in their C form, and whole.
    unsafe {
        let mut view = longer(*(*sent.raw()).view.cast::<c::Roadmap>());
        view.known.struct_size = size_of::<Longer<c::Roadmap>>();
        let mut raw = longer(*sent.raw());
        raw.known.struct_size = size_of::<Longer<c::Environment>>();
        raw.known.view = (&raw const view).cast();
        assert_eq!(
            Environment::from_c(&raw const raw.known).unwrap(),
            roadmap()
        );
        let sent = in_plane();
        let own = CInstance::new(&sent, std::ptr::null());
        let mut raw = longer(*own.raw());
        raw.known.struct_size = size_of::<Longer<c::Instance>>();
        let mut robot = longer(**raw.known.robots);
        robot.known.struct_size = size_of::<Longer<c::Robot>>();
        let robots = [&raw const robot.known];
        raw.known.robots = robots.as_ptr();
        assert_eq!(Instance::from_c(&raw const raw.known).unwrap(), sent);
        for sent in [cells(), visits(), knots(), controls()] {
            let read = sent.as_ref().with_c(|given| {
                let mut raw = longer(*given);
                raw.known.struct_size = size_of::<Longer<c::Plan>>();
                Plan::from_c(&raw const raw.known, Some(1), 10)
            });
            assert_eq!(read.unwrap(), sent);
        }
    }
}
