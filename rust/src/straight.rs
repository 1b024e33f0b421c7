//! The straight pieces of a drawing's lines, to a fraction of a pixel.
//!
//! Strokes are cut until each piece is straight to within a pixel. Then the ink's middle is taken across the piece at
//! every half pixel of its length, where nothing else crosses it, and a parabola is fitted through these: its slope is the
//! piece's direction, and by how much it bends says whether the piece is straight, or part of a curve.

use crate::camera::IMAGE;
use crate::trace::{Point, TraceConfig, trace};

/// A straight piece of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Pixels, x to the right, y down; a pixel's centre is half a pixel from its edges.
    pub ends: [[f64; 2]; 2],
    /// By how much the line bends between them: the coefficient of a parabola over [-1, 1], pixels.
    pub bend: f64,
}

/// Pixels of a piece are nearer to its line than this.
const STRAIGHT: f64 = 0.9;
/// Shorter pieces have no direction worth knowing; before they are measured, and after.
const SHORT: f64 = 8.0;
const SHORTEST: f64 = 10.0;
/// A piece that bends by more than this share of its length is of a curve.
const CURVED: f64 = 0.06;
/// The ink across a line is looked at as far as this to either side, at so many places.
const ACROSS: f64 = 2.5;
const PLACES: usize = 11;
/// The least number of places along a piece that it is measured by, and the share of its length that they span.
const FEWEST: usize = 10;
const SPANNED: f64 = 0.6;
const ROUNDS: usize = 3;

/// The straight pieces of a drawing [256, 256] whose ink is `least` or more.
pub fn straight(drawing: &[u8], least: u8) -> Vec<Piece> {
    let mut found = Vec::new();
    for stroke in trace(drawing, least, TraceConfig { step: 1, through: false }) {
        let points: Vec<[f64; 2]> = stroke.points.iter().map(|&p| centred(p)).collect();
        split(&points, &mut |from, to| found.extend(measured(drawing, from, to)));
    }
    found
}

fn centred([x, y]: Point) -> [f64; 2] {
    [f64::from(x) + 0.5, f64::from(y) + 0.5]
}

/// Cuts a line where it is furthest from its chord, until each part is straight.
fn split(points: &[[f64; 2]], found: &mut impl FnMut([f64; 2], [f64; 2])) {
    let n = points.len();
    if n < 4 {
        return;
    }
    let (first, last) = (points[0], points[n - 1]);
    let chord = [last[0] - first[0], last[1] - first[1]];
    let length = chord[0].hypot(chord[1]);
    if length < SHORT {
        // One that returns to where it began is long all the same.
        if n as f64 > 3.0 * SHORT {
            split(&points[..=n / 2], found);
            split(&points[n / 2..], found);
        }
        return;
    }
    let inner = if n > 8 { &points[1..n - 1] } else { points };
    let (middle, along) = line_through(inner);
    let off = |p: &[f64; 2]| (along[0] * (p[1] - middle[1]) - along[1] * (p[0] - middle[0])).abs();
    if points.iter().all(|p| off(p) <= STRAIGHT) {
        let places = inner.iter().map(|p| along[0] * (p[0] - middle[0]) + along[1] * (p[1] - middle[1]));
        let (low, high) = places.fold((f64::MAX, f64::MIN), |(l, h), t| (l.min(t), h.max(t)));
        if high - low >= SHORT {
            let at = |t: f64| [middle[0] + t * along[0], middle[1] + t * along[1]];
            found(at(low), at(high));
        }
        return;
    }
    let from_chord = |p: &[f64; 2]| (chord[0] * (p[1] - first[1]) - chord[1] * (p[0] - first[0])).abs();
    let mut cut = 0;
    for (i, point) in points.iter().enumerate() {
        if from_chord(point) > from_chord(&points[cut]) {
            cut = i;
        }
    }
    if cut < 3 || cut + 4 > n {
        cut = n / 2;
    }
    split(&points[..=cut], found);
    split(&points[cut..], found);
}

/// The middle of points, and the direction of the line through them that is nearest to all.
fn line_through(points: &[[f64; 2]]) -> ([f64; 2], [f64; 2]) {
    let n = points.len() as f64;
    let middle = [0, 1].map(|axis| points.iter().map(|p| p[axis]).sum::<f64>() / n);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for p in points {
        let (x, y) = (p[0] - middle[0], p[1] - middle[1]);
        xx += x * x;
        xy += x * y;
        yy += y * y;
    }
    let (sin, cos) = (0.5 * (2.0 * xy).atan2(xx - yy)).sin_cos();
    (middle, [cos, sin])
}

