//! Bytes of another implementation (pyigtl 0.3.4), and bytes that nobody should send.

use proptest::prelude::*;

use super::*;
use crate::wire::content::{MAX_TRACKED, Tracked, Transform};
use crate::wire::encode::Encoded;
use crate::wire::header::{MAX_BODY_IN, MAX_SKIPPED, TimeStamp, check_sum};

/// `TransformMessage`, device Stylus, time 1700000000.5: a quarter turn about z, at (10.5, −20.25, 300) mm.
const TRANSFORM: &str = "00015452414e53464f524d0000005374796c757300000000000000000000000000006553f1008000000000000000\
    00000030cc8c3eb7776e0328000000003f80000000000000bf800000000000000000000000000000000000003f80000041280000c1a2000043\
    960000";

/// The same with `header_version = 2`, two entries of metadata and message number 7.
const TRANSFORM_2: &str = "00025452414e53464f524d0000005374796c757300000000000000000000000000006553f10080000000000000\
    0000000059a98a6d034419ab53000c00120000000b00000007000000003f80000000000000bf80000000000000000000000000000000000000\
    3f80000041280000c1a2000043960000000200040003000000020004000300000001556e69746d6d4e6f74656e";

/// `StringMessage` with the text cut.
const STRING: &str = "0001535452494e470000000000005374796c757300000000000000000000000000006553f1004000000000000000000\
    0000796f188ebbf5e08fd00030003637574";

/// `PolyDataMessage` of one triangle, without attributes.
const POLYDATA: &str = "0001504f4c5944415441000000006c697665720000000000000000000000000000006553f10080000000000000000\
    000005c5dabb25d9ef8485c0000000300000000000000000000000000000000000000010000001000000000000000000000000000000000000\
    00000000000004120000000000000000000000000000041a000003f00000000000003000000000000000100000002";

fn bytes(hex: &str) -> Vec<u8> {
    let digits: String = hex.split_whitespace().collect();
    (0..digits.len()).step_by(2).map(|i| u8::from_str_radix(&digits[i..i + 2], 16).unwrap()).collect()
}

fn all(bytes: &[u8], chunk: usize) -> (Vec<Read>, Result<(), Broken>, usize) {
    let (mut stream, mut read, mut held) = (Deframer::default(), Vec::new(), 0);
    for part in bytes.chunks(chunk.max(1)) {
        let result = stream.push(part, &mut |message| read.push(message));
        held = held.max(stream.held_bytes());
        if result.is_err() {
            return (read, result, held);
        }
    }
    (read, Ok(()), held)
}

fn one(bytes: &[u8]) -> Read {
    let (mut read, result, _) = all(bytes, bytes.len());
    assert_eq!((read.len(), result), (1, Ok(())));
    read.remove(0)
}

/// A message of any type and version.
fn raw(version: u16, kind: &str, body: &[u8]) -> Vec<u8> {
    let mut header = vec![0; HEADER_BYTES];
    header[..2].copy_from_slice(&version.to_be_bytes());
    header[2..2 + kind.len()].copy_from_slice(kind.as_bytes());
    header[42..50].copy_from_slice(&(body.len() as u64).to_be_bytes());
    header[50..].copy_from_slice(&check_sum(body).to_be_bytes());
    header.extend(body);
    header
}

const QUARTER: Transform = Transform([0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 10.5, -20.25, 300.0]);

#[test]
fn bytes_of_pyigtl_are_read_in_both_versions() {
    for hex in [TRANSFORM, TRANSFORM_2] {
        let message = one(&bytes(hex)).unwrap();
        assert_eq!(message.content, Content::Transform(QUARTER));
        assert_eq!((message.device.as_str(), message.time.seconds()), ("Stylus", 1_700_000_000.5));
    }
    assert_eq!(one(&bytes(STRING)).unwrap().content, Content::Text("cut".into()));
    assert_eq!(one(&bytes(POLYDATA)).unwrap().content, Content::Other { kind: "POLYDATA".into() });
}

