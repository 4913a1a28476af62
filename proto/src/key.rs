//! The key space: `<realm>/@v1/<session>/<topic>`.
//!
//! `@v1` is a verbatim chunk, so wildcards never cross versions of the wire.
//!
//! | topic | message | direction |
//! |---|---|---|
//! | `body/<id>/surface/frame` | `SurfaceFrame` | server → all |
//! | `body/<id>/surface/topology` | `SurfaceTopology` | server → all |
//! | `body/<id>/surface/keyframe` | `SurfaceKeyframe` | query |
//! | `body/<id>/surface/field/<name>` | `SurfaceField` | server → subscribers |
//! | `measures` | `Measures` | server → subscribers |
//! | `forces` | `Forces` | server → subscribers |
//! | `client/<client>/tool/<id>/pose` | `ToolSample` | client → server |
//! | `client/<client>/tool/<id>/cut` | `CutCommand` | client → server |
//! | `client/<client>/tool/<id>/capability` | `DeviceCapability` | client → server |
//! | `client/<client>/live/<role>` | liveliness token | client → server |
//! | `tool/<id>/cut_ack` | `CutAck` | server → client |
//! | `tool/<id>/contact` | `HapticContact` | server → client |
//! | `tool/<id>/state` | `ToolState` | server → all |
//! | `stats`, `event`, `plan` | `Stats`, `Event`, `Plan` | server → all |
//! | `rpc/<verb>` | see [`Verb`] | query |
//! | `server/<id>/live` | liveliness token | server → all |
//!
//! The id of a client is part of every key that it publishes to, so that the access control of zenoh can
//! grant each client its own keys. The server refuses a message that names another client than its key does.

use std::fmt;

use thiserror::Error;

use crate::WIRE_VERSION;
use crate::limits::MAX_ID_BYTES;

/// Reason why a key or a part of it is refused.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum KeyError {
    /// A chunk is empty, too long, or has a character outside `[a-z0-9_-]`.
    #[error("{what} '{found}' is not a key chunk: 1 to {MAX_ID_BYTES} characters of a-z, 0-9, _ and -")]
    Chunk {
        /// Role of the chunk in the key.
        what: &'static str,
        /// The text of the chunk (at most the first 64 characters).
        found: String,
    },
    /// The key lies in another realm, session or wire version.
    #[error("key '{found}' does not lie below '{expected}'")]
    Foreign {
        /// The prefix of this session.
        expected: String,
        /// The refused key.
        found: String,
    },
    /// No topic has this form.
    #[error("'{found}' is no topic of scindo.v1; the documentation of scindo_proto::key lists the topics")]
    Unknown {
        /// The part of the key after the session.
        found: String,
    },
}

/// Stands in the id of a page's mouse between the id of its viewer and the number of the page.
pub const MOUSE: &str = "-mouse-";

/// One validated part of a key: `[a-z0-9_-]+`, at most [`MAX_ID_BYTES`] long.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Chunk(String);

impl Chunk {
    /// Accepts `text` as a chunk; `what` names its role in the error.
    pub fn new(what: &'static str, text: &str) -> Result<Self, KeyError> {
        if is_chunk(text) {
            return Ok(Self(text.to_owned()));
        }
        let found = text.chars().take(MAX_ID_BYTES).collect();
        Err(KeyError::Chunk { what, found })
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for Chunk {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// True if `text` may stand as one part of a key.
pub fn is_chunk(text: &str) -> bool {
    (1..=MAX_ID_BYTES).contains(&text.len())
        && text.bytes().all(|b| matches!(b, b'a'..=b'z' | b'0'..=b'9' | b'_' | b'-'))
}

/// Kind of client that a liveliness token stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Role {
    /// A viewer, perhaps with a mouse tool.
    Viewer,
    /// A haptic client.
    Haptic,
    /// Any other program, such as a script.
    Client,
}

impl Role {
    /// Every role.
    pub const ALL: [Self; 3] = [Self::Viewer, Self::Haptic, Self::Client];

    /// The chunk that stands for the role in a key.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Viewer => "viewer",
            Self::Haptic => "haptic",
            Self::Client => "client",
        }
    }
}

