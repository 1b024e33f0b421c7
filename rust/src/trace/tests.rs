use super::*;

const FINE: TraceConfig = TraceConfig { step: 1, through: false };

fn with_ink(inked: impl Fn(i32, i32) -> bool) -> Vec<u8> {
    (0..IMAGE * IMAGE).map(|i| if inked((i % IMAGE) as i32, (i / IMAGE) as i32) { 255 } else { 0 }).collect()
}

#[test]
fn a_square_has_four_sides_that_meet_at_its_corners() {
    let on = |x: i32, y: i32| (60..=180).contains(&x) && (60..=180).contains(&y);
    let inner = |x: i32, y: i32| (61..180).contains(&x) && (61..180).contains(&y);
    let strokes = trace(&with_ink(|x, y| on(x, y) && !inner(x, y)), 64, FINE);
    assert_eq!(strokes.len(), 4);
    for stroke in &strokes {
        assert_eq!(stroke.points.len(), 121);
        for end in [stroke.points[0], stroke.points[120]] {
            assert!(end.iter().all(|&v| v == 60.0 || v == 180.0), "{end:?}");
        }
    }
}

#[test]
fn a_thick_disc_ring_is_one_closed_line() {
    let strokes = trace(
        &with_ink(|x, y| {
            let d = (x - 128).pow(2) + (y - 120).pow(2);
            (58 * 58..62 * 62).contains(&d)
        }),
        64,
        FINE,
    );
    assert_eq!(strokes.len(), 1);
    assert!(strokes[0].closed && strokes[0].points.first() == strokes[0].points.last());
    for [x, y] in &strokes[0].points {
        assert!(((x - 128.0).hypot(y - 120.0) - 60.0).abs() < 1.5);
    }
}

#[test]
fn a_drop_with_one_corner_is_a_line_all_around() {
    // A ring, and above it two lines that meet in a point, where they leave it.
    let (half, high) = (42.0 / 2f64.sqrt(), 42.0 * 2f64.sqrt());
    let ring = |x: f64, y: f64| {
        let d = x.hypot(y);
        (41.0..43.0).contains(&d) && y > -half
    };
    let sides = |x: f64, y: f64| y <= -half && (y + high - x.abs()).abs() < 1.0;
    let drop = with_ink(|x, y| {
        let (x, y) = (f64::from(x - 128), f64::from(y - 120));
        ring(x, y) || sides(x, y)
    });
    for through in [false, true] {
        let strokes = trace(&drop, 64, TraceConfig { step: 2, through });
        let [stroke] = &strokes[..] else { panic!("{} strokes", strokes.len()) };
        let [x, y] = stroke.points[0];
        assert!(!stroke.closed && (x - 128.0).abs() < 2.0 && (y - (120.0 - high as f32)).abs() < 2.5);
        let lowest = stroke.points.iter().map(|p| p[1]).fold(0.0, f32::max);
        assert!((lowest - 162.0).abs() < 2.0, "{lowest}");
    }
}

#[test]
fn lines_go_on_through_crossings_if_asked() {
    let cross = with_ink(|x, y| (y == 128 && (50..200).contains(&x)) || (x == 120 && (40..220).contains(&y)));
    assert_eq!(trace(&cross, 64, FINE).len(), 4);
    let strokes = trace(&cross, 64, TraceConfig { step: 2, through: true });
    assert_eq!(strokes.len(), 2);
    let tee = with_ink(|x, y| (y == 128 && (50..200).contains(&x)) || (x == 120 && (128..220).contains(&y)));
    let strokes = trace(&tee, 64, TraceConfig { step: 2, through: true });
    assert_eq!(strokes.len(), 2);
}

#[test]
fn corners_near_each_other_are_two() {
    // A bar of six pixels between two long slanted lines.
    let strokes = trace(
        &with_ink(|x, y| {
            (y == 200 && (100..=106).contains(&x)) || ((100..200).contains(&y) && (x == 100 || x == 106))
        }),
        64,
        FINE,
    );
    let mut lengths: Vec<usize> = strokes.iter().map(|s| s.points.len() - 1).collect();
    lengths.sort_unstable();
    assert_eq!(lengths, [6, 100, 100]);
}

#[test]
fn slanted_lines_that_touch_everywhere_are_one() {
    let strokes = trace(
        &with_ink(|x, y| (50..150).contains(&y) && (x == y || x == y + 2)),
        64,
        TraceConfig { step: 1, through: true },
    );
    let long: usize = strokes.iter().map(|s| s.points.len()).sum();
    assert!((95..=110).contains(&long), "{long}");
}

#[test]
fn nothing_and_everything_can_be_traced() {
    assert!(trace(&[0; IMAGE * IMAGE], 64, FINE).is_empty());
    let all = trace(&[255; IMAGE * IMAGE], 64, FINE);
    assert!(all.iter().flat_map(|s| &s.points).flatten().all(|v| v.is_finite()));
}