#[test]
fn what_is_sent_has_the_bytes_of_pyigtl() {
    let time = TimeStamp((1_700_000_000 << 32) | (1 << 31));
    assert_eq!(Encoded::transform("Stylus", time, &QUARTER).into_bytes(), bytes(TRANSFORM));
    let (points, normals) = ([[0.0; 3], [10.0, 0.0, 0.0], [0.0, 20.0, 0.5]], [[0.0, 0.0, 1.0]; 3]);
    let mine = Encoded::surface("liver", time, &points, &normals, &[[0, 1, 2]]).unwrap().into_bytes();
    let theirs = bytes(POLYDATA);
    // pyigtl packs no attributes: mine are one more, behind its bytes.
    assert_eq!(mine[..42], theirs[..42]);
    assert_eq!((mine[42..50].to_vec(), theirs.len()), ((92_u64 + 50).to_be_bytes().to_vec(), 58 + 92));
    assert_eq!(mine[58..94], theirs[58..94]);
    assert_eq!((&mine[94..98], &theirs[94..98]), (&[0, 0, 0, 1][..], &[0, 0, 0, 0][..]));
    assert_eq!(mine[98..150], theirs[98..150]);
    assert_eq!(mine[150..164], *b"\x02\x03\0\0\0\x03Normals\0");
}

#[test]
fn what_is_sent_can_be_read() {
    let time = TimeStamp::now();
    let tool = |name: &str| Tracked { name: name.into(), transform: QUARTER };
    let tools = vec![tool("probe"), tool("a name of twenty by")];
    let read = |encoded: Encoded| one(&encoded.into_bytes()).unwrap();
    assert_eq!(read(Encoded::tracking("d", time, &tools)).content, Content::Tracking(tools));
    let long = "ä".repeat(40_000);
    let Content::Text(cut) = read(Encoded::text("d", time, &long)).content else { panic!("a text") };
    assert_eq!(cut.len(), 65_534, "cut between two letters");
    let status = read(Encoded::status("a device with a long name", time, 13, "Not ready", "no server"));
    assert_eq!(status.device, "a device with a long");
    let said =
        Content::Status { code: 13, subcode: 0, error: "Not ready".into(), message: "no server".into() };
    assert_eq!(status.content, said);
}

#[test]
fn questions_and_streams_are_read() {
    assert_eq!(one(&raw(1, "GET_STATUS", b"")).unwrap().content, Content::Get { what: "STATUS".into() });
    assert_eq!(one(&raw(1, "STP_TDATA", b"")).unwrap().content, Content::Stop { what: "TDATA".into() });
    let mut wish = 50_u32.to_be_bytes().to_vec();
    wish.resize(36, 0);
    let start = Content::Start { what: "TDATA".into(), resolution_ms: 50 };
    assert_eq!(one(&raw(1, "STT_TDATA", &wish)).unwrap().content, start);
    let any = Content::Start { what: "POLYDATA".into(), resolution_ms: 0 };
    assert_eq!(one(&raw(1, "STT_POLYDATA", b"")).unwrap().content, any);
}

#[test]
fn a_message_that_cannot_be_read_is_told_and_the_next_one_is_read() {
    let mut spoilt = bytes(TRANSFORM);
    spoilt[60] ^= 1;
    let not_finite = f32::NAN.to_be_bytes().repeat(12);
    let extended = [0, 12, 255, 255, 255, 255, 255, 255, 0, 0, 0, 0, 1, 2];
    let bad = [
        (spoilt, "check sum"),
        (raw(1, "TRANSFORM", &[0; 47]), "4 more bytes are needed, 3 are left"),
        (raw(1, "TRANSFORM", &not_finite), "entry 0 of a transform is NaN"),
        (raw(1, "TDATA", &[0; 71]), "71 bytes of content"),
        (raw(1, "TDATA", &vec![0; 70 * (MAX_TRACKED + 1)]), "at most 256 tools"),
        (raw(1, "STRING", &[0, 3, 0, 9, b'a']), "9 more bytes are needed, 1 are left"),
        (raw(2, "STRING", &extended), "4295032842 bytes around the content of a body of 14"),
        (raw(3, "STRING", &[0; 11]), "extended header"),
        (raw(2, "STRING", &[0; 12]), "0 bytes around"),
    ];
    for (message, words) in bad {
        let stream = [message, bytes(STRING)].concat();
        let (read, result, _) = all(&stream, 7);
        assert_eq!((read.len(), result), (2, Ok(())), "{words}");
        let error = read[0].as_ref().unwrap_err().to_string();
        assert!(error.contains(words), "{words}: {error}");
        assert_eq!(read[1].as_ref().unwrap().content, Content::Text("cut".into()));
    }
}

