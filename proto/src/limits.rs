//! Limits of the wire. A message beyond one of them is refused before memory is spent on it.

/// Longest id in a key or message [bytes]. Long enough for `host-name_process-id`, short enough
/// that a key with two ids stays below 200 bytes.
pub const MAX_ID_BYTES: usize = 64;

/// Longest free text (messages, hints, plan reasons) [bytes].
pub const MAX_TEXT_BYTES: usize = 4096;

/// Most surface vertices of one body. Their positions take 48 MB, twenty times the finest organ of the
/// reference models. One frame still fits a gigabit link in half a second.
pub const MAX_VERTICES: u32 = 4_000_000;

/// Most surface triangles of one body (a closed surface has about twice as many as vertices).
pub const MAX_TRIANGLES: u32 = 8_000_000;

/// Most marks of incisions on the surface of one body; a scratch through 100,000 elements has fewer.
pub const MAX_MARKS: u32 = 1_000_000;

/// Bytes of a position: three little-endian `f32`.
pub const POSITION_BYTES: usize = 12;

/// Bytes of a value of a field: one little-endian `f32`.
pub const VALUE_BYTES: usize = 4;

/// Bytes of a mark: two positions.
pub const MARK_BYTES: usize = 2 * POSITION_BYTES;

/// Bytes of a triangle: three little-endian `u32`.
pub const TRIANGLE_BYTES: usize = 12;

/// Bytes of a triangle tag: one little-endian `u32`.
pub const TAG_BYTES: usize = 4;

/// Bytes of the texture coordinates of a triangle: two little-endian `f32` for each corner.
pub const TEXTURE_BYTES: usize = 24;

/// Largest image on a body, as the file that it comes in [bytes].
pub const MAX_IMAGE_BYTES: usize = 16 << 20;

/// Fields beside the arrays of a surface message [bytes].
pub const HEADER_BYTES: usize = 512;

/// Largest surface frame [bytes].
pub const MAX_FRAME_BYTES: usize =
    MAX_VERTICES as usize * POSITION_BYTES + MAX_MARKS as usize * MARK_BYTES + HEADER_BYTES;

/// Largest surface topology [bytes].
pub const MAX_TOPOLOGY_BYTES: usize = MAX_TRIANGLES as usize * (TRIANGLE_BYTES + TAG_BYTES)
    + MAX_TRIANGLES as usize * TEXTURE_BYTES
    + MAX_VERTICES as usize * (POSITION_BYTES + 1)
    + HEADER_BYTES;

/// Largest field on a surface [bytes].
pub const MAX_FIELD_BYTES: usize = MAX_VERTICES as usize * VALUE_BYTES + HEADER_BYTES;

/// Most probes whose positions are published. Further ones are recorded but not shown.
pub const MAX_PROBES: usize = 256;

/// Most pairs in a message of forces.
pub const MAX_FORCE_PAIRS: usize = 64;

/// Most points of contact of a pair in a message of forces.
pub const MAX_FORCE_POINTS: usize = 32;

/// Most layers of tissue that a body may be drawn with.
pub const MAX_LAYERS: usize = 8;

/// Largest keyframe [bytes]: a topology and a frame.
pub const MAX_KEYFRAME_BYTES: usize = MAX_FRAME_BYTES + MAX_TOPOLOGY_BYTES + HEADER_BYTES;

/// Largest tool pose [bytes]. A full sample takes about 300.
pub const MAX_POSE_BYTES: usize = 1024;

/// Largest contact message [bytes]: one datagram, one zenoh batch, no fragmentation.
pub const MAX_CONTACT_BYTES: usize = 1024;

/// Longest time in which the force of held still tissue relaxes [s].
pub const MAX_RELAXATION_S: f64 = 1.0e3;

/// Most contact planes of a message: six with the longest ids fill [`MAX_CONTACT_BYTES`].
pub const MAX_CONTACTS: usize = 6;

/// Fewest blade segments of a cut: two span a surface.
pub const MIN_SWEEP_SEGMENTS: usize = 2;

/// Most blade segments of a cut. A longer incision is sent as several commands.
pub const MAX_SWEEP_SEGMENTS: usize = 1024;

/// Largest cut command [bytes]: 1024 segments of 62 bytes and the ids.
pub const MAX_CUT_BYTES: usize = 80 * 1024;

/// Largest small message: state, acknowledgement, event, capability, rpc request and reply [bytes].
pub const MAX_SMALL_BYTES: usize = 16 * 1024;

/// Largest report: statistics, plan, session information, schema [bytes].
pub const MAX_REPORT_BYTES: usize = 256 * 1024;

/// Largest file that `rpc/state` answers with [bytes].
pub const MAX_STATE_BYTES: usize = 64 * 1024 * 1024;

/// Most bodies of a session.
pub const MAX_BODIES: usize = 256;

/// Most obstacles of a session.
pub const MAX_OBSTACLES: usize = 64;

/// Most triangles of all obstacles of a session together; those of larger surfaces are not sent.
pub const MAX_OBSTACLE_TRIANGLES: usize = 8192;

/// Most tools of a session.
pub const MAX_TOOLS: usize = 64;

/// Most entries of a list in a report (stages, counters, effects).
pub const MAX_REPORT_ENTRIES: usize = 256;

/// Most parameters that `rpc/params` lists. Those of 256 bodies would not fit a report.
pub const MAX_PARAMS: usize = 512;

/// Most scenes that `rpc/scenes` lists.
pub const MAX_SCENES: usize = 256;

/// Most steps that one `rpc/step` may ask for.
pub const MAX_RPC_STEPS: u32 = 10_000;

/// Largest coordinate [m]. Beyond it, single precision resolves less than a millimetre.
pub const MAX_COORDINATE_M: f64 = 1.0e4;

/// Largest velocity [m/s]; a hand stays below 10.
pub const MAX_VELOCITY_M_S: f64 = 1.0e3;

/// Largest force of the grip of forceps [N].
pub const MAX_GRIP_N: f64 = 1e4;
/// Largest coefficient of dry friction.
pub const MAX_FRICTION: f64 = 10.0;

/// Largest dimension of a tool [m].
pub const MAX_TOOL_M: f64 = 10.0;

/// Largest force [N].
pub const MAX_FORCE_N: f64 = 1.0e6;

/// Largest deviation of the norm of an orientation quaternion from one. Devices in single precision round to
/// 1e-7. A tolerance of 1e-3 accepts them and catches unset or scaled quaternions.
pub const QUATERNION_TOLERANCE: f64 = 1.0e-3;

/// Largest deviation of the norm of a contact normal from one.
pub const NORMAL_TOLERANCE: f64 = 1.0e-3;
