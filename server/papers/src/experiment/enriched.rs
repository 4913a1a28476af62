//! What an enriched element costs, by law: forces and their Jacobian apart, and whole steps. Then the enrichments of the
//! literature beside each other: displacement, conditioning, cost, critical time step.
//!
//! # Source
//! Jeřábková 2007, section 3.3: operations of an enriched element over those of a plain one.

use nalgebra::Vector3;
use scindo_physics::assembly::Model;
use scindo_physics::body::{Body, BodySettings, Outcome, PcgSettings, Scheme};
use scindo_physics::cut::BladeSweep;
use scindo_physics::material::{Law, Material, Rayleigh, Tangent};
use scindo_physics::mesh::{BoxPattern, box_mesh};
use scindo_study::report::result::{ExperimentResult, Table, Unit};

use crate::enrichment::basis::{Enrichment, Side};
use crate::enrichment::enriched_tet::{EnrichedTet, UA};
use crate::enrichment::{bases, steps};
use crate::lab::{ExperimentBench, LAWS, Trouble, hold_left, least};

type V = Vector3<f64>;

/// Cells of the block along x, y and z, five tetrahedra each; the second is that of the quick form.
const CELLS: [[usize; 3]; 2] = [[24, 12, 16], [12, 6, 8]];
const CELL_M: f64 = 0.01;
/// Blades come from above and leave this part of the height whole.
const WHOLE: f64 = 0.125;
const STEP_S: f64 = 0.01;
/// Iterations of conjugate gradients of a step.
const ITERATIONS: u32 = 10;

const MATERIAL: Material = Material {
    young_pa: 1e5,
    poisson: 0.33,
    density_kg_m3: 1000.0,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 },
    law: Law::Linear,
};

/// Printed operations of an enriched element over those of a plain one, by law: of its forces, and of their Jacobian.
/// The stiffness of the linear law is computed once.
const PRINTED: [(Law, [Option<f64>; 2]); 3] = [
    (Law::Linear, [Some(4.0), None]),
    (Law::Corotational, [Some(2.6), Some(4.0)]),
    (Law::StVenantKirchhoff, [Some(2.2), Some(4.0)]),
];

/// The experiment.
///
/// # Errors
/// A body could not be made, or the user ended the study.
pub(super) fn enriched(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let cells = CELLS[usize::from(bench.is_quick())];
    let mut result = ExperimentResult {
        name: "enriched",
        title: "What an enriched element costs".into(),
        about: format!(
            "A block of {} tetrahedra is cut through the middle of every layer of cells, so that {:.0} % of its elements \
             are enriched: two pieces on copies of their nodes. Forces and Jacobian are those of the general model in \
             double precision, on one thread; a step is one of implicit Euler with {ITERATIONS} iterations of conjugate \
             gradients, for laws of small strains only, because under the others Newton's method decides how many there are. \
             The least time of several runs counts. The thesis counts operations of functions that are enriched by a \
             jump, whose nodes see both pieces; on copies of nodes each piece sees its own four.",
            5 * cells.iter().product::<usize>(),
            100.0 * (1.0 - WHOLE)
        ),
        ..ExperimentResult::default()
    };
    let mut table = Table::new(
        "Enriched over plain",
        "Time per element, and how many times longer an enriched one takes.",
        &[
            ("forces, plain", Unit::Seconds),
            ("forces, enriched", Unit::Seconds),
            ("of forces", Unit::Times),
            ("Jacobian, plain", Unit::Seconds),
            ("Jacobian, enriched", Unit::Seconds),
            ("of Jacobian", Unit::Times),
            ("step, plain", Unit::Seconds),
            ("step, enriched", Unit::Seconds),
            ("of step", Unit::Times),
        ],
    );
    let total = LAWS.len() + bases::BASES.len() * bases::SLIVERS.len() + 1;
    for (law, name) in LAWS {
        bench.begin(format!("{name} law"), total)?;
        let plain = block(law, cells, false)?;
        let cut = block(law, cells, true)?;
        let (n, share) = (plain.n_elements() as f64, share_cut(&plain, &cut)?);
        let [plain, cut] = [measure(plain, law)?, measure(cut, law)?];
        let mut values = Vec::new();
        for (plain, cut) in plain.into_iter().zip(cut) {
            let whole = plain / n;
            let enriched = (cut / n - (1.0 - share) * whole) / share;
            values.extend([whole, enriched, enriched / whole].map(|x| x.is_finite().then_some(x)));
        }
        table.row(name, &values);
        if let Some((_, [forces, jacobian])) = PRINTED.iter().find(|(of, _)| *of == law) {
            let mut values = [None; 9];
            (values[2], values[5]) = (*forces, *jacobian);
            table.printed(format!("{name}, printed"), &values);
        }
    }
    let in_bases = bases::compared(bench, total)?;
    bench.begin("critical steps", total)?;
    let (curves, steps) = steps::critical_steps()?;
    result.tables.extend([table, coefficients()?, in_bases, steps]);
    result.plots.push(curves);
    Ok(result)
}

