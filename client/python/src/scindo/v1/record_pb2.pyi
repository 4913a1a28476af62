from scindo.v1 import common_pb2 as _common_pb2
from scindo.v1 import server_pb2 as _server_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class RecordedScene(_message.Message):
    __slots__ = ("json", "file", "base_dir", "name", "version", "step_s", "threads")
    JSON_FIELD_NUMBER: _ClassVar[int]
    FILE_FIELD_NUMBER: _ClassVar[int]
    BASE_DIR_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    STEP_S_FIELD_NUMBER: _ClassVar[int]
    THREADS_FIELD_NUMBER: _ClassVar[int]
    json: str
    file: str
    base_dir: str
    name: str
    version: str
    step_s: float
    threads: int
    def __init__(self, json: _Optional[str] = ..., file: _Optional[str] = ..., base_dir: _Optional[str] = ..., name: _Optional[str] = ..., version: _Optional[str] = ..., step_s: _Optional[float] = ..., threads: _Optional[int] = ...) -> None: ...

class RecordedStep(_message.Message):
    __slots__ = ("number", "step", "time_s", "tools", "cuts", "energy", "hash", "broken_off")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    STEP_FIELD_NUMBER: _ClassVar[int]
    TIME_S_FIELD_NUMBER: _ClassVar[int]
    TOOLS_FIELD_NUMBER: _ClassVar[int]
    CUTS_FIELD_NUMBER: _ClassVar[int]
    ENERGY_FIELD_NUMBER: _ClassVar[int]
    HASH_FIELD_NUMBER: _ClassVar[int]
    BROKEN_OFF_FIELD_NUMBER: _ClassVar[int]
    number: int
    step: int
    time_s: float
    tools: _containers.RepeatedCompositeFieldContainer[RecordedTool]
    cuts: _containers.RepeatedCompositeFieldContainer[RecordedCut]
    energy: bool
    hash: bytes
    broken_off: bool
    def __init__(self, number: _Optional[int] = ..., step: _Optional[int] = ..., time_s: _Optional[float] = ..., tools: _Optional[_Iterable[_Union[RecordedTool, _Mapping[str, object]]]] = ..., cuts: _Optional[_Iterable[_Union[RecordedCut, _Mapping[str, object]]]] = ..., energy: _Optional[bool] = ..., hash: _Optional[bytes] = ..., broken_off: _Optional[bool] = ...) -> None: ...

class RecordedTool(_message.Message):
    __slots__ = ("id", "owner", "pose", "passed", "velocity_m_s", "mode", "closed", "shape", "dimensions", "seq", "client_time_ns")
    ID_FIELD_NUMBER: _ClassVar[int]
    OWNER_FIELD_NUMBER: _ClassVar[int]
    POSE_FIELD_NUMBER: _ClassVar[int]
    PASSED_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_M_S_FIELD_NUMBER: _ClassVar[int]
    MODE_FIELD_NUMBER: _ClassVar[int]
    CLOSED_FIELD_NUMBER: _ClassVar[int]
    SHAPE_FIELD_NUMBER: _ClassVar[int]
    DIMENSIONS_FIELD_NUMBER: _ClassVar[int]
    SEQ_FIELD_NUMBER: _ClassVar[int]
    CLIENT_TIME_NS_FIELD_NUMBER: _ClassVar[int]
    id: str
    owner: str
    pose: _common_pb2.Pose
    passed: _containers.RepeatedCompositeFieldContainer[_common_pb2.Pose]
    velocity_m_s: _common_pb2.Vec3
    mode: int
    closed: float
    shape: int
    dimensions: _containers.RepeatedScalarFieldContainer[float]
    seq: int
    client_time_ns: int
    def __init__(self, id: _Optional[str] = ..., owner: _Optional[str] = ..., pose: _Optional[_Union[_common_pb2.Pose, _Mapping[str, object]]] = ..., passed: _Optional[_Iterable[_Union[_common_pb2.Pose, _Mapping[str, object]]]] = ..., velocity_m_s: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ..., mode: _Optional[int] = ..., closed: _Optional[float] = ..., shape: _Optional[int] = ..., dimensions: _Optional[_Iterable[float]] = ..., seq: _Optional[int] = ..., client_time_ns: _Optional[int] = ...) -> None: ...

class RecordedCut(_message.Message):
    __slots__ = ("request", "tool", "body", "points_m")
    REQUEST_FIELD_NUMBER: _ClassVar[int]
    TOOL_FIELD_NUMBER: _ClassVar[int]
    BODY_FIELD_NUMBER: _ClassVar[int]
    POINTS_M_FIELD_NUMBER: _ClassVar[int]
    request: int
    tool: str
    body: str
    points_m: _containers.RepeatedCompositeFieldContainer[_common_pb2.Vec3]
    def __init__(self, request: _Optional[int] = ..., tool: _Optional[str] = ..., body: _Optional[str] = ..., points_m: _Optional[_Iterable[_Union[_common_pb2.Vec3, _Mapping[str, object]]]] = ...) -> None: ...

