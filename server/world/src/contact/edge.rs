//! Cutting with force: the edge of a blade presses on the tissue before it, and goes on where its load exceeds the
//! toughness.
//!
//! The edge is divided into parts. A part that is in tissue has a front: the material point that it has reached. The
//! hand pulls the front along by a one-sided spring k in the direction n from the front to the hand, so the tissue
//! yields before the blade. The spring transmits at most J ℓ cos φ, where J is the toughness [J/m² = N/m], ℓ the
//! length of the part, and φ the angle between n and the plane across the edge: a blade that slices needs less force.
//! (The toughness is that of the area at rest: J grows with what the edge has passed at rest over what it passed.)
//! What the hand does beyond that is an advance of the front by s through the material,
//!
//! ```text
//! s = max(0, e − J ℓ cos φ / k)        e: extension after the solve of the step
//! ```
//!
//! which opens the area ℓ s cos φ and takes the work J ℓ s cos φ. So the work of the hand is that of the toughness,
//! besides what the tissue stores. The swept surface is that of the fronts, not of the hand.
//!
//! A blade that is drawn back feels nothing within the slit that it made. Where it leaves the slit, beyond the end at
//! which it began or to a side, its fronts turn and are pressed there. Only the motion across the edge makes a slit:
//! a blade that is stabbed in along its own length has none, and is pressed to whichever side it goes next.
//!
//! # Source
//! Jeřábková 2007, 4.1.3 and fig. 4.8a (force feedback while cutting). Atkins, Xu, Jeronimidis 2004: Cutting, by
//! "pressing and slicing", of thin floppy slices of materials (the part of φ).

use nalgebra::Vector3;
use scindo_collision::CapsuleMotion;
use scindo_physics::body::{PointSpring, SpringKind};
use scindo_physics::element::MaterialPoint;

use super::surface::ContactSurface;
use crate::body::SimBody;
use crate::tool::Tool;
use crate::tool::blade::PressedEdge;
use crate::tool::geometry::core;

type V = Vector3<f64>;

/// Length of a part, in cells of the finest body, and most parts of an edge.
const PART_CELLS: f64 = 0.25;
const MOST_PARTS: usize = 128;
/// Distance ahead of the front at which its material is looked for, in cells.
const AHEAD: f64 = 1e-3;
/// Area at rest over area now up to which the toughness counts for the one at rest.
const MOST_GROWTH: f64 = 2.0;
/// cos φ below which a front slides along the edge without a slit, and that from which on a slit is open to the skin.
const LEAST_ACROSS: f64 = 0.1;
const MOSTLY_ACROSS: f64 = 0.5;
/// A hand is beside a slit from this many cells on, and so much more for each metre that it is behind the front.
const BESIDE_CELLS: f64 = 0.25;
const BESIDE_SLOPE: f64 = 0.5;
/// Parts from which on an edge may turn against that of the hand.
const ENOUGH: usize = 3;

/// The edge of one cutting blade.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct Edge {
    /// From the tip to the heel, all of one length.
    parts: Vec<Option<Front>>,
    /// Tip and heel in the hand at the last step [m].
    hand: Option<[V; 2]>,
    /// Where it was before the first of its parts met tissue, until that was told.
    began: Option<[V; 2]>,
    /// Whether a part has come out of the tissue in front of it.
    through: bool,
    report: EdgeReport,
    /// Area that the fronts have passed, as it was then [m²].
    passed_m2: f64,
    points: Vec<V>,
    which: Vec<usize>,
    found: Vec<Option<MaterialPoint>>,
}

/// What an edge has done since it began to cut.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct EdgeReport {
    /// Parts of the edge that are in tissue, over all parts.
    pub inside: f64,
    /// Parts that are pressed, over all parts.
    pub loaded: f64,
    /// Force with which the edge presses now [N].
    pub load_n: f64,
    /// Force at which it goes on [N].
    pub resistance_n: f64,
    /// Area at rest that the fronts have passed [m²].
    pub area_m2: f64,
    /// Work of the edge on the material that it parted [J].
    pub work_j: f64,
}