/// Factors between the blocks of the stiffness of an enriched element, for functions that are enriched by
/// ψᵢ = H(x) − H(xᵢ) with H = ±1, as the short paper has them; here they are half as large.
fn coefficients() -> Result<Table, Trouble> {
    let mut table = Table::new(
        "Blocks of the stiffness of an enriched element",
        "Linear law, a pair of nodes on one side of the cut: the block over that of the part of the element beyond the cut. \
         ψ = (H − Hᵢ)/2 here, so an added degree of freedom counts twice in the paper's convention.",
        &[("here", Unit::Number), ("in the paper's convention", Unit::Number)],
    );
    let corners = [V::zeros(), V::new(1.0, 0.1, 0.0), V::new(0.2, 0.9, 0.1), V::new(0.1, 0.2, 1.1)];
    let sides = [Side::Left, Side::Left, Side::Right, Side::Right];
    let above = 0.3;
    let tet = EnrichedTet::new(&corners, MATERIAL.lame(), sides, above)?;
    let still = UA { u: [V::zeros(); 4], a: [V::zeros(); 4] };
    let J = tet.tangent(Enrichment::ShiftedHeaviside, Law::Linear, &still);
    let [ua, aa] = [J.ua, J.aa].map(|block| block[0][1].norm() / (above * J.uu[0][1].norm()));
    table.row("K^ua over K^uu", &[ua, 2.0 * ua].map(Some));
    table.row("K^aa over K^uu", &[aa, 4.0 * aa].map(Some));
    table.printed("K^ua over K^uu, printed", &[None, Some(2.0)]);
    table.printed("K^aa over K^uu, printed", &[None, Some(4.0)]);
    Ok(table)
}

/// The block, held at its left side, cut or whole.
fn block(law: Law, cells: [usize; 3], is_cut: bool) -> Result<Body, Trouble> {
    let size = V::from(cells.map(|n| n as f64 * CELL_M));
    let mesh = box_mesh(V::zeros(), size, cells, BoxPattern::Tet5 { parity: false });
    let solver = PcgSettings { iterations: ITERATIONS, tolerance: 1e-30 };
    let settings = BodySettings { scheme: Scheme::ImplicitEuler, solver, ..BodySettings::default() };
    let mut body = Body::new(mesh, Material { law, ..MATERIAL }, settings)?;
    hold_left(&mut body)?;
    for layer in 0..if is_cut { cells[0] } else { 0 } {
        let x = (layer as f64 + 0.5) * CELL_M;
        let at = |z: f64| [V::new(x, -0.1 * size.y, z), V::new(x, 1.1 * size.y, z)];
        body.cut(&BladeSweep { segments: vec![at(1.1 * size.z), at(WHOLE * size.z)] }, layer as u32 + 1)?;
    }
    Ok(body)
}

/// The share of the elements of `plain` that consist of two pieces in `cut`.
fn share_cut(plain: &Body, cut: &Body) -> Result<f64, Trouble> {
    let pieces = |body: &Body| body.tets().map(|tets| tets.pieces().len()).ok_or("no tetrahedra");
    let n = pieces(plain)?;
    Ok((pieces(cut)? - n) as f64 / n as f64)
}

/// Least times of all forces, of all of their Jacobian, and of a step [s]; not a number where Newton's method makes it.
fn measure(mut body: Body, law: Law) -> Result<[f64; 3], Trouble> {
    let bent: Vec<V> = body
        .rest_positions()
        .iter()
        .map(|X| X + 0.02 * V::new(X.z, (20.0 * X.x).sin() * X.y, X.x * X.x / CELL_M))
        .collect();
    let model: Model = body.discrete_model()?;
    let (mut f, mut K) = (vec![V::zeros(); bent.len()], model.pattern());
    let forces = least(|| {
        f.fill(V::zeros());
        model.internal_forces(&bent, &mut f);
        Ok(())
    })?;
    let jacobian = least(|| {
        K.clear();
        model.tangent(&bent, Tangent::Exact, &mut K);
        Ok(())
    })?;
    if ![Law::Linear, Law::Corotational].contains(&law) {
        return Ok([forces, jacobian, f64::NAN]);
    }
    let (rest, still) = (body.rest_positions().to_vec(), vec![V::zeros(); bent.len()]);
    let step = least(|| {
        body.set_state(&rest, &still)?;
        match body.step(STEP_S, V::new(0.0, 0.0, -9.81), &[]).outcome {
            Outcome::Advanced => Ok(()),
            other => Err(format!("a step was refused: {other:?}").into()),
        }
    })?;
    Ok([forces, jacobian, step])
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn most_elements_are_enriched() {
        let [_, cells] = CELLS;
        let [plain, cut] = [false, true].map(|is_cut| block(Law::Corotational, cells, is_cut).unwrap());
        let share = share_cut(&plain, &cut).unwrap();
        assert!((share - (1.0 - WHOLE)).abs() < 1e-12, "{share}");
        assert_eq!(cut.parts().mass.len(), 1, "in one part");
    }
}