/// The ink's middle across a line, and how much of it there is and how widely it is spread.
struct Section {
    along: f64,
    middle: f64,
    ink: f64,
    spread: f64,
}

/// The piece between two points, measured by the ink along it; none if it cannot be, or is curved.
fn measured(drawing: &[u8], from: [f64; 2], to: [f64; 2]) -> Option<Piece> {
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    let length = dx.hypot(dy);
    let (along, across) = ([dx / length, dy / length], [-dy / length, dx / length]);
    let count = (2.0 * (length - 1.99)).ceil().max(0.0) as usize;
    let sections: Vec<Section> = (0..count)
        .map(|i| {
            let t = 1.0 + 0.5 * i as f64;
            section(drawing, [from[0] + t * along[0], from[1] + t * along[1]], across, 2.0 * t / length - 1.0)
        })
        .collect();
    let (ink, spread) = (median(sections.iter().map(|s| s.ink))?, median(sections.iter().map(|s| s.spread))?);
    let mut kept: Vec<bool> = sections
        .iter()
        .map(|s| s.ink > 0.3 * ink && s.ink < 1.35 * ink && s.spread < 1.3 * spread + 0.1)
        .collect();
    let held = |kept: &[bool]| kept.iter().filter(|&&k| k).count();
    if held(&kept) < FEWEST {
        return None;
    }
    let mut bow = [0.0; 3];
    for _ in 0..ROUNDS {
        bow = parabola(sections.iter().zip(&kept).filter(|(_, k)| **k).map(|(s, _)| (s.along, s.middle)))?;
        let off: Vec<f64> = sections
            .iter()
            .map(|s| (s.middle - bow[0] - bow[1] * s.along - bow[2] * (s.along * s.along - 1.0 / 3.0)).abs())
            .collect();
        let usual = median(off.iter().zip(&kept).filter(|(_, k)| **k).map(|(&o, _)| o))?;
        let fewer: Vec<bool> =
            kept.iter().zip(&off).map(|(&k, &o)| k && o < (2.5 * usual).max(0.2)).collect();
        if fewer == kept || held(&fewer) < FEWEST {
            break;
        }
        kept = fewer;
    }
    let places = sections.iter().zip(&kept).filter(|(_, k)| **k).map(|(s, _)| s.along);
    let (low, high) = places.fold((f64::MAX, f64::MIN), |(l, h), t| (l.min(t), h.max(t)));
    let aside = |point: [f64; 2], by: f64| [point[0] + by * across[0], point[1] + by * across[1]];
    let ends = [aside(from, bow[0] - bow[1]), aside(to, bow[0] + bow[1])];
    let (long, bend) = ((ends[1][0] - ends[0][0]).hypot(ends[1][1] - ends[0][1]), bow[2].abs());
    (high - low >= 2.0 * SPANNED && long >= SHORTEST && bend < CURVED * long).then_some(Piece { ends, bend })
}

fn section(drawing: &[u8], center: [f64; 2], across: [f64; 2], along: f64) -> Section {
    let (mut ink, mut first, mut second) = (0.0, 0.0, 0.0);
    for place in 0..PLACES {
        let off = ACROSS * (2.0 * place as f64 / (PLACES - 1) as f64 - 1.0);
        let value = value_at(drawing, center[0] + off * across[0], center[1] + off * across[1]);
        ink += value;
        first += value * off;
        second += value * off * off;
    }
    let middle = first / ink.max(1e-9);
    Section { along, middle, ink, spread: (second / ink.max(1e-9) - middle * middle).max(0.0).sqrt() }
}

/// A drawing between its pixels' centres; beyond them, nothing.
fn value_at(drawing: &[u8], x: f64, y: f64) -> f64 {
    let (x, y) = (x - 0.5, y - 0.5);
    let (left, top) = (x.floor(), y.floor());
    let (u, v) = (x - left, y - top);
    let pixel = |column: f64, row: f64| {
        let side = IMAGE as f64;
        if column < 0.0 || row < 0.0 || column >= side || row >= side {
            return 0.0;
        }
        f64::from(drawing[row as usize * IMAGE + column as usize])
    };
    (1.0 - v) * ((1.0 - u) * pixel(left, top) + u * pixel(left + 1.0, top))
        + v * ((1.0 - u) * pixel(left, top + 1.0) + u * pixel(left + 1.0, top + 1.0))
}