/// Where a part of the edge has got to.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Front {
    body: usize,
    epoch: u32,
    point: MaterialPoint,
    /// From the material point to the front [m].
    offset_m: V,
    /// Unit direction across the edge in which it went last; 0 while it has none.
    ahead: V,
    /// Length of the slit behind it [m]; none: it is open to the skin.
    slit_m: Option<f64>,
    /// Whether it went to another end of its slit since its material was last found.
    turned: bool,
    /// Whether it has left its material point.
    moved: bool,
    /// Its place at rest [m], when it was last found.
    rest_m: V,
    load: Option<Load>,
}

/// The spring of a front in this step.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Load {
    normal: V,
    /// Place of the hand along the normal [m].
    hand_m: f64,
    stiffness_n_m: f64,
    /// Force at which the front goes on [N].
    resistance_n: f64,
    /// Whether the tool is too weak for that.
    too_weak: bool,
    /// cos φ.
    across: f64,
}

impl Front {
    fn place(&self, x: &[V]) -> V {
        self.point.position(x) + self.offset_m
    }

    /// Whether a hand `way` before it presses on it, on an edge of direction `along`. If the hand has left the slit
    /// behind the front by more than `slack_m` to a side, or beyond its end, then the front turns: it goes to where
    /// that was, and is pressed in the next step.
    fn is_before(&mut self, way: V, along: &V, slack_m: f64) -> bool {
        let Some(ahead) = across(&self.ahead, along).try_normalize(LEAST_ACROSS) else {
            return way.norm() > 1e-9;
        };
        let way = across(&way, along);
        let gone_m = way.dot(&ahead);
        if gone_m > 0.0 {
            return true;
        }
        let end_m = self.slit_m.map_or(gone_m, |slit_m| gone_m.max(-slit_m));
        let side = way - gone_m * ahead;
        let beside = side.norm() > slack_m - BESIDE_SLOPE * end_m;
        if beside || gone_m < end_m {
            (self.moved, self.turned) = (true, true);
            self.offset_m += end_m * ahead;
            if beside {
                (self.ahead, self.slit_m) = (side.normalize(), Some(0.0));
            } else {
                self.ahead = -ahead;
            }
        }
        false
    }

    /// Goes on by `by`, on an edge of direction `along`.
    fn go(&mut self, by: V, along: &V) {
        self.offset_m += by;
        self.moved = true;
        let aside = across(&by, along);
        if aside.norm() > LEAST_ACROSS * by.norm() {
            self.slit_m = match self.slit_m {
                Some(slit_m) if self.ahead.dot(&aside) > 0.0 => Some(slit_m + aside.norm()),
                Some(_) => Some(aside.norm()),
                None => None,
            };
            self.ahead = aside.normalize();
        }
    }
}

/// The part of `v` that is perpendicular to an edge of direction `along`.
fn across(v: &V, along: &V) -> V {
    v - along * along.dot(v)
}

impl Edge {
    /// What it has done so far.
    pub fn report(&self) -> EdgeReport {
        self.report
    }

