//! What a round pen leaves on paper.

use crate::camera::IMAGE;
use crate::dispatch::for_each_instruction_set;
use crate::trace::Point;

/// The pen at one point of a stroke.
#[derive(Clone, Copy, Debug)]
pub struct Dab {
    pub at: Point,
    /// Pixels; below 1 the line is as wide as 1 and the paler.
    pub width: f32,
    /// From 0 to 1.
    pub ink: f32,
}

/// Draws a stroke through dabs, 256 x 256, row by row. Where strokes overlap the darker one counts.
pub fn draw(dabs: &[Dab], antialias: bool, canvas: &mut [u8]) {
    assert_eq!(canvas.len(), IMAGE * IMAGE);
    draw_dabs(dabs, if antialias { 1.0 } else { 1e6 }, canvas);
}

for_each_instruction_set! {
    fn draw_dabs(dabs: &[Dab], sharpness: f32, canvas: &mut [u8]) {
        draw_segments(dabs, sharpness, canvas);
    }
}

/// Added to a number below it, leaves that number, rounded, in the lowest bits: a cast that vectorises.
const ROUND: f32 = (1 << 23) as f32;
/// Pixels side by side that are looked at together.
const LANES: usize = 8;

#[inline(always)]
fn draw_segments(dabs: &[Dab], sharpness: f32, canvas: &mut [u8]) {
    let rows = canvas.as_chunks_mut::<IMAGE>().0;
    for pair in dabs.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let (dx, dy) = (b.at[0] - a.at[0], b.at[1] - a.at[1]);
        let squared = dx * dx + dy * dy;
        let (ux, uy) = if squared > 0.0 { (dx / squared, dy / squared) } else { (0.0, 0.0) };
        let width = 0.5 * (a.width + b.width);
        let half = 0.5 * width.max(1.0);
        let ink = 255.0 * 0.5 * (a.ink + b.ink) * width.min(1.0);
        let reach = half + 0.5;
        let side = |low: f32, high: f32| {
            // Before the first pixel to after the last one; a cast clips.
            let (from, to) = ((low - reach).ceil(), (high + reach).floor());
            (from.max(0.0) as usize, to.min((IMAGE - 1) as f32))
        };
        let (left, right) = side(a.at[0].min(b.at[0]), a.at[0].max(b.at[0]));
        let (top, bottom) = side(a.at[1].min(b.at[1]), a.at[1].max(b.at[1]));
        if right < left as f32 || bottom < top as f32 {
            continue;
        }
        let (right, bottom) = (right as usize, bottom as usize);
        for (row, line) in rows.iter_mut().enumerate().take(bottom + 1).skip(top) {
            let py = row as f32 - a.at[1];
            let along = py * uy;
            let mut col = left.min(IMAGE - LANES);
            while let Some(pixels) = line[col..].first_chunk_mut::<LANES>() {
                for (k, pixel) in pixels.iter_mut().enumerate() {
                    let px = (col + k) as f32 - a.at[0];
                    let t = (px * ux + along).clamp(0.0, 1.0);
                    let (ex, ey) = (px - t * dx, py - t * dy);
                    let distance = (ex * ex + ey * ey).sqrt();
                    let cover = ((half - distance) * sharpness + 0.5).clamp(0.0, 1.0);
                    *pixel = (*pixel).max((cover * ink + ROUND).to_bits() as u8);
                }
                if col + LANES > right {
                    break;
                }
                col = (col + LANES).min(IMAGE - LANES);
            }
        }
    }
}

/// Leaves out up to this share of the ink, pixel by pixel, as the grain of paper does.
pub fn grain(canvas: &mut [u8], share: f64, key: u64) {
    let (parts, _) = canvas.as_chunks_mut::<16>();
    for (part, pixels) in parts.iter_mut().enumerate().filter(|(_, p)| u128::from_ne_bytes(**p) != 0) {
        for (i, pixel) in pixels.iter_mut().enumerate() {
            // SplitMix64: any bits of the place, well mixed.
            let mut z = key.wrapping_add(((16 * part + i) as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            let unit = ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32;
            *pixel = (f32::from(*pixel) * (1.0 - share as f32 * unit) + ROUND).to_bits() as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn line(from: Point, to: Point, width: f32) -> Vec<Dab> {
        [from, to].map(|at| Dab { at, width, ink: 1.0 }).to_vec()
    }

    #[test]
    fn width_is_the_ink_across_a_line() {
        for width in [0.5, 1.0, 1.7, 3.0, 6.0] {
            for antialias in [true, false] {
                let mut canvas = vec![0; IMAGE * IMAGE];
                draw(&line([20.0, 100.0], [230.0, 100.0], width), antialias, &mut canvas);
                let across: f32 = (0..IMAGE).map(|row| f32::from(canvas[row * IMAGE + 128]) / 255.0).sum();
                // Without shades, a whole number of rows.
                let slack = if antialias { 0.02 } else { 1.0 };
                assert!((across - width).abs() <= slack, "{width}: {across}");
            }
        }
    }

    #[test]
    fn a_thin_line_between_pixels_is_as_dark_in_all() {
        let mut canvas = vec![0; IMAGE * IMAGE];
        draw(&line([20.0, 100.5], [230.0, 100.5], 1.0), true, &mut canvas);
        assert_eq!([100, 101, 102].map(|row| canvas[row * IMAGE + 77]), [128, 128, 0]);
    }

    #[test]
    fn every_instruction_set_draws_the_same_and_clips() {
        let mut random = Random::new(1, 2, 3);
        let dabs: Vec<Dab> = (0..300)
            .map(|_| Dab {
                at: [random.between([-40.0, 296.0]) as f32, random.between([-40.0, 296.0]) as f32],
                width: random.between([0.3, 6.0]) as f32,
                ink: random.unit() as f32,
            })
            .collect();
        for sharpness in [1.0, 1e6] {
            let (mut best, mut plain) = (vec![0; IMAGE * IMAGE], vec![0; IMAGE * IMAGE]);
            draw_dabs(&dabs, sharpness, &mut best);
            draw_segments(&dabs, sharpness, &mut plain);
            assert!(best == plain && best.contains(&255) == plain.contains(&255));
        }
    }

    #[test]
    fn grain_takes_at_most_its_share() {
        let mut canvas = vec![200; IMAGE * IMAGE];
        grain(&mut canvas, 0.5, 7);
        assert!(canvas.iter().all(|&v| (100..=200).contains(&v)));
        let mean = canvas.iter().map(|&v| f64::from(v)).sum::<f64>() / canvas.len() as f64;
        assert!((mean - 150.0).abs() < 1.0, "{mean}");
    }
}