/// The mean of the middle two, or the middle one.
fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    (n > 0).then(|| 0.5 * (sorted[n / 2] + sorted[(n - 1) / 2]))
}

/// Least squares for `a + b u + c (u^2 - 1/3)`.
fn parabola(points: impl Iterator<Item = (f64, f64)>) -> Option<[f64; 3]> {
    let mut normal = glam::DMat3::ZERO;
    let mut right = glam::DVec3::ZERO;
    for (u, value) in points {
        let row = glam::DVec3::new(1.0, u, u * u - 1.0 / 3.0);
        normal += glam::DMat3::from_cols(row * row.x, row * row.y, row * row.z);
        right += row * value;
    }
    (normal.determinant().abs() > 1e-9).then(|| (normal.inverse() * right).to_array())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line a pixel and a half wide, its edges smooth.
    fn drawn(from: [f64; 2], to: [f64; 2], bend: f64) -> Vec<u8> {
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let length = dx.hypot(dy);
        let mut drawing = vec![0; IMAGE * IMAGE];
        for (i, pixel) in drawing.iter_mut().enumerate() {
            let (x, y) = ((i % IMAGE) as f64 + 0.5 - from[0], (i / IMAGE) as f64 + 0.5 - from[1]);
            let t = (x * dx + y * dy) / length;
            let u = 2.0 * t / length - 1.0;
            let off = ((y * dx - x * dy) / length - bend * (1.0 - u * u)).abs();
            if (0.0..=length).contains(&t) {
                *pixel = (255.0 * (1.25 - off).clamp(0.0, 1.0)) as u8;
            }
        }
        drawing
    }

    #[test]
    fn a_line_of_any_slope_is_found_to_a_tenth_of_a_pixel_and_its_direction_better() {
        for degrees in (0..180).step_by(13) {
            let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
            let (from, to) =
                ([120.3 - 40.0 * cos, 130.7 - 40.0 * sin], [120.3 + 40.0 * cos, 130.7 + 40.0 * sin]);
            let pieces = straight(&drawn(from, to, 0.0), 64);
            assert_eq!(pieces.len(), 1, "{degrees} degrees");
            let off = pieces[0].ends.map(|end| (end[1] - from[1]) * cos - (end[0] - from[0]) * sin);
            assert!(
                off.iter().all(|o| o.abs() < 0.1) && (off[0] - off[1]).abs() < 0.03,
                "{degrees} degrees: {off:?}"
            );
            let [a, b] = pieces[0].ends;
            let long = (b[0] - a[0]).hypot(b[1] - a[1]);
            assert!(long > 60.0 && pieces[0].bend < 0.15, "{degrees} degrees: {long} px, {}", pieces[0].bend);
        }
    }

    #[test]
    fn a_bow_says_so() {
        let pieces = straight(&drawn([60.0, 100.0], [160.0, 120.0], 0.6), 64);
        assert_eq!(pieces.len(), 1);
        assert!((pieces[0].bend - 0.6).abs() < 0.1, "{}", pieces[0].bend);
    }

    #[test]
    fn what_crosses_a_line_does_not_turn_it() {
        let mut drawing = drawn([40.0, 90.0], [210.0, 120.0], 0.0);
        for (pixel, other) in drawing.iter_mut().zip(drawn([100.0, 60.0], [112.0, 180.0], 0.0)) {
            *pixel = (*pixel).max(other);
        }
        let slope = (30.0_f64 / 170.0).atan();
        let along: Vec<_> = straight(&drawing, 64)
            .into_iter()
            .map(|p| (p.ends[1][1] - p.ends[0][1]).atan2(p.ends[1][0] - p.ends[0][0]))
            .filter(|angle| (angle.tan() - slope.tan()).abs() < 0.2)
            .collect();
        assert_eq!(along.len(), 2, "the line before the crossing, and after it");
        assert!(along.iter().all(|a| (a.tan() - slope.tan()).abs() < 0.004), "{along:?}");
    }

    #[test]
    fn nothing_is_straight_in_an_empty_drawing_or_a_circle() {
        assert!(straight(&vec![0; IMAGE * IMAGE], 64).is_empty());
        let mut ring = vec![0; IMAGE * IMAGE];
        for (i, pixel) in ring.iter_mut().enumerate() {
            let (x, y) = ((i % IMAGE) as f64 - 128.0, (i / IMAGE) as f64 - 128.0);
            if (x.hypot(y) - 14.0).abs() < 0.8 {
                *pixel = 255;
            }
        }
        assert!(straight(&ring, 64).iter().all(|p| p.bend > 0.2));
    }
}
