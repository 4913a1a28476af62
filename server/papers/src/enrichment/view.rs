//! A whole cut body in the degrees of freedom of an enrichment: a linear change of variables from its copies.

use nalgebra::{DMatrix, Vector3};
use scindo_physics::assembly::BlockCsr;
use scindo_physics::cut::CutMesh;
use scindo_physics::element::{FixedCopy, Held};

use super::basis::{Enrichment, Side};

/// The linear map q = C p between the positions q of the copies of a body and the degrees of freedom
/// p = [X + u; a] of an enrichment.
///
/// Degrees of freedom are numbered like copies. Number i < n_nodes is X_i + u_i, and the a of a copy added by
/// a cut has the number of that copy. On the copies c of one node, with one a_j for every added copy j,
///
///   q_c = X_i + u_i + Σ_j ψ_j(c) a_j
///
/// | enrichment | ψ_j(c) |
/// |---|---|
/// | [`Heaviside`](Enrichment::Heaviside) | H_j if c = j, else −H_j |
/// | [`ShiftedHeaviside`](Enrichment::ShiftedHeaviside) | H_j if c = j, else 0 |
/// | [`OwnSide`](Enrichment::OwnSide) | 0 if c = j, else 1 |
/// | [`Substitution`](Enrichment::Substitution) | q_c is the degree of freedom itself |
///
/// where H_j = ±1 is the side of its cut on which copy j has its material. For one cut these are the
/// functions of [`Enrichment::coefficients`]. Any number of crossing and branching cuts is covered, because
/// copies are what cuts made of a node (Jeřábková 2007 §3.1.1 needs a hierarchy of cuts for this). The same
/// change of variables transforms forces and matrices: f̃ = Cᵀ f, Ã = Cᵀ A C. It therefore holds for every
/// constitutive law. The reference of a is 0, that of X + u is X.
///
/// This view serves analysis only. The solver works on copies, where 3×3 diagonal blocks make small pieces
/// harmless; in these variables they are not harmless.
#[derive(Clone, Debug)]
pub struct EnrichedView {
    enrichment: Enrichment,
    n: usize,
    /// Nodes with more than one copy.
    nodes: Vec<EnrichedNode>,
    /// Enriched node of every copy, if its node has several copies.
    node_of: Vec<Option<u32>>,
}

/// The copies of one node, the one with the node's number first.
#[derive(Clone, Debug)]
struct EnrichedNode {
    copies: Vec<u32>,
    /// C restricted to these copies.
    C: DMatrix<f64>,
    /// C⁻¹.
    inverse: DMatrix<f64>,
}

impl EnrichedView {
    /// The view of a cut body, with H = +1 on the side of every added copy.
    pub fn new(cut: &CutMesh, enrichment: Enrichment) -> Self {
        Self::oriented(cut.copy_node(), enrichment, |_| Side::Right)
    }

    /// The view for copies of the nodes `copy_node`, where copy i is a copy of node i as long as there are
    /// nodes. `side` gives the side of every further copy. The sides only change the signs of a.
    pub fn oriented(copy_node: &[u32], enrichment: Enrichment, side: impl Fn(u32) -> Side) -> Self {
        let mut node_of = vec![None; copy_node.len()];
        let mut nodes: Vec<EnrichedNode> = Vec::new();
        for (copy, &node) in (0u32..).zip(copy_node) {
            if copy == node {
                continue;
            }
            let group = *node_of[node as usize].get_or_insert(nodes.len() as u32);
            node_of[copy as usize] = Some(group);
            if group as usize == nodes.len() {
                let none = DMatrix::zeros(0, 0);
                nodes.push(EnrichedNode { copies: vec![node], C: none.clone(), inverse: none });
            }
            nodes[group as usize].copies.push(copy);
        }
        for node in &mut nodes {
            let signs: Vec<f64> = node.copies[1..].iter().map(|&copy| side(copy).sign()).collect();
            (node.C, node.inverse) = matrices(enrichment, &signs);
        }
        Self { enrichment, n: copy_node.len(), nodes, node_of }
    }

    /// The basis of the view.
    pub fn enrichment(&self) -> Enrichment {
        self.enrichment
    }

    /// Number of degrees of freedom (vectors), equal to the number of copies.
    pub fn len(&self) -> usize {
        self.n
    }

    /// Whether there is no copy.
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// Nodes with more than one copy.
    pub fn enriched_nodes(&self) -> usize {
        self.nodes.len()
    }

