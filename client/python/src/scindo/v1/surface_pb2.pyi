from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class SurfaceFrame(_message.Message):
    __slots__ = ("seq", "sim_step", "sim_time_s", "publish_unix_ns", "body_id", "epoch", "vertex_count", "positions", "mark_count", "marks")
    SEQ_FIELD_NUMBER: _ClassVar[int]
    SIM_STEP_FIELD_NUMBER: _ClassVar[int]
    SIM_TIME_S_FIELD_NUMBER: _ClassVar[int]
    PUBLISH_UNIX_NS_FIELD_NUMBER: _ClassVar[int]
    BODY_ID_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    VERTEX_COUNT_FIELD_NUMBER: _ClassVar[int]
    POSITIONS_FIELD_NUMBER: _ClassVar[int]
    MARK_COUNT_FIELD_NUMBER: _ClassVar[int]
    MARKS_FIELD_NUMBER: _ClassVar[int]
    seq: int
    sim_step: int
    sim_time_s: float
    publish_unix_ns: int
    body_id: str
    epoch: int
    vertex_count: int
    positions: bytes
    mark_count: int
    marks: bytes
    def __init__(self, seq: _Optional[int] = ..., sim_step: _Optional[int] = ..., sim_time_s: _Optional[float] = ..., publish_unix_ns: _Optional[int] = ..., body_id: _Optional[str] = ..., epoch: _Optional[int] = ..., vertex_count: _Optional[int] = ..., positions: _Optional[bytes] = ..., mark_count: _Optional[int] = ..., marks: _Optional[bytes] = ...) -> None: ...

class SurfaceTopology(_message.Message):
    __slots__ = ("seq", "sim_step", "sim_time_s", "publish_unix_ns", "body_id", "epoch", "vertex_count", "triangle_count", "triangles", "tags", "rest_positions", "held", "hangs", "texture_coordinates")
    SEQ_FIELD_NUMBER: _ClassVar[int]
    SIM_STEP_FIELD_NUMBER: _ClassVar[int]
    SIM_TIME_S_FIELD_NUMBER: _ClassVar[int]
    PUBLISH_UNIX_NS_FIELD_NUMBER: _ClassVar[int]
    BODY_ID_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    VERTEX_COUNT_FIELD_NUMBER: _ClassVar[int]
    TRIANGLE_COUNT_FIELD_NUMBER: _ClassVar[int]
    TRIANGLES_FIELD_NUMBER: _ClassVar[int]
    TAGS_FIELD_NUMBER: _ClassVar[int]
    REST_POSITIONS_FIELD_NUMBER: _ClassVar[int]
    HELD_FIELD_NUMBER: _ClassVar[int]
    HANGS_FIELD_NUMBER: _ClassVar[int]
    TEXTURE_COORDINATES_FIELD_NUMBER: _ClassVar[int]
    seq: int
    sim_step: int
    sim_time_s: float
    publish_unix_ns: int
    body_id: str
    epoch: int
    vertex_count: int
    triangle_count: int
    triangles: bytes
    tags: bytes
    rest_positions: bytes
    held: bytes
    hangs: bytes
    texture_coordinates: bytes
    def __init__(self, seq: _Optional[int] = ..., sim_step: _Optional[int] = ..., sim_time_s: _Optional[float] = ..., publish_unix_ns: _Optional[int] = ..., body_id: _Optional[str] = ..., epoch: _Optional[int] = ..., vertex_count: _Optional[int] = ..., triangle_count: _Optional[int] = ..., triangles: _Optional[bytes] = ..., tags: _Optional[bytes] = ..., rest_positions: _Optional[bytes] = ..., held: _Optional[bytes] = ..., hangs: _Optional[bytes] = ..., texture_coordinates: _Optional[bytes] = ...) -> None: ...

class SurfaceField(_message.Message):
    __slots__ = ("seq", "sim_step", "sim_time_s", "publish_unix_ns", "body_id", "epoch", "vertex_count", "name", "values")
    SEQ_FIELD_NUMBER: _ClassVar[int]
    SIM_STEP_FIELD_NUMBER: _ClassVar[int]
    SIM_TIME_S_FIELD_NUMBER: _ClassVar[int]
    PUBLISH_UNIX_NS_FIELD_NUMBER: _ClassVar[int]
    BODY_ID_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    VERTEX_COUNT_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    seq: int
    sim_step: int
    sim_time_s: float
    publish_unix_ns: int
    body_id: str
    epoch: int
    vertex_count: int
    name: str
    values: bytes
    def __init__(self, seq: _Optional[int] = ..., sim_step: _Optional[int] = ..., sim_time_s: _Optional[float] = ..., publish_unix_ns: _Optional[int] = ..., body_id: _Optional[str] = ..., epoch: _Optional[int] = ..., vertex_count: _Optional[int] = ..., name: _Optional[str] = ..., values: _Optional[bytes] = ...) -> None: ...

class SurfaceKeyframe(_message.Message):
    __slots__ = ("topology", "frame")
    TOPOLOGY_FIELD_NUMBER: _ClassVar[int]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    topology: SurfaceTopology
    frame: SurfaceFrame
    def __init__(self, topology: _Optional[_Union[SurfaceTopology, _Mapping[str, object]]] = ..., frame: _Optional[_Union[SurfaceFrame, _Mapping[str, object]]] = ...) -> None: ...
