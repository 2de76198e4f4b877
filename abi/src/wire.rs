//! The JSON wire: newline-delimited JSON-RPC 2.0.
//!
//! The host sends requests and `$/cancel`; the plugin sends responses and the
//! notifications `incumbent`, `annotation`, `keep`, `metric`, `note`, `progress` and `log`. One message a
//! line, UTF-8, no batches. The protocol has a version of its own.
//!
//! | method | parameters | result |
//! | --- | --- | --- |
//! | `initialize` | [`InitializeParams`] | [`InitializeResult`] |
//! | `create` | [`CreateParams`] | [`Outcome`] |
//! | `prepare` | [`PrepareParams`] | [`Outcome`] |
//! | `plan` | [`PlanParams`] | [`PlanResult`] |
//! | `recover` | [`RecoverParams`] | [`PlanResult`] |
//! | `generate` | [`GenerateParams`] | [`GenerateResult`] |
//! | `should_invoke` | [`ShouldInvokeParams`] | [`ShouldInvokeResult`] |
//! | `shutdown` | none | `null` |
//! | `exit` (notification) | none | |
//! | `$/cancel` (notification) | [`CancelParams`] | |

use std::borrow::Cow;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;

use crate::annotation::Annotation;
use crate::environment::Environment;
use crate::memory::Kept;
use crate::model::{
    Budget, Descriptor, FleetState, FleetStatus, Instance, Kind, LogLevel, Request as NextRequest,
    Status,
};
use crate::plan::{Knot, Visit};

/// The version of the protocol that this crate speaks.
pub const PROTOCOL_VERSION: u32 = 1;

/// JSON-RPC error code: the message is not JSON.
pub const PARSE_ERROR: i64 = -32700;
/// JSON-RPC error code: the message is no request.
pub const INVALID_REQUEST: i64 = -32600;
/// JSON-RPC error code: there is no such method.
pub const METHOD_NOT_FOUND: i64 = -32601;
/// JSON-RPC error code: the parameters are not of the method's form.
pub const INVALID_PARAMS: i64 = -32602;
/// JSON-RPC error code: the plugin failed.
pub const INTERNAL_ERROR: i64 = -32603;

/// The host's worker refuses the library that it was asked to load.
pub const REFUSED: i64 = -32001;
/// The host's worker found that the library broke the contract.
pub const BROKE_CONTRACT: i64 = -32002;

/// The notification that says, before an answer, that the plugin frees memory after it, and hears
/// nothing until it is [`READY`].
pub const BUSY: &str = "busy";
/// The notification that a [`BUSY`] plugin hears again.
pub const READY: &str = "ready";

/// Any message, its payload still as text.
#[derive(Debug, Deserialize)]
pub struct Envelope<'a> {
    /// `"2.0"`.
    #[serde(borrow, default)]
    pub jsonrpc: Cow<'a, str>,
    /// Identifier of a request or of the request that is answered.
    #[serde(default)]
    pub id: Option<u64>,
    /// Method of a request or notification.
    #[serde(borrow, default)]
    pub method: Option<Cow<'a, str>>,
    /// Parameters of a request or notification.
    #[serde(borrow, default)]
    pub params: Option<&'a RawValue>,
    /// Result of a response.
    #[serde(borrow, default)]
    pub result: Option<&'a RawValue>,
    /// Error of a response.
    #[serde(default)]
    pub error: Option<RpcError>,
}

impl Envelope<'_> {
    /// The parameters as a type; absent parameters read as `null`.
    pub fn params<T: serde::de::DeserializeOwned>(&self) -> Result<T, serde_json::Error> {
        serde_json::from_str(self.params.map_or("null", RawValue::get))
    }
}

/// The error of a response.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
pub struct RpcError {
    /// One of the codes of this module, or the plugin's own.
    pub code: i64,
    /// The reason, in words.
    pub message: String,
}

/// Serialises a request, or a notification when it has no `id`.
#[derive(Debug, Serialize)]
pub struct Request<'a, P> {
    jsonrpc: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    id: Option<u64>,
    method: &'a str,
    params: P,
}

impl<'a, P: Serialize> Request<'a, P> {
    /// A request that will be answered with `id`.
    pub fn new(id: u64, method: &'a str, params: P) -> Self {
        Self {
            jsonrpc: "2.0",
            id: Some(id),
            method,
            params,
        }
    }

    /// A message without an answer.
    pub fn notification(method: &'a str, params: P) -> Self {
        Self {
            jsonrpc: "2.0",
            id: None,
            method,
            params,
        }
    }
}

