//! The triangles around every vertex, kept up to date triangle by triangle.

/// No corner.
const NONE: u32 = u32::MAX;

/// A list of corners per vertex, in ascending order. Corner k of triangle t is 3t + k.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Stars {
    /// First corner at each vertex.
    first: Vec<u32>,
    /// The corner after each corner at the same vertex.
    next: Vec<u32>,
}

impl Stars {
    /// The stars of a surface.
    pub(crate) fn new(vertices: usize, triangles: &[[u32; 3]]) -> Self {
        let mut stars = Self { first: vec![NONE; vertices], next: vec![NONE; 3 * triangles.len()] };
        // From the last to the first, every corner comes before all others of its list.
        for (t, corners) in triangles.iter().enumerate().rev() {
            for (k, &v) in corners.iter().enumerate().rev() {
                let corner = (3 * t + k) as u32;
                stars.next[corner as usize] = std::mem::replace(&mut stars.first[v as usize], corner);
            }
        }
        stars
    }

    /// Makes room for other numbers of vertices and triangles. Vertices and triangles that fall away must not
    /// be linked any more.
    pub(crate) fn resize(&mut self, vertices: usize, triangles: usize) {
        self.first.resize(vertices, NONE);
        self.next.resize(3 * triangles, NONE);
    }

    /// Adds a triangle to the stars of its corners.
    pub(crate) fn insert(&mut self, triangle: u32, corners: [u32; 3]) {
        for (corner, v) in (3 * triangle..).zip(corners) {
            let (mut before, mut at) = (NONE, self.first[v as usize]);
            while at < corner {
                (before, at) = (at, self.next[at as usize]);
            }
            self.next[corner as usize] = at;
            *self.link(before, v) = corner;
        }
    }

    /// Takes a triangle out of the stars of its corners.
    pub(crate) fn remove(&mut self, triangle: u32, corners: [u32; 3]) {
        for (corner, v) in (3 * triangle..).zip(corners) {
            let (mut before, mut at) = (NONE, self.first[v as usize]);
            while at < corner {
                (before, at) = (at, self.next[at as usize]);
            }
            if at == corner {
                *self.link(before, v) = self.next[corner as usize];
            }
        }
    }

    /// The link behind corner `before`, or to the first corner of vertex `v`.
    fn link(&mut self, before: u32, v: u32) -> &mut u32 {
        if before == NONE { &mut self.first[v as usize] } else { &mut self.next[before as usize] }
    }

    /// Triangles around `vertex`, ascending.
    pub(crate) fn around(&self, vertex: u32) -> impl Iterator<Item = u32> {
        let step = |corner: u32| (corner != NONE).then_some(corner);
        std::iter::successors(step(self.first[vertex as usize]), move |&c| step(self.next[c as usize]))
            .map(|corner| corner / 3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stars_after_changes_are_those_of_a_new_surface() {
        let mut triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let mut stars = Stars::new(4, &triangles);
        let check = |stars: &Stars, vertices: usize, triangles: &[[u32; 3]]| {
            let new = Stars::new(vertices, triangles);
            for v in 0..vertices as u32 {
                let brute: Vec<u32> =
                    (0..).zip(triangles).filter(|(_, t)| t.contains(&v)).map(|(i, _)| i).collect();
                assert_eq!(stars.around(v).collect::<Vec<_>>(), brute);
                assert_eq!(new.around(v).collect::<Vec<_>>(), brute);
            }
        };
        check(&stars, 4, &triangles);
        stars.remove(1, triangles[1]);
        triangles[1] = [4, 1, 3];
        triangles.push([0, 1, 4]);
        stars.resize(5, 5);
        stars.insert(4, triangles[4]);
        stars.insert(1, triangles[1]);
        check(&stars, 5, &triangles);
    }
}
