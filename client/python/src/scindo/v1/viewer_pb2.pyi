from scindo.v1 import force_pb2 as _force_pb2
from scindo.v1 import server_pb2 as _server_pb2
from scindo.v1 import surface_pb2 as _surface_pb2
from scindo.v1 import tool_pb2 as _tool_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class ViewerDown(_message.Message):
    __slots__ = ("hello", "link", "info", "plan", "topology", "frame", "tool", "stats", "event", "pong", "rpc", "tool_gone", "field", "measures", "forces", "people", "coarse_frame", "texture")
    HELLO_FIELD_NUMBER: _ClassVar[int]
    LINK_FIELD_NUMBER: _ClassVar[int]
    INFO_FIELD_NUMBER: _ClassVar[int]
    PLAN_FIELD_NUMBER: _ClassVar[int]
    TOPOLOGY_FIELD_NUMBER: _ClassVar[int]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    TOOL_FIELD_NUMBER: _ClassVar[int]
    STATS_FIELD_NUMBER: _ClassVar[int]
    EVENT_FIELD_NUMBER: _ClassVar[int]
    PONG_FIELD_NUMBER: _ClassVar[int]
    RPC_FIELD_NUMBER: _ClassVar[int]
    TOOL_GONE_FIELD_NUMBER: _ClassVar[int]
    FIELD_FIELD_NUMBER: _ClassVar[int]
    MEASURES_FIELD_NUMBER: _ClassVar[int]
    FORCES_FIELD_NUMBER: _ClassVar[int]
    PEOPLE_FIELD_NUMBER: _ClassVar[int]
    COARSE_FRAME_FIELD_NUMBER: _ClassVar[int]
    TEXTURE_FIELD_NUMBER: _ClassVar[int]
    hello: ViewerHello
    link: ViewerLink
    info: _server_pb2.SessionInfo
    plan: _server_pb2.Plan
    topology: _surface_pb2.SurfaceTopology
    frame: _surface_pb2.SurfaceFrame
    tool: _tool_pb2.ToolState
    stats: _server_pb2.Stats
    event: _server_pb2.Event
    pong: ViewerPong
    rpc: ViewerRpcReply
    tool_gone: ViewerToolGone
    field: _surface_pb2.SurfaceField
    measures: _server_pb2.Measures
    forces: _force_pb2.Forces
    people: ViewerPeople
    coarse_frame: ViewerFrame
    texture: _server_pb2.TextureReply
    def __init__(self, hello: _Optional[_Union[ViewerHello, _Mapping[str, object]]] = ..., link: _Optional[_Union[ViewerLink, _Mapping[str, object]]] = ..., info: _Optional[_Union[_server_pb2.SessionInfo, _Mapping[str, object]]] = ..., plan: _Optional[_Union[_server_pb2.Plan, _Mapping[str, object]]] = ..., topology: _Optional[_Union[_surface_pb2.SurfaceTopology, _Mapping[str, object]]] = ..., frame: _Optional[_Union[_surface_pb2.SurfaceFrame, _Mapping[str, object]]] = ..., tool: _Optional[_Union[_tool_pb2.ToolState, _Mapping[str, object]]] = ..., stats: _Optional[_Union[_server_pb2.Stats, _Mapping[str, object]]] = ..., event: _Optional[_Union[_server_pb2.Event, _Mapping[str, object]]] = ..., pong: _Optional[_Union[ViewerPong, _Mapping[str, object]]] = ..., rpc: _Optional[_Union[ViewerRpcReply, _Mapping[str, object]]] = ..., tool_gone: _Optional[_Union[ViewerToolGone, _Mapping[str, object]]] = ..., field: _Optional[_Union[_surface_pb2.SurfaceField, _Mapping[str, object]]] = ..., measures: _Optional[_Union[_server_pb2.Measures, _Mapping[str, object]]] = ..., forces: _Optional[_Union[_force_pb2.Forces, _Mapping[str, object]]] = ..., people: _Optional[_Union[ViewerPeople, _Mapping[str, object]]] = ..., coarse_frame: _Optional[_Union[ViewerFrame, _Mapping[str, object]]] = ..., texture: _Optional[_Union[_server_pb2.TextureReply, _Mapping[str, object]]] = ...) -> None: ...

class ViewerFrame(_message.Message):
    __slots__ = ("frame", "min_x", "min_y", "min_z", "size_x", "size_y", "size_z", "positions")
    FRAME_FIELD_NUMBER: _ClassVar[int]
    MIN_X_FIELD_NUMBER: _ClassVar[int]
    MIN_Y_FIELD_NUMBER: _ClassVar[int]
    MIN_Z_FIELD_NUMBER: _ClassVar[int]
    SIZE_X_FIELD_NUMBER: _ClassVar[int]
    SIZE_Y_FIELD_NUMBER: _ClassVar[int]
    SIZE_Z_FIELD_NUMBER: _ClassVar[int]
    POSITIONS_FIELD_NUMBER: _ClassVar[int]
    frame: _surface_pb2.SurfaceFrame
    min_x: float
    min_y: float
    min_z: float
    size_x: float
    size_y: float
    size_z: float
    positions: bytes
    def __init__(self, frame: _Optional[_Union[_surface_pb2.SurfaceFrame, _Mapping[str, object]]] = ..., min_x: _Optional[float] = ..., min_y: _Optional[float] = ..., min_z: _Optional[float] = ..., size_x: _Optional[float] = ..., size_y: _Optional[float] = ..., size_z: _Optional[float] = ..., positions: _Optional[bytes] = ...) -> None: ...