/// Questions and orders under `rpc/`. Requests and replies: `PauseRequest`, `StepRequest`, `ResetRequest`,
/// `SetRequest`, `UndoRequest`, `LoadRequest`, `SnapshotRequest`, `RestoreRequest`, `RecordRequest` → `RpcReply`;
/// `info` → `SessionInfo`; `params` → `ParamsReply`; `scenes` → `ScenesReply`; `schema` → `SchemaReply`; `state` →
/// `StateReply`; `TextureRequest` → `TextureReply`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Verb {
    /// Describe the scene, its bodies and its tools.
    Info,
    /// Change to another scene.
    Load,
    /// Go back to the start of the scene.
    Reset,
    /// Pause or continue.
    Pause,
    /// Advance a paused simulation by some steps.
    Step,
    /// Change one parameter.
    Set,
    /// List the parameters that `Set` may change, with values and ranges.
    Params,
    /// Take the last cut back.
    Undo,
    /// List the scenes that can be loaded.
    Scenes,
    /// Keep the present state.
    Snapshot,
    /// Go back to a kept state.
    Restore,
    /// Begin or end a recording.
    Record,
    /// Return the present state as a file.
    State,
    /// Return the image on the skin of a body.
    Texture,
    /// Return the descriptors of the messages.
    Schema,
}

impl Verb {
    /// Every verb.
    pub const ALL: [Self; 15] = [
        Self::Info,
        Self::Load,
        Self::Reset,
        Self::Pause,
        Self::Step,
        Self::Set,
        Self::Params,
        Self::Undo,
        Self::Scenes,
        Self::Snapshot,
        Self::Restore,
        Self::Record,
        Self::State,
        Self::Texture,
        Self::Schema,
    ];

    /// Whether the verb changes what everybody sees, or takes time from the simulation. Anybody may ask the others,
    /// which are questions.
    pub fn is_order(self) -> bool {
        !matches!(self, Self::Info | Self::Schema | Self::Params | Self::Scenes | Self::Texture)
    }

    /// The chunk that stands for the verb in a key.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Info => "info",
            Self::Load => "load",
            Self::Reset => "reset",
            Self::Pause => "pause",
            Self::Step => "step",
            Self::Set => "set",
            Self::Params => "params",
            Self::Undo => "undo",
            Self::Scenes => "scenes",
            Self::Snapshot => "snapshot",
            Self::Restore => "restore",
            Self::Record => "record",
            Self::State => "state",
            Self::Texture => "texture",
            Self::Schema => "schema",
        }
    }
}

/// One topic of a session.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Topic {
    /// Positions of a body's surface.
    SurfaceFrame(Chunk),
    /// Triangles of a body's surface.
    SurfaceTopology(Chunk),
    /// Positions and triangles together, on query.
    SurfaceKeyframe(Chunk),
    /// A quantity on a body's surface, by body and name of the quantity.
    SurfaceField(Chunk, Chunk),
    /// Probes and energies.
    Measures,
    /// Forces of contact.
    Forces,
    /// Pose of a tool in a client's hand, by client and tool.
    ToolPose(Chunk, Chunk),
    /// A cut command, by client and tool.
    ToolCut(Chunk, Chunk),
    /// The answer to a cut command.
    ToolCutAck(Chunk),
    /// Capability of the device behind a tool, by client and tool.
    ToolCapability(Chunk, Chunk),
    /// The local contact model of a tool.
    ToolContact(Chunk),
    /// State of a tool, as viewers draw it.
    ToolState(Chunk),
    /// Rates, costs and health.
    Stats,
    /// Something that happened on the server.
    Event,
    /// Active and inactive effects.
    Plan,
    /// A question or order to the server.
    Rpc(Verb),
    /// Liveliness token of a client, by client and role.
    Live(Chunk, Role),
    /// Liveliness token of a server.
    Server(Chunk),
}

