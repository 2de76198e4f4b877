//! `schema/protocol.json` is what the wire types say.

use std::path::PathBuf;

use fleetyard_abi::{GoalTasks, Guidance, Kept, RestOfPlan, Traffic, wire};
use schemars::generate::SchemaSettings;

/// Every message of the protocol, by the name of its method and its part.
#[derive(schemars::JsonSchema)]
#[allow(dead_code)]
struct Messages<'a> {
    initialize_params: wire::InitializeParams,
    initialize_result: wire::InitializeResult,
    create_params: wire::CreateParams,
    create_result: wire::Outcome,
    prepare_params: wire::PrepareParams,
    prepare_result: wire::Outcome,
    plan_params: wire::PlanParams,
    plan_result: wire::PlanResult<'a>,
    recover_params: wire::RecoverParams<'a>,
    recover_result: wire::PlanResult<'a>,
    generate_params: wire::GenerateParams,
    generate_result: wire::GenerateResult,
    should_invoke_params: wire::ShouldInvokeParams,
    should_invoke_result: wire::ShouldInvokeResult,
    incumbent_params: wire::IncumbentParams<'a>,
    keep_params: wire::KeepParams,
    annotation_params: wire::AnnotationParams,
    metric_params: wire::MetricParams,
    note_params: wire::NoteParams,
    progress_params: wire::ProgressParams,
    log_params: wire::LogParams,
    cancel_params: wire::CancelParams,
    error: wire::RpcError,
    /// Data of the part `fleetyard.traffic/1`.
    traffic_part: Traffic,
    /// Data of the part `fleetyard.rest-of-plan/1`.
    rest_of_plan_part: RestOfPlan,
    /// Data of the part `fleetyard.goal-tasks/1`.
    goal_tasks_part: GoalTasks,
    /// Data of the part `fleetyard.guidance/1`.
    guidance_part: Guidance,
    /// Data of the part `fleetyard.kept/1`.
    kept_part: Kept,
}

#[test]
fn schemas_are_current() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("schema/protocol.json");
    let generator = SchemaSettings::draft2020_12().into_generator();
    let mut schema = generator.into_root_schema_for::<Messages<'_>>();
    schema.insert("title".into(), "Fleetyard plugin protocol".into());
    schema.insert(
        "description".into(),
        format!(
            "Parameters and results of each method of protocol version {}, as NAME_params and \
             NAME_result.",
            wire::PROTOCOL_VERSION
        )
        .into(),
    );
    let text = serde_json::to_string_pretty(&schema).expect("JSON") + "\n";
    if std::env::var_os("FLEETYARD_UPDATE").is_some() {
        std::fs::write(&path, &text).expect("write the schema");
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        committed == text,
        "schema/protocol.json is not what src/wire.rs says; run \
         `FLEETYARD_UPDATE=1 cargo test -p fleetyard-abi schema`"
    );
}
