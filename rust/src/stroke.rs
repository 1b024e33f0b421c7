//! Strokes drawn as a style says: several a line, run past their ends, unsteady, with gaps, tapered.

use crate::brush::{self, Dab};
use crate::camera::IMAGE;
use crate::random::Random;
use crate::style::LineStyle;
use crate::trace::{Point, Stroke, TraceConfig, trace};

/// Ink from here on is a line to be traced.
pub const LEAST_INK: u8 = 64;
/// Gaps are about so long.
const GAP: f64 = 10.0;
/// From point to point of a stroke, pixels.
pub const STEP: usize = 2;
/// And beyond its ends, where it is straight.
const BEYOND: f32 = 4.0;
/// Points over which the direction of a stroke is measured, on either side.
const REACH: usize = 3;
/// What is left of width and ink at the very end of a tapered stroke.
const TIP: [f64; 2] = [0.35, 0.45];

/// Draws a drawing [256, 256], ink 255 on 0, again. The same style and random numbers make the same drawing.
pub fn redraw(drawing: &[u8], style: &LineStyle, random: &mut Random, out: &mut [u8]) {
    assert_eq!(out.len(), IMAGE * IMAGE);
    if style.leaves_lines() {
        out.copy_from_slice(drawing);
        return;
    }
    let strokes = trace(drawing, LEAST_INK, TraceConfig { step: STEP, through: true });
    out.fill(0);
    put_down(vec![(strokes, style.clone())], style, random, out);
    finish(style, random, out);
}

/// Adds strokes to a drawing, each group in a style of its own, all of them placed as `style` says.
pub fn put_down(
    mut groups: Vec<(Vec<Stroke>, LineStyle)>,
    style: &LineStyle,
    random: &mut Random,
    out: &mut [u8],
) {
    place(groups.iter_mut().flat_map(|(strokes, _)| strokes), style, random);
    for (strokes, style) in groups {
        draw(strokes, &style, random, out);
    }
}

fn draw(strokes: Vec<Stroke>, style: &LineStyle, random: &mut Random, out: &mut [u8]) {
    let mut lines = Vec::with_capacity(strokes.len() * style.strokes as usize);
    for stroke in strokes {
        beside(stroke, style, random, &mut lines);
    }
    for line in &mut lines {
        overshoot(line, style.overshoot as f32);
        if style.wobble > 0.0 {
            wobble(line, style, random);
        }
    }
    let gone = gaps(&lines, style.gaps, style.width, random);
    for (line, gone) in lines.iter().zip(&gone) {
        let dabs = dabs(line, style, random);
        for run in runs(gone) {
            brush::draw(&dabs[run], style.antialias, out);
        }
    }
}

/// What the paper does, once all strokes are there.
pub fn finish(style: &LineStyle, random: &mut Random, out: &mut [u8]) {
    if style.noise > 0.0 {
        let key = (random.unit() * (1u64 << 53) as f64) as u64;
        brush::grain(out, style.noise, key);
    }
}

/// Scales and moves the whole drawing.
fn place<'a>(strokes: impl Iterator<Item = &'a mut Stroke>, style: &LineStyle, random: &mut Random) {
    let center = (IMAGE - 1) as f32 / 2.0;
    let (sin, cos) =
        if style.shift > 0.0 { (random.unit() * std::f64::consts::TAU).sin_cos() } else { (0.0, 0.0) };
    let by = [(style.shift * cos) as f32, (style.shift * sin) as f32];
    if style.scale != 1.0 || style.shift > 0.0 {
        for point in strokes.flat_map(|s| &mut s.points) {
            for axis in 0..2 {
                point[axis] = center + style.scale as f32 * (point[axis] - center) + by[axis];
            }
        }
    }
}

/// A line by several strokes side by side, none quite parallel to the next.
fn beside(stroke: Stroke, style: &LineStyle, random: &mut Random, lines: &mut Vec<Stroke>) {
    if style.strokes == 1 {
        lines.push(stroke);
        return;
    }
    let normals = normals(&stroke.points);
    let last = (stroke.points.len() - 1) as f64;
    for j in 0..style.strokes {
        let offset = (f64::from(j) - 0.5 * f64::from(style.strokes - 1)) * style.apart;
        let slant = if stroke.closed { 0.0 } else { random.around(0.5) * style.apart };
        let points = stroke.points.iter().zip(&normals).enumerate().map(|(i, (p, n))| {
            let by = (offset + slant * (2.0 * i as f64 / last - 1.0)) as f32;
            [p[0] + by * n[0], p[1] + by * n[1]]
        });
        lines.push(Stroke { points: points.collect(), closed: stroke.closed });
    }
}