class ViewerUp(_message.Message):
    __slots__ = ("tool", "rpc", "ping", "frame_ack", "release", "watch", "name")
    TOOL_FIELD_NUMBER: _ClassVar[int]
    RPC_FIELD_NUMBER: _ClassVar[int]
    PING_FIELD_NUMBER: _ClassVar[int]
    FRAME_ACK_FIELD_NUMBER: _ClassVar[int]
    RELEASE_FIELD_NUMBER: _ClassVar[int]
    WATCH_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    tool: _tool_pb2.ToolSample
    rpc: ViewerRpc
    ping: ViewerPing
    frame_ack: ViewerFrameAck
    release: ViewerToolRelease
    watch: ViewerWatch
    name: ViewerName
    def __init__(self, tool: _Optional[_Union[_tool_pb2.ToolSample, _Mapping[str, object]]] = ..., rpc: _Optional[_Union[ViewerRpc, _Mapping[str, object]]] = ..., ping: _Optional[_Union[ViewerPing, _Mapping[str, object]]] = ..., frame_ack: _Optional[_Union[ViewerFrameAck, _Mapping[str, object]]] = ..., release: _Optional[_Union[ViewerToolRelease, _Mapping[str, object]]] = ..., watch: _Optional[_Union[ViewerWatch, _Mapping[str, object]]] = ..., name: _Optional[_Union[ViewerName, _Mapping[str, object]]] = ...) -> None: ...

class ViewerHello(_message.Message):
    __slots__ = ("viewer_version", "client_id", "tool_id", "upstream", "read_only", "operator")
    VIEWER_VERSION_FIELD_NUMBER: _ClassVar[int]
    CLIENT_ID_FIELD_NUMBER: _ClassVar[int]
    TOOL_ID_FIELD_NUMBER: _ClassVar[int]
    UPSTREAM_FIELD_NUMBER: _ClassVar[int]
    READ_ONLY_FIELD_NUMBER: _ClassVar[int]
    OPERATOR_FIELD_NUMBER: _ClassVar[int]
    viewer_version: str
    client_id: str
    tool_id: str
    upstream: str
    read_only: bool
    operator: bool
    def __init__(self, viewer_version: _Optional[str] = ..., client_id: _Optional[str] = ..., tool_id: _Optional[str] = ..., upstream: _Optional[str] = ..., read_only: _Optional[bool] = ..., operator: _Optional[bool] = ...) -> None: ...

class ViewerLink(_message.Message):
    __slots__ = ("connected", "detail")
    CONNECTED_FIELD_NUMBER: _ClassVar[int]
    DETAIL_FIELD_NUMBER: _ClassVar[int]
    connected: bool
    detail: str
    def __init__(self, connected: _Optional[bool] = ..., detail: _Optional[str] = ...) -> None: ...

class ViewerToolGone(_message.Message):
    __slots__ = ("tool_id",)
    TOOL_ID_FIELD_NUMBER: _ClassVar[int]
    tool_id: str
    def __init__(self, tool_id: _Optional[str] = ...) -> None: ...

class ViewerToolRelease(_message.Message):
    __slots__ = ("left",)
    LEFT_FIELD_NUMBER: _ClassVar[int]
    left: bool
    def __init__(self, left: _Optional[bool] = ...) -> None: ...

class ViewerName(_message.Message):
    __slots__ = ("name",)
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class ViewerPeople(_message.Message):
    __slots__ = ("people",)
    PEOPLE_FIELD_NUMBER: _ClassVar[int]
    people: _containers.RepeatedCompositeFieldContainer[ViewerPerson]
    def __init__(self, people: _Optional[_Iterable[_Union[ViewerPerson, _Mapping[str, object]]]] = ...) -> None: ...

class ViewerPerson(_message.Message):
    __slots__ = ("tool_id", "name", "read_only", "operator")
    TOOL_ID_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    READ_ONLY_FIELD_NUMBER: _ClassVar[int]
    OPERATOR_FIELD_NUMBER: _ClassVar[int]
    tool_id: str
    name: str
    read_only: bool
    operator: bool
    def __init__(self, tool_id: _Optional[str] = ..., name: _Optional[str] = ..., read_only: _Optional[bool] = ..., operator: _Optional[bool] = ...) -> None: ...

