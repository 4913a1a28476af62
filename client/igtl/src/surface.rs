//! Surfaces of bodies as `POLYDATA`: positions, triangles and normals.

use std::sync::Arc;

use scindo_client::Surface;
use scindo_client::messages::SurfaceTopology;

use crate::axes::Axes;
use crate::wire::encode::{Encoded, TooLarge};
use crate::wire::header::TimeStamp;

/// Makes messages of the surfaces of one body. Its memory is kept from one to the next.
#[derive(Debug, Default)]
pub struct SurfaceWriter {
    /// The topology of `triangles`.
    topology: Option<Arc<SurfaceTopology>>,
    triangles: Vec<[u32; 3]>,
    points_mm: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
}

impl SurfaceWriter {
    /// The message of a surface under the name `device`.
    ///
    /// # Errors
    /// It would be longer than [`MAX_BODY_OUT`](crate::wire::header::MAX_BODY_OUT).
    pub fn encode(&mut self, device: &str, surface: &Surface, axes: Axes) -> Result<Encoded, TooLarge> {
        self.points_mm.clear();
        let points = triples(&surface.frame.positions).map(|p| axes.point_mm(p.map(f32::from_le_bytes)));
        self.points_mm.extend(points);
        if !self.topology.as_ref().is_some_and(|held| Arc::ptr_eq(held, &surface.topology)) {
            let known = |t: &[u32; 3]| t.iter().all(|i| (*i as usize) < self.points_mm.len());
            self.triangles.clear();
            let triangles = triples(&surface.topology.triangles).map(|t| t.map(u32::from_le_bytes));
            self.triangles.extend(triangles.filter(known));
            self.topology = Some(surface.topology.clone());
        }
        normals_into(&self.points_mm, &self.triangles, &mut self.normals);
        let time = TimeStamp::from_unix_ns(surface.frame.publish_unix_ns);
        Encoded::surface(device, time, &self.points_mm, &self.normals, &self.triangles)
    }
}

/// Three numbers of four bytes at a time.
fn triples(bytes: &[u8]) -> impl Iterator<Item = [[u8; 4]; 3]> {
    let number = |b: &[u8], i: usize| [b[i], b[i + 1], b[i + 2], b[i + 3]];
    bytes.chunks_exact(12).map(move |b| [number(b, 0), number(b, 4), number(b, 8)])
}

/// Unit normals of the points: the mean over the triangles around each, weighted by area. Zero where there is none.
fn normals_into(points: &[[f32; 3]], triangles: &[[u32; 3]], normals: &mut Vec<[f32; 3]>) {
    normals.clear();
    normals.resize(points.len(), [0.0; 3]);
    for triangle in triangles {
        let [a, b, c] = triangle.map(|i| points[i as usize]);
        let (u, v) = ([0, 1, 2].map(|k| b[k] - a[k]), [0, 1, 2].map(|k| c[k] - a[k]));
        let doubled = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        for i in triangle {
            let normal = &mut normals[*i as usize];
            (0..3).for_each(|k| normal[k] += doubled[k]);
        }
    }
    for normal in normals {
        let length = normal.iter().map(|n| n * n).sum::<f32>().sqrt();
        if length > 0.0 {
            *normal = normal.map(|n| n / length);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scindo_client::messages::SurfaceFrame;

    fn bytes(numbers: impl IntoIterator<Item = [u8; 4]>) -> Vec<u8> {
        numbers.into_iter().flatten().collect()
    }

    /// A tetrahedron with edges of 10 mm along the axes.
    fn surface(triangles: &[u32]) -> Surface {
        let e = 0.01_f32;
        let positions = [0.0, 0.0, 0.0, e, 0.0, 0.0, 0.0, e, 0.0, 0.0, 0.0, e].map(f32::to_le_bytes);
        let triangles = bytes(triangles.iter().map(|i| i.to_le_bytes())).into();
        let frame = SurfaceFrame { positions: bytes(positions).into(), ..SurfaceFrame::default() };
        Surface { topology: Arc::new(SurfaceTopology { triangles, ..SurfaceTopology::default() }), frame }
    }

    const CLOSED: [u32; 12] = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3];

    #[test]
    fn normals_point_outwards_and_have_length_one() {
        let mut writer = SurfaceWriter::default();
        let sent = writer.encode("body", &surface(&CLOSED), Axes::Lps).unwrap().into_bytes();
        assert_eq!(sent.len(), 58 + 40 + 4 * 12 + 4 * 16 + 14 + 4 * 12);
        assert_eq!(writer.points_mm[1], [-10.0, 0.0, 0.0]);
        for (i, normal) in writer.normals.iter().enumerate() {
            let length: f32 = normal.iter().map(|n| n * n).sum();
            let centre = [-2.5, -2.5, 2.5];
            let out: f32 = (0..3).map(|k| normal[k] * (writer.points_mm[i][k] - centre[k])).sum();
            assert!((length - 1.0).abs() < 1e-6 && out > 0.0, "{i}: {normal:?}");
        }
    }

    #[test]
    fn a_new_topology_is_taken_and_indices_beyond_the_points_are_left_out() {
        let mut writer = SurfaceWriter::default();
        writer.encode("body", &surface(&CLOSED), Axes::Ras).unwrap();
        writer.encode("body", &surface(&[0, 1, 2, 1, 2, 4]), Axes::Ras).unwrap();
        assert_eq!(writer.triangles, [[0, 1, 2]]);
        assert_eq!(writer.normals[3], [0.0; 3]);
    }
}