/// Goes straight on at both ends.
fn overshoot(line: &mut Stroke, by: f32) {
    let by = by.min(0.5 * length(&line.points));
    if line.closed || by <= 0.0 {
        return;
    }
    let count = (by / BEYOND).ceil() as usize;
    for _ in 0..2 {
        let points = &mut line.points;
        let last = points.len() - 1;
        let (end, before) = (points[last], points[last - (2 * REACH).min(last)]);
        let [x, y] = unit([end[0] - before[0], end[1] - before[1]]);
        points.extend((1..=count).map(|k| {
            let far = by * k as f32 / count as f32;
            [end[0] + far * x, end[1] + far * y]
        }));
        points.reverse();
    }
}

/// Moves a line across itself by smooth noise.
fn wobble(line: &mut Stroke, style: &LineStyle, random: &mut Random) {
    let normals = normals(&line.points);
    let mut waves = Waves::new(style.wavelength, random);
    let mut at = 0.0;
    let mut before = line.points[0];
    for (point, normal) in line.points.iter_mut().zip(&normals) {
        at += distance(before, *point);
        before = *point;
        let by = style.wobble as f32 * waves.at(at, random);
        *point = [point[0] + by * normal[0], point[1] + by * normal[1]];
    }
}

/// Smooth noise between -1 and 1 along a line: random heights, mostly up and down in turn, eased between.
struct Waves {
    half: f64,
    from: f32,
    to: f32,
    heights: [f32; 2],
}

impl Waves {
    fn new(wavelength: f64, random: &mut Random) -> Self {
        let half = 0.5 * wavelength;
        let first = random.around(1.0) as f32;
        // Begins somewhere within a wave.
        let from = -(random.unit() * half) as f32;
        let mut waves = Self { half, from, to: from, heights: [first; 2] };
        waves.go_on(random);
        waves
    }

    fn go_on(&mut self, random: &mut Random) {
        let height = random.between([0.3, 1.0]) as f32;
        let turns = random.chance(0.85);
        let sign = if (self.heights[1] > 0.0) == turns { -1.0 } else { 1.0 };
        self.heights = [self.heights[1], sign * height];
        self.from = self.to;
        self.to += (self.half * random.between([0.7, 1.4])) as f32;
    }

    /// The height at a length that is no less than the one before.
    fn at(&mut self, length: f32, random: &mut Random) -> f32 {
        while length >= self.to {
            self.go_on(random);
        }
        let t = ((length - self.from) / (self.to - self.from)).clamp(0.0, 1.0);
        self.heights[0] + (self.heights[1] - self.heights[0]) * t * t * (3.0 - 2.0 * t)
    }
}

/// Lifts the pen at random places until that share of all length is gone: for each line, whether each piece between two
/// points is. A pen is round: a gap is begun and ended half its width early and late.
fn gaps(lines: &[Stroke], share: f64, width: f64, random: &mut Random) -> Vec<Vec<bool>> {
    let mut gone: Vec<Vec<bool>> = lines.iter().map(|l| vec![false; l.points.len() - 1]).collect();
    if share == 0.0 || lines.is_empty() {
        return gone;
    }
    let mut ends = Vec::with_capacity(lines.len());
    let mut total = 0.0;
    for line in lines {
        total += f64::from(length(&line.points));
        ends.push(total);
    }
    let mut lack = share * total;
    while lack > 0.0 {
        let place = random.unit() * total;
        let i = ends.partition_point(|&end| end <= place).min(lines.len() - 1);
        let long = (random.between([0.5, 1.5]) * GAP).min(lack);
        let begin = place - if i > 0 { ends[i - 1] } else { 0.0 } - 0.5 * long;
        let mut at = 0.0;
        let mut lost = 0.0;
        for (piece, pair) in gone[i].iter_mut().zip(lines[i].points.windows(2)) {
            let piece_long = f64::from(distance(pair[0], pair[1]));
            let middle = at + 0.5 * piece_long;
            at += piece_long;
            if middle >= begin + long + 0.5 * width {
                break;
            }
            if middle >= begin - 0.5 * width && !*piece {
                *piece = true;
                lost += piece_long;
            }
        }
        // A little each time, so that it comes to an end.
        lack -= (lost * long / (long + width)).max(0.25);
    }
    gone
}

/// The points of a line from gap to gap.
fn runs(gone: &[bool]) -> impl Iterator<Item = std::ops::Range<usize>> {
    let mut from = 0;
    gone.chunk_by(|a, b| a == b).filter_map(move |pieces| {
        let run = from..from + pieces.len() + 1;
        from += pieces.len();
        (!pieces[0]).then_some(run)
    })
}

