//! Cases 21, 22 and 23: a stiffness ratio of a million, near incompressibility, ruined meshes.

use scindo_physics::assembly::{BlockCsr, Model, Tangent, Volumetric};
use scindo_physics::body::{Arithmetic, Body, BodySettings, ElementKind, PcgSettings, StaticSettings};
use scindo_physics::cut::CutMesh;
use scindo_physics::element::FixedCopy;
use scindo_physics::material::{Law, Material, Rayleigh, Region};
use scindo_physics::mesh::{BoxPattern, TetMesh, box_hexes, box_mesh};
use scindo_physics::octree::{BoxShape, Octree, OctreeSettings};
use scindo_physics::solver::multigrid::Smoother;
use scindo_physics::solver::{LinearSettings, LinearSolver, Method, Precision, StopReason};
use scindo_physics::team::Team;
use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::view;

use super::support::{DOWN, L, SOFT, V, block, clamp_left, cube, nodes};
use crate::lab::Trouble;
use crate::stress::case::{Case, Setting};
use crate::stress::evidence::Evidence;
use crate::stress::watch::{Common, Watch, charts};
use crate::system::linear::{MATERIAL, Problem, System};
use crate::system::solve;

/// Case 21.
pub(super) const LAYERS: Case = Case {
    number: Some(21),
    name: "stiffness-ratio",
    title: "Stiffness ratio of a million",
    set_up: "A clamped block of 8 × 8 × 8 cells of E = 1e3 Pa with an inclusion of 1e9 Pa in its middle; then \
             four glued layers of 1e3 and 1e9 Pa in turn. Implicit Euler, small strains, 25 steps of 20 ms under \
             gravity; every step solved by block-Jacobi PCG to 1e-6.",
    rule: "C. Every solve of the tetrahedra reaches 1e-6; its iterations are listed. Conjugate gradients with \
           multigrid on octree cells, 16 across, reach 1e-6 of an equilibrium in at most 60 iterations.",
    source: "Dick 2011, Fig. 14",
    quick: false,
    run: layers,
};

/// Case 22.
pub(super) const INCOMPRESSIBLE: Case = Case {
    number: Some(22),
    name: "incompressible",
    title: "Poisson's ratio 0.499",
    set_up: "A quarter of a Neo-Hookean cube that its own weight compresses by an eighth: node-averaged \
             tetrahedra and selectively integrated hexahedra of 10 cells per edge against quadratic tetrahedra \
             of 6.",
    rule: "The volume changes by at most 0.5 %; the top comes down as far as with quadratic tetrahedra, to 10 %. \
           The results of the same elements without the remedy are listed.",
    source: "Smith 2018; Zhu 2010",
    quick: false,
    run: incompressible,
};

/// Case 23.
pub(super) const NEEDLES: Case = Case {
    number: Some(23),
    name: "needles",
    title: "Needles, slivers and caps in the mesh",
    set_up: "Clamped cubes of 384 tetrahedra: in every seventh a node is added a ten-thousandth away from a \
             face (caps with dihedral angles of 179.9° and more); in every eleventh one as close to an edge \
             (slivers); in every thirteenth one as close to a corner (needles). A second under gravity, PCG to \
             1e-4.",
    rule: "C. At most three times the iterations of the mesh without them.",
    source: "Nienhuys 2003, §3.2.3",
    quick: false,
    run: needles,
};

/// The elements of one stiffness as a separate mesh, with the index of every node in the whole mesh.
fn part_of(mesh: &TetMesh, chosen: impl Fn(&V) -> bool) -> (TetMesh, Vec<u32>) {
    let middle = |e: usize| mesh.corners(e).iter().sum::<V>() / 4.0;
    let tets: Vec<[u32; 4]> =
        (0..mesh.tets.len()).filter(|&e| chosen(&middle(e))).map(|e| mesh.tets[e]).collect();
    let mut used: Vec<u32> = tets.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let number = |node: u32| used.binary_search(&node).unwrap_or(0) as u32;
    let tets = tets.into_iter().map(|tet| tet.map(number)).collect();
    (TetMesh { nodes: used.iter().map(|&n| mesh.nodes[n as usize]).collect(), tets }, used)
}

fn linear(young_pa: f64) -> Material {
    Material { young_pa, poisson: 0.33, density_kg_m3: 1e3, rayleigh: Rayleigh::default(), law: Law::Linear }
}

