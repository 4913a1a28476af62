from scindo.v1 import common_pb2 as _common_pb2
from scindo.v1 import tool_pb2 as _tool_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class SessionInfo(_message.Message):
    __slots__ = ("server_version", "wire_version", "scene_name", "step_s", "bodies", "tools", "scene_seq", "scene", "up", "obstacles", "records", "scene_description")
    SERVER_VERSION_FIELD_NUMBER: _ClassVar[int]
    WIRE_VERSION_FIELD_NUMBER: _ClassVar[int]
    SCENE_NAME_FIELD_NUMBER: _ClassVar[int]
    STEP_S_FIELD_NUMBER: _ClassVar[int]
    BODIES_FIELD_NUMBER: _ClassVar[int]
    TOOLS_FIELD_NUMBER: _ClassVar[int]
    SCENE_SEQ_FIELD_NUMBER: _ClassVar[int]
    SCENE_FIELD_NUMBER: _ClassVar[int]
    UP_FIELD_NUMBER: _ClassVar[int]
    OBSTACLES_FIELD_NUMBER: _ClassVar[int]
    RECORDS_FIELD_NUMBER: _ClassVar[int]
    SCENE_DESCRIPTION_FIELD_NUMBER: _ClassVar[int]
    server_version: str
    wire_version: int
    scene_name: str
    step_s: float
    bodies: _containers.RepeatedCompositeFieldContainer[BodyInfo]
    tools: _containers.RepeatedCompositeFieldContainer[ToolInfo]
    scene_seq: int
    scene: str
    up: _common_pb2.Vec3
    obstacles: _containers.RepeatedCompositeFieldContainer[ObstacleInfo]
    records: bool
    scene_description: str
    def __init__(self, server_version: _Optional[str] = ..., wire_version: _Optional[int] = ..., scene_name: _Optional[str] = ..., step_s: _Optional[float] = ..., bodies: _Optional[_Iterable[_Union[BodyInfo, _Mapping[str, object]]]] = ..., tools: _Optional[_Iterable[_Union[ToolInfo, _Mapping[str, object]]]] = ..., scene_seq: _Optional[int] = ..., scene: _Optional[str] = ..., up: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ..., obstacles: _Optional[_Iterable[_Union[ObstacleInfo, _Mapping[str, object]]]] = ..., records: _Optional[bool] = ..., scene_description: _Optional[str] = ...) -> None: ...

class ObstacleInfo(_message.Message):
    __slots__ = ("id", "half_space", "box", "capsule", "surface")
    class HalfSpace(_message.Message):
        __slots__ = ("point_m", "normal")
        POINT_M_FIELD_NUMBER: _ClassVar[int]
        NORMAL_FIELD_NUMBER: _ClassVar[int]
        point_m: _common_pb2.Vec3
        normal: _common_pb2.Vec3
        def __init__(self, point_m: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ..., normal: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ...) -> None: ...
    class Box(_message.Message):
        __slots__ = ("min_m", "max_m")
        MIN_M_FIELD_NUMBER: _ClassVar[int]
        MAX_M_FIELD_NUMBER: _ClassVar[int]
        min_m: _common_pb2.Vec3
        max_m: _common_pb2.Vec3
        def __init__(self, min_m: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ..., max_m: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ...) -> None: ...
    class Capsule(_message.Message):
        __slots__ = ("from_m", "to_m", "radius_m")
        FROM_M_FIELD_NUMBER: _ClassVar[int]
        TO_M_FIELD_NUMBER: _ClassVar[int]
        RADIUS_M_FIELD_NUMBER: _ClassVar[int]
        from_m: _common_pb2.Vec3
        to_m: _common_pb2.Vec3
        radius_m: float
        def __init__(self, from_m: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ..., to_m: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ..., radius_m: _Optional[float] = ...) -> None: ...
    class Surface(_message.Message):
        __slots__ = ("positions", "triangles")
        POSITIONS_FIELD_NUMBER: _ClassVar[int]
        TRIANGLES_FIELD_NUMBER: _ClassVar[int]
        positions: bytes
        triangles: bytes
        def __init__(self, positions: _Optional[bytes] = ..., triangles: _Optional[bytes] = ...) -> None: ...
    ID_FIELD_NUMBER: _ClassVar[int]
    HALF_SPACE_FIELD_NUMBER: _ClassVar[int]
    BOX_FIELD_NUMBER: _ClassVar[int]
    CAPSULE_FIELD_NUMBER: _ClassVar[int]
    SURFACE_FIELD_NUMBER: _ClassVar[int]
    id: str
    half_space: ObstacleInfo.HalfSpace
    box: ObstacleInfo.Box
    capsule: ObstacleInfo.Capsule
    surface: ObstacleInfo.Surface
    def __init__(self, id: _Optional[str] = ..., half_space: _Optional[_Union[ObstacleInfo.HalfSpace, _Mapping[str, object]]] = ..., box: _Optional[_Union[ObstacleInfo.Box, _Mapping[str, object]]] = ..., capsule: _Optional[_Union[ObstacleInfo.Capsule, _Mapping[str, object]]] = ..., surface: _Optional[_Union[ObstacleInfo.Surface, _Mapping[str, object]]] = ...) -> None: ...

