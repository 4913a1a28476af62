//! Frames with 16 bits per coordinate for pages: half the bytes of single precision.

use bytes::Bytes;
use scindo_client::messages::viewer_down::Message as Down;
use scindo_client::messages::{SurfaceFrame, ViewerFrame};

/// Largest error of a coordinate [m]. A body in a wider box (a part may have fallen far away) is sent in single
/// precision.
pub const MOST_ERROR_M: f64 = 1e-5;

/// Number of steps between the two ends of an axis.
const STEPS: f64 = 65535.0;

/// The message for pages: with 16 bits per coordinate if each is then off by at most [`MOST_ERROR_M`].
pub fn for_page(frame: SurfaceFrame) -> Down {
    let Some((min, size)) = box_of(&frame.positions) else { return Down::Frame(frame) };
    if size.iter().any(|&size| f64::from(size) > 2.0 * STEPS * MOST_ERROR_M) {
        return Down::Frame(frame);
    }
    let per_metre = size.map(|size| if size > 0.0 { STEPS / f64::from(size) } else { 0.0 });
    let mut positions = Vec::with_capacity(frame.positions.len() / 2);
    for vertex in vertices(&frame.positions) {
        let values: [f64; 3] =
            std::array::from_fn(|axis| (f64::from(vertex[axis]) - f64::from(min[axis])) * per_metre[axis]);
        for value in values {
            // A cast saturates, so rounding can never leave the range.
            positions.extend_from_slice(&(value.round() as u16).to_le_bytes());
        }
    }
    Down::CoarseFrame(ViewerFrame {
        frame: Some(SurfaceFrame { positions: Bytes::new(), ..frame }),
        min_x: min[0],
        min_y: min[1],
        min_z: min[2],
        size_x: size[0],
        size_y: size[1],
        size_z: size[2],
        positions: positions.into(),
    })
}

/// Least corner and size of the box around all positions; `None` without positions.
fn box_of(positions: &[u8]) -> Option<([f32; 3], [f32; 3])> {
    let mut all = vertices(positions);
    let first = all.next()?;
    let (mut min, mut max) = (first, first);
    for vertex in all {
        min = std::array::from_fn(|axis| min[axis].min(vertex[axis]));
        max = std::array::from_fn(|axis| max[axis].max(vertex[axis]));
    }
    Some((min, std::array::from_fn(|axis| max[axis] - min[axis])))
}

fn vertices(positions: &[u8]) -> impl Iterator<Item = [f32; 3]> + '_ {
    let at = |bytes: &[u8], i: usize| f32::from_le_bytes(std::array::from_fn(|byte| bytes[4 * i + byte]));
    positions.chunks_exact(12).map(move |bytes| std::array::from_fn(|axis| at(bytes, axis)))
}