/// Stiffness K [N/m] of a mesh whose elements are stiff where `stiff` holds.
fn stiffness(mesh: &TetMesh, stiff: &dyn Fn(&V) -> bool) -> Result<BlockCsr<f64>, Trouble> {
    let whole = Model::tet4(mesh, &linear(1e3), Volumetric::Full)?;
    let mut K = whole.pattern();
    for (young, is_stiff) in [(1e3, false), (1e9, true)] {
        let (part, number) = part_of(mesh, |X| stiff(X) == is_stiff);
        let model = Model::tet4(&part, &linear(young), Volumetric::Full)?;
        let mut local = model.pattern();
        model.tangent(model.rest(), Tangent::Exact, &mut local);
        for i in 0..local.n_rows() {
            for k in local.row(i) {
                let j = number[local.columns[k] as usize];
                let at = K.position(number[i] as usize, j).ok_or("a block outside the pattern")?;
                for (sum, entry) in K.blocks[at].iter_mut().zip(&local.blocks[k]) {
                    *sum += entry;
                }
            }
        }
    }
    Ok(K)
}

fn layers(_: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut energies = Chart::new("energy", "time [s]", "energy [J]");
    let mut iterations = Chart::new("iterations of the linear solver per step", "time [s]", "iterations");
    let mesh = block([0.2; 3], [8; 3]);
    let inclusion = |X: &V| (X - V::repeat(0.1)).amax() < 0.05;
    let layers = |X: &V| (X.y / 0.05) as usize % 2 == 1;
    type Kind<'a> = (&'a str, &'a dyn Fn(&V) -> bool);
    let kinds: [Kind; 2] = [("inclusion", &inclusion), ("layers", &layers)];
    for (name, stiff) in kinds {
        let K = stiffness(&mesh, stiff)?;
        // Both materials have the same density, so stiffness is all that tells them apart.
        let mass = Model::tet4(&mesh, &linear(1e3), Volumetric::Full)?.lumped_mass(1e3);
        let fixed: Vec<FixedCopy> = nodes(&mesh.nodes, |X| X.x == 0.0)
            .into_iter()
            .map(|copy| FixedCopy { copy, held: [true; 3].into(), position_m: [0.0; 3] })
            .collect();
        let h: f64 = 0.02;
        // (M + h² K) v⁺ = M v + h (M g − K u)
        let mut A = K.clone();
        A.blocks.iter_mut().flatten().for_each(|k| *k *= h * h);
        A.add_diagonal(1.0, &mass);
        let settings = LinearSettings {
            method: Method::Pcg,
            precision: Precision::Double,
            iterations: 50_000,
            tolerance: 1e-6,
        };
        let mut solver = LinearSolver::new(settings);
        solver.set_matrix(&A, &fixed);
        let mut team = Team::new(1)?;
        let n = mesh.nodes.len();
        let (mut u, mut v, mut Ku) = (vec![V::zeros(); n], vec![V::zeros(); n], vec![V::zeros(); n]);
        let (mut most, mut missed, mut excess, mut scale, mut not_finite) =
            (0, 0, f64::NEG_INFINITY, 0.0_f64, 0);
        let (mut path, mut counts) = (vec![[0.0, 0.0]], Vec::new());
        for step in 1..=25 {
            K.multiply(&u, &mut Ku);
            let b: Vec<V> = (0..n).map(|i| mass[i] * (v[i] + h * DOWN) - h * Ku[i]).collect();
            // The search begins with the velocity of the last step.
            let report = solver.solve(&mut team, &A, &b, &mut v, None);
            most = most.max(report.iterations);
            missed += usize::from(report.stop != StopReason::Converged);
            u.iter_mut().zip(&v).for_each(|(u, v)| *u += h * v);
            not_finite += v.iter().chain(&u).filter(|v| !v.iter().all(|c| c.is_finite())).count();
            // Implicit Euler only takes energy out, so kinetic and elastic energy stay below the work of gravity.
            let kinetic: f64 = mass.iter().zip(&v).map(|(m, v)| 0.5 * m * v.norm_squared()).sum();
            let elastic = 0.5 * K.bilinear(&u, &u);
            let work: f64 = mass.iter().zip(&u).map(|(m, u)| m * DOWN.dot(u)).sum();
            excess = excess.max(kinetic + elastic - work);
            scale = scale.max(work.abs());
            path.push([f64::from(step) * h, kinetic + elastic]);
            counts.push([f64::from(step) * h, f64::from(report.iterations)]);
        }
        evidence.exactly(format!("solves that did not reach 1e-6, {name}"), missed, 0);
        evidence.tell(format!("largest number of iterations of a step, {name}"), f64::from(most), "");
        evidence.exactly(format!("C: numbers that are not finite, {name}"), not_finite, 0);
        evidence.at_most(format!("C: energy beyond work, {name}"), excess / scale, 0.01, "");
        energies.lines.push(Line { name: name.to_owned(), points: path });
        iterations.lines.push(Line { name: name.to_owned(), points: counts });
        let rest = CutMesh::new(mesh.clone())?;
        let x: Vec<V> = mesh.nodes.iter().zip(&u).map(|(X, u)| X + u).collect();
        evidence.pictures.push(view::surface(
            rest.surface(),
            &x,
            V::y(),
            format!("{name}, after half a second"),
        ));
    }
    evidence.charts.extend([energies, iterations]);
    // The same two arrangements on octree cells, in a cube of 1 m.
    let centred: (&str, Inside) = ("inclusion", |X| (X - V::repeat(0.5)).amax() < 0.25);
    for (name, stiff) in [centred, ("layers", |X| (X.z / 0.25) as usize % 2 == 1)] {
        cells_with(name, stiff, &mut evidence)?;
    }
    Ok(evidence)
}