class BodyInfo(_message.Message):
    __slots__ = ("id", "epoch", "elements", "nodes", "min_m", "max_m", "look")
    ID_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    ELEMENTS_FIELD_NUMBER: _ClassVar[int]
    NODES_FIELD_NUMBER: _ClassVar[int]
    MIN_M_FIELD_NUMBER: _ClassVar[int]
    MAX_M_FIELD_NUMBER: _ClassVar[int]
    LOOK_FIELD_NUMBER: _ClassVar[int]
    id: str
    epoch: int
    elements: int
    nodes: int
    min_m: _common_pb2.Vec3
    max_m: _common_pb2.Vec3
    look: BodyLook
    def __init__(self, id: _Optional[str] = ..., epoch: _Optional[int] = ..., elements: _Optional[int] = ..., nodes: _Optional[int] = ..., min_m: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ..., max_m: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ..., look: _Optional[_Union[BodyLook, _Mapping[str, object]]] = ...) -> None: ...

class BodyLook(_message.Message):
    __slots__ = ("colour", "opacity", "layers", "textured")
    COLOUR_FIELD_NUMBER: _ClassVar[int]
    OPACITY_FIELD_NUMBER: _ClassVar[int]
    LAYERS_FIELD_NUMBER: _ClassVar[int]
    TEXTURED_FIELD_NUMBER: _ClassVar[int]
    colour: int
    opacity: float
    layers: _containers.RepeatedCompositeFieldContainer[LookLayer]
    textured: bool
    def __init__(self, colour: _Optional[int] = ..., opacity: _Optional[float] = ..., layers: _Optional[_Iterable[_Union[LookLayer, _Mapping[str, object]]]] = ..., textured: _Optional[bool] = ...) -> None: ...

class LookLayer(_message.Message):
    __slots__ = ("depth_m", "colour")
    DEPTH_M_FIELD_NUMBER: _ClassVar[int]
    COLOUR_FIELD_NUMBER: _ClassVar[int]
    depth_m: float
    colour: int
    def __init__(self, depth_m: _Optional[float] = ..., colour: _Optional[int] = ...) -> None: ...

class ToolInfo(_message.Message):
    __slots__ = ("id", "shape", "owner", "cuts")
    ID_FIELD_NUMBER: _ClassVar[int]
    SHAPE_FIELD_NUMBER: _ClassVar[int]
    OWNER_FIELD_NUMBER: _ClassVar[int]
    CUTS_FIELD_NUMBER: _ClassVar[int]
    id: str
    shape: _tool_pb2.ToolShape
    owner: str
    cuts: bool
    def __init__(self, id: _Optional[str] = ..., shape: _Optional[_Union[_tool_pb2.ToolShape, _Mapping[str, object]]] = ..., owner: _Optional[str] = ..., cuts: _Optional[bool] = ...) -> None: ...