class RecordedOrder(_message.Message):
    __slots__ = ("number", "reset", "undo", "set", "govern_s", "discard", "snapshot", "restore", "jump")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    RESET_FIELD_NUMBER: _ClassVar[int]
    UNDO_FIELD_NUMBER: _ClassVar[int]
    SET_FIELD_NUMBER: _ClassVar[int]
    GOVERN_S_FIELD_NUMBER: _ClassVar[int]
    DISCARD_FIELD_NUMBER: _ClassVar[int]
    SNAPSHOT_FIELD_NUMBER: _ClassVar[int]
    RESTORE_FIELD_NUMBER: _ClassVar[int]
    JUMP_FIELD_NUMBER: _ClassVar[int]
    number: int
    reset: bool
    undo: bool
    set: _server_pb2.SetRequest
    govern_s: float
    discard: str
    snapshot: str
    restore: str
    jump: str
    def __init__(self, number: _Optional[int] = ..., reset: _Optional[bool] = ..., undo: _Optional[bool] = ..., set: _Optional[_Union[_server_pb2.SetRequest, _Mapping[str, object]]] = ..., govern_s: _Optional[float] = ..., discard: _Optional[str] = ..., snapshot: _Optional[str] = ..., restore: _Optional[str] = ..., jump: _Optional[str] = ...) -> None: ...

class RecordedCheckpoint(_message.Message):
    __slots__ = ("number", "step", "state")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    STEP_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    number: int
    step: int
    state: bytes
    def __init__(self, number: _Optional[int] = ..., step: _Optional[int] = ..., state: _Optional[bytes] = ...) -> None: ...

class RecordedEvent(_message.Message):
    __slots__ = ("number", "name", "message", "body_id")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    BODY_ID_FIELD_NUMBER: _ClassVar[int]
    number: int
    name: str
    message: str
    body_id: str
    def __init__(self, number: _Optional[int] = ..., name: _Optional[str] = ..., message: _Optional[str] = ..., body_id: _Optional[str] = ...) -> None: ...

class RecordedStats(_message.Message):
    __slots__ = ("number", "time_s", "step_ms", "iterations", "residual")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    TIME_S_FIELD_NUMBER: _ClassVar[int]
    STEP_MS_FIELD_NUMBER: _ClassVar[int]
    ITERATIONS_FIELD_NUMBER: _ClassVar[int]
    RESIDUAL_FIELD_NUMBER: _ClassVar[int]
    number: int
    time_s: float
    step_ms: float
    iterations: _containers.RepeatedScalarFieldContainer[int]
    residual: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, number: _Optional[int] = ..., time_s: _Optional[float] = ..., step_ms: _Optional[float] = ..., iterations: _Optional[_Iterable[int]] = ..., residual: _Optional[_Iterable[float]] = ...) -> None: ...

class RecordedForces(_message.Message):
    __slots__ = ("number", "time_s", "tools")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    TIME_S_FIELD_NUMBER: _ClassVar[int]
    TOOLS_FIELD_NUMBER: _ClassVar[int]
    number: int
    time_s: float
    tools: _containers.RepeatedCompositeFieldContainer[ToolForce]
    def __init__(self, number: _Optional[int] = ..., time_s: _Optional[float] = ..., tools: _Optional[_Iterable[_Union[ToolForce, _Mapping[str, object]]]] = ...) -> None: ...

class ToolForce(_message.Message):
    __slots__ = ("id", "owner", "pose", "force_n")
    ID_FIELD_NUMBER: _ClassVar[int]
    OWNER_FIELD_NUMBER: _ClassVar[int]
    POSE_FIELD_NUMBER: _ClassVar[int]
    FORCE_N_FIELD_NUMBER: _ClassVar[int]
    id: str
    owner: str
    pose: _common_pb2.Pose
    force_n: _common_pb2.Vec3
    def __init__(self, id: _Optional[str] = ..., owner: _Optional[str] = ..., pose: _Optional[_Union[_common_pb2.Pose, _Mapping[str, object]]] = ..., force_n: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ...) -> None: ...

class RecordedSurface(_message.Message):
    __slots__ = ("number", "time_s", "body_id", "epoch", "positions_m", "triangles")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    TIME_S_FIELD_NUMBER: _ClassVar[int]
    BODY_ID_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    POSITIONS_M_FIELD_NUMBER: _ClassVar[int]
    TRIANGLES_FIELD_NUMBER: _ClassVar[int]
    number: int
    time_s: float
    body_id: str
    epoch: int
    positions_m: bytes
    triangles: bytes
    def __init__(self, number: _Optional[int] = ..., time_s: _Optional[float] = ..., body_id: _Optional[str] = ..., epoch: _Optional[int] = ..., positions_m: _Optional[bytes] = ..., triangles: _Optional[bytes] = ...) -> None: ...
