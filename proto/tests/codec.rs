//! Round trips of every message, and the refusals.

#![allow(clippy::unwrap_used)]

use bytes::Bytes;
use proptest::{collection::vec, prelude::*};
use scindo_proto::limits::{MAX_FORCE_PAIRS, MAX_FORCE_POINTS};
use scindo_proto::messages::*;
use scindo_proto::{
    DecodeError, KeySpace, Role, Topic, Verb, WireMessage, decode, decode_as, encode, encoding,
};

fn id() -> impl Strategy<Value = String> {
    "[a-z0-9_-]{1,64}"
}

fn metres() -> impl Strategy<Value = Vec3> {
    [-100.0..100.0, -100.0..100.0, -100.0..100.0_f64].prop_map(|[x, y, z]| Vec3 { x, y, z })
}

fn metres_f32() -> impl Strategy<Value = Vec3f> {
    metres().prop_map(|v| Vec3f { x: v.x as f32, y: v.y as f32, z: v.z as f32 })
}

fn pose() -> impl Strategy<Value = Pose> {
    (metres(), -3.0..3.0_f64, -3.0..3.0_f64).prop_map(|(position, a, b)| Pose {
        position_m: Some(position),
        qx: a.sin() * b.cos(),
        qy: a.sin() * b.sin(),
        qz: 0.0,
        qw: a.cos(),
    })
}

fn shape() -> impl Strategy<Value = ToolShape> {
    use tool_shape::*;
    let size = 1e-4..1.0_f64;
    let kind = prop_oneof![
        size.clone().prop_map(|radius_m| Kind::Sphere(Sphere { radius_m })),
        (size.clone(), size.clone())
            .prop_map(|(radius_m, length_m)| Kind::Capsule(Capsule { radius_m, length_m })),
        (size.clone(), size.clone())
            .prop_map(|(length_m, thickness_m)| Kind::Blade(Blade { length_m, thickness_m })),
        [size.clone(), size.clone(), size.clone(), 0.0..1e4, 0.0..10.0].prop_map(
            |[radius_m, length_m, opening_m, grip_force_n, friction]| {
                Kind::Forceps(Forceps { radius_m, length_m, opening_m, grip_force_n, friction })
            }
        ),
        [size.clone(), size.clone(), size.clone(), size.clone()].prop_map(
            |[radius_m, length_m, width_m, height_m]| {
                Kind::Retractor(Retractor { radius_m, length_m, width_m, height_m })
            }
        ),
        [size.clone(), size.clone(), size.clone(), size].prop_map(
            |[radius_m, length_m, reach_m, point_m]| {
                Kind::Hook(Hook { radius_m, length_m, reach_m, point_m })
            }
        ),
    ];
    kind.prop_map(|kind| ToolShape { kind: Some(kind) })
}

fn tool_sample() -> impl Strategy<Value = ToolSample> {
    let header = (any::<u64>(), any::<u64>(), id(), id(), 0..5_i32);
    let closed = proptest::option::of(0.0..=1.0_f32);
    let rest = (pose(), metres(), proptest::option::of(shape()), 0.0..9.0_f32, closed);
    (header, rest).prop_map(
        |((seq, time, client_id, tool_id, mode), (pose, velocity, shape, age, closed))| ToolSample {
            seq,
            client_time_ns: time,
            client_id,
            tool_id,
            pose: Some(pose),
            velocity_m_s: Some(velocity),
            mode,
            shape,
            applied_force_n: None,
            last_contact_seq_used: seq / 2,
            contact_age_ms: age,
            passivity_energy_j: -1.5,
            fault_flags: 3,
            closed,
            round_trip_ms: age,
            name: "Änne O'Neill".into(),
        },
    )
}

fn cut_command() -> impl Strategy<Value = CutCommand> {
    let segment =
        (metres(), metres()).prop_map(|(tip, heel)| BladeSegment { tip_m: Some(tip), heel_m: Some(heel) });
    let ids = (id(), id(), prop_oneof![Just(String::new()), id()]);
    (ids, 1..u64::MAX, vec(segment, 2..200)).prop_map(|((client_id, tool_id, body_id), seq, sweep)| {
        CutCommand { client_id, tool_id, seq, client_time_ns: seq ^ 7, body_id, sweep }
    })
}