class Stats(_message.Message):
    __slots__ = ("seq", "sim_step", "sim_time_s", "publish_unix_ns", "step_rate_hz", "real_time_factor", "stages", "bodies", "tools", "refused", "cuts_applied", "surface_subscribers", "haptic_clients", "paused", "clients", "client_count", "recording")
    SEQ_FIELD_NUMBER: _ClassVar[int]
    SIM_STEP_FIELD_NUMBER: _ClassVar[int]
    SIM_TIME_S_FIELD_NUMBER: _ClassVar[int]
    PUBLISH_UNIX_NS_FIELD_NUMBER: _ClassVar[int]
    STEP_RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    REAL_TIME_FACTOR_FIELD_NUMBER: _ClassVar[int]
    STAGES_FIELD_NUMBER: _ClassVar[int]
    BODIES_FIELD_NUMBER: _ClassVar[int]
    TOOLS_FIELD_NUMBER: _ClassVar[int]
    REFUSED_FIELD_NUMBER: _ClassVar[int]
    CUTS_APPLIED_FIELD_NUMBER: _ClassVar[int]
    SURFACE_SUBSCRIBERS_FIELD_NUMBER: _ClassVar[int]
    HAPTIC_CLIENTS_FIELD_NUMBER: _ClassVar[int]
    PAUSED_FIELD_NUMBER: _ClassVar[int]
    CLIENTS_FIELD_NUMBER: _ClassVar[int]
    CLIENT_COUNT_FIELD_NUMBER: _ClassVar[int]
    RECORDING_FIELD_NUMBER: _ClassVar[int]
    seq: int
    sim_step: int
    sim_time_s: float
    publish_unix_ns: int
    step_rate_hz: float
    real_time_factor: float
    stages: _containers.RepeatedCompositeFieldContainer[StageTime]
    bodies: _containers.RepeatedCompositeFieldContainer[BodyStats]
    tools: _containers.RepeatedCompositeFieldContainer[ToolStats]
    refused: _containers.RepeatedCompositeFieldContainer[Counter]
    cuts_applied: int
    surface_subscribers: int
    haptic_clients: int
    paused: bool
    clients: _containers.RepeatedCompositeFieldContainer[ClientStats]
    client_count: int
    recording: RecordingStats
    def __init__(self, seq: _Optional[int] = ..., sim_step: _Optional[int] = ..., sim_time_s: _Optional[float] = ..., publish_unix_ns: _Optional[int] = ..., step_rate_hz: _Optional[float] = ..., real_time_factor: _Optional[float] = ..., stages: _Optional[_Iterable[_Union[StageTime, _Mapping[str, object]]]] = ..., bodies: _Optional[_Iterable[_Union[BodyStats, _Mapping[str, object]]]] = ..., tools: _Optional[_Iterable[_Union[ToolStats, _Mapping[str, object]]]] = ..., refused: _Optional[_Iterable[_Union[Counter, _Mapping[str, object]]]] = ..., cuts_applied: _Optional[int] = ..., surface_subscribers: _Optional[int] = ..., haptic_clients: _Optional[int] = ..., paused: _Optional[bool] = ..., clients: _Optional[_Iterable[_Union[ClientStats, _Mapping[str, object]]]] = ..., client_count: _Optional[int] = ..., recording: _Optional[_Union[RecordingStats, _Mapping[str, object]]] = ...) -> None: ...

class RecordingStats(_message.Message):
    __slots__ = ("file", "seconds", "bytes")
    FILE_FIELD_NUMBER: _ClassVar[int]
    SECONDS_FIELD_NUMBER: _ClassVar[int]
    BYTES_FIELD_NUMBER: _ClassVar[int]
    file: str
    seconds: float
    bytes: int
    def __init__(self, file: _Optional[str] = ..., seconds: _Optional[float] = ..., bytes: _Optional[int] = ...) -> None: ...

