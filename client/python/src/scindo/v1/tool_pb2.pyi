from scindo.v1 import common_pb2 as _common_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class ToolShape(_message.Message):
    __slots__ = ("sphere", "capsule", "blade", "forceps", "retractor", "hook")
    class Sphere(_message.Message):
        __slots__ = ("radius_m",)
        RADIUS_M_FIELD_NUMBER: _ClassVar[int]
        radius_m: float
        def __init__(self, radius_m: _Optional[float] = ...) -> None: ...
    class Capsule(_message.Message):
        __slots__ = ("radius_m", "length_m")
        RADIUS_M_FIELD_NUMBER: _ClassVar[int]
        LENGTH_M_FIELD_NUMBER: _ClassVar[int]
        radius_m: float
        length_m: float
        def __init__(self, radius_m: _Optional[float] = ..., length_m: _Optional[float] = ...) -> None: ...
    class Blade(_message.Message):
        __slots__ = ("length_m", "thickness_m")
        LENGTH_M_FIELD_NUMBER: _ClassVar[int]
        THICKNESS_M_FIELD_NUMBER: _ClassVar[int]
        length_m: float
        thickness_m: float
        def __init__(self, length_m: _Optional[float] = ..., thickness_m: _Optional[float] = ...) -> None: ...
    class Forceps(_message.Message):
        __slots__ = ("radius_m", "length_m", "opening_m", "grip_force_n", "friction")
        RADIUS_M_FIELD_NUMBER: _ClassVar[int]
        LENGTH_M_FIELD_NUMBER: _ClassVar[int]
        OPENING_M_FIELD_NUMBER: _ClassVar[int]
        GRIP_FORCE_N_FIELD_NUMBER: _ClassVar[int]
        FRICTION_FIELD_NUMBER: _ClassVar[int]
        radius_m: float
        length_m: float
        opening_m: float
        grip_force_n: float
        friction: float
        def __init__(self, radius_m: _Optional[float] = ..., length_m: _Optional[float] = ..., opening_m: _Optional[float] = ..., grip_force_n: _Optional[float] = ..., friction: _Optional[float] = ...) -> None: ...
    class Retractor(_message.Message):
        __slots__ = ("radius_m", "length_m", "width_m", "height_m")
        RADIUS_M_FIELD_NUMBER: _ClassVar[int]
        LENGTH_M_FIELD_NUMBER: _ClassVar[int]
        WIDTH_M_FIELD_NUMBER: _ClassVar[int]
        HEIGHT_M_FIELD_NUMBER: _ClassVar[int]
        radius_m: float
        length_m: float
        width_m: float
        height_m: float
        def __init__(self, radius_m: _Optional[float] = ..., length_m: _Optional[float] = ..., width_m: _Optional[float] = ..., height_m: _Optional[float] = ...) -> None: ...
    class Hook(_message.Message):
        __slots__ = ("radius_m", "length_m", "reach_m", "point_m")
        RADIUS_M_FIELD_NUMBER: _ClassVar[int]
        LENGTH_M_FIELD_NUMBER: _ClassVar[int]
        REACH_M_FIELD_NUMBER: _ClassVar[int]
        POINT_M_FIELD_NUMBER: _ClassVar[int]
        radius_m: float
        length_m: float
        reach_m: float
        point_m: float
        def __init__(self, radius_m: _Optional[float] = ..., length_m: _Optional[float] = ..., reach_m: _Optional[float] = ..., point_m: _Optional[float] = ...) -> None: ...
    SPHERE_FIELD_NUMBER: _ClassVar[int]
    CAPSULE_FIELD_NUMBER: _ClassVar[int]
    BLADE_FIELD_NUMBER: _ClassVar[int]
    FORCEPS_FIELD_NUMBER: _ClassVar[int]
    RETRACTOR_FIELD_NUMBER: _ClassVar[int]
    HOOK_FIELD_NUMBER: _ClassVar[int]
    sphere: ToolShape.Sphere
    capsule: ToolShape.Capsule
    blade: ToolShape.Blade
    forceps: ToolShape.Forceps
    retractor: ToolShape.Retractor
    hook: ToolShape.Hook
    def __init__(self, sphere: _Optional[_Union[ToolShape.Sphere, _Mapping[str, object]]] = ..., capsule: _Optional[_Union[ToolShape.Capsule, _Mapping[str, object]]] = ..., blade: _Optional[_Union[ToolShape.Blade, _Mapping[str, object]]] = ..., forceps: _Optional[_Union[ToolShape.Forceps, _Mapping[str, object]]] = ..., retractor: _Optional[_Union[ToolShape.Retractor, _Mapping[str, object]]] = ..., hook: _Optional[_Union[ToolShape.Hook, _Mapping[str, object]]] = ...) -> None: ...

