//! World grid <-> camera grid, trilinear, zero outside the grid that is read.

use crate::camera::Camera;
use crate::voxel::{CELLS, SIDE, voxel_center};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Reads a volume between its cells' centres, at a position in cells; what lies outside the volume is 0.
pub(crate) fn trilinear(volume: &[f32], at: Vec3) -> f32 {
    let side = SIDE as f32;
    if !(at.min_element() > -1.0 && at.max_element() < side) {
        return 0.0;
    }
    // One more than the lower neighbour along each axis, so that truncation rounds down.
    let up = at + 1.0;
    let (i, j, k) = (up.x as usize, up.y as usize, up.z as usize);
    let f = up - Vec3::new(i as f32, j as f32, k as f32);
    let inner = 1..SIDE;
    if inner.contains(&i) && inner.contains(&j) && inner.contains(&k) {
        let base = ((i - 1) * SIDE + j - 1) * SIDE + k - 1;
        let block = &volume[base..base + SIDE * SIDE + SIDE + 2];
        let pair = |o: usize| block[o] + f.z * (block[o + 1] - block[o]);
        let (a, b) = (pair(0), pair(SIDE));
        let (c, d) = (pair(SIDE * SIDE), pair(SIDE * SIDE + SIDE));
        let (low, high) = (a + f.y * (b - a), c + f.y * (d - c));
        return low + f.x * (high - low);
    }
    let mut sum = 0.0;
    for corner in 0..8 {
        let (ci, cj, ck) = (i + (corner >> 2), j + (corner >> 1 & 1), k + (corner & 1));
        let inside = 1..=SIDE;
        if inside.contains(&ci) && inside.contains(&cj) && inside.contains(&ck) {
            let weight = |upper: bool, t: f32| if upper { t } else { 1.0 - t };
            let index = ((ci - 1) * SIDE + cj - 1) * SIDE + ck - 1;
            sum += volume[index] * weight(ci > i, f.x) * weight(cj > j, f.y) * weight(ck > k, f.z);
        }
    }
    sum
}

/// Reads a world volume `[x, y, z]` at the cells' centres of a camera grid `[slice, row, col]`.
pub fn to_camera_grid(world: &[f32], camera: &Camera, out: &mut [f32]) {
    assert_eq!((world.len(), out.len()), (CELLS, CELLS));
    let at = |i: usize| (2 * i + 1) as f64 / SIDE as f64 - 1.0;
    // From world units to cells of the world grid.
    let cells = |p: DVec3| (p * SIDE as f64).as_vec3();
    let corner = cells(camera.position + DVec3::splat(0.5)) - Vec3::splat(0.5);
    out.par_chunks_mut(SIDE * SIDE).enumerate().for_each(|(slice, plane)| {
        let depth = camera.slice_depth(slice) as f32;
        for (row, line) in plane.chunks_exact_mut(SIDE).enumerate() {
            let start = corner + cells(camera.ray(at(0), at(row))) * depth;
            let step = cells(camera.ray(at(1), at(row)) - camera.ray(at(0), at(row))) * depth;
            for (col, cell) in line.iter_mut().enumerate() {
                *cell = trilinear(world, start + step * col as f32);
            }
        }
    });
}

/// Reads a camera volume `[slice, row, col]` at the voxels' centres of the world grid `[x, y, z]`; voxels outside
/// the frustum keep what `out` holds.
pub fn to_world_grid(volume: &[f32], camera: &Camera, out: &mut [f32]) {
    assert_eq!((volume.len(), out.len()), (CELLS, CELLS));
    let side = SIDE as f32;
    let half = 0.5 * side;
    let focal = half / camera.half_image as f32;
    let (near, per_slice) = (camera.near as f32, side / (camera.far - camera.near) as f32);
    out.par_chunks_mut(SIDE * SIDE).enumerate().for_each(|(x, plane)| {
        for (y, line) in plane.chunks_exact_mut(SIDE).enumerate() {
            let corner = DVec3::new(voxel_center(x), voxel_center(y), voxel_center(0));
            let start = camera.to_camera(corner).as_vec3();
            let step = camera.to_camera(camera.position + DVec3::Z / SIDE as f64).as_vec3();
            for (z, voxel) in line.iter_mut().enumerate() {
                let p = start + step * z as f32;
                let slice = (p.z - near) * per_slice;
                let scale = focal / p.z;
                let (row, col) = (p.y * scale + half, p.x * scale + half);
                let inside = |v: f32| (0.0..=side).contains(&v);
                if inside(slice) && inside(row) && inside(col) {
                    *voxel = trilinear(volume, Vec3::new(slice, row, col) - 0.5);
                }
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// World -> camera -> world on a smooth blob loses little.
    #[test]
    fn a_smooth_field_comes_back() {
        let blob: Vec<f32> = (0..CELLS)
            .map(|i| {
                let p = Vec3::from([i / 4096, i / 64 % 64, i % 64].map(|c| voxel_center(c) as f32));
                (-(p - Vec3::new(0.05, -0.1, 0.0)).length_squared() / 0.02).exp()
            })
            .collect();
        for azimuth in [0.0, 37.5, 200.0] {
            let camera = Camera::orbit(azimuth, 38.0, 0.0, 2.0);
            let (mut seen, mut back) = (vec![0.0; CELLS], vec![0.0; CELLS]);
            to_camera_grid(&blob, &camera, &mut seen);
            to_world_grid(&seen, &camera, &mut back);
            let worst = blob.iter().zip(&back).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst < 0.03, "{worst}");
        }
    }

    #[test]
    fn a_constant_field_stays_constant_well_inside() {
        let camera = Camera::orbit(52.5, 38.0, 0.0, 2.0);
        let (mut seen, mut back) = (vec![9.0; CELLS], vec![-1.0; CELLS]);
        to_camera_grid(&vec![1.0; CELLS], &camera, &mut seen);
        assert!((seen[32 * 4096 + 32 * 64 + 32] - 1.0).abs() < 1e-6);
        assert_eq!(seen[0], 0.0, "outside the world grid");
        to_world_grid(&vec![1.0; CELLS], &camera, &mut back);
        assert!((back[32 * 4096 + 32 * 64 + 32] - 1.0).abs() < 1e-6);
        assert!(back.contains(&-1.0), "some corners lie outside the frustum and stay");
    }
}
