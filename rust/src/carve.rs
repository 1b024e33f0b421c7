//! The silhouette of a drawing, and carving from silhouettes (Martin and Aggarwal 1983; paper, section 6.5).

use crate::camera::{Camera, IMAGE};
use crate::distance::squared_distance;
use crate::voxel::{CELLS, SIDE, voxel_center};
use glam::DVec3;

/// Ink from here on counts as a line.
pub const INK: u8 = 64;
/// Gaps in an outline are closed up to twice this many pixels.
const LARGEST_GAP: u16 = 5;

/// The inside of a drawing's outline, its lines and holes included: what a flood of the background over
/// four-connected neighbours does not reach.
///
/// Where the outline has gaps, so that the flood gets into regions too wide to be mere narrow spaces between
/// lines, lines are thickened just enough to close the gaps, and what they gained is taken back after the flood.
pub fn silhouette(drawing: &[u8]) -> Vec<bool> {
    let ink: Vec<bool> = drawing.iter().map(|&v| v >= INK).collect();
    let to_ink = squared_distance(&ink);
    let widest = closed(&to_ink, LARGEST_GAP);
    for radius in 0..LARGEST_GAP {
        let inside = closed(&to_ink, radius);
        let too_wide = (LARGEST_GAP + 1) * (LARGEST_GAP + 1);
        let leaked = (0..inside.len()).any(|i| widest[i] && !inside[i] && to_ink[i] > too_wide);
        if !leaked {
            return joined(inside, &ink);
        }
    }
    joined(widest, &ink)
}

fn joined(mut inside: Vec<bool>, ink: &[bool]) -> Vec<bool> {
    inside.iter_mut().zip(ink).for_each(|(i, k)| *i |= k);
    inside
}

/// The inside of the lines thickened by `radius`, less as much.
fn closed(to_ink: &[u16], radius: u16) -> Vec<bool> {
    let outside = flood(|i| to_ink[i] > radius * radius);
    if radius == 0 {
        return outside.iter().map(|o| !o).collect();
    }
    let to_outside = squared_distance(&outside);
    to_outside.iter().map(|&d| d > radius * radius).collect()
}

/// Pixels that can be reached from the border over open four-connected neighbours.
fn flood(open: impl Fn(usize) -> bool) -> Vec<bool> {
    let mut reached = vec![false; IMAGE * IMAGE];
    let mut stack = Vec::new();
    let mut visit = |i: usize, stack: &mut Vec<usize>| {
        if !reached[i] && open(i) {
            reached[i] = true;
            stack.push(i);
        }
    };
    for k in 0..IMAGE {
        for i in [k, (IMAGE - 1) * IMAGE + k, k * IMAGE, k * IMAGE + IMAGE - 1] {
            visit(i, &mut stack);
        }
    }
    while let Some(i) = stack.pop() {
        let (row, col) = (i / IMAGE, i % IMAGE);
        if row > 0 {
            visit(i - IMAGE, &mut stack);
        }
        if row + 1 < IMAGE {
            visit(i + IMAGE, &mut stack);
        }
        if col > 0 {
            visit(i - 1, &mut stack);
        }
        if col + 1 < IMAGE {
            visit(i + 1, &mut stack);
        }
    }
    reached
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
        for gap in 1..=9 {
            let area = silhouette(&square(gap)).iter().filter(|&&b| b).count();
            assert!(area.abs_diff(121 * 121) < 60, "gap {gap}: {area}");
        }
        assert!(silhouette(&square(30)).iter().filter(|&&b| b).count() < 1000);
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
