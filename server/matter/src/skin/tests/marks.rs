//! Lines that a blade has drawn on a skin without opening it.

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

/// Largest distance of a place on the blade's path from all marks [m].
fn missed(marks: &[IncisionMark], x: &[Vector3<f64>], way: impl Iterator<Item = Vector3<f64>>) -> f64 {
    let lines: Vec<[Vector3<f64>; 2]> = marks.iter().map(|mark| mark.ends.map(|e| e.position(x))).collect();
    let distance = |p: &Vector3<f64>, [a, b]: &[Vector3<f64>; 2]| {
        let s = (p - a).dot(&(b - a)) / (b - a).norm_squared();
        (a + (b - a) * s.clamp(0.0, 1.0) - p).norm()
    };
    way.map(|p| lines.iter().map(|line| distance(&p, line)).fold(f64::INFINITY, f64::min)).fold(0.0, f64::max)
}

#[test]
fn a_scratch_shallower_than_the_elements_is_drawn_from_end_to_end_and_opens_nothing() {
    for (settings, cells) in [(None, 5), (Some(0.0), 5), (Some(0.25), 5), (Some(0.0), 1)] {
        let settings = settings.map(|snapping| SkinSettings { divisions: 3, snapping });
        let mut body = Body::new(cells, BoxPattern::Tet6, settings.unwrap_or_default(), 0.0);
        let on = |s: f64| v(0.1 + 0.8 * s, 0.47 + 0.08 * (2.4 * s + 0.3).sin(), 1.0);
        for parts in [1, 20, 400] {
            let at = |s: f64| Penetration { point_m: on(s), normal: v(0.0, 0.0, 1.0), depth_m: 0.01 };
            for part in 0..parts {
                let s = |k: i32| (f64::from(part) + f64::from(k) / 20.0) / f64::from(parts);
                let path: Vec<Penetration> = (0..=20).map(|k| at(s(k))).collect();
                let report = body.sweep(&incision(&path).segments, 1);
                assert_eq!((report.elements_cut, report.new_copies.len()), (0, 0));
            }
            // Cuts of another incision do not remove it.
            body.sweep(&[[v(0.9, 0.9, 0.99), v(0.9, 0.9, 1.1)], [v(0.95, 0.9, 0.99), v(0.95, 0.9, 1.1)]], 2);
            let marks = match settings {
                Some(_) => body.skin.incision_marks(&body.cut),
                None => body.cut.incision_marks(),
            };
            let marks: Vec<IncisionMark> = marks.into_iter().filter(|mark| mark.incision == 1).collect();
            let drawn = length(&marks, &body.x, |p| (p.z - 1.0).abs() < 1e-9);
            let asked: f64 =
                (0..400).map(|k| (on(f64::from(k + 1) / 400.0) - on(f64::from(k) / 400.0)).norm()).sum();
            // The tolerance is a share of an element finer than any skin.
            let element = 1.0 / cells as f64;
            let off = missed(&marks, &body.x, (0..=400).map(|k| on(f64::from(k) / 400.0)));
            assert!(off < element / 32.0, "{off} with {cells} cells in {parts} parts");
            assert!((drawn - asked).abs() < 0.02 * asked, "{drawn} of {asked}");
            assert!(marks.len() < 300, "{} marks", marks.len());
            body.cut.reset().unwrap();
            body.skin.follow(&body.cut);
            body.x.truncate(body.cut.n_copies());
            assert!(body.cut.incision_marks().is_empty());
        }
    }
}

