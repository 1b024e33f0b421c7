//! The silhouette of a drawing, and carving from silhouettes (Martin and Aggarwal 1983; paper, section 6.5).

use crate::camera::{Camera, IMAGE};
use crate::distance::squared_distance;
use crate::voxel::{CELLS, SIDE, voxel_center};
use glam::DVec3;

/// Ink from here on counts as a line.
pub const INK: u8 = 64;
/// Gaps in an outline are closed up to twice this many pixels.
const LARGEST_GAP: u16 = 14;
/// How much further, in pixels, a region reaches from its lines than the gap is wide that the flood came in by.
const DEEPER: f32 = 1.0;

/// The inside of a drawing's outline, its lines and holes included: what a flood of the background over
/// four-connected neighbours does not reach.
///
/// Where the outline has gaps, so that the flood gets into regions wider than the way in, lines are thickened just
/// enough to close the gaps, and what they gained is taken back after the flood. Spaces that narrow inwards, or stay as
/// narrow, are no such regions.
pub fn silhouette(drawing: &[u8]) -> Vec<bool> {
    let ink: Vec<bool> = drawing.iter().map(|&v| v >= INK).collect();
    let to_ink = squared_distance(&ink);
    let ways = ways_in(&to_ink);
    let largest = LARGEST_GAP * LARGEST_GAP;
    let leaks = ways.iter().zip(&to_ink).filter(|&(&way, &deep)| {
        (1..=largest).contains(&way) && f32::from(deep).sqrt() > f32::from(way).sqrt() + DEEPER
    });
    let radius = leaks.map(|(&way, _)| way).max().unwrap_or(0);
    let outside: Vec<bool> = ways.iter().map(|&way| way > radius).collect();
    if radius == 0 {
        return outside.iter().map(|o| !o).collect();
    }
    let to_outside = squared_distance(&outside);
    to_outside.iter().zip(ink).map(|(&d, ink)| ink || d > radius).collect()
}

/// How wide the widest way from the border to each pixel is at its narrowest: the squared distance to ink there, and
/// nowhere on the way less. A flood among lines thickened by a radius reaches what has a way wider than it.
fn ways_in(to_ink: &[u16]) -> Vec<u16> {
    const UNKNOWN: u16 = u16::MAX;
    let mut ways = vec![UNKNOWN; IMAGE * IMAGE];
    let widest = usize::from(to_ink.iter().copied().max().unwrap_or(0));
    let mut by_width = vec![Vec::new(); widest + 1];
    let mut reach = |i: usize, width: u16, by_width: &mut Vec<Vec<usize>>| {
        if ways[i] == UNKNOWN {
            ways[i] = width.min(to_ink[i]);
            by_width[usize::from(ways[i])].push(i);
        }
    };
    for k in 0..IMAGE {
        for i in [k, (IMAGE - 1) * IMAGE + k, k * IMAGE, k * IMAGE + IMAGE - 1] {
            reach(i, u16::MAX - 1, &mut by_width);
        }
    }
    for width in (0..=widest).rev() {
        while let Some(i) = by_width[width].pop() {
            let (row, col) = (i / IMAGE, i % IMAGE);
            if row > 0 {
                reach(i - IMAGE, width as u16, &mut by_width);
            }
            if row + 1 < IMAGE {
                reach(i + IMAGE, width as u16, &mut by_width);
            }
            if col > 0 {
                reach(i - 1, width as u16, &mut by_width);
            }
            if col + 1 < IMAGE {
                reach(i + 1, width as u16, &mut by_width);
            }
        }
    }
    ways
}

/// Carves the world grid: a voxel stays while its centre falls into every silhouette. Outside an image is outside.
pub fn carve(silhouettes: &[Vec<bool>], cameras: &[Camera], out: &mut [u8]) {
    assert_eq!(out.len(), CELLS);
    for (i, voxel) in out.iter_mut().enumerate() {
        let point = DVec3::from([i / (SIDE * SIDE), i / SIDE % SIDE, i % SIDE].map(voxel_center));
        let stays = silhouettes.iter().zip(cameras).all(|(inside, camera)| {
            let p = camera.to_camera(point);
            pixel_of(p, camera).is_some_and(|pixel| inside[pixel])
        });
        *voxel = u8::from(stays);
    }
}

/// The pixel that a point in camera coordinates falls into.
fn pixel_of(p: DVec3, camera: &Camera) -> Option<usize> {
    let scale = 0.5 * IMAGE as f64 / (p.z * camera.half_image);
    let (col, row) = (p.x * scale + 0.5 * IMAGE as f64, p.y * scale + 0.5 * IMAGE as f64);
    let inside = 0.0..IMAGE as f64;
    (p.z > 0.0 && inside.contains(&col) && inside.contains(&row)).then(|| row as usize * IMAGE + col as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(gap: usize) -> Vec<u8> {
        let mut drawing = vec![0; IMAGE * IMAGE];
        for k in 60..=180 {
            for (row, col) in [(60, k), (180, k), (k, 60), (k, 180)] {
                drawing[row * IMAGE + col] = 255;
            }
        }
        for k in 100..100 + gap {
            drawing[60 * IMAGE + k] = 0;
        }
        drawing
    }

    #[test]
    fn a_closed_outline_is_filled_exactly() {
        let area = silhouette(&square(0)).iter().filter(|&&b| b).count();
        assert_eq!(area, 121 * 121);
    }

    #[test]
    fn small_gaps_are_closed_and_a_wide_one_is_not() {
        for gap in 1..=27 {
            let area = silhouette(&square(gap)).iter().filter(|&&b| b).count();
            // What a closed gap lacks is less than a half disc over it.
            assert!(area.abs_diff(121 * 121) < 60.max(gap * gap / 2), "gap {gap}: {area}");
        }
        assert!(silhouette(&square(40)).iter().filter(|&&b| b).count() < 1000);
    }

    #[test]
    fn a_narrow_space_between_lines_stays_open() {
        let mut drawing = square(0);
        // A slot three pixels wide, cut into the square from above.
        for row in 60..120 {
            for col in 118..=122 {
                let wall = col == 118 || col == 122;
                drawing[row * IMAGE + col] = if wall { 255 } else { 0 };
            }
        }
        for col in 118..=122 {
            drawing[120 * IMAGE + col] = 255;
        }
        let area = silhouette(&drawing).iter().filter(|&&b| b).count();
        assert_eq!(area, 121 * 121 - 3 * 60);
    }
}