/// Whether a point is in the stiff material.
type Inside = fn(&V) -> bool;

/// The same stiffness ratio on octree cells, in equilibrium.
fn cells_with(name: &str, stiff: Inside, evidence: &mut Evidence) -> Result<(), Trouble> {
    let shape = BoxShape { min: V::zeros(), max: V::repeat(1.0) };
    let mut octree = Octree::fill(&shape, OctreeSettings { cells: 16, levels: 2 }, &|p| u16::from(stiff(p)))?;
    let young_pa = 1e6 * MATERIAL.young_pa;
    octree.set_regions(vec![Region {
        young_pa,
        poisson: MATERIAL.poisson,
        density_kg_m3: MATERIAL.density_kg_m3,
    }]);
    let held: fn(&V) -> bool = |X| X.x == 0.0;
    let mut system = System::new(&octree, (held, |_| DOWN), Problem::Equilibrium)?;
    let (mut multigrid, _) = system.multigrid(Smoother::default());
    let found = solve::iterations(&mut system, &mut multigrid, 1e-6);
    let found = found.map_or(f64::INFINITY, f64::from);
    evidence.at_most(format!("iterations with multigrid on octree cells, {name}"), found, 60.0, "");
    Ok(())
}

/// Downward motion of corner, centre and mean of the top, in edges, and the volume change V/V₀ − 1.
struct Compressed {
    top: [f64; 3],
    volume: f64,
    iterations: u32,
}

fn compress(body: &mut Body) -> Result<Compressed, Trouble> {
    let held = |n: usize, body: &Body| {
        let X = body.rest_positions()[n];
        let clamped = X.z < 1e-9;
        [clamped || X.x < 1e-9, clamped || X.y < 1e-9, clamped]
    };
    for n in 0..body.rest_positions().len() {
        let axes = held(n, body);
        if axes != [false; 3] {
            body.fix(&[n as u32], axes, V::zeros())?;
        }
    }
    let before = body.volume();
    let settings = StaticSettings {
        tolerance: 1e-6,
        newton_steps: 60,
        linear: PcgSettings { iterations: 20_000, tolerance: 1e-2 },
    };
    let report = body.solve_static(V::new(0.0, 0.0, -40.0), &settings)?;
    if !report.converged {
        return Err(format!("no equilibrium: {report:?}").into());
    }
    let (x, X) = (body.positions(), body.rest_positions());
    let down = |n: usize| (X[n].z - x[n].z) / L;
    let at = |place: V| {
        let near = |n: &usize| (X[*n] - place).norm() < 1e-9;
        (0..x.len()).find(near).map_or(f64::NAN, down)
    };
    let top: Vec<f64> = (0..x.len()).filter(|&n| X[n].z > L - 1e-9).map(down).collect();
    Ok(Compressed {
        top: [at(V::new(0.5, 0.5, 1.0) * L), at(V::z() * L), top.iter().sum::<f64>() / top.len() as f64],
        volume: body.volume() / before - 1.0,
        iterations: report.iterations,
    })
}