#[test]
fn a_stream_that_cannot_be_read_ends_with_the_reason() {
    let mut spoilt = bytes(STRING);
    spoilt[64] ^= 1;
    let (read, result, _) = all(&spoilt.repeat(20), 50);
    assert_eq!((read.len(), result), (8, Err(Broken::Spoilt { count: 8 })));

    let announce = |kind: &str, length: u64| {
        let mut header = raw(1, kind, b"");
        header[42..50].copy_from_slice(&length.to_be_bytes());
        all(&header, 58).1
    };
    for (kind, allowed) in [("TRANSFORM", MAX_BODY_IN), ("STT_TDATA", MAX_BODY_IN), ("IMAGE", MAX_SKIPPED)] {
        assert_eq!(announce(kind, allowed), Ok(()));
        let error = announce(kind, allowed + 1).unwrap_err();
        assert_eq!(error, Broken::TooLong { kind: kind.into(), found: allowed + 1, allowed });
        assert!(announce(kind, u64::MAX).is_err());
    }
}

#[test]
fn a_long_body_of_another_type_is_skipped_without_memory() {
    let stream = [raw(1, "IMAGE", &vec![7; 3 << 20]), bytes(STRING)].concat();
    let (read, result, held) = all(&stream, 65_536);
    assert_eq!((read.len(), result), (2, Ok(())));
    assert_eq!(read[0].as_ref().unwrap().content, Content::Other { kind: "IMAGE".into() });
    assert!(held < 1024, "{held}");
}

#[test]
fn announced_bytes_take_no_memory_before_they_come() {
    let mut header = raw(1, "STRING", b"");
    header[42..50].copy_from_slice(&MAX_BODY_IN.to_be_bytes());
    let (_, result, held) = all(&header, 58);
    assert!(result.is_ok() && held < 1024, "{held}");
}

/// A stream of good messages, some of them damaged.
fn streams() -> impl Strategy<Value = Vec<u8>> {
    let message = prop_oneof![
        Just(bytes(TRANSFORM)),
        Just(bytes(TRANSFORM_2)),
        Just(bytes(STRING)),
        Just(bytes(POLYDATA)),
        (1_u16..4, "[A-Z_]{1,12}", prop::collection::vec(any::<u8>(), 0..200))
            .prop_map(|(version, kind, body)| raw(version, &kind, &body)),
        ("(STRING|TDATA|STATUS|STT_TDATA|GET_X)", 1_u16..4, prop::collection::vec(any::<u8>(), 0..300))
            .prop_map(|(kind, version, body)| raw(version, &kind, &body)),
    ];
    prop::collection::vec(message, 1..6).prop_map(|messages| messages.concat())
}

proptest! {
    #[test]
    fn garbage_never_panics_and_takes_bounded_memory(garbage in prop::collection::vec(any::<u8>(), 0..4000)) {
        let (_, _, held) = all(&garbage, 999);
        prop_assert!(held <= 8192);
    }

    #[test]
    fn damaged_streams_never_panic(stream in streams(), damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..8)) {
        let mut stream = stream;
        for (at, value) in damage {
            let at = at.index(stream.len());
            stream[at] = value;
        }
        let (_, _, held) = all(&stream, 100);
        prop_assert!(held <= 2 * MAX_BODY_IN as usize);
    }

    #[test]
    fn where_the_stream_is_divided_does_not_matter(stream in streams(), chunk in 1_usize..200) {
        let (whole, end, _) = all(&stream, stream.len());
        let (parts, other_end, _) = all(&stream, chunk);
        prop_assert_eq!(format!("{whole:?} {end:?}"), format!("{parts:?} {other_end:?}"));
    }

    #[test]
    fn a_flipped_bit_of_a_body_is_found(bit in 0_usize..48 * 8) {
        let mut message = bytes(TRANSFORM);
        message[HEADER_BYTES + bit / 8] ^= 1 << (bit % 8);
        let read = one(&message);
        prop_assert!(matches!(read, Err(Unreadable::CheckSum { .. })), "{:?}", read);
    }
}