    /// q = C p: positions of the copies [m], or increments of them. In place.
    pub fn to_copies(&self, p: &mut [Vector3<f64>]) {
        self.apply(p, |node| (&node.C, false));
    }

    /// p = C⁻¹ q, in place.
    pub fn from_copies(&self, q: &mut [Vector3<f64>]) {
        self.apply(q, |node| (&node.inverse, false));
    }

    /// f̃ = Cᵀ f: forces [N] on the degrees of freedom from those on the copies, in place.
    pub fn forces(&self, f: &mut [Vector3<f64>]) {
        self.apply(f, |node| (&node.C, true));
    }

    fn apply<'a>(
        &'a self,
        v: &mut [Vector3<f64>],
        matrix: impl Fn(&'a EnrichedNode) -> (&'a DMatrix<f64>, bool),
    ) {
        for node in &self.nodes {
            let old: Vec<Vector3<f64>> = node.copies.iter().map(|&c| v[c as usize]).collect();
            let (A, transposed) = matrix(node);
            for (i, &c) in node.copies.iter().enumerate() {
                let entry = |j: usize| if transposed { A[(j, i)] } else { A[(i, j)] };
                v[c as usize] = old.iter().enumerate().map(|(j, old)| entry(j) * old).sum();
            }
        }
    }

    /// Ã = Cᵀ A C of a stiffness, mass or system matrix on copies. Its pattern depends only on that of A.
    pub fn matrix(&self, A: &BlockCsr<f64>) -> BlockCsr<f64> {
        let single = |c: u32| [(c, 1.0)];
        let terms = |c: u32| -> Vec<(u32, f64)> {
            match self.node_of[c as usize] {
                Some(group) => self.nodes[group as usize].row(c),
                None => single(c).to_vec(),
            }
        };
        // The pattern comes first, so that the blocks can be added in place.
        let mut rows = vec![Vec::new(); self.n];
        for r in 0..self.n {
            let columns: Vec<u32> =
                A.columns[A.row(r)].iter().flat_map(|&c| terms(c)).map(|(dof, _)| dof).collect();
            for (dof, _) in terms(r as u32) {
                rows[dof as usize].extend_from_slice(&columns);
            }
        }
        let mut out = BlockCsr::with_rows(rows);
        for r in 0..self.n {
            let left = terms(r as u32);
            for k in A.row(r) {
                for (column, right) in terms(A.columns[k]) {
                    for &(row, left) in &left {
                        let Some(at) = out.position(row as usize, column) else { continue };
                        for (entry, a) in out.blocks[at].iter_mut().zip(&A.blocks[k]) {
                            *entry += left * right * a;
                        }
                    }
                }
            }
        }
        out
    }

    /// Constraints on the degrees of freedom that follow from constraints on copies. The result is `None`
    /// where a simple constraint does not suffice: where some copies of a node are held and others are not,
    /// unless the held ones are degrees of freedom themselves. Under substitution this is so for all copies,
    /// in the shifted enrichment for the node's own copy, and in that by H for none. This is why shifting
    /// makes boundary conditions simple. It is also `None` where a node of the cut is held in an inclined direction.
    pub fn fixed(&self, fixed: &[FixedCopy]) -> Option<Vec<FixedCopy>> {
        let mut out: Vec<FixedCopy> =
            fixed.iter().filter(|f| self.node_of[f.copy as usize].is_none()).copied().collect();
        for node in &self.nodes {
            let of = |copy: u32| fixed.iter().find(|f| f.copy == copy);
            let mut dofs: Vec<FixedCopy> = node
                .copies
                .iter()
                .map(|&copy| FixedCopy { copy, held: Held::NOT, position_m: [0.0; 3] })
                .collect();
            if node.copies.iter().any(|&copy| of(copy).is_some_and(|f| f.held.is_inclined())) {
                return None;
            }
            let axes_of = |f: &FixedCopy| f.held.axes().unwrap_or([false; 3]);
            let mut axes = vec![[false; 3]; dofs.len()];
            for axis in 0..3 {
                let held: Vec<Option<f64>> = (node.copies.iter())
                    .map(|&copy| of(copy).filter(|f| axes_of(f)[axis]).map(|f| f.position_m[axis]))
                    .collect();
                for (i, dof) in dofs.iter_mut().enumerate() {
                    // All copies of the node are held: invert C. If only some are, their row of C must be
                    // that of the identity.
                    if held.iter().all(Option::is_some) {
                        let position = (0..held.len()).map(|j| node.inverse[(i, j)] * held[j].unwrap_or(0.0));
                        (axes[i][axis], dof.position_m[axis]) = (true, position.sum());
                    } else if let Some(position) = held[i] {
                        if (0..held.len()).any(|j| node.C[(i, j)] != f64::from(u8::from(i == j))) {
                            return None;
                        }
                        (axes[i][axis], dof.position_m[axis]) = (true, position);
                    }
                }
            }
            dofs.iter_mut().zip(axes).for_each(|(dof, axes)| dof.held = axes.into());
            out.extend(dofs.into_iter().filter(|dof| dof.held.any()));
        }
        out.sort_by_key(|f| f.copy);
        Some(out)
    }
}

