//! Lines as a person puts them down: bent, of some width, with gaps, running past their corners.

use crate::camera::IMAGE;
use crate::distance::squared_distance;
use crate::random::Random;
use serde::{Deserialize, Serialize};

/// How far a drawing is from a renderer's. Lengths in pixels of the 256^2 image; pairs are ranges drawn from evenly.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct PenConfig {
    /// Width of the lines.
    pub width: [f64; 2],
    /// Largest displacement of the smooth random field that bends the drawing.
    pub bend: [f64; 2],
    /// Distance between the independent values of that field.
    pub wavelength: [f64; 2],
    /// How many gaps, and their lengths.
    pub gaps: [f64; 2],
    pub gap_length: [f64; 2],
    /// How many line ends run past their corner, and how far.
    pub overshoots: [f64; 2],
    pub overshoot_length: [f64; 2],
}

impl Default for PenConfig {
    fn default() -> Self {
        Self {
            width: [1.0, 3.0],
            bend: [0.0, 3.0],
            wavelength: [24.0, 96.0],
            gaps: [0.0, 6.0],
            gap_length: [2.0, 9.0],
            overshoots: [0.0, 12.0],
            overshoot_length: [2.0, 10.0],
        }
    }
}

/// Draws one-pixel lines again as a person would. `ink` is 256^2, row by row; so is the result, 255 for full ink.
pub fn redraw(mut ink: Vec<bool>, config: &PenConfig, random: &mut Random) -> Vec<u8> {
    overshoot(&mut ink, config, random);
    leave_gaps(&mut ink, config, random);
    let width = random.between(config.width);
    let bend = Bend::new(random.between(config.bend), random.between(config.wavelength), random);
    let distance: Vec<f32> = squared_distance(&ink).iter().map(|&d| f32::from(d).sqrt()).collect();
    let reach = 0.5 * width as f32 + 0.5;
    let far = reach + 1.5 * bend.amplitude as f32 + 2.0;
    let mut drawing = vec![0; IMAGE * IMAGE];
    for row in 0..IMAGE {
        for col in 0..IMAGE {
            let i = row * IMAGE + col;
            if distance[i] > far {
                continue;
            }
            let (dx, dy) = bend.at(col as f64, row as f64);
            let d = bilinear(&distance, col as f64 + dx, row as f64 + dy);
            drawing[i] = ((reach - d).clamp(0.0, 1.0) * 255.0).round() as u8;
        }
    }
    drawing
}

/// A smooth random displacement: values at the nodes of a coarse lattice, eased between them.
struct Bend {
    amplitude: f64,
    spacing: f64,
    nodes: usize,
    values: Vec<(f64, f64)>,
}

impl Bend {
    fn new(amplitude: f64, spacing: f64, random: &mut Random) -> Self {
        let spacing = spacing.max(4.0);
        let nodes = (IMAGE as f64 / spacing) as usize + 2;
        let mut value = || amplitude * (2.0 * random.unit() - 1.0);
        let values = (0..nodes * nodes).map(|_| (value(), value())).collect();
        Self { amplitude, spacing, nodes, values }
    }

    fn at(&self, x: f64, y: f64) -> (f64, f64) {
        let ease = |t: f64| t * t * (3.0 - 2.0 * t);
        let (u, v) = (x / self.spacing, y / self.spacing);
        let (i, j) = (u as usize, v as usize);
        let (s, t) = (ease(u.fract()), ease(v.fract()));
        let node = |i: usize, j: usize| self.values[j * self.nodes + i];
        let mix = |a: (f64, f64), b: (f64, f64), t: f64| (a.0 + t * (b.0 - a.0), a.1 + t * (b.1 - a.1));
        mix(mix(node(i, j), node(i + 1, j), s), mix(node(i, j + 1), node(i + 1, j + 1), s), t)
    }
}

fn bilinear(image: &[f32], x: f64, y: f64) -> f32 {
    let last = (IMAGE - 1) as f64;
    let (x, y) = (x.clamp(0.0, last), y.clamp(0.0, last));
    let (i, j) = ((x as usize).min(IMAGE - 2), (y as usize).min(IMAGE - 2));
    let (s, t) = ((x - i as f64) as f32, (y - j as f64) as f32);
    let row = |j: usize| {
        let k = j * IMAGE + i;
        image[k] + s * (image[k + 1] - image[k])
    };
    row(j) + t * (row(j + 1) - row(j))
}

fn ink_pixels(ink: &[bool]) -> Vec<usize> {
    (0..ink.len()).filter(|&i| ink[i]).collect()
}