fn contact() -> impl Strategy<Value = Contact> {
    let numbers = [0.0..1e4_f32, 0.0..1e4_f32, 0.0..1e4_f32, -1.0..1.0_f32];
    let rest = (numbers, any::<u64>(), 0.0..6.0_f32);
    (metres_f32(), metres_f32(), rest).prop_map(
        |(point, force, ([stiffness, tangential, damping, gap], feature_id, angle))| Contact {
            point_m: Some(point),
            normal: Some(Vec3f { x: angle.cos(), y: angle.sin(), z: 0.0 }),
            gap_m: gap,
            force_n: Some(force),
            stiffness_n_m: stiffness,
            tangential_stiffness_n_m: tangential,
            damping_ns_m: damping,
            surface_velocity_m_s: Some(force),
            patch_radius_m: 0.01,
            feature_id,
            friction: damping * 1e-3,
            edge_of: 0,
        },
    )
}

/// A contact, or an edge of another one, which has no force.
fn contact_or_edge() -> impl Strategy<Value = Contact> {
    (contact(), 0..=6_u32).prop_map(|(contact, edge_of)| match edge_of {
        0 => contact,
        _ => Contact {
            point_m: contact.point_m,
            normal: contact.normal,
            gap_m: contact.gap_m,
            patch_radius_m: contact.patch_radius_m,
            feature_id: contact.feature_id,
            edge_of,
            ..Contact::default()
        },
    })
}

fn haptic_contact() -> impl Strategy<Value = HapticContact> {
    let header = (any::<[u64; 5]>(), any::<u32>());
    (header, id(), pose(), vec(contact_or_edge(), 0..=6), 0..5_i32).prop_map(
        |(([seq, step, now, used, client], epoch), tool_id, pose, contacts, mode)| HapticContact {
            seq,
            sim_step: step,
            sim_time_s: 12.5,
            publish_unix_ns: now,
            tool_seq_used: used,
            tool_client_time_ns: client,
            epoch,
            body_id: tool_id.clone(),
            client_id: tool_id.clone(),
            tool_id,
            tool_pose_used: Some(pose),
            mode,
            contacts,
            validity_ms: 50.0,
            max_force_n: 8.0,
            max_stiffness_n_m: 900.0,
            instant_stiffness_n_m: 600.0,
            relaxed_stiffness_n_m: 250.0,
            relaxation_s: 0.01,
        },
    )
}

fn keyframe() -> impl Strategy<Value = SurfaceKeyframe> {
    let positions = vec([-9.0..9.0_f32, -9.0..9.0, -9.0..9.0], 1..60);
    let triangles = vec(([0..60_u32, 0..60, 0..60], 0..4_u32), 0..90);
    (positions, triangles, id(), any::<[u64; 3]>(), any::<u32>()).prop_map(
        |(positions, triangles, body_id, [seq, step, now], epoch)| {
            let n = positions.len() as u32;
            let bytes_of_positions: Vec<u8> =
                positions.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
            let bytes_of_triangles: Vec<u8> =
                triangles.iter().flat_map(|(t, _)| t).flat_map(|i| (i % n).to_le_bytes()).collect();
            let skin = triangles.iter().filter(|(_, tag)| *tag == 0).count();
            let texture_coordinates: Vec<u8> =
                (0..6 * skin).flat_map(|k| (0.25 * k as f32).to_le_bytes()).collect();
            let bytes_of_tags: Vec<u8> = triangles.iter().flat_map(|(_, tag)| tag.to_le_bytes()).collect();
            let topology = SurfaceTopology {
                seq,
                sim_step: step,
                sim_time_s: 1.25,
                publish_unix_ns: now,
                body_id: body_id.clone(),
                epoch,
                vertex_count: n,
                triangle_count: triangles.len() as u32,
                triangles: bytes_of_triangles.into(),
                tags: bytes_of_tags.into(),
                rest_positions: bytes_of_positions.clone().into(),
                held: vec![1; n.div_ceil(8) as usize].into(),
                hangs: Bytes::new(),
                texture_coordinates: texture_coordinates.into(),
            };
            let frame = SurfaceFrame {
                seq,
                sim_step: step,
                sim_time_s: 1.25,
                publish_unix_ns: now,
                body_id,
                epoch,
                vertex_count: n,
                mark_count: n / 2,
                marks: bytes_of_positions[..(n / 2) as usize * 24].to_vec().into(),
                positions: bytes_of_positions.into(),
            };
            SurfaceKeyframe { topology: Some(topology), frame: Some(frame) }
        },
    )
}

