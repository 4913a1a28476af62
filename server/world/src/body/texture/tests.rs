use std::f64::consts::TAU;

use super::*;
use crate::format::TexturedSurface;

const RADIUS: f64 = 0.1;
const HEIGHT: f64 = 0.3;

fn image() -> Image {
    Image { media_type: "image/png", bytes: Bytes::new() }
}

fn atlas(surface: &TexturedSurface, scale: f64) -> Mapping {
    Mapping::Atlas(Box::new(Atlas::new(surface, scale).unwrap()))
}

/// Point of a cylinder at an angle, as parts of a turn, and a height, as a part of its own.
fn on_cylinder(turn: f64, height: f64) -> Vector3<f64> {
    Vector3::new(RADIUS * (TAU * turn).cos(), RADIUS * (TAU * turn).sin(), HEIGHT * height)
}

/// The side of a cylinder, unrolled onto the whole image: it meets itself at the seam u = 0 = 1.
fn cylinder(around: usize, along: usize) -> TexturedSurface {
    let mut surface =
        TexturedSurface { vertices: Vec::new(), triangles: Vec::new(), coordinates: Vec::new() };
    for i in 0..around {
        for j in 0..along {
            let corner = |i: usize, j: usize| {
                let (u, v) = (i as f64 / around as f64, j as f64 / along as f64);
                // The last column is at the place of the first, to the bit.
                (on_cylinder((i % around) as f64 / around as f64, v), [u as f32, v as f32])
            };
            let corners = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            for triangle in [[0, 1, 2], [0, 2, 3]] {
                let first = surface.vertices.len() as u32;
                surface.vertices.extend(triangle.map(|k| corners[k].0));
                surface.coordinates.push(triangle.map(|k| corners[k].1));
                surface.triangles.push([first, first + 1, first + 2]);
            }
        }
    }
    surface
}

/// Coordinates of triangles without common vertices.
fn coordinates(texture: &Texture, triangles: &[[[f32; 3]; 3]]) -> Vec<Corners> {
    let numbers = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
    texture.coordinates(triangles.as_flattened(), numbers)
}

fn single(x: Vector3<f64>) -> [f32; 3] {
    [x.x as f32, x.y as f32, x.z as f32]
}

/// Triangles of another size and place on the cylinder, all around: also on and across the seam.
fn others() -> impl Iterator<Item = [[f64; 2]; 3]> {
    (0..400).map(|i| {
        let (turn, height) = (f64::from(i) / 400.0 - 0.01, 0.5 + 0.35 * f64::from(i % 7 - 3) / 3.0);
        [[turn, height], [turn + 0.02, height], [turn + 0.01, height + 0.03]]
    })
}

#[test]
fn triangles_across_a_seam_stay_on_one_side_of_it() {
    let texture = Texture::new(image(), atlas(&cylinder(40, 12), 1.0));
    let triangles: Vec<_> =
        others().map(|corners| corners.map(|[turn, height]| single(on_cylinder(turn, height)))).collect();
    let found = coordinates(&texture, &triangles);
    for (expected, found) in others().zip(&found) {
        let [least, most] = [f32::min, f32::max].map(|f| found.iter().map(|c| c[0]).reduce(f).unwrap());
        assert!(most - least < 0.04, "{expected:?} spreads over the image: {found:?}");
        for ([turn, height], [u, v]) in expected.iter().zip(found) {
            let away = f64::from(*u) - turn;
            // Beyond the seam it ends at the border of the image.
            assert!((away - away.round()).abs() < 0.021, "{turn} became {u}");
            assert!((f64::from(*v) - height).abs() < 0.01, "{height} became {v}");
        }
    }
    let on_seam = others().filter(|corners| corners[0][0] * corners[1][0] < 0.0).count();
    assert!(on_seam > 3, "{on_seam} triangles cross it");
}

#[test]
fn most_triangles_need_no_closer_look() {
    let atlas = Atlas::new(&cylinder(40, 12), 1.0).unwrap();
    let close = |corners: &[[f64; 2]; 3]| {
        let x = corners.map(|[turn, height]| on_cylinder(turn, height));
        atlas.goes_on(&x, &x.map(|x| atlas.place(x)))
    };
    let (all, continued) = (others().count(), others().filter(close).count());
    assert!(continued > all * 9 / 10, "{continued} of {all}");
}

#[test]
fn a_place_keeps_its_coordinates_when_others_come() {
    let texture = Texture::new(image(), atlas(&cylinder(16, 4), 1e-3));
    let triangles: Vec<_> = others()
        .map(|corners| corners.map(|[turn, height]| single(1e-3 * on_cylinder(turn, height))))
        .collect();
    let first = coordinates(&texture, &triangles[..100]);
    let all = coordinates(&texture, &triangles);
    assert_eq!(first, all[..100]);
    let fresh = Texture::new(image(), atlas(&cylinder(16, 4), 1e-3));
    assert_eq!(coordinates(&fresh, &triangles), all, "what was asked before changes nothing");
}

#[test]
fn a_pattern_keeps_its_size_on_every_face() {
    let texture = Texture::new(image(), Mapping::Axes { repeat_m: 0.05 });
    for [a, b] in [[0, 1], [1, 2], [2, 0]] {
        let mut corners = [[0.3_f32; 3]; 3];
        corners[1][a] += 0.1;
        corners[2][b] += 0.05;
        let [[o, p, q]] = coordinates(&texture, &[corners])[..] else { panic!("one triangle") };
        let length = |x: [f32; 2]| (x[0] - o[0]).hypot(x[1] - o[1]);
        assert!((length(p) - 2.0).abs() < 1e-5 && (length(q) - 1.0).abs() < 1e-5, "{p:?} {q:?}");
    }
}

#[test]
fn an_atlas_without_triangles_says_nothing() {
    let empty = TexturedSurface { vertices: Vec::new(), triangles: Vec::new(), coordinates: Vec::new() };
    let texture = Texture::new(image(), atlas(&empty, 1.0));
    assert_eq!(coordinates(&texture, &[[[0.0; 3]; 3]]), [[[0.0; 2]; 3]]);
}