/// Lifts the pen: clears small discs along the lines.
fn leave_gaps(ink: &mut [bool], config: &PenConfig, random: &mut Random) {
    let pixels = ink_pixels(ink);
    let count = random.between(config.gaps).round() as usize;
    for _ in 0..if pixels.is_empty() { 0 } else { count } {
        let center = pixels[random.below(pixels.len())];
        let radius = 0.5 * random.between(config.gap_length);
        let reach = radius.ceil() as i64;
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                if (dx * dx + dy * dy) as f64 <= radius * radius
                    && let Some(i) = shifted(center, dx, dy)
                {
                    ink[i] = false;
                }
            }
        }
    }
}

/// Lets straight lines run past their ends: picks two ink pixels of one line, follows them to where the ink ends,
/// and goes on.
fn overshoot(ink: &mut [bool], config: &PenConfig, random: &mut Random) {
    let pixels = ink_pixels(ink);
    let count = random.between(config.overshoots).round() as usize;
    let mut extra = Vec::new();
    for _ in 0..if pixels.is_empty() { 0 } else { count } {
        let start = pixels[random.below(pixels.len())];
        let length = random.between(config.overshoot_length);
        if let Some((x, y)) = direction_at(ink, start, random) {
            let at = |k: f64| shifted(start, (x * k).round() as i64, (y * k).round() as i64);
            let inked = |k: f64| at(k).is_some_and(|i| near_ink(ink, i));
            let mut end = 0.0;
            while inked(end) && end < IMAGE as f64 {
                end += 1.0;
            }
            extra.extend((0..length as usize).filter_map(|k| at(end + k as f64)));
        }
    }
    extra.into_iter().for_each(|i| ink[i] = true);
}

/// The unit direction of a straight line through an inked pixel, if one runs there.
fn direction_at(ink: &[bool], start: usize, random: &mut Random) -> Option<(f64, f64)> {
    const LENGTH: f64 = 14.0;
    let first = random.below(64);
    (0..64).find_map(|turn| {
        let angle = (first + turn * 25) as f64 * (std::f64::consts::TAU / 64.0);
        let (y, x) = angle.sin_cos();
        let straight = (1..=LENGTH as i64).all(|k| {
            let (dx, dy) = ((x * k as f64).round() as i64, (y * k as f64).round() as i64);
            shifted(start, dx, dy).is_some_and(|i| ink[i])
        });
        straight.then_some((x, y))
    })
}

fn near_ink(ink: &[bool], i: usize) -> bool {
    (-1..=1).any(|dy| (-1..=1).any(|dx| shifted(i, dx, dy).is_some_and(|j| ink[j])))
}

fn shifted(i: usize, dx: i64, dy: i64) -> Option<usize> {
    let (x, y) = ((i % IMAGE) as i64 + dx, (i / IMAGE) as i64 + dy);
    let side = 0..IMAGE as i64;
    (side.contains(&x) && side.contains(&y)).then(|| y as usize * IMAGE + x as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bar() -> Vec<bool> {
        let mut ink = vec![false; IMAGE * IMAGE];
        ink[128 * IMAGE + 60..128 * IMAGE + 180].fill(true);
        ink
    }

    fn still() -> PenConfig {
        PenConfig {
            width: [1.0, 1.0],
            bend: [0.0, 0.0],
            gaps: [0.0, 0.0],
            overshoots: [0.0, 0.0],
            ..PenConfig::default()
        }
    }

    #[test]
    fn a_steady_thin_pen_changes_nothing() {
        let drawing = redraw(bar(), &still(), &mut Random::new(1, 2, 3));
        assert!(drawing.iter().zip(bar()).all(|(&v, b)| v == if b { 255 } else { 0 }));
    }

    #[test]
    fn width_is_the_share_of_ink_across_a_line() {
        for width in [1.0, 1.7, 2.0, 3.0] {
            let config = PenConfig { width: [width, width], ..still() };
            let drawing = redraw(bar(), &config, &mut Random::new(1, 2, 3));
            let across: f64 = (0..IMAGE).map(|row| f64::from(drawing[row * IMAGE + 120]) / 255.0).sum();
            assert!((across - width).abs() < 0.02, "{width}: {across}");
        }
    }

    #[test]
    fn overshoot_lengthens_and_gaps_shorten() {
        let mut ink = bar();
        let config = PenConfig { overshoots: [8.0, 8.0], overshoot_length: [5.0, 5.0], ..still() };
        overshoot(&mut ink, &config, &mut Random::new(1, 2, 3));
        let gained = ink_pixels(&ink).len() - 120;
        assert!((4..=14).contains(&gained), "{gained}");
        let config = PenConfig { gaps: [1.0, 1.0], gap_length: [6.0, 6.0], ..still() };
        leave_gaps(&mut ink, &config, &mut Random::new(1, 2, 3));
        let lost = 120 + gained - ink_pixels(&ink).len();
        assert!((4..=7).contains(&lost), "{lost}");
    }
}