impl EnrichedNode {
    /// Degrees of freedom in the row of `copy`, with their coefficients.
    fn row(&self, copy: u32) -> Vec<(u32, f64)> {
        let i = self.copies.iter().position(|&c| c == copy).unwrap_or(0);
        let entry = |(j, &dof): (usize, &u32)| (dof, self.C[(i, j)]);
        self.copies.iter().enumerate().map(entry).filter(|(_, factor)| *factor != 0.0).collect()
    }
}

/// C and C⁻¹ of a node with one added copy per entry of `signs`.
fn matrices(enrichment: Enrichment, signs: &[f64]) -> (DMatrix<f64>, DMatrix<f64>) {
    let k = signs.len() + 1;
    if enrichment == Enrichment::Substitution {
        return (DMatrix::identity(k, k), DMatrix::identity(k, k));
    }
    // ψ_j on copy j and on all others, up to its sign.
    let (here, elsewhere) = match enrichment {
        Enrichment::Heaviside => (1.0, -1.0),
        Enrichment::OwnSide => (0.0, 1.0),
        _ => (1.0, 0.0),
    };
    let sign = |j: usize| if enrichment == Enrichment::OwnSide { 1.0 } else { signs[j - 1] };
    let C = DMatrix::from_fn(k, k, |c, j| match j {
        0 => 1.0,
        j => sign(j) * if c == j { here } else { elsewhere },
    });
    // a_j = (q_j − q_0) / (ψ_j(j) − ψ_j(0)), u = q_0 − Σ ψ_j(0) a_j.
    let mut inverse = DMatrix::zeros(k, k);
    inverse[(0, 0)] = 1.0;
    for j in 1..k {
        let jump = 1.0 / (C[(j, j)] - C[(0, j)]);
        (inverse[(j, j)], inverse[(j, 0)]) = (jump, -jump);
        inverse[(0, j)] = -C[(0, j)] * jump;
        inverse[(0, 0)] += C[(0, j)] * jump;
    }
    (C, inverse)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn one_cut_has_the_coefficients_of_the_element() {
        for enrichment in Enrichment::ALL.into_iter().filter(|e| *e != Enrichment::Substitution) {
            for node in [Side::Left, Side::Right] {
                let other = if node == Side::Left { Side::Right } else { Side::Left };
                let (C, _) = matrices(enrichment, &[other.sign()]);
                for (row, piece) in [(0, node), (1, other)] {
                    assert_eq!(enrichment.coefficients(piece, node), [C[(row, 0)], C[(row, 1)]]);
                }
            }
        }
    }

    #[test]
    fn any_number_of_copies_goes_there_and_back() {
        for enrichment in Enrichment::ALL {
            for signs in [&[1.0][..], &[-1.0, 1.0], &[1.0, 1.0, -1.0, 1.0]] {
                let (C, inverse) = matrices(enrichment, signs);
                let k = signs.len() + 1;
                assert!((C * inverse - DMatrix::identity(k, k)).norm() < 1e-15);
            }
        }
    }

    #[test]
    fn what_is_held_stays_a_prescription_where_it_can() {
        let held = |copy, x: f64| FixedCopy {
            copy,
            held: Held::Axes([true, false, false]),
            position_m: [x, 0.0, 0.0],
        };
        // Node 0 has the copies 0 and 2.
        let view = |enrichment| EnrichedView::oriented(&[0, 1, 0], enrichment, |_| Side::Right);
        let one = [held(0, 3.0), held(1, 5.0)];
        assert_eq!(view(Enrichment::Heaviside).fixed(&one), None);
        for enrichment in [Enrichment::ShiftedHeaviside, Enrichment::Substitution] {
            assert_eq!(view(enrichment).fixed(&one).unwrap(), one);
        }
        let both = [held(0, 3.0), held(2, 4.0)];
        let dofs = view(Enrichment::Heaviside).fixed(&both).unwrap();
        assert_eq!(dofs, [held(0, 3.5), held(2, 0.5)]);
    }
}