/// Serialises a response.
#[derive(Debug, Serialize)]
pub struct Response<R> {
    jsonrpc: &'static str,
    id: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    result: Option<R>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<RpcError>,
}

impl<R: Serialize> Response<R> {
    /// The answer to request `id`.
    pub fn result(id: u64, result: R) -> Self {
        Self {
            jsonrpc: "2.0",
            id: Some(id),
            result: Some(result),
            error: None,
        }
    }
}

impl Response<()> {
    /// The refusal of a request.
    pub fn error(id: Option<u64>, code: i64, message: impl Into<String>) -> Self {
        let error = Some(RpcError {
            code,
            message: message.into(),
        });
        Self {
            jsonrpc: "2.0",
            id,
            result: None,
            error,
        }
    }
}

/// A message as one line, its newline included.
pub fn line<M: Serialize>(message: &M) -> Vec<u8> {
    let mut line = Vec::with_capacity(256);
    // Writing to memory cannot fail, and no type of this crate has maps with
    // keys that are not strings.
    if let Err(error) = serde_json::to_writer(&mut line, message) {
        line.clear();
        line.extend_from_slice(
            &serde_json::to_vec(&Response::error(None, INTERNAL_ERROR, error.to_string()))
                .unwrap_or_default(),
        );
    }
    line.push(b'\n');
    line
}

/// The program at one end of the connection.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
pub struct Peer {
    /// Name of the program.
    pub name: String,
    /// Its version.
    pub version: String,
}

/// Parameters of `initialize`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
pub struct InitializeParams {
    /// Versions of the protocol that the host speaks.
    pub protocol_versions: Vec<u32>,
    /// The host.
    pub host: Peer,
}

/// Result of `initialize`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
pub struct InitializeResult {
    /// The version that the plugin chose from those offered.
    pub protocol_version: u32,
    /// Every plugin of the program.
    pub plugins: Vec<Descriptor>,
    /// Major and minor version of the C ABI that a library was built for: the host's
    /// own worker says it. Programs leave it out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub abi_version: Option<[u16; 2]>,
}

/// Parameters of `create`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
pub struct CreateParams {
    /// Kind of the plugin to make.
    pub kind: Kind,
    /// Its identifier.
    pub plugin: String,
    /// Its options, an object that satisfies the descriptor's schema.
    #[serde(default)]
    pub options: serde_json::Value,
}

// Something large may be text already that a host has written before the clock of the call
// began: that is what the types of these parameters are open for.

/// Parameters of `prepare`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "PrepareParams")]
pub struct PrepareParams<E = Environment> {
    /// The map.
    pub environment: E,
    /// Limits of this call.
    pub budget: Budget,
}

/// The result of a call without further content.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
pub struct Outcome {
    /// `solved` stands for success.
    pub status: Status,
    /// The reason, when it is no success.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub message: Option<String>,
}

/// Parameters of `plan`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "PlanParams")]
pub struct PlanParams<I = Instance> {
    /// The instance to solve.
    pub instance: I,
    /// Limits of this call.
    pub budget: Budget,
    /// Identifiers of the extensions that the host has for this call because somebody wants them,
    /// such as `fleetyard.annotations/1`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub extensions: Vec<Cow<'static, str>>,
}

/// A plan in one of its forms, still as text; see [`crate::paths::PlanContext`].
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Plan")]
pub struct PlanText<'a> {
    /// On a grid: one path per agent.
    #[serde(borrow, default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<Vec<WirePath>>")]
    pub paths: Option<&'a RawValue>,
    /// On a roadmap: per agent its visits, in order.
    #[serde(borrow, default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<Vec<Vec<Visit>>>")]
    pub visits: Option<&'a RawValue>,
    /// In the plane: per agent its knots, or knots and controls.
    #[serde(borrow, default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<Vec<WireMotion>>")]
    pub trajectories: Option<&'a RawValue>,
}

impl PlanText<'_> {
    /// True if there is a plan, whatever its form.
    pub fn is_there(&self) -> bool {
        self.paths.is_some() || self.visits.is_some() || self.trajectories.is_some()
    }
}

/// Parameters of the notification `incumbent`: a plan, better than the last.
pub type IncumbentParams<'a> = PlanText<'a>;

/// Parameters of the notification `annotation`, with the extension
/// [`ANNOTATIONS_ID`](crate::c::ANNOTATIONS_ID): something to show.
pub type AnnotationParams = Annotation;

