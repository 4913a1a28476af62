//! Cuts that move no nodes, press elements flat, or leave degenerate elements.

use super::super::relocate::LEAST_ASPECT;
use super::super::shape::{FLAT, aspect};
use super::super::{MeshCut, Moves, SnapSettings};
use super::*;

fn sample(moves: Moves, clean: bool) -> Sample {
    let snapper = Snapper::new(MeshCut::Snap, SnapSettings { moves, clean });
    Sample { snapper, ..Sample::new([1.0; 3], [8; 3], BoxPattern::Octahedral6) }
}

/// A plane through the body that presses many elements of this pattern flat: a point and the normal.
fn oblique() -> [Vector3<f64>; 2] {
    let (a, b) = (60_f64.to_radians(), 20_f64.to_radians());
    let normal = v(a.cos() * b.cos(), b.sin(), a.sin() * b.cos());
    [v(0.5, 0.5, 0.5) + normal * 0.0625, normal]
}

fn cut(sample: &mut Sample) -> SnapReport {
    let [point, normal] = oblique();
    sample.cut_plane(point, normal, 2.0, 1)
}

/// Largest distance of a node of the lips from the sweep [m].
fn off(sample: &Sample) -> f64 {
    let [point, normal] = oblique();
    let distance = |n: u32| (sample.nodes[n as usize].rest - point).dot(&normal).abs();
    sample.lip_nodes().into_iter().map(distance).fold(0.0, f64::max)
}

fn least_aspect(sample: &Sample) -> f64 {
    let aspect = |tet: &[u32; 4]| aspect(&tet.map(|n| sample.mesh.nodes[n as usize]));
    sample.mesh.tets.iter().map(aspect).fold(1.0, f64::min)
}

#[test]
fn a_jagged_cut_moves_no_node_and_changes_no_element() {
    let mut jagged = sample(Moves::None, true);
    let whole = jagged.mesh.clone();
    let report = cut(&mut jagged);
    jagged.check();
    assert_eq!((jagged.parts(), report.moved, report.refused, report.collapses), (2, 0, 0, 0));
    let corners = |mesh: &TetMesh| -> Vec<[Vector3<f64>; 4]> {
        mesh.tets.iter().map(|tet| tet.map(|n| mesh.nodes[n as usize])).collect()
    };
    assert_eq!(corners(&jagged.mesh), corners(&whole));
    // Half a cell of 1/8 off the sweep is jagged.
    assert!(off(&jagged) > 0.05, "{}", off(&jagged));
}

#[test]
fn pressed_elements_bring_every_node_to_the_sweep_and_are_collapsed() {
    let [mut sound, mut pressed, mut cleaned] =
        [(Moves::Sound, true), (Moves::Press, false), (Moves::Press, true)].map(|(m, c)| sample(m, c));
    let [of_sound, of_pressed, of_cleaned] = [&mut sound, &mut pressed, &mut cleaned].map(cut);
    for sample in [&sound, &pressed, &cleaned] {
        sample.check();
        assert_eq!(sample.parts(), 2);
    }
    // Sound moves and a few divisions need no element pressed.
    assert!(of_sound.refused == 0 && of_sound.flattened == 0 && off(&sound) < 1e-9, "{of_sound:?}");
    assert!(of_sound.moved > 4 * of_sound.splits && least_aspect(&sound) > FLAT, "{of_sound:?}");
    assert!(of_pressed.refused == 0 && off(&pressed) < 1e-3, "{of_pressed:?} {}", off(&pressed));
    assert!(of_pressed.flattened > 40 && of_pressed.degenerate == of_pressed.flattened, "{of_pressed:?}");
    assert_eq!((of_pressed.collapses, of_pressed.splits), (0, 0));
    let flattest = least_aspect(&pressed);
    assert!((LEAST_ASPECT..FLAT).contains(&flattest), "{flattest}");
    assert!(of_cleaned.flattened == of_pressed.flattened && of_cleaned.degenerate == 0, "{of_cleaned:?}");
    assert!(of_cleaned.collapses > 40 && off(&cleaned) < 1e-3, "{of_cleaned:?} {}", off(&cleaned));
    assert!(least_aspect(&cleaned) >= FLAT);
}

#[test]
fn where_all_moves_are_sound_nothing_is_pressed() {
    let [sound, pressed] = [Moves::Sound, Moves::Press].map(|moves| {
        let mut sample = sample(moves, true);
        let report = sample.cut_plane(v(0.5, 0.5, 0.52), v(0.26, 0.0, 0.97), 2.0, 1);
        assert_eq!((report.refused, report.flattened), (0, 0));
        sample.mesh
    });
    assert_eq!(sound, pressed);
}

#[test]
fn a_cut_in_thirty_parts_that_presses_parts_the_body() {
    let mut sample = sample(Moves::Press, true);
    // The same plane.
    let edge = |s: f64| [v(s, -0.1, 1.119 - 0.58 * s), v(s, 1.1, 0.615 - 0.58 * s)];
    let mut collapses = 0;
    for k in 0..30 {
        let edges = [edge(-0.1 + 0.04 * f64::from(k)), edge(-0.1 + 0.04 * f64::from(k + 1))];
        collapses += sample.sweep(&edges, 1).collapses;
        sample.check();
    }
    assert_eq!(sample.parts(), 2);
    assert!(collapses > 10, "{collapses}");
}

#[test]
fn random_cuts_that_press_leave_a_sound_body() {
    let mut random = Rng::with_seed(11);
    let mut sample = sample(Moves::Press, true);
    let mut collapses = 0;
    for id in 1..=30 {
        let point = v(0.5, 0.5, 0.5) + random.vector(0.4);
        collapses += sample.cut_plane(point, random.vector(1.0), 0.4, id).collapses;
        sample.check();
        assert!(least_aspect(&sample) >= 0.99 * LEAST_ASPECT, "cut {id}");
    }
    assert!(collapses > 50, "{collapses}");
}