fn error() -> impl Strategy<Value = Option<Error>> {
    proptest::option::of(".{0,40}".prop_map(|message| Error {
        code: "out-of-range".into(),
        message,
        hint: "ask again".into(),
    }))
}

fn session_info() -> impl Strategy<Value = SessionInfo> {
    let body = (id(), metres(), any::<[u32; 3]>()).prop_map(|(id, min, [a, b, c])| BodyInfo {
        id,
        epoch: a,
        elements: b,
        nodes: c,
        min_m: Some(min),
        max_m: None,
        look: (a % 2 == 0).then(|| BodyLook {
            colour: Some(b),
            opacity: 0.5,
            layers: vec![LookLayer { depth_m: 0.01, colour: c }],
            textured: b % 2 == 0,
        }),
    });
    let tool = (id(), shape(), any::<bool>()).prop_map(|(id, shape, cuts)| ToolInfo {
        owner: String::new(),
        id,
        shape: Some(shape),
        cuts,
    });
    let obstacle = (id(), metres(), 0u32..4).prop_map(|(id, at, kind)| {
        use obstacle_info as wire;
        let shape = match kind {
            0 => wire::Shape::HalfSpace(wire::HalfSpace { point_m: Some(at), normal: None }),
            1 => wire::Shape::Box(wire::Box { min_m: None, max_m: Some(at) }),
            2 => wire::Shape::Capsule(wire::Capsule { from_m: Some(at), to_m: None, radius_m: 0.01 }),
            _ => wire::Shape::Surface(wire::Surface {
                positions: vec![0; 36].into(),
                triangles: vec![0; 12].into(),
            }),
        };
        ObstacleInfo { id, shape: Some(shape) }
    });
    let lists = (vec(body, 0..5), vec(tool, 0..5), vec(obstacle, 0..5), ".{0,30}");
    lists.prop_map(|(bodies, tools, obstacles, scene_name)| SessionInfo {
        server_version: "0.1.0".into(),
        wire_version: 1,
        scene_name,
        step_s: 0.02,
        bodies,
        tools,
        scene_seq: 3,
        scene: "kidney".into(),
        up: Some(Vec3 { x: 0.0, y: 1.0, z: 0.0 }),
        obstacles,
        records: true,
        scene_description: "A kidney is cut.".into(),
    })
}

fn stats() -> impl Strategy<Value = Stats> {
    (id(), any::<[u32; 4]>(), 0.0..1e3_f32).prop_map(|(id, [a, b, c, d], x)| Stats {
        seq: a.into(),
        sim_step: b.into(),
        sim_time_s: f64::from(x),
        publish_unix_ns: c.into(),
        step_rate_hz: x,
        real_time_factor: x,
        stages: vec![StageTime { name: "solve".into(), milliseconds: x }],
        bodies: vec![BodyStats {
            body_id: id.clone(),
            iterations: a,
            residual: x,
            elements: b,
            pieces: c,
            copies: d,
            epoch: a,
            volume_m3: f64::from(x),
            tolerance: x,
            unconverged_steps: b.into(),
            refused_steps: c.into(),
            divided_steps: d.into(),
            rolled_back_steps: a.into(),
            inverted: b,
            fixed_iterations: c % 2 == 0,
            unconverged: d % 2 == 0,
            divided_cells: a.into(),
            joined_cells: b.into(),
            unbalanced_steps: c.into(),
        }],
        tools: vec![ToolStats {
            tool_id: id,
            owner: "script".into(),
            contact_rate_hz: x,
            pose_rate_hz: x,
            force_n: x,
            contact_age_ms: x,
            pose_age_ms: 12.5,
            name: "Anna".into(),
        }],
        refused: vec![Counter { name: "non-finite".into(), count: d.into() }],
        cuts_applied: a.into(),
        surface_subscribers: b,
        haptic_clients: c,
        paused: d % 2 == 0,
        clients: vec![ClientStats { client_id: "seven".into(), role: "viewer".into() }],
        client_count: 70,
        recording: Some(RecordingStats {
            file: "kidney.mcap".into(),
            seconds: f64::from(x),
            bytes: a.into(),
        }),
    })
}