class ViewerWatch(_message.Message):
    __slots__ = ("stress", "measures", "forces")
    STRESS_FIELD_NUMBER: _ClassVar[int]
    MEASURES_FIELD_NUMBER: _ClassVar[int]
    FORCES_FIELD_NUMBER: _ClassVar[int]
    stress: bool
    measures: bool
    forces: bool
    def __init__(self, stress: _Optional[bool] = ..., measures: _Optional[bool] = ..., forces: _Optional[bool] = ...) -> None: ...

class ViewerFrameAck(_message.Message):
    __slots__ = ("frames",)
    FRAMES_FIELD_NUMBER: _ClassVar[int]
    frames: int
    def __init__(self, frames: _Optional[int] = ...) -> None: ...

class ViewerPing(_message.Message):
    __slots__ = ("page_time_ms",)
    PAGE_TIME_MS_FIELD_NUMBER: _ClassVar[int]
    page_time_ms: float
    def __init__(self, page_time_ms: _Optional[float] = ...) -> None: ...

class ViewerPong(_message.Message):
    __slots__ = ("page_time_ms", "relay_unix_ns", "browsers", "frames_dropped")
    PAGE_TIME_MS_FIELD_NUMBER: _ClassVar[int]
    RELAY_UNIX_NS_FIELD_NUMBER: _ClassVar[int]
    BROWSERS_FIELD_NUMBER: _ClassVar[int]
    FRAMES_DROPPED_FIELD_NUMBER: _ClassVar[int]
    page_time_ms: float
    relay_unix_ns: int
    browsers: int
    frames_dropped: int
    def __init__(self, page_time_ms: _Optional[float] = ..., relay_unix_ns: _Optional[int] = ..., browsers: _Optional[int] = ..., frames_dropped: _Optional[int] = ...) -> None: ...

class ViewerRpc(_message.Message):
    __slots__ = ("call_id", "pause", "step", "reset", "set", "params", "undo", "scenes", "load", "record", "state")
    CALL_ID_FIELD_NUMBER: _ClassVar[int]
    PAUSE_FIELD_NUMBER: _ClassVar[int]
    STEP_FIELD_NUMBER: _ClassVar[int]
    RESET_FIELD_NUMBER: _ClassVar[int]
    SET_FIELD_NUMBER: _ClassVar[int]
    PARAMS_FIELD_NUMBER: _ClassVar[int]
    UNDO_FIELD_NUMBER: _ClassVar[int]
    SCENES_FIELD_NUMBER: _ClassVar[int]
    LOAD_FIELD_NUMBER: _ClassVar[int]
    RECORD_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    call_id: int
    pause: _server_pb2.PauseRequest
    step: _server_pb2.StepRequest
    reset: _server_pb2.ResetRequest
    set: _server_pb2.SetRequest
    params: ViewerParamsCall
    undo: _server_pb2.UndoRequest
    scenes: ViewerScenesCall
    load: _server_pb2.LoadRequest
    record: _server_pb2.RecordRequest
    state: ViewerStateCall
    def __init__(self, call_id: _Optional[int] = ..., pause: _Optional[_Union[_server_pb2.PauseRequest, _Mapping[str, object]]] = ..., step: _Optional[_Union[_server_pb2.StepRequest, _Mapping[str, object]]] = ..., reset: _Optional[_Union[_server_pb2.ResetRequest, _Mapping[str, object]]] = ..., set: _Optional[_Union[_server_pb2.SetRequest, _Mapping[str, object]]] = ..., params: _Optional[_Union[ViewerParamsCall, _Mapping[str, object]]] = ..., undo: _Optional[_Union[_server_pb2.UndoRequest, _Mapping[str, object]]] = ..., scenes: _Optional[_Union[ViewerScenesCall, _Mapping[str, object]]] = ..., load: _Optional[_Union[_server_pb2.LoadRequest, _Mapping[str, object]]] = ..., record: _Optional[_Union[_server_pb2.RecordRequest, _Mapping[str, object]]] = ..., state: _Optional[_Union[ViewerStateCall, _Mapping[str, object]]] = ...) -> None: ...

class ViewerParamsCall(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class ViewerScenesCall(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class ViewerStateCall(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class ViewerRpcReply(_message.Message):
    __slots__ = ("call_id", "reply", "params", "scenes", "state")
    CALL_ID_FIELD_NUMBER: _ClassVar[int]
    REPLY_FIELD_NUMBER: _ClassVar[int]
    PARAMS_FIELD_NUMBER: _ClassVar[int]
    SCENES_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    call_id: int
    reply: _server_pb2.RpcReply
    params: _server_pb2.ParamsReply
    scenes: _server_pb2.ScenesReply
    state: _server_pb2.StateReply
    def __init__(self, call_id: _Optional[int] = ..., reply: _Optional[_Union[_server_pb2.RpcReply, _Mapping[str, object]]] = ..., params: _Optional[_Union[_server_pb2.ParamsReply, _Mapping[str, object]]] = ..., scenes: _Optional[_Union[_server_pb2.ScenesReply, _Mapping[str, object]]] = ..., state: _Optional[_Union[_server_pb2.StateReply, _Mapping[str, object]]] = ...) -> None: ...
