from scindo.v1 import common_pb2 as _common_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class BladeSegment(_message.Message):
    __slots__ = ("tip_m", "heel_m")
    TIP_M_FIELD_NUMBER: _ClassVar[int]
    HEEL_M_FIELD_NUMBER: _ClassVar[int]
    tip_m: _common_pb2.Vec3
    heel_m: _common_pb2.Vec3
    def __init__(self, tip_m: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ..., heel_m: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ...) -> None: ...

class CutCommand(_message.Message):
    __slots__ = ("client_id", "tool_id", "seq", "client_time_ns", "body_id", "sweep")
    CLIENT_ID_FIELD_NUMBER: _ClassVar[int]
    TOOL_ID_FIELD_NUMBER: _ClassVar[int]
    SEQ_FIELD_NUMBER: _ClassVar[int]
    CLIENT_TIME_NS_FIELD_NUMBER: _ClassVar[int]
    BODY_ID_FIELD_NUMBER: _ClassVar[int]
    SWEEP_FIELD_NUMBER: _ClassVar[int]
    client_id: str
    tool_id: str
    seq: int
    client_time_ns: int
    body_id: str
    sweep: _containers.RepeatedCompositeFieldContainer[BladeSegment]
    def __init__(self, client_id: _Optional[str] = ..., tool_id: _Optional[str] = ..., seq: _Optional[int] = ..., client_time_ns: _Optional[int] = ..., body_id: _Optional[str] = ..., sweep: _Optional[_Iterable[_Union[BladeSegment, _Mapping[str, object]]]] = ...) -> None: ...

class CutAck(_message.Message):
    __slots__ = ("client_id", "tool_id", "seq", "outcome", "sim_step", "epochs", "elements_cut", "error")
    class Outcome(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        OUTCOME_UNSPECIFIED: _ClassVar[CutAck.Outcome]
        OUTCOME_APPLIED: _ClassVar[CutAck.Outcome]
        OUTCOME_DUPLICATE: _ClassVar[CutAck.Outcome]
        OUTCOME_REFUSED: _ClassVar[CutAck.Outcome]
    OUTCOME_UNSPECIFIED: CutAck.Outcome
    OUTCOME_APPLIED: CutAck.Outcome
    OUTCOME_DUPLICATE: CutAck.Outcome
    OUTCOME_REFUSED: CutAck.Outcome
    CLIENT_ID_FIELD_NUMBER: _ClassVar[int]
    TOOL_ID_FIELD_NUMBER: _ClassVar[int]
    SEQ_FIELD_NUMBER: _ClassVar[int]
    OUTCOME_FIELD_NUMBER: _ClassVar[int]
    SIM_STEP_FIELD_NUMBER: _ClassVar[int]
    EPOCHS_FIELD_NUMBER: _ClassVar[int]
    ELEMENTS_CUT_FIELD_NUMBER: _ClassVar[int]
    ERROR_FIELD_NUMBER: _ClassVar[int]
    client_id: str
    tool_id: str
    seq: int
    outcome: CutAck.Outcome
    sim_step: int
    epochs: _containers.RepeatedCompositeFieldContainer[BodyEpoch]
    elements_cut: int
    error: _common_pb2.Error
    def __init__(self, client_id: _Optional[str] = ..., tool_id: _Optional[str] = ..., seq: _Optional[int] = ..., outcome: _Optional[_Union[CutAck.Outcome, str]] = ..., sim_step: _Optional[int] = ..., epochs: _Optional[_Iterable[_Union[BodyEpoch, _Mapping[str, object]]]] = ..., elements_cut: _Optional[int] = ..., error: _Optional[_Union[_common_pb2.Error, _Mapping[str, object]]] = ...) -> None: ...

class BodyEpoch(_message.Message):
    __slots__ = ("body_id", "epoch")
    BODY_ID_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    body_id: str
    epoch: int
    def __init__(self, body_id: _Optional[str] = ..., epoch: _Optional[int] = ...) -> None: ...