class ClientStats(_message.Message):
    __slots__ = ("client_id", "role")
    CLIENT_ID_FIELD_NUMBER: _ClassVar[int]
    ROLE_FIELD_NUMBER: _ClassVar[int]
    client_id: str
    role: str
    def __init__(self, client_id: _Optional[str] = ..., role: _Optional[str] = ...) -> None: ...

class StageTime(_message.Message):
    __slots__ = ("name", "milliseconds")
    NAME_FIELD_NUMBER: _ClassVar[int]
    MILLISECONDS_FIELD_NUMBER: _ClassVar[int]
    name: str
    milliseconds: float
    def __init__(self, name: _Optional[str] = ..., milliseconds: _Optional[float] = ...) -> None: ...

class BodyStats(_message.Message):
    __slots__ = ("body_id", "iterations", "residual", "elements", "pieces", "copies", "epoch", "volume_m3", "tolerance", "unconverged_steps", "refused_steps", "divided_steps", "rolled_back_steps", "inverted", "fixed_iterations", "unconverged", "divided_cells", "joined_cells", "unbalanced_steps")
    BODY_ID_FIELD_NUMBER: _ClassVar[int]
    ITERATIONS_FIELD_NUMBER: _ClassVar[int]
    RESIDUAL_FIELD_NUMBER: _ClassVar[int]
    ELEMENTS_FIELD_NUMBER: _ClassVar[int]
    PIECES_FIELD_NUMBER: _ClassVar[int]
    COPIES_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    VOLUME_M3_FIELD_NUMBER: _ClassVar[int]
    TOLERANCE_FIELD_NUMBER: _ClassVar[int]
    UNCONVERGED_STEPS_FIELD_NUMBER: _ClassVar[int]
    REFUSED_STEPS_FIELD_NUMBER: _ClassVar[int]
    DIVIDED_STEPS_FIELD_NUMBER: _ClassVar[int]
    ROLLED_BACK_STEPS_FIELD_NUMBER: _ClassVar[int]
    INVERTED_FIELD_NUMBER: _ClassVar[int]
    FIXED_ITERATIONS_FIELD_NUMBER: _ClassVar[int]
    UNCONVERGED_FIELD_NUMBER: _ClassVar[int]
    DIVIDED_CELLS_FIELD_NUMBER: _ClassVar[int]
    JOINED_CELLS_FIELD_NUMBER: _ClassVar[int]
    UNBALANCED_STEPS_FIELD_NUMBER: _ClassVar[int]
    body_id: str
    iterations: int
    residual: float
    elements: int
    pieces: int
    copies: int
    epoch: int
    volume_m3: float
    tolerance: float
    unconverged_steps: int
    refused_steps: int
    divided_steps: int
    rolled_back_steps: int
    inverted: int
    fixed_iterations: bool
    unconverged: bool
    divided_cells: int
    joined_cells: int
    unbalanced_steps: int
    def __init__(self, body_id: _Optional[str] = ..., iterations: _Optional[int] = ..., residual: _Optional[float] = ..., elements: _Optional[int] = ..., pieces: _Optional[int] = ..., copies: _Optional[int] = ..., epoch: _Optional[int] = ..., volume_m3: _Optional[float] = ..., tolerance: _Optional[float] = ..., unconverged_steps: _Optional[int] = ..., refused_steps: _Optional[int] = ..., divided_steps: _Optional[int] = ..., rolled_back_steps: _Optional[int] = ..., inverted: _Optional[int] = ..., fixed_iterations: _Optional[bool] = ..., unconverged: _Optional[bool] = ..., divided_cells: _Optional[int] = ..., joined_cells: _Optional[int] = ..., unbalanced_steps: _Optional[int] = ...) -> None: ...