/// A valid message survives; cut short or with a wrong encoding it is refused, never a panic.
fn survives<M: WireMessage + PartialEq + std::fmt::Debug>(message: &M) -> Result<(), TestCaseError> {
    let bytes = encode(message);
    prop_assert!(bytes.len() <= M::MAX_BYTES, "{} bytes", bytes.len());
    prop_assert_eq!(&decode::<M>(bytes.clone()).unwrap(), message);
    prop_assert_eq!(&decode_as::<M>(&encoding::<M>(), bytes.clone()).unwrap(), message);
    let foreign = decode_as::<M>("application/json", bytes.clone()).unwrap_err();
    prop_assert_eq!(foreign.code(), "bad-encoding");
    for end in (0..bytes.len()).step_by(1 + bytes.len() / 64) {
        let _ = decode::<M>(bytes.slice(..end));
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn poses_round_trip(message in tool_sample()) { survives(&message)?; }

    #[test]
    fn cuts_round_trip(message in cut_command()) { survives(&message)?; }

    #[test]
    fn contacts_round_trip_within_one_datagram(message in haptic_contact()) { survives(&message)?; }

    #[test]
    fn surfaces_round_trip(message in keyframe()) {
        survives(message.topology.as_ref().unwrap())?;
        survives(message.frame.as_ref().unwrap())?;
        survives(&message)?;
    }

    #[test]
    fn tool_states_round_trip(id in id(), pose in pose(), shape in shape(), force in metres()) {
        survives(&ToolState {
            seq: 4, sim_step: 5, sim_time_s: 0.5, publish_unix_ns: 6, tool_id: id.clone(),
            shape: Some(shape), pose: Some(pose), proxy_pose: Some(pose), mode: 2,
            force_n: Some(force), owner: id, max_force_n: 8.0, held_point_m: Some(force),
            closed: 0.25,
        })?;
    }

    #[test]
    fn fields_and_measures_round_trip(id in id(), values in vec(0.0..1e6_f32, 0..50), at in metres()) {
        survives(&SurfaceField {
            seq: 1, sim_step: 2, sim_time_s: 0.1, publish_unix_ns: 3, body_id: id.clone(), epoch: 4,
            vertex_count: values.len() as u32, name: "von-mises".into(),
            values: values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>().into(),
        })?;
        survives(&Measures {
            seq: 1, sim_step: 2, sim_time_s: 0.1, publish_unix_ns: 3,
            probes: vec![ProbePoint {
                id: id.clone(), body_id: id.clone(), position_m: Some(at), rest_m: Some(at),
            }],
            energies: vec![BodyEnergy { body_id: id, kinetic_j: 1.0, elastic_j: 2.0 }],
        })?;
    }

    #[test]
    fn forces_round_trip(
        id in id(), kind in 0..5_i32, force in metres(), points in 0..=MAX_FORCE_POINTS, depth in 0.0..0.1_f32,
    ) {
        let point = ForcePoint {
            point_m: Some(Vec3f { x: 0.1, y: -0.2, z: 0.3 }), normal: Some(Vec3f { x: 0.6, y: 0.0, z: -0.8 }),
            depth_m: depth, normal_n: 2.0 * depth, tangential_n: Some(Vec3f { x: 0.0, y: depth, z: 0.0 }),
        };
        let pair = ForcePair {
            kind, on: id.clone(), by: id, contacts: 40, deepest_m: 0.1, force_n: Some(force), normal_n: 3.0,
            points: vec![point; points],
        };
        let forces = |pairs| Forces { seq: 1, sim_step: 2, sim_time_s: 0.1, publish_unix_ns: 3, pairs };
        survives(&forces(vec![pair.clone(); MAX_FORCE_PAIRS]))?;
        survives(&forces(Vec::new()))?;
    }

    #[test]
    fn small_messages_round_trip(
        id in id(), text in ".{0,40}", error in error(), number in 1..1000_u32, level in 0..4_i32,
    ) {
        survives(&CutAck {
            client_id: id.clone(), tool_id: id.clone(), seq: 3, outcome: level, sim_step: 9,
            epochs: vec![BodyEpoch { body_id: id.clone(), epoch: number }],
            elements_cut: number, error: error.clone(),
        })?;
        survives(&DeviceCapability {
            client_id: id.clone(), tool_id: id, model: text.clone(), max_force_n: 8.0,
            max_continuous_force_n: 4.0, max_stiffness_n_m: 2000.0, workspace_radius_m: 0.1,
            loop_rate_hz: f64::from(number),
        })?;
        survives(&Event {
            seq: 1, sim_step: 2, publish_unix_ns: 3, level, name: "cut-applied".into(),
            message: text.clone(),
        })?;
        survives(&Plan { effects: vec![Effect {
            name: "gravity".into(), on: true, why: text.clone(), predicted_ms: 0.1, measured_ms: 0.2,
        }] })?;
        survives(&PauseRequest { paused: level > 1 })?;
        survives(&StepRequest { count: number })?;
        survives(&ResetRequest {})?;
        survives(&SetRequest { key: "world.gravity_m_s2".into(), value: text.clone() })?;
        survives(&UndoRequest {})?;
        survives(&SnapshotRequest { name: "before-2".into() })?;
        survives(&RestoreRequest { name: "before-2".into() })?;
        survives(&RecordRequest { on: true })?;
        survives(&StateReply { name: "kidney.mcap".into(), file: vec![137; 300].into() })?;
        survives(&LoadRequest { name: text.clone() })?;
        survives(&ScenesReply { scenes: vec![SceneEntry {
            name: "kidney".into(), description: text.clone(),
        }] })?;
        survives(&ParamsReply { params: vec![Param {
            key: "body.liver.young_pa".into(), meaning: text.clone(), unit: "Pa".into(), kind: level,
            value: "5000.0".into(), min: 1.0, max: 1e12, usual_min: 10.0, usual_max: f64::from(number),
            logarithmic: true,
        }] })?;
        survives(&RpcReply { ok: level > 1, sim_step: 8, message: text, error })?;
        survives(&SchemaReply { file_descriptor_set: Bytes::from_static(b"abc") })?;
    }

    #[test]
    fn reports_round_trip(info in session_info(), stats in stats()) {
        survives(&info)?;
        survives(&stats)?;
    }

    #[test]
    fn random_bytes_never_panic(bytes in vec(any::<u8>(), 0..2000)) {
        let bytes = Bytes::from(bytes);
        let _ = decode::<ToolSample>(bytes.clone());
        let _ = decode::<CutCommand>(bytes.clone());
        let _ = decode::<CutAck>(bytes.clone());
        let _ = decode::<ToolState>(bytes.clone());
        let _ = decode::<DeviceCapability>(bytes.clone());
        let _ = decode::<HapticContact>(bytes.clone());
        let _ = decode::<SurfaceFrame>(bytes.clone());
        let _ = decode::<SurfaceTopology>(bytes.clone());
        let _ = decode::<SurfaceKeyframe>(bytes.clone());
        let _ = decode::<SurfaceField>(bytes.clone());
        let _ = decode::<Measures>(bytes.clone());
        let _ = decode::<Forces>(bytes.clone());
        let _ = decode::<SessionInfo>(bytes.clone());
        let _ = decode::<Stats>(bytes.clone());
        let _ = decode::<Event>(bytes.clone());
        let _ = decode::<Plan>(bytes.clone());
        let _ = decode::<SetRequest>(bytes.clone());
        let _ = decode::<ParamsReply>(bytes.clone());
        let _ = decode::<ScenesReply>(bytes.clone());
        let _ = decode::<LoadRequest>(bytes.clone());
        let _ = decode::<TextureRequest>(bytes.clone());
        let _ = decode::<TextureReply>(bytes.clone());
        let _ = decode::<RpcReply>(bytes);
    }

    #[test]
    fn flipped_bytes_never_panic(message in cut_command(), at in any::<usize>(), value: u8) {
        let mut bytes = encode(&message).to_vec();
        let at = at % bytes.len();
        bytes[at] = value;
        let _ = decode::<CutCommand>(bytes.into());
    }

    #[test]
    fn random_keys_never_panic(key in ".{0,80}") {
        let keys = KeySpace::new("scindo", "main").unwrap();
        let _ = keys.parse(&key);
        let _ = keys.parse(&format!("scindo/@v1/main/{key}"));
    }
}

fn a_sample() -> ToolSample {
    ToolSample {
        seq: 1,
        client_id: "c1".into(),
        tool_id: "t1".into(),
        pose: Some(Pose { position_m: Some(Vec3::default()), qw: 1.0, ..Pose::default() }),
        mode: tool_sample::Mode::Touch.into(),
        ..ToolSample::default()
    }
}

fn refusal<M: WireMessage + std::fmt::Debug>(message: &M) -> DecodeError {
    decode::<M>(message.encode_to_vec().into()).unwrap_err()
}

#[test]
fn non_finite_numbers_are_refused() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut sample = a_sample();
        sample.pose.as_mut().unwrap().position_m = Some(Vec3 { x: bad, y: 0.0, z: 0.0 });
        assert_eq!(refusal(&sample).code(), "non-finite");
        let mut sample = a_sample();
        sample.pose.as_mut().unwrap().qy = bad;
        assert_eq!(refusal(&sample).code(), "non-finite");
        let mut sample = a_sample();
        sample.velocity_m_s = Some(Vec3 { x: 0.0, y: 0.0, z: bad });
        assert_eq!(refusal(&sample).code(), "non-finite");
        let frame = SurfaceFrame {
            body_id: "b".into(),
            vertex_count: 1,
            positions: [0.0_f32, 0.0, bad as f32]
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect::<Vec<u8>>()
                .into(),
            ..SurfaceFrame::default()
        };
        assert_eq!(refusal(&frame).code(), "non-finite");
    }
}