#[test]
fn a_winding_cut_leaves_no_marks_beside_its_lips() {
    for (cells, parts) in [(2, 1), (2, 60), (3, 7), (4, 1), (4, 60)] {
        let settings = SkinSettings { divisions: 3, snapping: 0.0 };
        let mut body = Body::new(cells, BoxPattern::Tet6, settings, 0.0);
        let blade = |s: f64| {
            let (x, y) = (-0.1 + 1.2 * s, 0.48 + 0.09 * (7.0 * s).sin());
            [v(x, y, -0.2), v(x, y, 1.2)]
        };
        for part in 0..parts {
            let s = |k: i32| (f64::from(part) + f64::from(k) / 60.0) / f64::from(parts);
            body.sweep(&(0..=60).map(|k| blade(s(k))).collect::<Vec<_>>(), 1);
        }
        body.check(1e-10);
        assert_eq!(body.cut.components().len(), 2, "{cells} cells in {parts} parts");
        let marks = body.skin.incision_marks(&body.cut);
        let drawn = length(&marks, &body.x, on_box);
        assert_eq!(drawn, 0.0, "{cells} cells in {parts} parts");
        assert!(body.cut.incision_marks().is_empty());
    }
}

#[test]
fn a_mark_stays_where_it_is_when_another_cut_divides_the_skin_under_it() {
    let mut body = Body::new(3, BoxPattern::Tet6, SkinSettings { divisions: 3, snapping: 0.0 }, 0.0);
    let [from, to] = [v(0.4, 0.13, 1.0), v(0.47, 0.93, 1.0)];
    let path = [from, to].map(|point_m| Penetration { point_m, normal: Vector3::z(), depth_m: 0.01 });
    body.sweep(&incision(&path).segments, 1);
    for (incision, y) in [(2, 0.2), (3, 0.43), (4, 0.71)] {
        body.cut_plane(v(0.5, y, 0.5), v(0.2, 1.0, 0.1), 3.0, incision);
        body.check(1e-10);
        let mut marks = body.skin.incision_marks(&body.cut);
        marks.retain(|mark| mark.incision == 1);
        let drawn = length(&marks, &body.x, |p| (p.z - 1.0).abs() < 1e-9);
        let off = missed(&marks, &body.x, (0..=100).map(|k| from.lerp(&to, f64::from(k) / 100.0)));
        assert!(
            (drawn - (to - from).norm()).abs() < 1e-9 && off < 1e-9,
            "{drawn} of {}, {off} off",
            (to - from).norm()
        );
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
        let marks = body.skin.incision_marks(&body.cut);
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
    let marks = body.skin.incision_marks(&body.cut);
    assert!(!marks.is_empty());
    let on_skin = |p: &Vector3<f64>| (0.03..0.0501).contains(&(p.z - 1.0));
    let flat = length(&marks, &body.x, on_skin);
    let stretched: Vec<Vector3<f64>> = body.x.iter().map(|p| v(2.0 * p.x, p.y, p.z)).collect();
    let long = length(&marks, &stretched, on_skin);
    assert!(long > 1.9 * flat && long < 2.01 * flat, "{flat} {long}");
}

#[test]
fn a_scratch_is_drawn_where_it_reaches_the_elements_below_a_skin_that_stands_off_them() {
    let mut drawn = Vec::new();
    for depth_m in [0.01, 0.045, 0.06] {
        let settings = SkinSettings { divisions: 4, snapping: 0.0 };
        let mut body = Body::new(4, BoxPattern::Tet6, settings, 0.05);
        let centre = Vector3::repeat(0.5);
        let on = |x: f64| {
            let flat = v(x, 0.43, 1.0);
            flat + (flat - centre).normalize() * 0.05
        };
        let at = |x: f64| Penetration { point_m: on(x), normal: v(0.0, 0.0, 1.0), depth_m };
        let path: Vec<Penetration> = (0..=20).map(|k| at(0.1 + 0.04 * f64::from(k))).collect();
        body.sweep(&incision(&path).segments, 1);
        let marks = body.skin.incision_marks(&body.cut);
        let asked: f64 = path.windows(2).map(|p| (p[1].point_m - p[0].point_m).norm()).sum();
        drawn.push(length(&marks, &body.x, |p| p.z > 1.03) / asked);
    }
    // The skin is from 0.037 to 0.05 above the elements along the path.
    assert!(drawn[0] == 0.0 && drawn[1] > 0.2 && drawn[1] < 0.8 && drawn[2] > 0.97, "{drawn:?}");
}
