//! A shaded picture of a body's surface. Lips of cuts have their own colour.

use std::fmt::Write as _;

use nalgebra::Vector3;
use scindo_physics::body::Body;
use scindo_physics::cut::Surface;

use super::html::escape;

/// A picture of a body.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Describes what the picture shows.
    pub caption: String,
    /// The picture as SVG.
    pub svg: String,
}

impl Picture {
    /// The picture with its caption as HTML.
    pub fn figure(&self) -> String {
        format!("<figure>{}<figcaption>{}</figcaption></figure>\n", self.svg, escape(&self.caption))
    }
}

/// Number of shades per colour.
pub const SHADES: usize = 8;
const WIDTH: f64 = 320.0;
const HEIGHT: f64 = 220.0;
const AIR: f64 = 8.0;
/// Direction to the viewer: from the right, in front and above.
const EYE: Vector3<f64> = Vector3::new(0.55, -0.75, 0.42);

/// Draws a body in its present shape.
pub fn body(body: &Body, caption: impl Into<String>) -> Picture {
    surface(body.surface(), body.positions(), Vector3::y(), caption)
}

/// A surface with copies at `x` [m], drawn with `up` upwards.
pub fn surface(
    surface: &Surface,
    x: &[Vector3<f64>],
    up: Vector3<f64>,
    caption: impl Into<String>,
) -> Picture {
    let points: Vec<Vector3<f64>> = surface.vertices.iter().map(|v| v.position(x)).collect();
    let svg = draw(&points, &surface.triangles, &surface.tags, up);
    Picture { caption: caption.into(), svg }
}

/// Triangles between `points` [m], drawn with `up` upwards.
pub fn triangles(
    points: &[Vector3<f64>],
    triangles: &[[u32; 3]],
    up: Vector3<f64>,
    caption: impl Into<String>,
) -> Picture {
    Picture { caption: caption.into(), svg: draw(points, triangles, &[], up) }
}

fn draw(points: &[Vector3<f64>], triangles: &[[u32; 3]], tags: &[u32], up: Vector3<f64>) -> String {
    // The viewer stands in front, to the right and above with respect to `up`.
    let side = if up.y.abs() > 0.5 { Vector3::z() } else { -Vector3::y() };
    let right = side.cross(&up) * -1.0;
    let eye = (EYE.x * right + EYE.z * up - EYE.y * side).normalize();
    let across = up.cross(&eye).normalize();
    let upward = eye.cross(&across);
    let flat: Vec<[f64; 3]> = points.iter().map(|p| [p.dot(&across), -p.dot(&upward), p.dot(&eye)]).collect();
    let used =
        || triangles.iter().flatten().map(|&v| flat[v as usize]).filter(|p| p.iter().all(|c| c.is_finite()));
    let bounds = |k: usize| {
        used().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p[k]), high.max(p[k])))
    };
    let ((left, far), (top, bottom)) = (bounds(0), bounds(1));
    let span = (far - left).max(1e-12);
    let rise = (bottom - top).max(1e-12);
    let scale = ((WIDTH - 2.0 * AIR) / span).min((HEIGHT - 2.0 * AIR) / rise);
    let (dx, dy) = (0.5 * (WIDTH - scale * span), 0.5 * (HEIGHT - scale * rise));
    let place = |v: u32| {
        let p = flat[v as usize];
        [dx + scale * (p[0] - left), dy + scale * (p[1] - top)]
    };
    let light = (eye + 0.6 * upward - 0.5 * across).normalize();
    let mut seen: Vec<(f64, usize, String)> = Vec::new();
    for (t, triangle) in triangles.iter().enumerate() {
        let [a, b, c] = triangle.map(|v| points[v as usize]);
        let Some(normal) = (b - a).cross(&(c - a)).try_normalize(0.0) else { continue };
        if normal.dot(&eye) <= 0.0 || !normal.iter().all(|c| c.is_finite()) {
            continue;
        }
        let depth: f64 = triangle.iter().map(|&v| flat[v as usize][2]).sum();
        let bright = 0.5 + 0.5 * normal.dot(&light);
        let shade = ((bright * SHADES as f64) as usize).min(SHADES - 1);
        let kind = if tags.get(t).is_some_and(|&tag| tag > 0) { 'w' } else { 'k' };
        seen.push((depth, t, format!("{kind}{shade}")));
    }
    seen.sort_by(|p, q| p.0.total_cmp(&q.0).then(p.1.cmp(&q.1)));
    let mut out = format!(
        "<svg class=\"view\" xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\">\n"
    );
    let mut open = String::new();
    for (_, t, class) in seen {
        if class != open {
            if !open.is_empty() {
                out += "\"/>\n";
            }
            let _ = write!(out, "<path class=\"{class}\" d=\"");
            open = class;
        }
        let [a, b, c] = triangles[t].map(place);
        let _ = write!(out, "M{:.1} {:.1}L{:.1} {:.1}L{:.1} {:.1}Z", a[0], a[1], b[0], b[1], c[0], c[1]);
    }
    if !open.is_empty() {
        out += "\"/>\n";
    }
    out += "</svg>\n";
    out
}

/// Colours of skin and wound, and of their outlines, from dark to light.
pub fn style() -> String {
    let mut out = String::from(
        "svg.view { display: block; width: 100%; height: auto; }\nsvg.view path { stroke-width: 0.35; stroke-linejoin: round; }\n",
    );
    for k in 0..SHADES {
        let t = (k as f64 + 0.5) / SHADES as f64;
        let mix = |dark: [f64; 3], light: [f64; 3]| {
            let c = |i: usize| (dark[i] + (light[i] - dark[i]) * t).round() as u8;
            format!("#{:02x}{:02x}{:02x}", c(0), c(1), c(2))
        };
        let skin = mix([96.0, 74.0, 72.0], [240.0, 214.0, 198.0]);
        let wound = mix([104.0, 16.0, 22.0], [226.0, 74.0, 70.0]);
        let _ = writeln!(
            out,
            "svg.view .k{k} {{ fill: {skin}; stroke: #7a5c56; }} svg.view .w{k} {{ fill: {wound}; stroke: #5e1014; }}"
        );
    }
    out
}