#[test]
fn forces_are_refused_with_what_and_where() {
    type Change = fn(&mut ForcePair);
    let point = ForcePoint {
        point_m: Some(Vec3f::default()),
        normal: Some(Vec3f { x: 0.0, y: 0.0, z: 1.0 }),
        tangential_n: Some(Vec3f::default()),
        ..ForcePoint::default()
    };
    let pair = ForcePair {
        kind: force_pair::Kind::Obstacle.into(),
        on: "block".into(),
        by: "floor".into(),
        force_n: Some(Vec3::default()),
        points: vec![point],
        ..ForcePair::default()
    };
    let with = |change: Change| {
        let mut pair = pair.clone();
        change(&mut pair);
        Forces { pairs: vec![pair], ..Forces::default() }
    };
    decode::<Forces>(encode(&with(|_| ()))).unwrap();
    let cases: [(Change, &str); 7] = [
        (|pair| pair.kind = 9, "pairs.kind"),
        (|pair| pair.by = "no floor".into(), "pairs.by"),
        (|pair| pair.force_n = None, "pairs.force_n is missing"),
        (|pair| pair.normal_n = f64::NAN, "pairs.normal_n"),
        (|pair| pair.points = vec![pair.points[0]; MAX_FORCE_POINTS + 1], "pairs.points"),
        (|pair| pair.points[0].normal = Some(Vec3f::default()), "pairs.points.normal is norm 0"),
        (|pair| pair.points[0].depth_m = f32::INFINITY, "pairs.points.depth_m"),
    ];
    for (change, words) in cases {
        let refused = refusal(&with(change)).to_string();
        assert!(refused.contains(words), "{refused}: {words}");
    }
    let many = Forces { pairs: vec![pair; MAX_FORCE_PAIRS + 1], ..Forces::default() };
    assert!(matches!(refusal(&many), DecodeError::TooLarge { field: "pairs", .. }));
}