class ToolStats(_message.Message):
    __slots__ = ("tool_id", "owner", "contact_rate_hz", "pose_rate_hz", "force_n", "contact_age_ms", "pose_age_ms", "name")
    TOOL_ID_FIELD_NUMBER: _ClassVar[int]
    OWNER_FIELD_NUMBER: _ClassVar[int]
    CONTACT_RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    POSE_RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    FORCE_N_FIELD_NUMBER: _ClassVar[int]
    CONTACT_AGE_MS_FIELD_NUMBER: _ClassVar[int]
    POSE_AGE_MS_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    tool_id: str
    owner: str
    contact_rate_hz: float
    pose_rate_hz: float
    force_n: float
    contact_age_ms: float
    pose_age_ms: float
    name: str
    def __init__(self, tool_id: _Optional[str] = ..., owner: _Optional[str] = ..., contact_rate_hz: _Optional[float] = ..., pose_rate_hz: _Optional[float] = ..., force_n: _Optional[float] = ..., contact_age_ms: _Optional[float] = ..., pose_age_ms: _Optional[float] = ..., name: _Optional[str] = ...) -> None: ...

class Counter(_message.Message):
    __slots__ = ("name", "count")
    NAME_FIELD_NUMBER: _ClassVar[int]
    COUNT_FIELD_NUMBER: _ClassVar[int]
    name: str
    count: int
    def __init__(self, name: _Optional[str] = ..., count: _Optional[int] = ...) -> None: ...

class Measures(_message.Message):
    __slots__ = ("seq", "sim_step", "sim_time_s", "publish_unix_ns", "probes", "energies")
    SEQ_FIELD_NUMBER: _ClassVar[int]
    SIM_STEP_FIELD_NUMBER: _ClassVar[int]
    SIM_TIME_S_FIELD_NUMBER: _ClassVar[int]
    PUBLISH_UNIX_NS_FIELD_NUMBER: _ClassVar[int]
    PROBES_FIELD_NUMBER: _ClassVar[int]
    ENERGIES_FIELD_NUMBER: _ClassVar[int]
    seq: int
    sim_step: int
    sim_time_s: float
    publish_unix_ns: int
    probes: _containers.RepeatedCompositeFieldContainer[ProbePoint]
    energies: _containers.RepeatedCompositeFieldContainer[BodyEnergy]
    def __init__(self, seq: _Optional[int] = ..., sim_step: _Optional[int] = ..., sim_time_s: _Optional[float] = ..., publish_unix_ns: _Optional[int] = ..., probes: _Optional[_Iterable[_Union[ProbePoint, _Mapping[str, object]]]] = ..., energies: _Optional[_Iterable[_Union[BodyEnergy, _Mapping[str, object]]]] = ...) -> None: ...

class ProbePoint(_message.Message):
    __slots__ = ("id", "body_id", "position_m", "rest_m")
    ID_FIELD_NUMBER: _ClassVar[int]
    BODY_ID_FIELD_NUMBER: _ClassVar[int]
    POSITION_M_FIELD_NUMBER: _ClassVar[int]
    REST_M_FIELD_NUMBER: _ClassVar[int]
    id: str
    body_id: str
    position_m: _common_pb2.Vec3
    rest_m: _common_pb2.Vec3
    def __init__(self, id: _Optional[str] = ..., body_id: _Optional[str] = ..., position_m: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ..., rest_m: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ...) -> None: ...

class BodyEnergy(_message.Message):
    __slots__ = ("body_id", "kinetic_j", "elastic_j")
    BODY_ID_FIELD_NUMBER: _ClassVar[int]
    KINETIC_J_FIELD_NUMBER: _ClassVar[int]
    ELASTIC_J_FIELD_NUMBER: _ClassVar[int]
    body_id: str
    kinetic_j: float
    elastic_j: float
    def __init__(self, body_id: _Optional[str] = ..., kinetic_j: _Optional[float] = ..., elastic_j: _Optional[float] = ...) -> None: ...

