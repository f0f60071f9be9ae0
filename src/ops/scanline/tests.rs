//! Chords along lines, and where lines end.

use super::*;

fn follow(tolerance: Tolerance, line: &[Position]) -> Vec<f32> {
    let order: Vec<u32> = (0..line.len() as u32).collect();
    let mut distances = vec![f32::NAN; line.len()];
    tolerance.follow(&order, line, &mut distances);
    distances
}

fn within(distance: f64, cosine: Option<f64>) -> Tolerance {
    Tolerance { distance2: distance * distance, cosine, gap2: u128::MAX }
}

fn kept(distances: &[f32]) -> Vec<usize> {
    (0..distances.len()).filter(|&n| distances[n].is_nan()).collect()
}

#[test]
fn a_straight_line_keeps_its_ends_and_a_corner_stays() {
    let straight: Vec<Position> = (0..100).map(|x| [10 * x, 0, 0]).collect();
    assert_eq!(kept(&follow(within(0.1, None), &straight)), [0, 99]);
    let corner: Vec<Position> =
        (0..100).map(|n: i64| [10 * n.min(50), 10 * (n - 50).max(0), 0]).collect();
    assert_eq!(kept(&follow(within(3.0, None), &corner)), [0, 50, 99]);
    let long: Vec<Position> = (0..1000).map(|x| [10 * x, 0, 0]).collect();
    assert_eq!(kept(&follow(within(0.1, None), &long)), [0, 256, 512, 768, 999]);
    assert_eq!(kept(&follow(within(1.0, None), &straight[..1])), [0]);
    assert_eq!(kept(&follow(within(1.0, None), &straight[..2])), [0, 1]);
}

#[test]
fn what_goes_is_within_the_tolerance_of_its_chord() {
    let wave = |n: i64| [10 * n, (300.0 * (n as f64 / 9.0).sin()) as i64, 0];
    let line: Vec<Position> = (0..400).map(wave).collect();
    for most in [1.0, 5.0, 40.0] {
        let distances = follow(within(most, None), &line);
        assert!(distances.iter().all(|d| d.is_nan() || f64::from(*d) <= most));
        assert!(kept(&distances).len() < 300, "{most}");
    }
    let fewer = kept(&follow(within(40.0, None), &line)).len();
    let by_angle = kept(&follow(within(40.0, Some(libm::cos(0.2))), &line)).len();
    assert!(by_angle > fewer, "an angle keeps {by_angle}, none {fewer}");
}

/// What one tile gathered.
struct OneTile(Rows<LinePoint>);

impl Gathered<Rows<LinePoint>> for OneTile {
    fn each(&self, visit: &mut dyn FnMut(Rows<LinePoint>) -> Result<()>) -> Result<()> {
        visit(self.0.clone())
    }

    fn records(&self) -> u64 {
        self.0.positions.len() as u64
    }
}

#[test]
fn lines_end_behind_their_edges_whether_the_first_point_is_one_or_not() {
    for begins_with_edge in [false, true] {
        // Three sweeps of ten points, side by side, that all go one way.
        let point = |n: i64| {
            let is_edge = n % 10 == 9 || begins_with_edge && n % 10 == 0;
            LinePoint { along: n as f64, ends: [7, 0, 0, u32::from(is_edge), 0], unused: 0 }
        };
        let mut all: Vec<(Position, LinePoint)> =
            (0..30).map(|n| ([n % 10 * 5, n / 10 * 9, 0], point(n))).collect();
        all.sort_by(|a, b| crate::geom::morton::morton_cmp(&a.0, &b.0));
        let (positions, values) = all.into_iter().unzip();
        let tile = OneTile(Rows { positions, values });
        let mut stage: Scanline = toml::from_str("max_distance = 1").unwrap();
        stage.settled = Some(within(0.5, None));
        stage.conclude(&tile).unwrap();
        let found = stage.found.unwrap();
        assert_eq!(found.lines, 3);
        assert_eq!(kept(&found.rows.values).len(), 6, "two ends of each line");
    }
}

#[test]
fn a_chord_that_turns_back_measures_to_its_ends() {
    assert_eq!(chord_distance2([0; 3], [10, 0, 0], [-3, 4, 0]), 25.0);
    assert_eq!(chord_distance2([0; 3], [10, 0, 0], [13, 4, 0]), 25.0);
    assert_eq!(chord_distance2([0; 3], [10, 0, 0], [5, 4, 0]), 16.0);
}

#[test]
fn keys_that_mean_nothing_are_refused() {
    let read = toml::from_str::<Scanline>;
    assert_eq!(read("max_distance = 0.1").unwrap().lines, ends_of_las());
    assert!(read("max_distance = '2 cm'\nmax_angle = '5deg'\nlines = []\ngap = 1").is_ok());
    for wrong in
        ["", "max_distance = 0", "max_distance = 1\ngap = -1", "max_distance = 1\nlines = ['z']"]
    {
        assert!(read(wrong).is_err(), "{wrong}");
    }
    let twice = read("max_distance = 1\nlines = ['edge', 'edge']").unwrap();
    assert!(twice.build(&StagePlace::new("test", 1)).is_err());
}

#[test]
fn rows_of_an_organised_scan_are_lines_in_the_order_of_columns() {
    // Four rows of 20 columns, of which some are missing; times would tell nothing.
    let mut all: Vec<(Position, LinePoint)> = Vec::new();
    for row in 0..4 {
        for column in (0..20).filter(|column| (row * 7 + column) % 6 != 3) {
            let bend = if column > 9 { 3 * (column - 9) } else { 0 };
            let point =
                LinePoint { along: column as f64, ends: [0, 0, 0, 0, row as u32], unused: 0 };
            all.push(([column * 5, row * 9, bend], point));
        }
    }
    all.sort_by(|a, b| crate::geom::morton::morton_cmp(&a.0, &b.0));
    let (positions, values) = all.into_iter().unzip();
    let mut stage: Scanline = toml::from_str("max_distance = 1\nlines = ['row']").unwrap();
    let needs = stage.gather_needs();
    assert!(needs.does_read(&COLUMN) && !needs.does_read(&TIME));
    stage.settled = Some(within(1.0, None));
    stage.conclude(&OneTile(Rows { positions, values })).unwrap();
    let found = stage.found.unwrap();
    assert_eq!(found.lines, 4);
    let kept = kept(&found.rows.values).len();
    assert!((12..=16).contains(&kept), "two ends of each row and its bend: {kept}");
}