/// Parameters of `recover`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "RecoverParams")]
pub struct RecoverParams<'a, I = Instance> {
    /// The instance that was to be solved.
    pub instance: I,
    /// Limits of this call.
    pub budget: Budget,
    /// The plan that the planner left, collisions and all.
    #[serde(borrow, default)]
    #[schemars(with = "Option<PlanText<'_>>")]
    pub failed_plan: Option<&'a RawValue>,
    /// As in `plan`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub extensions: Vec<Cow<'static, str>>,
}

/// Result of `plan` and `recover`, the plan still as text. It may be left out when the last
/// `incumbent` was the answer.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub struct PlanResult<'a> {
    /// The plugin's claim.
    pub status: Status,
    /// The reason, when it did not succeed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub message: Option<String>,
    /// As in `incumbent`.
    #[serde(borrow, default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<Vec<WirePath>>")]
    pub paths: Option<&'a RawValue>,
    /// As in `incumbent`.
    #[serde(borrow, default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<Vec<Vec<Visit>>>")]
    pub visits: Option<&'a RawValue>,
    /// As in `incumbent`.
    #[serde(borrow, default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<Vec<WireMotion>>")]
    pub trajectories: Option<&'a RawValue>,
    /// Time for which the plugin worked on the call, without reading and writing messages:
    /// nanoseconds of a monotonic clock, no more than the call took. A claim: nobody is ranked by
    /// it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub call_ns: Option<u64>,
}

impl<'a> PlanResult<'a> {
    /// Its plan, if it has one.
    pub fn plan(&self) -> PlanText<'a> {
        PlanText {
            paths: self.paths,
            visits: self.visits,
            trajectories: self.trajectories,
        }
    }
}

/// A path in any of its encodings; for the schemas only.
#[derive(Debug, JsonSchema)]
#[serde(untagged)]
pub enum WirePath {
    /// `[[row, col], …]`
    Pairs(Vec<[i64; 2]>),
    /// Cell indices.
    Cells(Vec<i64>),
    /// Letters of moves from the agent's start.
    Moves(String),
}

/// A motion in the plane; for the schemas only.
#[derive(Debug, JsonSchema)]
#[serde(untagged)]
pub enum WireMotion {
    /// Knots alone.
    Knots(Vec<Knot>),
    /// Knots, controls, or both.
    Controlled(WireControlled),
}

/// A motion with controls; for the schemas only.
#[derive(Debug, JsonSchema)]
pub struct WireControlled {
    /// Knots, in order. May be left out: then the robot is where its controls lead from its start.
    pub knots: Option<Vec<Knot>>,
    /// `[duration_s, number, …]`: a control of the robot and the time that it is held, one after the
    /// other from time 0 on.
    pub controls: Option<Vec<Vec<f64>>>,
}

/// Parameters of `generate`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "GenerateParams")]
pub struct GenerateParams<S = FleetState> {
    /// The fleet and its tasks.
    pub state: S,
    /// Limits of this call.
    pub budget: Budget,
}

/// Result of `generate`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
pub struct GenerateResult {
    /// `solved` stands for success.
    pub status: Status,
    /// The reason, when it is no success.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub message: Option<String>,
    /// The decision about the next instance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub request: Option<NextRequest>,
}

/// Parameters of `should_invoke`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "ShouldInvokeParams")]
pub struct ShouldInvokeParams<S = FleetStatus> {
    /// The fleet.
    pub status: S,
}

/// Result of `should_invoke`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
pub struct ShouldInvokeResult {
    /// True if the planner has to be called now.
    pub invoke: bool,
}

/// Parameters of the notification `metric`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
pub struct MetricParams {
    /// Name, such as `expansions`.
    pub name: String,
    /// Value.
    pub value: f64,
}

/// Parameters of the notification `keep`, in calls for plans and requests: bytes to be kept in place
/// of those before. The last ones of a call count, and only if it ends well and in time.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
pub struct KeepParams {
    /// The bytes.
    pub bytes: Kept,
}

/// Parameters of the notification `note`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
pub struct NoteParams {
    /// Name, such as `weights-sha256`.
    pub name: String,
    /// The fact.
    pub text: String,
}

/// Parameters of the notification `progress`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
pub struct ProgressParams {
    /// Work done.
    pub done: u64,
    /// All work; 0 if unknown.
    #[serde(default)]
    pub total: u64,
}

/// Parameters of the notification `log`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
pub struct LogParams {
    /// Severity of the line.
    pub level: LogLevel,
    /// The line.
    pub text: String,
}

/// Parameters of the notification `$/cancel`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
pub struct CancelParams {
    /// The request that should end.
    pub id: u64,
}