impl Topic {
    /// The key below the session.
    pub fn suffix(&self) -> String {
        match self {
            Self::SurfaceFrame(id) => format!("body/{id}/surface/frame"),
            Self::SurfaceTopology(id) => format!("body/{id}/surface/topology"),
            Self::SurfaceKeyframe(id) => format!("body/{id}/surface/keyframe"),
            Self::SurfaceField(id, name) => format!("body/{id}/surface/field/{name}"),
            Self::Measures => "measures".to_owned(),
            Self::Forces => "forces".to_owned(),
            Self::ToolPose(client, id) => format!("client/{client}/tool/{id}/pose"),
            Self::ToolCut(client, id) => format!("client/{client}/tool/{id}/cut"),
            Self::ToolCutAck(id) => format!("tool/{id}/cut_ack"),
            Self::ToolCapability(client, id) => format!("client/{client}/tool/{id}/capability"),
            Self::ToolContact(id) => format!("tool/{id}/contact"),
            Self::ToolState(id) => format!("tool/{id}/state"),
            Self::Stats => "stats".to_owned(),
            Self::Event => "event".to_owned(),
            Self::Plan => "plan".to_owned(),
            Self::Rpc(verb) => format!("rpc/{}", verb.as_str()),
            Self::Live(client, role) => format!("client/{client}/live/{}", role.as_str()),
            Self::Server(id) => format!("server/{id}/live"),
        }
    }

    /// The topic of a key below the session.
    pub fn from_suffix(suffix: &str) -> Result<Self, KeyError> {
        let unknown = || KeyError::Unknown { found: suffix.chars().take(4 * MAX_ID_BYTES).collect() };
        let body = |id| Chunk::new("body id", id);
        let tool = |id| Chunk::new("tool id", id);
        let client = |id| Chunk::new("client id", id);
        // No topic has more than five chunks, so a sixth makes the key unknown.
        let chunks: Vec<&str> = suffix.splitn(7, '/').collect();
        Ok(match chunks.as_slice() {
            ["body", id, "surface", "frame"] => Self::SurfaceFrame(body(id)?),
            ["body", id, "surface", "topology"] => Self::SurfaceTopology(body(id)?),
            ["body", id, "surface", "keyframe"] => Self::SurfaceKeyframe(body(id)?),
            ["body", id, "surface", "field", name] => {
                Self::SurfaceField(body(id)?, Chunk::new("field name", name)?)
            }
            ["measures"] => Self::Measures,
            ["forces"] => Self::Forces,
            ["client", who, "tool", id, "pose"] => Self::ToolPose(client(who)?, tool(id)?),
            ["client", who, "tool", id, "cut"] => Self::ToolCut(client(who)?, tool(id)?),
            ["client", who, "tool", id, "capability"] => Self::ToolCapability(client(who)?, tool(id)?),
            ["tool", id, "cut_ack"] => Self::ToolCutAck(tool(id)?),
            ["tool", id, "contact"] => Self::ToolContact(tool(id)?),
            ["tool", id, "state"] => Self::ToolState(tool(id)?),
            ["stats"] => Self::Stats,
            ["event"] => Self::Event,
            ["plan"] => Self::Plan,
            ["rpc", verb] => {
                let known = Verb::ALL.into_iter().find(|v| v.as_str() == *verb);
                Self::Rpc(known.ok_or_else(unknown)?)
            }
            ["client", who, "live", role] => {
                let known = Role::ALL.into_iter().find(|r| r.as_str() == *role);
                Self::Live(client(who)?, known.ok_or_else(unknown)?)
            }
            ["server", id, "live"] => Self::Server(Chunk::new("server id", id)?),
            _ => return Err(unknown()),
        })
    }
}

/// Later versions of the wire whose clients are told that they are not understood.
pub const FUTURE: u32 = 8;