/// How wide and how dark a line is from point to point.
fn dabs(line: &Stroke, style: &LineStyle, random: &mut Random) -> Vec<Dab> {
    let total = length(&line.points);
    let taper = if line.closed { 0.0 } else { (style.taper as f32).min(0.5 * total) };
    let noise = 0.5 * style.noise as f32;
    let mut pressure = (style.noise > 0.0).then(|| Waves::new(style.wavelength, random));
    let mut at = 0.0;
    let mut before = line.points[0];
    let mut dabs = Vec::with_capacity(line.points.len());
    for &point in &line.points {
        at += distance(before, point);
        before = point;
        let end = at.min(total - at).max(0.0);
        let full = if end < taper { end / taper } else { 1.0 };
        let full = full * (2.0 - full);
        let [thin, pale] = TIP.map(|tip| tip as f32 + (1.0 - tip as f32) * full);
        let pressed = pressure.as_mut().map_or(1.0, |p| 1.0 - noise * (0.5 + 0.5 * p.at(at, random)));
        dabs.push(Dab { at: point, width: style.width as f32 * thin, ink: pale * pressed });
    }
    dabs
}

fn distance(a: Point, b: Point) -> f32 {
    let (x, y) = (b[0] - a[0], b[1] - a[1]);
    (x * x + y * y).sqrt()
}

fn length(points: &[Point]) -> f32 {
    points.windows(2).map(|pair| distance(pair[0], pair[1])).sum()
}

fn unit([x, y]: Point) -> Point {
    let long = (x * x + y * y).sqrt().max(1e-9);
    [x / long, y / long]
}

/// A unit vector across a line at each of its points, smooth along it.
fn normals(points: &[Point]) -> Vec<Point> {
    let last = points.len() - 1;
    (0..=last)
        .map(|i| {
            let (a, b) = (points[i.saturating_sub(REACH)], points[(i + REACH).min(last)]);
            let [x, y] = unit([b[0] - a[0], b[1] - a[1]]);
            [-y, x]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bar() -> Vec<u8> {
        let mut ink = vec![0; IMAGE * IMAGE];
        ink[128 * IMAGE + 40..128 * IMAGE + 200].fill(255);
        ink
    }

    fn drawn(style: &LineStyle, seed: u64) -> Vec<u8> {
        let mut out = vec![0; IMAGE * IMAGE];
        redraw(&bar(), style, &mut Random::new(seed, 0, 0), &mut out);
        out
    }

    fn pen() -> LineStyle {
        LineStyle { antialias: true, ..LineStyle::default() }
    }

    fn inked(drawing: &[u8]) -> impl Iterator<Item = (usize, usize)> {
        drawing.iter().enumerate().filter(|&(_, &v)| v >= 64).map(|(i, _)| (i % IMAGE, i / IMAGE))
    }

    #[test]
    fn the_clean_style_and_a_straight_line_drawn_again_change_nothing() {
        assert_eq!(drawn(&LineStyle::default(), 1), bar());
        let again = drawn(&pen(), 1);
        assert!(inked(&again).eq(inked(&bar())));
    }

    #[test]
    fn wobble_reaches_its_amplitude_and_no_farther() {
        for amplitude in [1.0, 2.5, 4.0] {
            let farthest = (0..6)
                .flat_map(|seed| {
                    let out = drawn(&LineStyle { wobble: amplitude, ..pen() }, seed);
                    inked(&out).map(|(_, y)| (y as f64 - 128.0).abs()).collect::<Vec<_>>()
                })
                .fold(0.0, f64::max);
            assert!((0.7 * amplitude..=amplitude + 1.0).contains(&farthest), "{amplitude} {farthest}");
        }
    }

    #[test]
    fn gaps_take_their_share_of_the_length() {
        for share in [0.1, 0.25, 0.4] {
            let line = trace(&bar(), LEAST_INK, TraceConfig { step: 1, through: true });
            for seed in 0..5 {
                let gone = gaps(&line, share, 0.0, &mut Random::new(seed, 0, 0));
                let lost = gone[0].iter().filter(|&&g| g).count() as f64 / gone[0].len() as f64;
                assert!((lost - share).abs() < 0.03, "{share} {lost}");
            }
        }
    }

    #[test]
    fn overshoot_goes_straight_on() {
        let out = drawn(&LineStyle { overshoot: 14.0, ..pen() }, 1);
        assert!(inked(&out).all(|(_, y)| y == 128));
        assert_eq!(
            (inked(&out).map(|(x, _)| x).min(), inked(&out).map(|(x, _)| x).max()),
            (Some(26), Some(213))
        );
    }

    #[test]
    fn ends_are_tapered() {
        let out = drawn(&LineStyle { width: 3.0, taper: 30.0, ..pen() }, 1);
        let across = |x: usize| (0..IMAGE).map(|y| u32::from(out[y * IMAGE + x])).sum::<u32>();
        assert!(across(40) < 255 && across(60) > across(42) && across(120) == 3 * 255);
    }

    #[test]
    fn noise_is_ink_that_lacks() {
        let out = drawn(&LineStyle { noise: 0.6, ..pen() }, 1);
        let mean = inked(&bar()).map(|(x, y)| f64::from(out[y * IMAGE + x])).sum::<f64>() / 160.0;
        assert!((120.0..230.0).contains(&mean), "{mean}");
    }
}