    /// Follows the hand to its present pose: finds what tissue the edge meets, and calls `emit` with the body, the
    /// spring, and its largest extension so far for every part that is loaded. `toughness` [J/m²] is that of every
    /// body.
    pub fn follow(
        &mut self,
        tool: &Tool,
        surfaces: &[ContactSurface],
        bodies: &mut [SimBody],
        toughness: &[f64],
        mut emit: impl FnMut(usize, PointSpring),
    ) {
        let edge = core(tool.shape, &tool.pose);
        let begins = self.hand.is_none();
        let before = self.hand.replace(edge).unwrap_or(edge);
        let length_m = (edge[1] - edge[0]).norm();
        if self.parts.is_empty() {
            self.divide(length_m, bodies);
        }
        let inside = |parts: &[Option<Front>]| parts.iter().any(Option::is_some);
        self.find_again(surfaces, bodies);
        if !inside(&self.parts) {
            self.enter((before, edge), begins, surfaces, bodies);
            if inside(&self.parts) {
                (self.began, self.through) = (Some(before), false);
            }
        } else {
            self.enter((before, edge), begins, surfaces, bodies);
        }
        let along = (edge[1] - edge[0]) / length_m.max(f64::MIN_POSITIVE);
        let growth = self.growth(length_m, bodies);
        let n = self.parts.len();
        let each = 1.0 / n as f64;
        let (stiffness_n_m, most_n) = (tool.stiffness_n_m * each, tool.max_force_n * each);
        for (i, part) in self.parts.iter_mut().enumerate() {
            let Some(front) = part else { continue };
            let body = &bodies[front.body];
            let hand = place(&edge, middle(i, n));
            let way = hand - front.place(body.body.positions());
            front.load = None;
            if !front.is_before(way, &along, BESIDE_CELLS * body.cell_m()) {
                if lifted(hand, front, &surfaces[front.body], body) {
                    *part = None;
                }
                continue;
            }
            let distance = way.norm();
            let normal = way / distance;
            let across = normal.cross(&along).norm();
            let resistance_n = toughness[front.body] * length_m * each * across * growth;
            front.load = Some(Load {
                normal,
                hand_m: normal.dot(&hand),
                stiffness_n_m,
                resistance_n,
                too_weak: resistance_n > most_n,
                across,
            });
            let kind = SpringKind::OneSided { normal, offset_m: normal.dot(&(hand - front.offset_m)) };
            let max_force_n = resistance_n.min(most_n);
            emit(front.body, PointSpring { point: front.point, kind, stiffness_n_m, max_force_n });
        }
    }

    /// Divides the edge into parts.
    fn divide(&mut self, length_m: f64, bodies: &[SimBody]) {
        let cell_m = bodies.iter().map(SimBody::cell_m).fold(f64::INFINITY, f64::min);
        let n = (length_m / (PART_CELLS * cell_m)).ceil().clamp(1.0, MOST_PARTS as f64) as usize;
        self.parts = vec![None; n];
        self.which.reserve(n);
        self.points.reserve(n);
        self.found.reserve(n);
    }

    /// Finds the material of fronts that went on, and of those whose body was cut.
    fn find_again(&mut self, surfaces: &[ContactSurface], bodies: &mut [SimBody]) {
        for (number, body) in bodies.iter_mut().enumerate() {
            self.which.clear();
            self.points.clear();
            let (epoch, ahead_m) = (body.epoch(), AHEAD * body.cell_m());
            let x = body.body.positions();
            for (i, part) in self.parts.iter().enumerate() {
                let Some(front) = part else { continue };
                if front.body == number && (front.moved || front.epoch != epoch) {
                    self.which.push(i);
                    self.points.push(front.place(x) + ahead_m * front.ahead);
                }
            }
            if self.which.is_empty() || body.body.is_being_cut() {
                continue;
            }
            body.body.material_at(&self.points, &mut self.found);
            let along = self.along(number);
            for ((&i, found), at) in self.which.iter().zip(&self.found).zip(&self.points) {
                let Some(front) = &mut self.parts[i] else { continue };
                match found {
                    Some(point) => {
                        let rest_m = point.position(body.body.rest_positions());
                        if front.moved && !front.turned {
                            self.report.area_m2 += (rest_m - front.rest_m).cross(&along).norm();
                        }
                        front.rest_m = rest_m;
                        let at = front.place(body.body.positions());
                        front.offset_m = at - point.position(body.body.positions());
                        (front.point, front.epoch) = (*point, epoch);
                        (front.moved, front.turned) = (false, false);
                    }
                    // Between the lips of a cut, and not out of the body: it keeps to the material that it had.
                    None if surfaces[number].whole().is_some_and(|tree| tree.contains(*at)) => {
                        front.moved = true
                    }
                    None => {
                        self.through |= front.ahead != V::zeros() && !front.turned;
                        self.parts[i] = None;
                    }
                }
            }
        }
    }

