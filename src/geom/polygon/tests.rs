use super::*;

/// Whole numbers by a generator of their own.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, n: i64) -> i64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963);
        ((self.0 >> 33) as i64).rem_euclid(n)
    }
}

type Rings = Vec<Vec<[i64; 2]>>;

/// In whole numbers, by the edges that a ray towards smaller x meets, counted at their upper ends.
fn is_in(rings: &Rings, [x, y]: [i64; 2]) -> bool {
    let mut met = 0;
    for ring in rings {
        for (n, &a) in ring.iter().enumerate() {
            let b = ring[(n + 1) % ring.len()];
            let ([ax, ay], [bx, by]) = if a[1] <= b[1] { (a, b) } else { (b, a) };
            let cross = (bx - ax) * (y - ay) - (by - ay) * (x - ax);
            let within = ax.min(bx) <= x && x <= ax.max(bx) && ay <= y && y <= by;
            if cross == 0 && within {
                return true;
            }
            // At height y the edge is at ax + (y - ay) (bx - ax) / (by - ay), which is below x.
            if ay < y && y <= by && (y - ay) * (bx - ax) < (x - ax) * (by - ay) {
                met += 1;
            }
        }
    }
    met % 2 == 1
}

fn area(polygons: &[Rings]) -> Area {
    let ring = |ring: &Vec<[i64; 2]>| ring.iter().map(|p| p.map(|v| v as f64)).collect();
    let polygons: Vec<PolygonRings> =
        polygons.iter().map(|rings| rings.iter().map(ring).collect()).collect();
    Area::of(&polygons)
}

#[test]
fn what_is_in_is_what_whole_numbers_say_borders_corners_and_holes_included() {
    let mut numbers = Numbers(3);
    let (mut inside, mut outside, mut borders) = (0, 0, 0);
    for case in 0..600 {
        let size = [4, 9, 30][case % 3];
        let polygons: Vec<Rings> = (0..1 + numbers.below(3))
            .map(|_| {
                (0..1 + numbers.below(2))
                    .map(|_| {
                        let corners = 3 + numbers.below(if case % 5 == 0 { 40 } else { 6 });
                        (0..corners).map(|_| [numbers.below(size), numbers.below(size)]).collect()
                    })
                    .collect()
            })
            .collect();
        let area = area(&polygons);
        for x in -1..=size {
            for y in -1..=size {
                let expected = polygons.iter().any(|rings| is_in(rings, [x, y]));
                let point = [x as f64, y as f64];
                assert_eq!(area.contains(point), expected, "{point:?} of {polygons:?}");
                inside += usize::from(expected);
                outside += usize::from(!expected);
                let on = |edge: &PolygonEdge| edge.side(point) == EdgeSide::On;
                borders += usize::from(area.edges.iter().any(on));
            }
        }
    }
    assert!(
        inside > 10_000 && outside > 10_000 && borders > 10_000,
        "{inside} {outside} {borders}"
    );
}

#[test]
fn a_hole_is_outside_and_its_border_is_in() {
    let square = |lo: i64, hi: i64| vec![[lo, lo], [hi, lo], [hi, hi], [lo, hi]];
    let area = area(&[vec![square(0, 9), square(3, 6)], vec![square(20, 22)]]);
    for (point, expected) in [
        ([1.0, 1.0], true),
        ([4.0, 4.0], false),
        ([3.0, 4.0], true),
        ([3.0 - 1e-15, 4.0], true),
        ([3.0 + 1e-15, 4.0], false),
        ([9.0, 9.0], true),
        ([9.000_000_1, 9.0], false),
        ([21.0, 21.5], true),
        ([15.0, 21.0], false),
        ([f64::NAN, 4.0], false),
        ([1.0, f64::INFINITY], false),
    ] {
        assert_eq!(area.contains(point), expected, "{point:?}");
    }
}

#[test]
fn the_border_is_exact_to_the_last_bit() {
    // On the line from the origin to (3e15 + 1, 1e15): a product of these has too many digits.
    let far = [3e15 + 1.0, 1e15];
    let area = Area::of(&[vec![vec![[0.0, 0.0], far, [0.0, 1e15]]]]);
    let half = far.map(|v| v / 2.0);
    assert!(area.contains(far) && area.contains(half));
    assert!(!area.contains([half[0].next_up(), half[1]]));
    assert!(area.contains([half[0].next_down(), half[1]]));
}

#[test]
fn rings_that_cross_themselves_are_found_and_those_that_touch_are_not() {
    let crossing = |rings: Rings| area(&[rings]).crossing().is_some();
    assert!(crossing(vec![vec![[0, 0], [4, 4], [4, 0], [0, 4]]]));
    assert!(!crossing(vec![vec![[0, 0], [4, 0], [4, 4], [0, 4]]]));
    // A hole that touches the outer ring in a corner, and one that reaches beyond it.
    let outer = vec![[0, 0], [9, 0], [9, 9], [0, 9]];
    assert!(!crossing(vec![outer.clone(), vec![[0, 0], [4, 2], [2, 4]]]));
    assert!(crossing(vec![outer.clone(), vec![[5, 5], [12, 5], [5, 7]]]));
    // Two polygons may lie over each other: what is in both is in.
    let both = area(&[vec![outer], vec![vec![[5, 5], [12, 5], [5, 7]]]]);
    assert!(both.crossing().is_none() && both.contains([6.0, 5.5]));
}