#[test]
fn values_out_of_range_are_refused_with_what_and_where() {
    let mut sample = a_sample();
    sample.pose.as_mut().unwrap().qw = 2.0;
    assert_eq!(
        refusal(&sample).to_string(),
        "ToolSample: pose.orientation is norm 2, allowed norm 1 within 0.001"
    );
    let mut sample = a_sample();
    sample.mode = 99;
    assert_eq!(refusal(&sample).code(), "out-of-range");
    let mut sample = a_sample();
    sample.tool_id = "../etc".into();
    assert_eq!(refusal(&sample).code(), "out-of-range");
    let mut sample = a_sample();
    sample.pose = None;
    assert_eq!(refusal(&sample).to_string(), "ToolSample: pose is missing");
    let topology = SurfaceTopology {
        body_id: "b".into(),
        vertex_count: 3,
        triangle_count: 1,
        triangles: [0_u32, 1, 3].iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>().into(),
        tags: vec![0; 4].into(),
        ..SurfaceTopology::default()
    };
    assert_eq!(
        refusal(&topology).to_string(),
        "SurfaceTopology: triangles is 3, allowed below vertex_count = 3"
    );
    let short = vec![0; 11];
    let topology =
        SurfaceTopology { triangle_count: 0, triangles: Bytes::new(), tags: Bytes::new(), ..topology };
    let rest = SurfaceTopology { rest_positions: short.clone().into(), ..topology.clone() };
    assert_eq!(
        refusal(&rest).to_string(),
        "SurfaceTopology: rest_positions is 11 bytes, allowed 36 bytes (3 x 12)"
    );
    assert_eq!(refusal(&SurfaceTopology { held: short.into(), ..topology.clone() }).code(), "out-of-range");
    let tags: Vec<u8> = [0_u32, 7].iter().flat_map(|tag| tag.to_le_bytes()).collect();
    let two = SurfaceTopology {
        triangle_count: 2,
        triangles: vec![0; 24].into(),
        tags: tags.into(),
        texture_coordinates: vec![0; 48].into(),
        ..topology
    };
    assert_eq!(
        refusal(&two).to_string(),
        "SurfaceTopology: texture_coordinates is 48 bytes, allowed 24 bytes (1 x 24)",
        "a lip has none"
    );
    let nowhere = f32::NAN.to_le_bytes().repeat(6);
    let nowhere = refusal(&SurfaceTopology { texture_coordinates: nowhere.into(), ..two });
    assert_eq!(nowhere.code(), "non-finite");
    let picture = TextureReply { body_id: "b".into(), media_type: "text/html".into(), image: Bytes::new() };
    assert_eq!(
        refusal(&picture).to_string(),
        "TextureReply: media_type is text/html, allowed image/png or image/jpeg"
    );
    let field = SurfaceField {
        body_id: "b".into(),
        name: "von-mises".into(),
        vertex_count: 1,
        values: f32::NAN.to_le_bytes().to_vec().into(),
        ..SurfaceField::default()
    };
    assert_eq!(refusal(&field).code(), "non-finite");
    let frame = SurfaceFrame {
        body_id: "b".into(),
        vertex_count: 1000,
        positions: vec![0; 12].into(),
        ..SurfaceFrame::default()
    };
    assert_eq!(refusal(&frame).code(), "out-of-range");
    let frame = SurfaceFrame {
        body_id: "b".into(),
        mark_count: 2,
        marks: vec![0; 24].into(),
        ..SurfaceFrame::default()
    };
    assert_eq!(refusal(&frame).to_string(), "SurfaceFrame: marks is 24 bytes, allowed 48 bytes (2 x 24)");
    assert_eq!(refusal(&StepRequest { count: 10_001 }).code(), "out-of-range");
    let endless = Param { max: f64::INFINITY, ..Param::default() };
    assert_eq!(refusal(&ParamsReply { params: vec![endless] }).code(), "non-finite");
    assert_eq!(refusal(&LoadRequest { name: "x".repeat(5000) }).code(), "too-large");
}