    /// A part of the edge as it lay in the material of `body` at rest [m].
    fn along(&self, body: usize) -> V {
        let n = self.parts.len();
        let mut inside = self.parts.iter().enumerate().filter_map(|(i, part)| Some((i, part.as_ref()?)));
        let mut inside = inside.by_ref().filter(|(_, front)| front.body == body);
        match (inside.next(), inside.last()) {
            (Some((i, first)), Some((j, last))) => (last.rest_m - first.rest_m) / (j - i) as f64,
            _ => self.hand.map_or(V::zeros(), |[tip, heel]| (heel - tip) / n as f64),
        }
    }

    /// Area at rest over area now of what the edge has passed. It is smoothed over an edge of one cell's way, for the
    /// element that a front presses says nothing about the tissue around.
    fn growth(&self, length_m: f64, bodies: &[SimBody]) -> f64 {
        let cell_m = bodies.iter().map(SimBody::cell_m).fold(f64::INFINITY, f64::min);
        let usual = length_m * cell_m;
        ((self.report.area_m2 + usual) / (self.passed_m2 + usual)).clamp(1.0 / MOST_GROWTH, MOST_GROWTH)
    }

    /// Lets parts in the air enter the tissue that they met on their way from one edge to the other, or that they are
    /// in when the blade `begins` to cut.
    fn enter(
        &mut self,
        (before, now): ([V; 2], [V; 2]),
        begins: bool,
        surfaces: &[ContactSurface],
        bodies: &mut [SimBody],
    ) {
        for (number, body) in bodies.iter_mut().enumerate() {
            let Some(tree) = surfaces[number].whole() else { continue };
            if body.body.is_being_cut() || !body.body.can_be_cut() {
                continue;
            }
            self.which.clear();
            self.points.clear();
            let ahead_m = AHEAD * body.cell_m();
            let n = self.parts.len();
            let along = (now[1] - now[0]).try_normalize(0.0).unwrap_or_default();
            for i in (0..n).filter(|&i| self.parts[i].is_none()) {
                let (from, to) = (place(&before, middle(i, n)), place(&now, middle(i, n)));
                let ray = CapsuleMotion { start: [from; 2], end: [to; 2], radius: 0.0 };
                let met = tree.sweep_moving(&ray).map(|impact| {
                    let corners = tree.triangle(impact.triangle);
                    let on = corners.iter().zip(impact.barycentric).map(|(p, w)| p * w).sum::<V>();
                    on - ahead_m * impact.normal
                });
                if let Some(at) = met.or(begins.then_some(to)) {
                    self.which.push(i);
                    self.points.push(at);
                }
            }
            if self.which.is_empty() {
                continue;
            }
            body.body.material_at(&self.points, &mut self.found);
            for (&i, found) in self.which.iter().zip(&self.found) {
                let Some(point) = found else { continue };
                // Unknown where the blade begins in tissue or is stabbed in, until it goes aside.
                let way = place(&now, middle(i, n)) - place(&before, middle(i, n));
                let aside = across(&way, &along);
                let open = aside.norm() > MOSTLY_ACROSS * way.norm().max(1e-12);
                let ahead = if open { aside.normalize() } else { V::zeros() };
                self.parts[i] = Some(Front {
                    body: number,
                    epoch: body.epoch(),
                    point: *point,
                    offset_m: V::zeros(),
                    ahead,
                    slit_m: (!open).then_some(0.0),
                    turned: false,
                    moved: false,
                    rest_m: point.position(body.body.rest_positions()),
                    load: None,
                });
            }
        }
    }

