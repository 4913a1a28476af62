//! Cases 7 and 8: what is cut loose falls.

use scindo_physics::body::Body;
use scindo_physics::cut::{BladeSweep, Piece};
use scindo_study::report::view;

use super::flaws::{mass_of_parts, tell};
use super::support::{DOWN, L, SOFT, V, clamp_left, cube, pieces, slice};
use crate::lab::Trouble;
use crate::stress::case::{Case, Setting};
use crate::stress::evidence::Evidence;
use crate::stress::watch::{Common, Watch, charts};

/// Case 7.
pub(super) const FREED_NODE: Case = Case {
    number: Some(7),
    name: "freed-node",
    title: "A single node is cut free",
    set_up: "A blade whose tip stays inside the body turns once around a node of the skin. It cuts out a cone \
             that contains this node and tiny pieces of the tetrahedra around it. The rest is clamped; gravity \
             pulls the cone out.",
    rule: "C. One fragment besides the rest; its centre of mass falls with g to 1e-3 although no element has \
           more than a thousandth of its volume in it.",
    source: "Molino, Bao, Fedkiw 2004: virtual nodes with the masses of their pieces",
    quick: true,
    run: freed_node,
};

/// Case 8.
pub(super) const FRAGMENTS: Case = Case {
    number: Some(8),
    name: "free-fall",
    title: "Every fragment falls with g",
    set_up: "A cube of 384 tetrahedra sliced into four by three cuts, one slice a twentieth of the whole; all \
             free, then with one side clamped. 0.4 s under gravity in steps of 10 ms.",
    rule: "C. The momentum of every free fragment is density × volume × g × time to 1e-6, with the volume of its \
           rest geometry. So is the distance that its centre of mass has fallen. (Lumping of the enriched \
           degrees of freedom as in Jeřábková 2007, (3.47): 0.40 to 0.997.)",
    source: "errata of Jeřábková 2007, (3.46) and (3.47)",
    quick: true,
    run: fragments,
};

/// A part of a body and the copies that move it.
struct Fragment {
    mass: f64,
    centre: V,
    momentum: V,
    /// Density times rest volume of its pieces [kg].
    weighed: f64,
}

fn fragments_of(body: &Body) -> Vec<Fragment> {
    let parts = body.parts();
    let none = || Fragment { mass: 0.0, centre: V::zeros(), momentum: V::zeros(), weighed: 0.0 };
    let mut all: Vec<Fragment> = (0..parts.len()).map(|_| none()).collect();
    for (c, &part) in parts.of_copy.iter().enumerate() {
        let (m, fragment) = (body.masses()[c], &mut all[part as usize]);
        fragment.mass += m;
        fragment.centre += m * body.positions()[c];
        fragment.momentum += m * body.velocities()[c];
    }
    for (piece, volume) in pieces(body) {
        let part = parts.of_copy[piece.copies[0] as usize] as usize;
        all[part].weighed += body.material().density_kg_m3 * (piece.fraction * volume);
    }
    all.iter_mut().for_each(|fragment| fragment.centre /= fragment.mass);
    all
}

/// Deviation of the free fragments from a falling point mass, in momentum and in distance.
struct Fall {
    momentum: f64,
    way: f64,
    free: usize,
}

fn fall(watch: &mut Watch, h: f64, steps: usize, gravity: V) -> Fall {
    let start = fragments_of(&watch.body);
    watch.steps(steps);
    let n = steps as f64;
    let way = h * h * n * (n + 1.0) / 2.0 * gravity; // the sum that implicit Euler makes
    let mut fall = Fall { momentum: 0.0, way: 0.0, free: 0 };
    let free = &watch.body.parts().free;
    for ((now, then), _) in fragments_of(&watch.body).iter().zip(&start).zip(free).filter(|(_, free)| **free)
    {
        let gained = now.momentum - then.momentum;
        let due = n * h * now.weighed * gravity;
        fall.momentum = fall.momentum.max((gained - due).norm() / due.norm());
        fall.way = fall.way.max((now.centre - then.centre - way).norm() / way.norm());
        fall.free += 1;
    }
    fall
}