class ToolSample(_message.Message):
    __slots__ = ("seq", "client_time_ns", "client_id", "tool_id", "pose", "velocity_m_s", "mode", "shape", "applied_force_n", "last_contact_seq_used", "contact_age_ms", "passivity_energy_j", "fault_flags", "closed", "round_trip_ms", "name")
    class Mode(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        MODE_UNSPECIFIED: _ClassVar[ToolSample.Mode]
        MODE_HOVER: _ClassVar[ToolSample.Mode]
        MODE_TOUCH: _ClassVar[ToolSample.Mode]
        MODE_GRAB: _ClassVar[ToolSample.Mode]
        MODE_CUT: _ClassVar[ToolSample.Mode]
        MODE_SCALPEL: _ClassVar[ToolSample.Mode]
    MODE_UNSPECIFIED: ToolSample.Mode
    MODE_HOVER: ToolSample.Mode
    MODE_TOUCH: ToolSample.Mode
    MODE_GRAB: ToolSample.Mode
    MODE_CUT: ToolSample.Mode
    MODE_SCALPEL: ToolSample.Mode
    SEQ_FIELD_NUMBER: _ClassVar[int]
    CLIENT_TIME_NS_FIELD_NUMBER: _ClassVar[int]
    CLIENT_ID_FIELD_NUMBER: _ClassVar[int]
    TOOL_ID_FIELD_NUMBER: _ClassVar[int]
    POSE_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_M_S_FIELD_NUMBER: _ClassVar[int]
    MODE_FIELD_NUMBER: _ClassVar[int]
    SHAPE_FIELD_NUMBER: _ClassVar[int]
    APPLIED_FORCE_N_FIELD_NUMBER: _ClassVar[int]
    LAST_CONTACT_SEQ_USED_FIELD_NUMBER: _ClassVar[int]
    CONTACT_AGE_MS_FIELD_NUMBER: _ClassVar[int]
    PASSIVITY_ENERGY_J_FIELD_NUMBER: _ClassVar[int]
    FAULT_FLAGS_FIELD_NUMBER: _ClassVar[int]
    CLOSED_FIELD_NUMBER: _ClassVar[int]
    ROUND_TRIP_MS_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    seq: int
    client_time_ns: int
    client_id: str
    tool_id: str
    pose: _common_pb2.Pose
    velocity_m_s: _common_pb2.Vec3
    mode: ToolSample.Mode
    shape: ToolShape
    applied_force_n: _common_pb2.Vec3
    last_contact_seq_used: int
    contact_age_ms: float
    passivity_energy_j: float
    fault_flags: int
    closed: float
    round_trip_ms: float
    name: str
    def __init__(self, seq: _Optional[int] = ..., client_time_ns: _Optional[int] = ..., client_id: _Optional[str] = ..., tool_id: _Optional[str] = ..., pose: _Optional[_Union[_common_pb2.Pose, _Mapping[str, object]]] = ..., velocity_m_s: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ..., mode: _Optional[_Union[ToolSample.Mode, str]] = ..., shape: _Optional[_Union[ToolShape, _Mapping[str, object]]] = ..., applied_force_n: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ..., last_contact_seq_used: _Optional[int] = ..., contact_age_ms: _Optional[float] = ..., passivity_energy_j: _Optional[float] = ..., fault_flags: _Optional[int] = ..., closed: _Optional[float] = ..., round_trip_ms: _Optional[float] = ..., name: _Optional[str] = ...) -> None: ...

class DeviceCapability(_message.Message):
    __slots__ = ("client_id", "tool_id", "model", "max_force_n", "max_continuous_force_n", "max_stiffness_n_m", "workspace_radius_m", "loop_rate_hz")
    CLIENT_ID_FIELD_NUMBER: _ClassVar[int]
    TOOL_ID_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    MAX_FORCE_N_FIELD_NUMBER: _ClassVar[int]
    MAX_CONTINUOUS_FORCE_N_FIELD_NUMBER: _ClassVar[int]
    MAX_STIFFNESS_N_M_FIELD_NUMBER: _ClassVar[int]
    WORKSPACE_RADIUS_M_FIELD_NUMBER: _ClassVar[int]
    LOOP_RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    client_id: str
    tool_id: str
    model: str
    max_force_n: float
    max_continuous_force_n: float
    max_stiffness_n_m: float
    workspace_radius_m: float
    loop_rate_hz: float
    def __init__(self, client_id: _Optional[str] = ..., tool_id: _Optional[str] = ..., model: _Optional[str] = ..., max_force_n: _Optional[float] = ..., max_continuous_force_n: _Optional[float] = ..., max_stiffness_n_m: _Optional[float] = ..., workspace_radius_m: _Optional[float] = ..., loop_rate_hz: _Optional[float] = ...) -> None: ...

class ToolState(_message.Message):
    __slots__ = ("seq", "sim_step", "sim_time_s", "publish_unix_ns", "tool_id", "shape", "pose", "proxy_pose", "mode", "force_n", "owner", "max_force_n", "held_point_m", "closed")
    SEQ_FIELD_NUMBER: _ClassVar[int]
    SIM_STEP_FIELD_NUMBER: _ClassVar[int]
    SIM_TIME_S_FIELD_NUMBER: _ClassVar[int]
    PUBLISH_UNIX_NS_FIELD_NUMBER: _ClassVar[int]
    TOOL_ID_FIELD_NUMBER: _ClassVar[int]
    SHAPE_FIELD_NUMBER: _ClassVar[int]
    POSE_FIELD_NUMBER: _ClassVar[int]
    PROXY_POSE_FIELD_NUMBER: _ClassVar[int]
    MODE_FIELD_NUMBER: _ClassVar[int]
    FORCE_N_FIELD_NUMBER: _ClassVar[int]
    OWNER_FIELD_NUMBER: _ClassVar[int]
    MAX_FORCE_N_FIELD_NUMBER: _ClassVar[int]
    HELD_POINT_M_FIELD_NUMBER: _ClassVar[int]
    CLOSED_FIELD_NUMBER: _ClassVar[int]
    seq: int
    sim_step: int
    sim_time_s: float
    publish_unix_ns: int
    tool_id: str
    shape: ToolShape
    pose: _common_pb2.Pose
    proxy_pose: _common_pb2.Pose
    mode: ToolSample.Mode
    force_n: _common_pb2.Vec3
    owner: str
    max_force_n: float
    held_point_m: _common_pb2.Vec3
    closed: float
    def __init__(self, seq: _Optional[int] = ..., sim_step: _Optional[int] = ..., sim_time_s: _Optional[float] = ..., publish_unix_ns: _Optional[int] = ..., tool_id: _Optional[str] = ..., shape: _Optional[_Union[ToolShape, _Mapping[str, object]]] = ..., pose: _Optional[_Union[_common_pb2.Pose, _Mapping[str, object]]] = ..., proxy_pose: _Optional[_Union[_common_pb2.Pose, _Mapping[str, object]]] = ..., mode: _Optional[_Union[ToolSample.Mode, str]] = ..., force_n: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ..., owner: _Optional[str] = ..., max_force_n: _Optional[float] = ..., held_point_m: _Optional[_Union[_common_pb2.Vec3, _Mapping[str, object]]] = ..., closed: _Optional[float] = ...) -> None: ...

class HapticContact(_message.Message):
    __slots__ = ("seq", "sim_step", "sim_time_s", "publish_unix_ns", "tool_seq_used", "tool_client_time_ns", "epoch", "tool_id", "body_id", "tool_pose_used", "mode", "contacts", "validity_ms", "max_force_n", "max_stiffness_n_m", "instant_stiffness_n_m", "relaxed_stiffness_n_m", "relaxation_s", "client_id")
    class Mode(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        MODE_UNSPECIFIED: _ClassVar[HapticContact.Mode]
        MODE_FREE: _ClassVar[HapticContact.Mode]
        MODE_CONTACT: _ClassVar[HapticContact.Mode]
        MODE_CUTTING: _ClassVar[HapticContact.Mode]
        MODE_HOLD: _ClassVar[HapticContact.Mode]
    MODE_UNSPECIFIED: HapticContact.Mode
    MODE_FREE: HapticContact.Mode
    MODE_CONTACT: HapticContact.Mode
    MODE_CUTTING: HapticContact.Mode
    MODE_HOLD: HapticContact.Mode
    SEQ_FIELD_NUMBER: _ClassVar[int]
    SIM_STEP_FIELD_NUMBER: _ClassVar[int]
    SIM_TIME_S_FIELD_NUMBER: _ClassVar[int]
    PUBLISH_UNIX_NS_FIELD_NUMBER: _ClassVar[int]
    TOOL_SEQ_USED_FIELD_NUMBER: _ClassVar[int]
    TOOL_CLIENT_TIME_NS_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    TOOL_ID_FIELD_NUMBER: _ClassVar[int]
    BODY_ID_FIELD_NUMBER: _ClassVar[int]
    TOOL_POSE_USED_FIELD_NUMBER: _ClassVar[int]
    MODE_FIELD_NUMBER: _ClassVar[int]
    CONTACTS_FIELD_NUMBER: _ClassVar[int]
    VALIDITY_MS_FIELD_NUMBER: _ClassVar[int]
    MAX_FORCE_N_FIELD_NUMBER: _ClassVar[int]
    MAX_STIFFNESS_N_M_FIELD_NUMBER: _ClassVar[int]
    INSTANT_STIFFNESS_N_M_FIELD_NUMBER: _ClassVar[int]
    RELAXED_STIFFNESS_N_M_FIELD_NUMBER: _ClassVar[int]
    RELAXATION_S_FIELD_NUMBER: _ClassVar[int]
    CLIENT_ID_FIELD_NUMBER: _ClassVar[int]
    seq: int
    sim_step: int
    sim_time_s: float
    publish_unix_ns: int
    tool_seq_used: int
    tool_client_time_ns: int
    epoch: int
    tool_id: str
    body_id: str
    tool_pose_used: _common_pb2.Pose
    mode: HapticContact.Mode
    contacts: _containers.RepeatedCompositeFieldContainer[Contact]
    validity_ms: float
    max_force_n: float
    max_stiffness_n_m: float
    instant_stiffness_n_m: float
    relaxed_stiffness_n_m: float
    relaxation_s: float
    client_id: str
    def __init__(self, seq: _Optional[int] = ..., sim_step: _Optional[int] = ..., sim_time_s: _Optional[float] = ..., publish_unix_ns: _Optional[int] = ..., tool_seq_used: _Optional[int] = ..., tool_client_time_ns: _Optional[int] = ..., epoch: _Optional[int] = ..., tool_id: _Optional[str] = ..., body_id: _Optional[str] = ..., tool_pose_used: _Optional[_Union[_common_pb2.Pose, _Mapping[str, object]]] = ..., mode: _Optional[_Union[HapticContact.Mode, str]] = ..., contacts: _Optional[_Iterable[_Union[Contact, _Mapping[str, object]]]] = ..., validity_ms: _Optional[float] = ..., max_force_n: _Optional[float] = ..., max_stiffness_n_m: _Optional[float] = ..., instant_stiffness_n_m: _Optional[float] = ..., relaxed_stiffness_n_m: _Optional[float] = ..., relaxation_s: _Optional[float] = ..., client_id: _Optional[str] = ...) -> None: ...

class Contact(_message.Message):
    __slots__ = ("point_m", "normal", "gap_m", "force_n", "stiffness_n_m", "tangential_stiffness_n_m", "damping_ns_m", "surface_velocity_m_s", "patch_radius_m", "feature_id", "friction", "edge_of")
    POINT_M_FIELD_NUMBER: _ClassVar[int]
    NORMAL_FIELD_NUMBER: _ClassVar[int]
    GAP_M_FIELD_NUMBER: _ClassVar[int]
    FORCE_N_FIELD_NUMBER: _ClassVar[int]
    STIFFNESS_N_M_FIELD_NUMBER: _ClassVar[int]
    TANGENTIAL_STIFFNESS_N_M_FIELD_NUMBER: _ClassVar[int]
    DAMPING_NS_M_FIELD_NUMBER: _ClassVar[int]
    SURFACE_VELOCITY_M_S_FIELD_NUMBER: _ClassVar[int]
    PATCH_RADIUS_M_FIELD_NUMBER: _ClassVar[int]
    FEATURE_ID_FIELD_NUMBER: _ClassVar[int]
    FRICTION_FIELD_NUMBER: _ClassVar[int]
    EDGE_OF_FIELD_NUMBER: _ClassVar[int]
    point_m: _common_pb2.Vec3f
    normal: _common_pb2.Vec3f
    gap_m: float
    force_n: _common_pb2.Vec3f
    stiffness_n_m: float
    tangential_stiffness_n_m: float
    damping_ns_m: float
    surface_velocity_m_s: _common_pb2.Vec3f
    patch_radius_m: float
    feature_id: int
    friction: float
    edge_of: int
    def __init__(self, point_m: _Optional[_Union[_common_pb2.Vec3f, _Mapping[str, object]]] = ..., normal: _Optional[_Union[_common_pb2.Vec3f, _Mapping[str, object]]] = ..., gap_m: _Optional[float] = ..., force_n: _Optional[_Union[_common_pb2.Vec3f, _Mapping[str, object]]] = ..., stiffness_n_m: _Optional[float] = ..., tangential_stiffness_n_m: _Optional[float] = ..., damping_ns_m: _Optional[float] = ..., surface_velocity_m_s: _Optional[_Union[_common_pb2.Vec3f, _Mapping[str, object]]] = ..., patch_radius_m: _Optional[float] = ..., feature_id: _Optional[int] = ..., friction: _Optional[float] = ..., edge_of: _Optional[int] = ...) -> None: ...