    /// Advances the fronts after the solve of a step, and tells `pressed` where they are.
    pub fn settle(&mut self, bodies: &[SimBody], pressed: &mut PressedEdge) {
        let Some(edge) = self.hand else { return };
        if let Some(before) = self.began.take() {
            pressed.enter(before);
        }
        let n = self.parts.len().max(1) as f64;
        let length_m = (edge[1] - edge[0]).norm() / n;
        let along = (edge[1] - edge[0]).try_normalize(0.0).unwrap_or_default();
        let was_inside = self.report.inside > 0.0;
        let (mut inside, mut most) = (0, 0.0f64);
        (self.report.load_n, self.report.resistance_n, self.report.loaded) = (0.0, 0.0, 0.0);
        for front in self.parts.iter_mut().flatten() {
            inside += 1;
            let Some(load) = &front.load else { continue };
            let place = front.place(bodies[front.body].body.positions());
            let extension = (load.hand_m - load.normal.dot(&place)).max(0.0);
            let s = if load.too_weak {
                0.0
            } else {
                (extension - load.resistance_n / load.stiffness_n_m).max(0.0)
            };
            self.report.load_n += (load.stiffness_n_m * extension).min(load.resistance_n);
            self.report.loaded += 1.0 / n;
            self.report.resistance_n += load.resistance_n;
            if s > 0.0 {
                self.passed_m2 += length_m * s * load.across;
                self.report.work_j += load.resistance_n * s;
                front.go(s * load.normal, &along);
                most = most.max(s);
            }
        }
        self.report.inside = f64::from(inside) / n;
        if inside > 0 {
            return pressed.advance(self.line(&edge, bodies), most);
        }
        if was_inside && self.through {
            // Out of the other side: the hand has nothing before it.
            pressed.advance(edge, (edge[1] - edge[0]).norm());
        }
        pressed.leave();
    }

    /// The straight edge that is nearest to all fronts and not ahead of any of them.
    fn line(&self, edge: &[V; 2], bodies: &[SimBody]) -> [V; 2] {
        let mut behind = Line::default();
        let n = self.parts.len();
        let fronts = || {
            let all = self.parts.iter().enumerate();
            all.filter_map(|(i, part)| Some((middle(i, n), part.as_ref()?)))
        };
        let lag = |s: f64, front: &Front| place(edge, s) - front.place(bodies[front.body].body.positions());
        fronts().for_each(|(s, front)| behind.add(s, lag(s, front)));
        let back = fronts().fold(V::zeros(), |back: V, (s, front)| {
            let ahead_m = (lag(s, front) - behind.at(s)).dot(&front.ahead);
            if ahead_m > back.norm() { ahead_m * front.ahead } else { back }
        });
        [edge[0] - behind.at(0.0) - back, edge[1] - behind.at(1.0) - back]
    }
}

/// Whether a hand has left the wound: skin lies between it and the front.
fn lifted(hand: V, front: &Front, surface: &ContactSurface, body: &SimBody) -> bool {
    let Some(tree) = surface.whole() else { return true };
    let to = front.place(body.body.positions());
    let ray = CapsuleMotion { start: [hand; 2], end: [to; 2], radius: 0.0 };
    let tags = &body.body.surface().tags;
    tree.sweep(&ray).is_some_and(|impact| tags.get(impact.triangle as usize) == Some(&0))
}

/// Least squares of vectors along an edge: c₀ + c₁ s.
#[derive(Debug, Default)]
struct Line {
    n: usize,
    sums: [f64; 2],
    of: [V; 2],
}

impl Line {
    fn add(&mut self, s: f64, value: V) {
        self.n += 1;
        self.sums = [self.sums[0] + s, self.sums[1] + s * s];
        self.of = [self.of[0] + value, self.of[1] + s * value];
    }

    fn at(&self, s: f64) -> V {
        if self.n == 0 {
            return V::zeros();
        }
        let n = self.n as f64;
        let (mean, centre) = (self.of[0] / n, self.sums[0] / n);
        let spread = self.sums[1] / n - centre * centre;
        if self.n < ENOUGH || spread <= 0.0 {
            return mean;
        }
        mean + (self.of[1] / n - centre * mean) / spread * (s - centre)
    }
}

/// The middle of part `i` of `n` along the edge, 0 at the tip and 1 at the heel.
fn middle(i: usize, n: usize) -> f64 {
    (i as f64 + 0.5) / n as f64
}

fn place([tip, heel]: &[V; 2], s: f64) -> V {
    tip + (heel - tip) * s
}