fn incompressible(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let material = Material {
        young_pa: 1e4,
        poisson: 0.499,
        density_kg_m3: 1e3,
        rayleigh: Rayleigh::default(),
        law: Law::NeoHookean,
    };
    let extent = V::new(0.5, 0.5, 1.0) * L;
    let cells = |n: usize| [n / 2, n / 2, n];
    let tets = |n: usize| box_mesh(V::zeros(), extent, cells(n), BoxPattern::Tet5 { parity: false });
    let settings = BodySettings { arithmetic: Some(Arithmetic::Double), ..BodySettings::default() };
    let quadratic = BodySettings { element: ElementKind::Tet10, ..settings };
    let mut body = setting.with(tets(6), material, quadratic)?;
    let reference = compress(&mut body)?;
    evidence.tell("top of quadratic tetrahedra, mean", reference.top[2], "edges");
    let tet4 = |volumetric| setting.with(tets(10), material, BodySettings { volumetric, ..settings });
    let hex8 = |volumetric| {
        let with = BodySettings { volumetric, ablation: setting.ablation, ..settings };
        Body::hex8(box_hexes(V::zeros(), extent, cells(10)), material, with)
    };
    let bodies = [
        ("tetrahedra", tet4(Volumetric::Full)?, tet4(Volumetric::NodeAveraged { kept: 0.05 })?),
        ("hexahedra", hex8(Volumetric::Full)?, hex8(Volumetric::Selective)?),
    ];
    for (name, mut plain, mut remedied) in bodies {
        let off = |c: &Compressed| {
            c.top.iter().zip(reference.top).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max)
        };
        let (plain, end) = (compress(&mut plain)?, compress(&mut remedied)?);
        evidence.at_most(format!("change of volume, {name}"), end.volume.abs(), 0.005, "");
        evidence.at_most(format!("top against quadratic tetrahedra, {name}"), off(&end), 0.1, "off");
        evidence.tell(format!("the same without remedy, {name}"), off(&plain), "off");
        evidence.tell(format!("iterations to equilibrium, {name}"), f64::from(end.iterations), "");
        evidence.pictures.push(view::surface(
            remedied.surface(),
            remedied.positions(),
            V::z(),
            format!("{name} in equilibrium"),
        ));
    }
    Ok(evidence)
}

/// Splits tet `e` at the point with these barycentric coordinates, all of them positive.
fn split(mesh: &mut TetMesh, e: usize, weights: [f64; 4]) {
    let corners = mesh.corners(e);
    let sum: f64 = weights.iter().sum();
    let point: V = corners.iter().zip(weights).map(|(X, w)| w / sum * X).sum();
    let (nodes, apex) = (mesh.tets[e], mesh.nodes.len() as u32);
    mesh.nodes.push(point);
    for k in 0..4 {
        // The point replaces corner k, on the inner side of the opposite face.
        let mut tet = nodes;
        tet[k] = apex;
        if k == 0 { mesh.tets[e] = tet } else { mesh.tets.push(tet) }
    }
}

fn needles(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    let d = 1e-4;
    let kinds = [
        ("clean", 0, [1.0; 4]),
        ("caps", 7, [d, 1.0, 1.0, 1.0]),
        ("slivers", 11, [d, d, 1.0, 1.0]),
        ("needles", 13, [d, d, d, 1.0]),
    ];
    let ruined = |every: usize, weights: [f64; 4]| {
        let mut mesh = cube(4);
        (0..mesh.tets.len())
            .filter(|e| every > 0 && e % every == 0)
            .for_each(|e| split(&mut mesh, e, weights));
        mesh
    };
    let quality = |mesh: &TetMesh| {
        let of = |e: usize| {
            let longest = mesh.longest_edge(e);
            mesh.volume(e) / longest.powi(3)
        };
        (0..mesh.tets.len()).map(of).fold(f64::INFINITY, f64::min)
    };
    let mut most = Vec::new();
    for (name, every, weights) in kinds {
        let mesh = ruined(every, weights);
        evidence.tell(format!("least volume over (longest edge)³, {name}"), quality(&mesh), "");
        evidence.tell(format!("tetrahedra, {name}"), mesh.tets.len() as f64, "");
        let mut body = setting.body(mesh, SOFT, 2000, 1e-4)?;
        clamp_left(&mut body)?;
        let mut watch = Watch::new(name, body, 0.02, DOWN);
        most.push((0..50).map(|_| watch.step().iterations).max().unwrap_or(0));
        let body = watch.finish(&mut common, &mut energies, &mut iterations);
        evidence.pictures.push(view::body(&body, format!("{name}, after one second")));
    }
    evidence.tell("largest number of iterations of a step, clean", f64::from(most[0]), "");
    for ((name, ..), found) in kinds.iter().zip(&most).skip(1) {
        let ratio = f64::from(*found) / f64::from(most[0]);
        evidence.at_most(format!("iterations with {name}, over clean"), ratio, 3.0, "");
    }
    evidence.charts.extend([energies, iterations]);
    common.tell(&mut evidence);
    Ok(evidence)
}