#[test]
fn oversized_messages_are_refused_before_they_are_decoded() {
    let sweep = |n: usize| CutCommand {
        client_id: "c1".into(),
        tool_id: "t1".into(),
        seq: 1,
        sweep: vec![BladeSegment::default(); n],
        ..CutCommand::default()
    };
    // 1025 empty segments take 2 bytes each on the wire but 112 in memory.
    match refusal(&sweep(1025)) {
        DecodeError::TooLarge { field: "sweep", found: 1025, allowed: 1024, .. } => {}
        other => panic!("{other}"),
    }
    match refusal(&ParamsReply { params: vec![Param::default(); 513] }) {
        DecodeError::TooLarge { field: "params", found: 513, allowed: 512, .. } => {}
        other => panic!("{other}"),
    }
    match refusal(&sweep(60_000)) {
        DecodeError::TooLarge { field: "payload bytes", .. } => {}
        other => panic!("{other}"),
    }
    let mut sample = a_sample();
    sample.client_id = "x".repeat(2000);
    assert_eq!(refusal(&sample).code(), "too-large");
}

#[test]
fn keys_round_trip_and_foreign_ones_are_refused() {
    let keys = KeySpace::new("lab-1", "main").unwrap();
    let id = || scindo_proto::Chunk::new("id", "liver_2").unwrap();
    let mut topics = vec![
        Topic::SurfaceFrame(id()),
        Topic::SurfaceTopology(id()),
        Topic::SurfaceKeyframe(id()),
        Topic::SurfaceField(id(), id()),
        Topic::Measures,
        Topic::Forces,
        Topic::ToolPose(id(), id()),
        Topic::ToolCut(id(), id()),
        Topic::ToolCutAck(id()),
        Topic::ToolCapability(id(), id()),
        Topic::ToolContact(id()),
        Topic::ToolState(id()),
        Topic::Stats,
        Topic::Event,
        Topic::Plan,
        Topic::Server(id()),
    ];
    topics.extend(Verb::ALL.map(Topic::Rpc));
    topics.extend(Role::ALL.map(|role| Topic::Live(id(), role)));
    for topic in topics {
        assert_eq!(keys.parse(&keys.key(&topic)).unwrap(), topic);
    }
    assert_eq!(keys.key(&Topic::ToolPose(id(), id())), "lab-1/@v1/main/client/liver_2/tool/liver_2/pose");
    for bad in [
        "lab-2/@v1/main/stats",
        "lab-1/@v2/main/stats",
        "lab-1/@v1/main/tool/liver/pose",
        "lab-1/@v1/main/client/a/tool/Liver/pose",
        "lab-1/@v1/main/client/A/tool/liver/pose",
        "lab-1/@v1/main/client/a/tool//pose",
        "lab-1/@v1/main/client/a/tool/a/pose/b",
        "lab-1/@v1/main/rpc/quit",
    ] {
        assert!(keys.parse(bad).is_err(), "{bad}");
    }
    assert!(KeySpace::new("lab/1", "main").is_err());
    assert!(KeySpace::new("scindo", "@v1").is_err());
}

#[test]
fn schema_names_every_message() {
    let text = String::from_utf8_lossy(scindo_proto::FILE_DESCRIPTOR_SET);
    for name in ["HapticContact", "CutCommand", "SurfaceKeyframe", "Stats"] {
        assert!(text.contains(name));
    }
}

#[test]
fn jaws_close_between_open_and_closed() {
    for closed in [-0.1, 1.1, f32::NAN] {
        let refused = refusal(&ToolSample { closed: Some(closed), ..a_sample() });
        assert!(refused.to_string().contains("closed"), "{refused}");
    }
    for [opening_m, friction] in [[0.0, 0.5], [0.01, -0.1], [0.01, 11.0], [f64::NAN, 0.5]] {
        let kind =
            tool_shape::Forceps { radius_m: 0.001, length_m: 0.1, opening_m, grip_force_n: 1.0, friction };
        let shape = Some(ToolShape { kind: Some(tool_shape::Kind::Forceps(kind)) });
        let refused = refusal(&ToolSample { shape, ..a_sample() });
        assert!(refused.to_string().contains("shape.forceps"), "{refused}");
    }
}
