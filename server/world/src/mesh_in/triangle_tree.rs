//! A tree of boxes over triangles, for the crossings of a segment and the generalised winding number.
//!
//! # Source
//! Barill, Dickson, Schmidt, Levin, Jacobson 2018, "Fast winding numbers for soups and clouds" (the
//! first term of their expansion, exact solid angles nearby); van Oosterom, Strackee 1983 (solid angle).

use nalgebra::Vector3;

/// Most triangles in a leaf.
const LEAF: usize = 4;
/// A box is approximated by its dipole when the query is farther than this many radii from its centre.
const FAR: f64 = 2.3;
/// Slack of the barycentric test, so that a segment through an edge hits one of its triangles.
const EDGE_SLACK: f64 = 1e-9;

/// Boxes, dipoles and triangles. The children of node `i` are `first` and `first + 1`.
pub(crate) struct TriangleTree {
    nodes: Vec<Node>,
    corners: Vec<[Vector3<f64>; 3]>,
    /// Number of each stored triangle in the list from which the tree was built.
    source: Vec<u32>,
}

struct Node {
    low: Vector3<f64>,
    high: Vector3<f64>,
    /// Area-weighted centre of the triangles.
    centre: Vector3<f64>,
    /// Σ area · normal [m²].
    area_normal: Vector3<f64>,
    /// Largest distance of a corner from the centre.
    radius: f64,
    /// Leaf: triangles `first..first + count`. Inner: `count == 0`, children `first`, `first + 1`.
    first: u32,
    count: u32,
}

impl TriangleTree {
    /// Builds the tree by median splits along the longest side.
    pub(crate) fn new(vertices: &[Vector3<f64>], triangles: &[[u32; 3]]) -> Self {
        let corners: Vec<[Vector3<f64>; 3]> =
            triangles.iter().map(|t| t.map(|v| vertices[v as usize])).collect();
        let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
        let mut tree = TriangleTree { nodes: Vec::new(), corners: Vec::new(), source: Vec::new() };
        if !order.is_empty() {
            tree.nodes.push(Node::around(&corners, &order));
            let n = order.len();
            tree.split(0, &corners, &mut order, 0..n);
        }
        tree.corners = order.iter().map(|&t| corners[t as usize]).collect();
        tree.source = order;
        tree
    }

    /// Corners of all triangles [m], in the order of the tree.
    pub(crate) fn triangles(&self) -> &[[Vector3<f64>; 3]] {
        &self.corners
    }

    /// Unit normals of all triangles, by their numbers in the list from which the tree was built.
    pub(crate) fn normals(&self) -> Vec<Vector3<f64>> {
        let mut normals = vec![Vector3::zeros(); self.source.len()];
        for ([a, b, c], &number) in self.corners.iter().zip(&self.source) {
            normals[number as usize] = (b - a).cross(&(c - a)).normalize();
        }
        normals
    }

    fn split(
        &mut self,
        node: usize,
        corners: &[[Vector3<f64>; 3]],
        order: &mut [u32],
        range: std::ops::Range<usize>,
    ) {
        if range.len() <= LEAF {
            self.nodes[node].first = range.start as u32;
            self.nodes[node].count = range.len() as u32;
            return;
        }
        let axis = (self.nodes[node].high - self.nodes[node].low).imax();
        let middle = range.len() / 2;
        let key = |t: u32| corners[t as usize].iter().map(|c| c[axis]).sum::<f64>();
        order[range.clone()]
            .select_nth_unstable_by(middle, |&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
        let halves = [range.start..range.start + middle, range.start + middle..range.end];
        let first = self.nodes.len();
        self.nodes[node].first = first as u32;
        for half in &halves {
            self.nodes.push(Node::around(corners, &order[half.clone()]));
        }
        for (child, half) in halves.into_iter().enumerate() {
            self.split(first + child, corners, order, half);
        }
    }

    /// Parameters t in [0, 1] where the segment `a + t (b − a)` meets triangles, ascending, each with the
    /// number of its triangle.
    pub(crate) fn crossings(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> Vec<(f64, u32)> {
        let mut hits = Vec::new();
        let mut stack = vec![0u32];
        while let Some(node) = stack.pop().and_then(|i| self.nodes.get(i as usize)) {
            if !node.meets_segment(a, b) {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.first + 1, node.first]);
                continue;
            }
            for i in node.first..node.first + node.count {
                if let Some(t) = segment_triangle(a, b, &self.corners[i as usize]) {
                    hits.push((t, self.source[i as usize]));
                }
            }
        }
        hits.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        hits
    }

    /// Generalised winding number at `q`: 1 inside and 0 outside a closed, outward oriented surface, values
    /// in between near holes.
    pub(crate) fn winding_number(&self, q: &Vector3<f64>) -> f64 {
        let mut sum = 0.0;
        let mut stack = [0u32; 64];
        let mut depth = usize::from(!self.nodes.is_empty());
        while depth > 0 {
            depth -= 1;
            let node = &self.nodes[stack[depth] as usize];
            let d = node.centre - q;
            let distance_squared = d.norm_squared();
            if distance_squared > (FAR * node.radius).powi(2) {
                sum += d.dot(&node.area_normal) / (distance_squared * distance_squared.sqrt());
            } else if node.count > 0 {
                for i in node.first..node.first + node.count {
                    sum += solid_angle(q, &self.corners[i as usize]);
                }
            } else {
                // Median splits bound the depth by log2(n) + 1, far below 62.
                stack[depth] = node.first;
                stack[depth + 1] = node.first + 1;
                depth += 2;
            }
        }
        sum / (4.0 * std::f64::consts::PI)
    }
}

