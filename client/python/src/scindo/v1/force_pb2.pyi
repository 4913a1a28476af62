from scindo.v1 import common_pb2 as _common_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Forces(_message.Message):
    __slots__ = ("seq", "sim_step", "sim_time_s", "publish_unix_ns", "pairs")
    SEQ_FIELD_NUMBER: _ClassVar[int]
    SIM_STEP_FIELD_NUMBER: _ClassVar[int]
    SIM_TIME_S_FIELD_NUMBER: _ClassVar[int]
    PUBLISH_UNIX_NS_FIELD_NUMBER: _ClassVar[int]
    PAIRS_FIELD_NUMBER: _ClassVar[int]
    seq: int
    sim_step: int
    sim_time_s: float
    publish_unix_ns: int
    pairs: _containers.RepeatedCompositeFieldContainer[ForcePair]
    def __init__(self, seq: _Optional[int] = ..., sim_step: _Optional[int] = ..., sim_time_s: _Optional[float] = ..., publish_unix_ns: _Optional[int] = ..., pairs: _Optional[_Iterable[_Union[ForcePair, _Mapping[str, object]]]] = ...) -> None: ...

class ForcePair(_message.Message):
    __slots__ = ("kind", "on", "by", "contacts", "deepest_m", "force_n", "normal_n", "points")
    class Kind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        KIND_UNSPECIFIED: _ClassVar[ForcePair.Kind]
        KIND_TOOL: _ClassVar[ForcePair.Kind]
        KIND_OBSTACLE: _ClassVar[ForcePair.Kind]
        KIND_BODY: _ClassVar[ForcePair.Kind]
        KIND_SELF: _ClassVar[ForcePair.Kind]
    KIND_UNSPECIFIED: ForcePair.Kind
    KIND_TOOL: ForcePair.Kind
    KIND_OBSTACLE: ForcePair.Kind
    KIND_BODY: ForcePair.Kind
    KIND_SELF: ForcePair.Kind
    KIND_FIELD_NUMBER: _ClassVar[int]
    ON_FIELD_NUMBER: _ClassVar[int]
    BY_FIELD_NUMBER: _ClassVar[int]
    CONTACTS_FIELD_NUMBER: _ClassVar[int]
    DEEPEST_M_FIELD_NUMBER: _ClassVar[int]
    FORCE_N_FIELD_NUMBER: _ClassVar[int]
    NORMAL_N_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    kind: ForcePair.Kind
    on: str
    by: str
    contacts: int
    deepest_m: float
    force_n: _common_pb2.Vec3
    normal_n: float
    points: _containers.RepeatedCompositeFieldContainer[ForcePoint]
    def __init__(self, kind: _Optional[_Union[ForcePair.Kind, str]] = ..., on: _Optional[str] = ..., by: _Optional[str] = ..., contacts: _Optional[int] = ..., deepest_m: _Optional[float] = ..., force_n: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ..., normal_n: _Optional[float] = ..., points: _Optional[_Iterable[_Union[ForcePoint, _Mapping[str, object]]]] = ...) -> None: ...

class ForcePoint(_message.Message):
    __slots__ = ("point_m", "normal", "depth_m", "normal_n", "tangential_n")
    POINT_M_FIELD_NUMBER: _ClassVar[int]
    NORMAL_FIELD_NUMBER: _ClassVar[int]
    DEPTH_M_FIELD_NUMBER: _ClassVar[int]
    NORMAL_N_FIELD_NUMBER: _ClassVar[int]
    TANGENTIAL_N_FIELD_NUMBER: _ClassVar[int]
    point_m: _common_pb2.Vec3f
    normal: _common_pb2.Vec3f
    depth_m: float
    normal_n: float
    tangential_n: _common_pb2.Vec3f
    def __init__(self, point_m: _Optional[_Union[_common_pb2.Vec3f, _Mapping[str, object]]] = ..., normal: _Optional[_Union[_common_pb2.Vec3f, _Mapping[str, object]]] = ..., depth_m: _Optional[float] = ..., normal_n: _Optional[float] = ..., tangential_n: _Optional[_Union[_common_pb2.Vec3f, _Mapping[str, object]]] = ...) -> None: ...
