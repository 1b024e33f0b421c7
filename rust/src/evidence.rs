//! What all drawings together say about each cell of one camera's grid.
//!
//! Two volumes, both gathered along the cell's projections into the drawings and, where shapes are known to be
//! symmetric about z = 0, into the drawings as seen by the mirrored cameras:
//!
//! * **hull**: the least signed distance to a silhouette's border: inside the visual hull it is positive;
//! * **match**: how near the other drawings' lines are, on average: where a line of this drawing meets one of
//!   theirs at the right depth, an edge of the object may be (a plane sweep over drawings).

use crate::camera::{Camera, IMAGE};
use crate::carve::{INK, silhouette};
use crate::distance::{REACH, squared_distance};
use crate::voxel::{CELLS, SIDE};
use glam::{DVec3, Vec3};
use std::sync::LazyLock;

/// Bytes of one drawing's fields: signed silhouette distance and nearness to ink, one pair a pixel.
pub const FIELDS: usize = 2 * IMAGE * IMAGE;
/// Steps of a byte for one pixel of distance.
const STEPS: f32 = 8.0;

/// Distance in steps for each squared distance within reach.
static DISTANCE: LazyLock<Vec<f32>> = LazyLock::new(|| {
    let last = (REACH + 1) * (REACH + 1);
    (0..=last).map(|d| f32::from(d).sqrt()).collect()
});

/// The fields that evidence is gathered from, pairs (silhouette, nearness) row by row.
///
/// Silhouette: 128 on the border, 8 a pixel more towards the inside, within [0, 255]. Nearness: 255 on ink,
/// 16 a pixel less away from it.
pub fn fill_fields(drawing: &[u8], out: &mut [u8]) {
    assert_eq!(out.len(), FIELDS);
    let inside = silhouette(drawing);
    let outside: Vec<bool> = inside.iter().map(|i| !i).collect();
    let ink: Vec<bool> = drawing.iter().map(|&v| v >= INK).collect();
    let (to_in, to_out, to_ink) =
        (squared_distance(&inside), squared_distance(&outside), squared_distance(&ink));
    let distance = |d: u16| DISTANCE[usize::from(d).min(DISTANCE.len() - 1)];
    for (i, pair) in out.chunks_exact_mut(2).enumerate() {
        let signed = if inside[i] { distance(to_out[i]) - 0.5 } else { 0.5 - distance(to_in[i]) };
        pair[0] = (128.0 + STEPS * signed).round().clamp(0.0, 255.0) as u8;
        pair[1] = (255.0 - 2.0 * STEPS * distance(to_ink[i])).round().max(0.0) as u8;
    }
}

/// Gathers the evidence of all drawings for the grid of camera `target`, one of `cameras`.
///
/// `fields` holds `FIELDS` bytes a drawing; `out` 2 x 64^3 bytes: hull, then match, each (slice, row, col).
pub fn gather(fields: &[u8], cameras: &[Camera], target: usize, mirror: bool, out: &mut [u8]) {
    assert_eq!(fields.len(), cameras.len() * FIELDS);
    assert_eq!(out.len(), 2 * CELLS);
    let (hull, matches) = out.split_at_mut(CELLS);
    let eye = &cameras[target];
    let depths: [f32; SIDE] = std::array::from_fn(|k| eye.slice_depth(k) as f32);
    let at = |i: usize| (2 * i + 1) as f64 / SIDE as f64 - 1.0;
    let reflections: &[f64] = if mirror { &[1.0, -1.0] } else { &[1.0] };
    let others = cameras.len() * reflections.len() - 1;
    let share = 1.0 / others.max(1) as f32;
    for row in 0..SIDE {
        for col in 0..SIDE {
            let direction = eye.ray(at(col), at(row));
            let mut least = [255u8; SIDE];
            let mut total = [0u32; SIDE];
            for (j, (camera, field)) in cameras.iter().zip(fields.chunks_exact(FIELDS)).enumerate() {
                for &side in reflections {
                    let flip = DVec3::new(1.0, 1.0, side);
                    let start = camera.to_camera(eye.position * flip).as_vec3();
                    let step = camera.to_camera(camera.position + direction * flip).as_vec3();
                    let own = j == target && side > 0.0;
                    let pixels = pixels_along(start, step, &depths, camera);
                    for (k, &pixel) in pixels.iter().enumerate() {
                        let (signed, nearness) = match pixel {
                            OUTSIDE => (0, 0),
                            _ => (field[2 * pixel as usize], field[2 * pixel as usize + 1]),
                        };
                        least[k] = least[k].min(signed);
                        total[k] += if own { 0 } else { u32::from(nearness) };
                    }
                }
            }
            for k in 0..SIDE {
                let cell = (k * SIDE + row) * SIDE + col;
                hull[cell] = least[k];
                matches[cell] = (total[k] as f32 * share).round() as u8;
            }
        }
    }
}

const OUTSIDE: u32 = u32::MAX;

/// The pixel that each point `start + depth * step` (camera coordinates) falls into.
fn pixels_along(start: Vec3, step: Vec3, depths: &[f32; SIDE], camera: &Camera) -> [u32; SIDE] {
    let half = 0.5 * IMAGE as f32;
    let focal = half / camera.half_image as f32;
    // A cell's own ray ends in the corner of four pixels: rounding shall not choose between them.
    let half = half + 0.01;
    depths.map(|depth| {
        let p = start + step * depth;
        let scale = focal / p.z;
        let (x, y) = (p.x * scale + half, p.y * scale + half);
        let seen = p.z > 0.0 && x >= 0.0 && y >= 0.0 && x < IMAGE as f32 && y < IMAGE as f32;
        if seen { y as u32 * IMAGE as u32 + x as u32 } else { OUTSIDE }
    })
}
