use nalgebra::Vector3;

use super::*;

type V = Vector3<f64>;

fn roller(x: f64, y: f64, z: f64) -> Held {
    Held::along(V::new(x, y, z)).unwrap()
}

#[test]
fn directions_become_axes_where_they_are_axes() {
    assert_eq!(roller(0.0, -3.0, 0.0), Held::Axes([false, true, false]));
    assert_eq!(Held::across(V::new(0.0, 0.0, 1e-300)), Some(Held::Axes([true, true, false])));
    for nothing in [V::zeros(), V::repeat(f64::NAN), V::new(f64::INFINITY, 0.0, 0.0)] {
        assert_eq!((Held::along(nothing), Held::across(nothing)), (None, None));
    }
}

#[test]
fn the_filter_is_a_projection_that_leaves_what_is_free() {
    let (n, t) = (V::new(1.0, 2.0, -2.0) / 3.0, V::new(2.0, -2.0, -1.0) / 3.0);
    for (held, free, count) in [(Held::Along(n.into()), t, 1), (Held::Across(t.into()), t, 2)] {
        let P = held.filter();
        assert!((P * P - P).norm() < 1e-15 && (P - P.transpose()).norm() == 0.0);
        assert!((P * free - free).norm() < 1e-15 && (P * n).norm() < 1e-15);
        assert_eq!((held.count(), held.directions().count()), (count, count));
        let H: Matrix3<f64> = held.directions().map(|e| e * e.transpose()).sum();
        assert!((H - held.projection()).norm() < 1e-15);
        let (mut v, mut padded) = (V::new(0.3, 0.1, 0.7), [0.3, 0.1, 0.7, 0.0]);
        held.clear(&mut v);
        held.clear_padded(&mut padded);
        assert!((0..3).all(|k| (f64::from(padded[k]) - v[k]).abs() < 1e-7) && v.dot(&n).abs() < 1e-16);
    }
}

#[test]
fn a_placed_point_keeps_its_bits() {
    let held = roller(0.3, -0.8, 0.52);
    for scale in [1e-9, 1.0, 1e6] {
        let target = [scale, 2.0 * scale, -0.1 * scale];
        let mut x = V::new(0.7, -0.1, 0.33) * scale;
        held.place(&mut x, &target);
        let placed = x;
        held.place(&mut x, &target);
        assert_eq!(x, placed);
        assert!(held.part_of(&(placed - V::from(target))).norm() < 1e-14 * scale);
    }
}

#[test]
fn two_rollers_make_a_rail_and_three_a_clamp() {
    let (a, b) = (roller(1.0, 1.0, 0.0), roller(0.0, 1.0, 1.0));
    let (da, db) = (V::new(0.1, 0.3, 0.0), V::new(0.0, -0.2, 0.5));
    let (rail, d) = a.with(&da, &b, &db);
    assert!(matches!(rail, Held::Across(_)));
    assert!(rail.covers(&a) && rail.covers(&b) && !a.covers(&rail));
    assert!(a.part_of(&(d - da)).norm() < 1e-15 && b.part_of(&(d - db)).norm() < 1e-15);
    let (clamp, e) = rail.with(&d, &Held::Axes([true, false, false]), &V::new(7.0, 0.0, 0.0));
    assert_eq!(clamp, Held::FULLY);
    assert!((e.x - 7.0).abs() < 1e-14 && rail.part_of(&(e - d)).norm() < 1e-14);
    // The same direction again replaces what was asked.
    let (same, d) = a.with(&da, &a, &V::zeros());
    assert!(same.covers(&a) && same.count() == 1 && d.norm() < 1e-15);
    let free = Held::NOT.with(&V::zeros(), &a, &da);
    assert!(free.0.covers(&a) && (free.1 - a.part_of(&da)).norm() < 1e-15);
}

#[test]
fn shared_directions_are_those_held_by_both() {
    let (a, b) = (roller(1.0, 1.0, 0.0), roller(0.0, 1.0, 1.0));
    let rails = [V::new(1.0, -1.0, 3.0), V::new(1.0, -1.0, -1.0)].map(|t| Held::across(t).unwrap());
    assert_eq!(a.shared(&b), Held::NOT);
    assert_eq!((a.shared(&Held::FULLY), a.shared(&rails[0]), Held::NOT.shared(&a)), (a, a, Held::NOT));
    let both = rails[0].shared(&rails[1]);
    assert!(both.count() == 1 && rails.iter().all(|rail| rail.covers(&both)));
}