fn freed_node(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    let mut body = setting.body(cube(4), SOFT, 200, 1e-5)?;
    clamp_left(&mut body)?;
    let mut watch = Watch::new("", body, 0.01, -DOWN);
    // A node in the middle of the upper face; edges are L/4 long. Gravity pulls upwards, out of it.
    let (node, depth) = (V::new(0.5, 1.0, 0.5) * L, 0.06 * L / 4.0);
    let tip = node - depth * V::y();
    let turn = |k: usize| {
        let angle = std::f64::consts::TAU * (k % 24) as f64 / 24.0 + 0.1;
        [tip, node + depth * V::new(3.0 * angle.cos(), 2.0, 3.0 * angle.sin())]
    };
    watch.cut(&BladeSweep { segments: (0..=24).map(turn).collect() }, 1)?;
    let components = watch.body.components();
    evidence.exactly("parts", components.len(), 2);
    let freed = components.volume.iter().fold(f64::INFINITY, |a, b| a.min(*b));
    let tiny = |part: usize| {
        let of = |p: &&Piece| watch.body.parts().of_copy[p.copies[0] as usize] as usize == part;
        pieces(&watch.body).map(|(p, _)| p).filter(of).map(|p| p.fraction).fold(0.0, f64::max)
    };
    let largest = (0..watch.body.parts().len()).map(tiny).fold(f64::INFINITY, f64::min);
    evidence.tell("volume of the fragment over that of the cube", freed / L.powi(3), "");
    evidence.at_most("largest fraction of an element in it", largest, 1e-3, "");
    tell(&watch.body.flaws(), &mut evidence);
    let fall = fall(&mut watch, 0.01, 40, -DOWN);
    evidence.exactly("fragments that nothing holds", fall.free, 1);
    evidence.at_most(
        "deviation of its momentum from density × volume × g × time",
        fall.momentum,
        1e-3,
        "off",
    );
    evidence.at_most("deviation of its fall from free fall", fall.way, 1e-3, "off");
    evidence.at_most("mass of the parts against density × volume", mass_of_parts(&watch.body), 1e-10, "off");
    let body = watch.finish(&mut common, &mut energies, &mut iterations);
    evidence.pictures.push(view::surface(body.surface(), body.rest_positions(), V::y(), "The cut, at rest"));
    evidence.charts.extend([energies, iterations]);
    common.tell(&mut evidence);
    Ok(evidence)
}

fn fragments(setting: &Setting) -> Result<Evidence, Trouble> {
    let mut evidence = Evidence::default();
    let mut common = Common::default();
    let (mut energies, mut iterations) = charts();
    for (name, clamped) in [("all free", false), ("one clamped", true)] {
        let mut body = setting.body(cube(4), SOFT, 200, 1e-5)?;
        if clamped {
            clamp_left(&mut body)?;
        }
        let mut watch = Watch::new(name, body, 0.01, DOWN);
        for (incision, at) in [(1, 0.300_001), (2, 0.251), (3, 0.77)] {
            watch.cut(&slice(at, -5.0, 5.0), incision)?;
        }
        tell(&watch.body.flaws(), &mut evidence);
        let fall = fall(&mut watch, 0.01, 40, DOWN);
        evidence.exactly(format!("free fragments, {name}"), fall.free, if clamped { 3 } else { 4 });
        evidence.at_most(format!("momentum of a fragment, {name}"), fall.momentum, 1e-6, "off");
        evidence.at_most(
            format!("deviation of the fall of a fragment from free fall, {name}"),
            fall.way,
            1e-6,
            "off",
        );
        evidence.at_most(
            format!("mass of a fragment against density × volume, {name}"),
            mass_of_parts(&watch.body),
            1e-10,
            "off",
        );
        let body = watch.finish(&mut common, &mut energies, &mut iterations);
        evidence.pictures.push(view::body(&body, format!("{name}, after 0.4 s")));
    }
    evidence.charts.extend([energies, iterations]);
    common.tell(&mut evidence);
    Ok(evidence)
}
