//! Frames with 16 bits per coordinate: their error, their size, and when they are not used.
use prost::Message as _;
use scindo_proto::messages::viewer_down::Message as Down;
use scindo_proto::messages::{SurfaceFrame, ViewerFrame};
use scindo_view::coarse::{MOST_ERROR_M, for_page};

/// A frame of `count` vertices, spread over a box of `size` metres away from the origin.
fn frame(count: u32, size: [f32; 3]) -> SurfaceFrame {
    let spread = |n: u32| f32::from((n.wrapping_mul(2_654_435_761) >> 16) as u16) / 65535.0;
    let positions = (0..3 * count).flat_map(|i| {
        let axis = (i % 3) as usize;
        (0.3 * (axis as f32 - 1.0) + size[axis] * spread(i)).to_le_bytes()
    });
    SurfaceFrame {
        body_id: "liver".into(),
        vertex_count: count,
        positions: positions.collect::<Vec<u8>>().into(),
        mark_count: 1,
        marks: vec![0; 24].into(),
        ..SurfaceFrame::default()
    }
}

fn exact(frame: &SurfaceFrame) -> Vec<f64> {
    let coordinates = frame.positions.chunks_exact(4);
    coordinates.map(|bytes| f64::from(f32::from_le_bytes(bytes.try_into().unwrap()))).collect()
}

/// The coordinates as `viewer.proto` says.
fn decoded(coarse: &ViewerFrame) -> Vec<f64> {
    let min = [coarse.min_x, coarse.min_y, coarse.min_z].map(f64::from);
    let size = sizes(coarse);
    let values = coarse.positions.chunks_exact(2).map(|v| f64::from(u16::from_le_bytes([v[0], v[1]])));
    values.enumerate().map(|(i, value)| min[i % 3] + size[i % 3] * value / 65535.0).collect()
}

fn sizes(coarse: &ViewerFrame) -> [f64; 3] {
    [coarse.size_x, coarse.size_y, coarse.size_z].map(f64::from)
}

#[test]
fn coordinates_stay_within_the_stated_error_at_half_the_bytes() {
    for size in [[0.2, 0.1, 0.05], [1.3, 1e-4, 0.7], [0.1, 0.0, 0.1]] {
        let sent = frame(20_000, size);
        let Down::CoarseFrame(coarse) = for_page(sent.clone()) else { panic!("not coarse: {size:?}") };
        let sizes = sizes(&coarse);
        let (exact, told) = (exact(&sent), decoded(&coarse));
        assert_eq!(exact.len(), told.len());
        for (i, (exact, told)) in exact.iter().zip(&told).enumerate() {
            let error = (exact - told).abs();
            // The size of the box is rounded to single precision.
            let bound = sizes[i % 3] / 131_070.0 + f64::from(f32::EPSILON);
            assert!(error <= bound, "axis {}: {exact} became {told}", i % 3);
            assert!(error <= MOST_ERROR_M + f64::from(f32::EPSILON));
        }
        let ratio = coarse.encoded_len() as f64 / sent.encoded_len() as f64;
        assert!(ratio < 0.501, "{ratio} of the bytes");
        let rest = coarse.frame.unwrap();
        assert_eq!((rest.vertex_count, rest.mark_count, &rest.marks), (20_000, 1, &sent.marks));
    }
}

#[test]
fn a_box_that_is_too_wide_keeps_single_precision() {
    let sent = frame(1000, [0.1, 0.1, 1.4]);
    assert!(matches!(for_page(sent.clone()), Down::Frame(frame) if frame == sent));
    assert!(matches!(for_page(frame(0, [0.0; 3])), Down::Frame(_)));
}
