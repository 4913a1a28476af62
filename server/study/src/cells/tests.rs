//! Counts, rates and iterations on small bodies. Times are never tested.

#[test]
#[ignore]
fn probe_counts() {
    use super::model::*;
    for angle in [37.0] {
        let mut m = cube(80, 4, Grid::Uncut).unwrap();
        m.blades = grid_of_blades(80, angle, 0.5);
        println!("{angle}: {}", m.cut().unwrap().space.octree().cells().len());
    }
    {
        for grid in [Grid::Uncut, Grid::Aligned, Grid::Rotated] {
            let m = cube(80, 4, grid).unwrap();
            let cut = m.cut().unwrap();
            println!(
                "{} {} -> {} links {} {:.2} s",
                m.name,
                m.octree.cells().len(),
                cut.space.octree().cells().len(),
                cut.links,
                cut.seconds
            );
        }
    }
    for (n, l) in [(155, 4), (77, 3), (39, 2)] {
        let u = animal(None, n, 0, false).unwrap();
        let m = animal(None, n, l, true).unwrap();
        let cut = m.cut().unwrap();
        println!("parts {}", cut.space.octree().components().len());
        println!(
            "{n}: uniform {} uncut {} cut {} links {} {:.2} s bounds {:?}",
            u.octree.cells().len(),
            m.octree.cells().len(),
            cut.space.octree().cells().len(),
            cut.links,
            cut.seconds,
            u.octree.bounds()
        );
    }
}

#[test]
#[ignore]
fn probe_rates() {
    use super::{model::*, solve::*, system::*};
    for (n, l) in [(39, 2), (77, 3)] {
        let m = animal(None, n, l, true).unwrap();
        rates_of(&m, n == 39);
    }
    for g in [Grid::Uncut, Grid::Aligned, Grid::Rotated] {
        rates_of(&cube(40, 3, g).unwrap(), false);
    }
    fn rates_of(m: &Model, chol: bool) {
        let cut = m.cut().unwrap();
        for p in [Problem::Equilibrium, Problem::Step(1e3), Problem::Step(1e2), Problem::Step(1e1)] {
            let mut s = System::new(cut.space.octree(), (m.held, m.pull), p).unwrap();
            let up = s.update();
            let (u, left) = s.converged();
            println!("{} {} cells {:?}: left {left:.1e} update {up:.3}", m.name, s.octree().cells().len(), p);
            let cg = run(&mut s, Solver::Jacobi, &u, Until { iterations: 3000, error: 1e-5, seconds: 0.0 });
            println!("   cg {} its {:.2} s", cg.points.len(), cg.points.last().unwrap().0);
            for (name, sm) in smoothers() {
                let (mut mg, sec) = s.multigrid(sm);
                let c = run(
                    &mut s,
                    Solver::Cycles(&mut mg),
                    &u,
                    Until { iterations: 40, error: 1e-5, seconds: 0.0 },
                );
                let d = decay(&mut s, &mut mg, &u, 24);
                println!(
                    "   {name}: e3 {:.4} ({:.4}) in {:.3}+{:.3}+{:.3} s, rate {:.3} {:.3}; cg at same time {:.3}, to same {:?}",
                    c.error(3),
                    d[3],
                    sec.levels,
                    sec.coarse,
                    c.points[2].0,
                    rate(&d, [8, 16]),
                    rate(&d, [16, 24]),
                    cg.error_after(sec.coarse + c.points[2].0),
                    cg.seconds_to(c.error(3))
                );
                let c = run(
                    &mut s,
                    Solver::Preconditioned(&mut mg),
                    &u,
                    Until { iterations: 40, error: 1e-5, seconds: 0.0 },
                );
                println!("      mgcg {} its to {:.1e}", c.points.len(), c.points.last().unwrap().1);
            }
            if chol {
                println!("   chol {:?}", cholesky(&s, &u).unwrap().points);
            }
        }
    }
}

#[test]
#[ignore]
fn probe_find() {
    use super::{model::*, solve::*, system::*};
    find(&animal(None, 39, 2, true).unwrap(), 0.0734);
    find(&animal(None, 77, 3, true).unwrap(), 0.107);
    find(&cube(80, 4, Grid::Rotated).unwrap(), 0.0145);
    find(&animal(None, 155, 4, true).unwrap(), 0.100);
    fn find(m: &Model, target: f64) {
        let cut = m.cut().unwrap();
        let (mut low, mut high) = (100f64.ln(), 1e5f64.ln());
        for _ in 0..9 {
            let mid = 0.5 * (low + high);
            let mut s = System::new(cut.space.octree(), (m.held, m.pull), Problem::Step(mid.exp())).unwrap();
            let (u, _) = s.converged();
            let (mut mg, sec) = s.multigrid(PAPERS);
            let c =
                run(&mut s, Solver::Cycles(&mut mg), &u, Until { iterations: 3, error: 0.0, seconds: 0.0 });
            println!(
                "{} s {:.1}: {:.4} levels {:.2} coarse {:.2} cycles {:.2}",
                m.name,
                mid.exp(),
                c.error(3),
                sec.levels,
                sec.coarse,
                c.points[2].0
            );
            if c.error(3) > target { high = mid } else { low = mid }
        }
    }
}

#[test]
#[ignore]
fn probe_layer() {
    use super::{layer, model::*};
    for tip in [0.45, 0.4, 0.35, 0.3, 0.25, 0.2] {
        let mut m = cube(80, 4, Grid::Uncut).unwrap();
        m.blades = grid_of_blades(80, 37.0, tip);
        println!("tip {tip}: {}", m.cut().unwrap().space.octree().cells().len());
    }
    for (cut, soft) in [(true, true), (true, false), (false, true)] {
        let r = layer::run(32, 3, cut, soft).unwrap();
        println!("{cut} {soft}: cells {:?} its {} sideways {:.4}", r.cells, r.iterations, r.sideways);
    }
}

#[test]
#[ignore]
fn probe_study() {
    let case = std::env::var("DCASE").unwrap();
    let settings = crate::Settings {
        cases: case.split(',').map(str::to_owned).collect(),
        out: std::env::var("DOUT").unwrap().into(),
        quick: std::env::var("DQUICK").is_ok(),
        within_s: None,
        budget_ms: None,
        seconds: None,
        only: Vec::new(),
        cells: Vec::new(),
        surface: std::env::var("DSURF").ok().map(Into::into),
        stop: Default::default(),
    };
    let r = crate::run(&settings, &mut |p| println!("{} {}/{} {}", p.case, p.done, p.total, p.what)).unwrap();
    for c in &r.cells {
        println!("{:?} {:?}", c.name, c.trouble);
        for t in &c.tables {
            println!("{} {:?}", t.title, t.columns.iter().map(|c| c.name).collect::<Vec<_>>());
            for r in &t.rows {
                println!(
                    "  {:40} {:?}",
                    r.name,
                    r.values.iter().map(|v| v.map_or("-".into(), crate::words::short)).collect::<Vec<_>>()
                );
            }
        }
    }
}