class Event(_message.Message):
    __slots__ = ("seq", "sim_step", "publish_unix_ns", "level", "name", "message")
    class Level(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        LEVEL_UNSPECIFIED: _ClassVar[Event.Level]
        LEVEL_INFO: _ClassVar[Event.Level]
        LEVEL_WARNING: _ClassVar[Event.Level]
        LEVEL_ERROR: _ClassVar[Event.Level]
    LEVEL_UNSPECIFIED: Event.Level
    LEVEL_INFO: Event.Level
    LEVEL_WARNING: Event.Level
    LEVEL_ERROR: Event.Level
    SEQ_FIELD_NUMBER: _ClassVar[int]
    SIM_STEP_FIELD_NUMBER: _ClassVar[int]
    PUBLISH_UNIX_NS_FIELD_NUMBER: _ClassVar[int]
    LEVEL_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    seq: int
    sim_step: int
    publish_unix_ns: int
    level: Event.Level
    name: str
    message: str
    def __init__(self, seq: _Optional[int] = ..., sim_step: _Optional[int] = ..., publish_unix_ns: _Optional[int] = ..., level: _Optional[_Union[Event.Level, str]] = ..., name: _Optional[str] = ..., message: _Optional[str] = ...) -> None: ...

class Plan(_message.Message):
    __slots__ = ("effects",)
    EFFECTS_FIELD_NUMBER: _ClassVar[int]
    effects: _containers.RepeatedCompositeFieldContainer[Effect]
    def __init__(self, effects: _Optional[_Iterable[_Union[Effect, _Mapping[str, object]]]] = ...) -> None: ...

class Effect(_message.Message):
    __slots__ = ("name", "on", "why", "predicted_ms", "measured_ms")
    NAME_FIELD_NUMBER: _ClassVar[int]
    ON_FIELD_NUMBER: _ClassVar[int]
    WHY_FIELD_NUMBER: _ClassVar[int]
    PREDICTED_MS_FIELD_NUMBER: _ClassVar[int]
    MEASURED_MS_FIELD_NUMBER: _ClassVar[int]
    name: str
    on: bool
    why: str
    predicted_ms: float
    measured_ms: float
    def __init__(self, name: _Optional[str] = ..., on: _Optional[bool] = ..., why: _Optional[str] = ..., predicted_ms: _Optional[float] = ..., measured_ms: _Optional[float] = ...) -> None: ...

class PauseRequest(_message.Message):
    __slots__ = ("paused",)
    PAUSED_FIELD_NUMBER: _ClassVar[int]
    paused: bool
    def __init__(self, paused: _Optional[bool] = ...) -> None: ...

class StepRequest(_message.Message):
    __slots__ = ("count",)
    COUNT_FIELD_NUMBER: _ClassVar[int]
    count: int
    def __init__(self, count: _Optional[int] = ...) -> None: ...

class ResetRequest(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class SetRequest(_message.Message):
    __slots__ = ("key", "value")
    KEY_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    key: str
    value: str
    def __init__(self, key: _Optional[str] = ..., value: _Optional[str] = ...) -> None: ...

class ParamsReply(_message.Message):
    __slots__ = ("params",)
    PARAMS_FIELD_NUMBER: _ClassVar[int]
    params: _containers.RepeatedCompositeFieldContainer[Param]
    def __init__(self, params: _Optional[_Iterable[_Union[Param, _Mapping[str, object]]]] = ...) -> None: ...

class Param(_message.Message):
    __slots__ = ("key", "meaning", "unit", "kind", "value", "min", "max", "usual_min", "usual_max", "logarithmic")
    class Kind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        KIND_UNSPECIFIED: _ClassVar[Param.Kind]
        KIND_NUMBER: _ClassVar[Param.Kind]
        KIND_INTEGER: _ClassVar[Param.Kind]
        KIND_SWITCH: _ClassVar[Param.Kind]
        KIND_VECTOR: _ClassVar[Param.Kind]
    KIND_UNSPECIFIED: Param.Kind
    KIND_NUMBER: Param.Kind
    KIND_INTEGER: Param.Kind
    KIND_SWITCH: Param.Kind
    KIND_VECTOR: Param.Kind
    KEY_FIELD_NUMBER: _ClassVar[int]
    MEANING_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    MIN_FIELD_NUMBER: _ClassVar[int]
    MAX_FIELD_NUMBER: _ClassVar[int]
    USUAL_MIN_FIELD_NUMBER: _ClassVar[int]
    USUAL_MAX_FIELD_NUMBER: _ClassVar[int]
    LOGARITHMIC_FIELD_NUMBER: _ClassVar[int]
    key: str
    meaning: str
    unit: str
    kind: Param.Kind
    value: str
    min: float
    max: float
    usual_min: float
    usual_max: float
    logarithmic: bool
    def __init__(self, key: _Optional[str] = ..., meaning: _Optional[str] = ..., unit: _Optional[str] = ..., kind: _Optional[_Union[Param.Kind, str]] = ..., value: _Optional[str] = ..., min: _Optional[float] = ..., max: _Optional[float] = ..., usual_min: _Optional[float] = ..., usual_max: _Optional[float] = ..., logarithmic: _Optional[bool] = ...) -> None: ...

class UndoRequest(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class SnapshotRequest(_message.Message):
    __slots__ = ("name",)
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class RestoreRequest(_message.Message):
    __slots__ = ("name",)
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class RecordRequest(_message.Message):
    __slots__ = ("on",)
    ON_FIELD_NUMBER: _ClassVar[int]
    on: bool
    def __init__(self, on: _Optional[bool] = ...) -> None: ...

class StateReply(_message.Message):
    __slots__ = ("name", "file")
    NAME_FIELD_NUMBER: _ClassVar[int]
    FILE_FIELD_NUMBER: _ClassVar[int]
    name: str
    file: bytes
    def __init__(self, name: _Optional[str] = ..., file: _Optional[bytes] = ...) -> None: ...

class ScenesReply(_message.Message):
    __slots__ = ("scenes",)
    SCENES_FIELD_NUMBER: _ClassVar[int]
    scenes: _containers.RepeatedCompositeFieldContainer[SceneEntry]
    def __init__(self, scenes: _Optional[_Iterable[_Union[SceneEntry, _Mapping[str, object]]]] = ...) -> None: ...

class SceneEntry(_message.Message):
    __slots__ = ("name", "description")
    NAME_FIELD_NUMBER: _ClassVar[int]
    DESCRIPTION_FIELD_NUMBER: _ClassVar[int]
    name: str
    description: str
    def __init__(self, name: _Optional[str] = ..., description: _Optional[str] = ...) -> None: ...

class TextureRequest(_message.Message):
    __slots__ = ("body_id",)
    BODY_ID_FIELD_NUMBER: _ClassVar[int]
    body_id: str
    def __init__(self, body_id: _Optional[str] = ...) -> None: ...

class TextureReply(_message.Message):
    __slots__ = ("body_id", "media_type", "image")
    BODY_ID_FIELD_NUMBER: _ClassVar[int]
    MEDIA_TYPE_FIELD_NUMBER: _ClassVar[int]
    IMAGE_FIELD_NUMBER: _ClassVar[int]
    body_id: str
    media_type: str
    image: bytes
    def __init__(self, body_id: _Optional[str] = ..., media_type: _Optional[str] = ..., image: _Optional[bytes] = ...) -> None: ...

class LoadRequest(_message.Message):
    __slots__ = ("name",)
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class RpcReply(_message.Message):
    __slots__ = ("ok", "sim_step", "message", "error")
    OK_FIELD_NUMBER: _ClassVar[int]
    SIM_STEP_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    ERROR_FIELD_NUMBER: _ClassVar[int]
    ok: bool
    sim_step: int
    message: str
    error: _common_pb2.Error
    def __init__(self, ok: _Optional[bool] = ..., sim_step: _Optional[int] = ..., message: _Optional[str] = ..., error: _Optional[_Union[_common_pb2.Error, _Mapping[str, object]]] = ...) -> None: ...

class SchemaReply(_message.Message):
    __slots__ = ("file_descriptor_set",)
    FILE_DESCRIPTOR_SET_FIELD_NUMBER: _ClassVar[int]
    file_descriptor_set: bytes
    def __init__(self, file_descriptor_set: _Optional[bytes] = ...) -> None: ...