impl Node {
    fn around(corners: &[[Vector3<f64>; 3]], order: &[u32]) -> Self {
        let mut low = Vector3::repeat(f64::INFINITY);
        let mut high = Vector3::repeat(f64::NEG_INFINITY);
        let (mut centre, mut area_normal, mut area) = (Vector3::zeros(), Vector3::zeros(), 0.0);
        for [a, b, c] in order.iter().map(|&t| &corners[t as usize]) {
            low = low.inf(a).inf(b).inf(c);
            high = high.sup(a).sup(b).sup(c);
            let n = 0.5 * (b - a).cross(&(c - a));
            let size = n.norm();
            centre += size / 3.0 * (a + b + c);
            area_normal += n;
            area += size;
        }
        let centre = if area > 0.0 { centre / area } else { 0.5 * (low + high) };
        let radius_squared = order
            .iter()
            .flat_map(|&t| &corners[t as usize])
            .map(|c| (c - centre).norm_squared())
            .fold(0.0, f64::max);
        Node { low, high, centre, area_normal, radius: radius_squared.sqrt(), first: 0, count: 0 }
    }

    /// Slab test with a slack that keeps hits on the boundary.
    fn meets_segment(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> bool {
        let (mut enter, mut leave) = (-EDGE_SLACK, 1.0 + EDGE_SLACK);
        let slack = EDGE_SLACK * (self.radius + (b - a).norm());
        for axis in 0..3 {
            let (low, high) = (self.low[axis] - slack, self.high[axis] + slack);
            let d = b[axis] - a[axis];
            if d == 0.0 {
                if a[axis] < low || a[axis] > high {
                    return false;
                }
                continue;
            }
            let (t0, t1) = ((low - a[axis]) / d, (high - a[axis]) / d);
            enter = enter.max(t0.min(t1));
            leave = leave.min(t0.max(t1));
        }
        enter <= leave
    }
}

/// Parameter t in [0, 1] where the segment meets the triangle, if it does (Möller, Trumbore 1997).
fn segment_triangle(a: &Vector3<f64>, b: &Vector3<f64>, [p, q, r]: &[Vector3<f64>; 3]) -> Option<f64> {
    let d = b - a;
    let (e1, e2) = (q - p, r - p);
    let h = d.cross(&e2);
    let det = e1.dot(&h);
    if det.abs() <= 1e-14 * e1.norm() * h.norm().max(d.norm() * e2.norm()) {
        return None; // parallel, or a triangle without area
    }
    let s = a - p;
    let u = s.dot(&h) / det;
    let k = s.cross(&e1);
    let v = d.dot(&k) / det;
    let t = e2.dot(&k) / det;
    let slack = EDGE_SLACK;
    let inside = u >= -slack && v >= -slack && u + v <= 1.0 + slack && t >= -slack && t <= 1.0 + slack;
    inside.then(|| t.clamp(0.0, 1.0))
}

/// Signed solid angle [sr] of a triangle seen from `q`; positive when its front faces away.
fn solid_angle(q: &Vector3<f64>, corners: &[Vector3<f64>; 3]) -> f64 {
    let [a, b, c] = corners.map(|p| p - q);
    let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
    let numerator = a.dot(&b.cross(&c));
    let denominator = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
    2.0 * numerator.atan2(denominator)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh_in::shapes::{cube, sphere};

    #[test]
    fn winding_number_is_one_inside_and_zero_outside() {
        let (vertices, triangles) = sphere(24, 1.0);
        let tree = TriangleTree::new(&vertices, &triangles);
        for i in 0..500 {
            let direction =
                Vector3::new((i as f64).sin(), (1.7 * i as f64).cos(), (0.3 * i as f64).sin()).normalize();
            let radius = 0.004 * i as f64;
            let exact: f64 = tree.corners.iter().map(|c| solid_angle(&(radius * direction), c)).sum::<f64>()
                / (4.0 * std::f64::consts::PI);
            let fast = tree.winding_number(&(radius * direction));
            assert!((fast - exact).abs() < 0.05, "{radius}: {fast} {exact}");
            if !(0.98..1.01).contains(&radius) {
                assert_eq!(fast > 0.5, radius < 1.0, "{radius}: {fast}");
            }
        }
    }

    #[test]
    fn half_open_surface_has_a_fractional_number() {
        let (vertices, mut triangles) = cube();
        triangles.truncate(10); // one face of six is missing
        let tree = TriangleTree::new(&vertices, &triangles);
        let centre = tree.winding_number(&Vector3::repeat(0.5));
        assert!((centre - 5.0 / 6.0).abs() < 1e-12, "{centre}");
    }

    #[test]
    fn segments_through_faces_edges_and_vertices_hit() {
        let (vertices, triangles) = cube();
        let tree = TriangleTree::new(&vertices, &triangles);
        for target in [
            Vector3::new(0.3, 0.2, 0.0),
            Vector3::new(0.5, 0.5, 0.0),
            Vector3::zeros(),
            Vector3::new(0.5, 0.0, 0.0),
        ] {
            let inside = Vector3::new(0.6, 0.45, 0.5);
            let hits = tree.crossings(&inside, &(inside + 2.0 * (target - inside)));
            assert!(!hits.is_empty() && (hits[0].0 - 0.5).abs() < 1e-9, "{target}: {hits:?}");
        }
        assert!(tree.crossings(&Vector3::repeat(0.2), &Vector3::repeat(0.8)).is_empty());
    }
}
