//! Surface vertices as vertices of a file, which have one place on an image each.

use std::collections::HashMap;

use scindo_world::body::texture::Corners;
use scindo_world::snapshot::SurfaceTopology;

/// A surface whose vertices are split where the image on the skin does not go on.
pub(super) struct Split {
    /// Surface vertex of every vertex.
    pub source: Vec<u32>,
    /// Place on the image of every vertex; (0, 0) is the upper left corner, as glTF has it.
    pub coordinates: Vec<[f32; 2]>,
    /// Triangles of the skin.
    pub skin: Vec<[u32; 3]>,
    /// Triangles of the lips.
    pub lips: Vec<[u32; 3]>,
}

impl Split {
    /// Splits the vertices of a surface by the texture coordinates of its skin.
    pub(super) fn new(surface: &SurfaceTopology, image: &[Corners]) -> Self {
        let mut split =
            Self { source: Vec::new(), coordinates: Vec::new(), skin: Vec::new(), lips: Vec::new() };
        let mut known = HashMap::new();
        let mut image = image.iter();
        for (triangle, tag) in surface.triangles.iter().zip(&surface.tags) {
            let is_skin = *tag == 0;
            let corners = if is_skin { image.next().copied() } else { None }.unwrap_or_default();
            let mut vertices = [0; 3];
            for ((vertex, &source), [u, v]) in vertices.iter_mut().zip(triangle).zip(corners) {
                *vertex = *known.entry((source, is_skin, u.to_bits(), v.to_bits())).or_insert_with(|| {
                    split.source.push(source);
                    split.coordinates.push([u, 1.0 - v]);
                    split.source.len() as u32 - 1
                });
            }
            if is_skin { split.skin.push(vertices) } else { split.lips.push(vertices) }
        }
        split
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vertex_on_a_seam_becomes_two_and_others_stay_one() {
        let surface = SurfaceTopology {
            vertex_count: 4,
            triangles: vec![[0, 1, 2], [2, 1, 3], [0, 2, 3]],
            tags: vec![0, 0, 5],
            ..SurfaceTopology::default()
        };
        let image = [[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[0.0, 1.0], [0.5, 0.0], [1.0, 1.0]]];
        let split = Split::new(&surface, &image);
        assert_eq!(split.skin, [[0, 1, 2], [2, 3, 4]]);
        assert_eq!(split.lips, [[5, 6, 7]]);
        assert_eq!(split.source, [0, 1, 2, 1, 3, 0, 2, 3]);
        assert_eq!(split.coordinates[..3], [[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]], "v runs downwards");
    }
}