/// The keys of one session of one realm.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeySpace {
    /// `<realm>/@v1/<session>/`
    prefix: String,
}

impl KeySpace {
    /// Keys below `<realm>/@v1/<session>`.
    pub fn new(realm: &str, session: &str) -> Result<Self, KeyError> {
        let realm = Chunk::new("realm", realm)?;
        let session = Chunk::new("session", session)?;
        Ok(Self { prefix: format!("{realm}/@v{WIRE_VERSION}/{session}/") })
    }

    /// The full key of a topic.
    pub fn key(&self, topic: &Topic) -> String {
        format!("{}{}", self.prefix, topic.suffix())
    }

    /// The topic of a full key.
    pub fn parse(&self, key: &str) -> Result<Topic, KeyError> {
        match key.strip_prefix(&self.prefix) {
            Some(suffix) => Topic::from_suffix(suffix),
            None => Err(KeyError::Foreign {
                expected: self.prefix.clone(),
                found: key.chars().take(8 * MAX_ID_BYTES).collect(),
            }),
        }
    }

    /// Expression for everything of the session.
    pub fn every_key(&self) -> String {
        format!("{}**", self.prefix)
    }

    /// Expression for every key under which clients speak, and their tokens.
    pub fn every_key_of_clients(&self) -> String {
        format!("{}client/**", self.prefix)
    }

    /// Expression for the keyframes of all bodies.
    pub fn every_keyframe(&self) -> String {
        format!("{}body/*/surface/keyframe", self.prefix)
    }

    /// Expression for `client/*/tool/*/pose`.
    pub fn every_tool_pose(&self) -> String {
        format!("{}client/*/tool/*/pose", self.prefix)
    }

    /// Expression for `client/*/tool/*/cut`.
    pub fn every_tool_cut(&self) -> String {
        format!("{}client/*/tool/*/cut", self.prefix)
    }

    /// Expression for `client/*/tool/*/capability`.
    pub fn every_tool_capability(&self) -> String {
        format!("{}client/*/tool/*/capability", self.prefix)
    }

    /// Expression for `tool/*/state`.
    pub fn every_tool_state(&self) -> String {
        format!("{}tool/*/state", self.prefix)
    }

    /// Expression for `rpc/*`.
    pub fn every_rpc(&self) -> String {
        format!("{}rpc/*", self.prefix)
    }

    /// Expressions for `rpc/*` of clients that speak another version of the wire, and that version: all earlier ones
    /// and the next [`FUTURE`].
    pub fn every_foreign_rpc(&self) -> Vec<(u32, String)> {
        let own = format!("/@v{WIRE_VERSION}/");
        let others = (0..=WIRE_VERSION + FUTURE).filter(|&version| version != WIRE_VERSION);
        let key = |version| self.every_rpc().replacen(&own, &format!("/@v{version}/"), 1);
        others.map(|version| (version, key(version))).collect()
    }

    /// Expression for the liveliness tokens of all clients.
    pub fn every_client(&self) -> String {
        format!("{}client/*/live/*", self.prefix)
    }

    /// Expression for the liveliness tokens of all servers.
    pub fn every_server(&self) -> String {
        format!("{}server/*/live", self.prefix)
    }

    /// Expressions for the liveliness tokens of `client`, and of the mice of its pages.
    pub fn tokens_of(&self, client: &Chunk) -> Vec<String> {
        self.own_and_mice(client, "live/*")
    }

    /// Expressions for all that `client` publishes with tools, and the mice of its pages do.
    pub fn tools_of(&self, client: &Chunk) -> Vec<String> {
        self.own_and_mice(client, "tool/*/*")
    }

    /// Pages behind a viewer are clients of their own, named after it: see [`MOUSE`].
    fn own_and_mice(&self, client: &Chunk, rest: &str) -> Vec<String> {
        let Self { prefix } = self;
        vec![format!("{prefix}client/{client}/{rest}"), format!("{prefix}client/{client}{MOUSE}$*/{rest}")]
    }
}
