//! What a blade has drawn on a skin without opening it.

use super::*;
use crate::cut::IncisionMark;

/// Total length of marks [m], after checking that each lies on the given surface.
fn length(marks: &[IncisionMark], x: &[Vector3<f64>], on_surface: impl Fn(&Vector3<f64>) -> bool) -> f64 {
    let ends = |mark: &IncisionMark| mark.ends.map(|end| end.position(x));
    assert!(marks.iter().flat_map(ends).all(|p| on_surface(&p)), "a mark is off the surface");
    marks.iter().map(ends).map(|[p, q]| (q - p).norm()).sum()
}

fn on_box(p: &Vector3<f64>) -> bool {
    p.iter().any(|c| c.abs() < 1e-9 || (c - 1.0).abs() < 1e-9)
}

#[test]
fn a_scratch_shallower_than_the_elements_is_drawn_and_opens_nothing() {
    for settings in [None, Some(0.0), Some(0.25)] {
        let settings = settings.map(|snapping| SkinSettings { divisions: 3, snapping });
        let mut body = Body::new(5, BoxPattern::Tet6, settings.unwrap_or_default(), 0.0);
        let y = |s: f64| 0.47 + 0.08 * (3.0 * s).sin();
        let path: Vec<Penetration> = (0..=20)
            .map(|i| 0.1 + 0.8 * f64::from(i) / 20.0)
            .map(|s| Penetration { point_m: v(s, y(s), 1.0), normal: v(0.0, 0.0, 1.0), depth_m: 0.01 })
            .collect();
        let report = body.sweep(&incision(&path).segments, 1);
        assert_eq!((report.elements_cut, report.new_copies.len()), (0, 0));
        assert!(report.pending_edges > 0);
        let marks = match settings {
            Some(_) => body.skin.incision_marks(&body.cut, &body.x),
            None => body.cut.incision_marks(&body.x),
        };
        assert!(marks.iter().all(|mark| mark.incision == 1));
        let drawn = length(&marks, &body.x, |p| (p.z - 1.0).abs() < 1e-9 && (p.y - y(p.x)).abs() < 0.03);
        let asked: f64 = path.windows(2).map(|p| (p[1].point_m - p[0].point_m).norm()).sum();
        // All of it but the start, which lies inside a face of an element.
        assert!(drawn > asked - 0.25 && drawn < asked + 1e-9, "{drawn} of {asked}");
        body.cut.reset().unwrap();
        body.x.truncate(body.cut.n_copies());
        assert!(body.cut.incision_marks(&body.x).is_empty());
    }
}

#[test]
fn marks_go_ahead_of_the_cut_and_are_gone_when_it_is_through() {
    let settings = SkinSettings { divisions: 3, snapping: 0.0 };
    let mut body = Body::new(3, BoxPattern::Tet6, settings, 0.0);
    let blade = |y: f64| [v(0.45, y, -0.2), v(0.45, y, 1.2)];
    let mut drawn = Vec::new();
    for step in 0..24 {
        let from = -0.1 + 0.05 * f64::from(step);
        let to = from + 0.05;
        body.sweep(&[blade(from), blade(to)], 1);
        body.check(1e-10);
        let marks = body.skin.incision_marks(&body.cut, &body.x);
        drawn.push(length(&marks, &body.x, |p| (p.x - 0.45).abs() < 1e-9 && on_box(p)));
        let farthest =
            |points: &mut dyn Iterator<Item = Vector3<f64>>| points.map(|p| p.y).fold(0.0, f64::max);
        let mark = farthest(&mut marks.iter().flat_map(|m| m.ends).map(|end| end.position(&body.x)));
        let surface = body.skin.surface();
        let lips =
            (0..surface.tags.len()).filter(|&t| surface.tags[t] > 0).flat_map(|t| surface.triangles[t]);
        let lip = farthest(&mut lips.map(|v| surface.vertices[v as usize].position(&body.x)));
        // Lips and marks together reach the blade, and no farther.
        let reached = mark.max(lip);
        assert!(reached <= to.max(0.0) + 1e-9 && reached > to.clamp(0.0, 1.0) - 1e-3, "{mark} {lip} {to}");
    }
    assert!(drawn.iter().any(|&length| length > 0.1), "{drawn:?}");
    assert_eq!(drawn.last(), Some(&0.0));
}

#[test]
fn marks_lie_on_a_skin_that_bulges_and_follow_the_material() {
    let settings = SkinSettings { divisions: 4, snapping: 0.0 };
    let mut body = Body::new(4, BoxPattern::Tet6, settings, 0.05);
    let blade = |x: f64| [v(x, 0.43, 0.97), v(x, 0.43, 1.3)];
    body.sweep(&[blade(0.2), blade(0.8)], 1);
    let marks = body.skin.incision_marks(&body.cut, &body.x);
    assert!(!marks.is_empty());
    let on_skin = |p: &Vector3<f64>| (0.03..0.0501).contains(&(p.z - 1.0));
    let flat = length(&marks, &body.x, on_skin);
    let stretched: Vec<Vector3<f64>> = body.x.iter().map(|p| v(2.0 * p.x, p.y, p.z)).collect();
    let long = length(&marks, &stretched, on_skin);
    assert!(long > 1.9 * flat && long < 2.01 * flat, "{flat} {long}");
}
