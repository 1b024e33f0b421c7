//! The solid of a mesh at twice the resolution, and the fractional camera grid that is read in it.

use super::{Frame, SolidError, inside};
use crate::camera::Camera;
use crate::dispatch::for_each_instruction_set;
use crate::voxel::{CELLS, SIDE};

/// Voxels along each side.
const FINE: usize = 2 * SIDE;
/// Places along depth at which a cell of a camera grid is looked at.
const DEPTHS: usize = 4;

/// Samples of a voxel along each axis that its share is measured by.
const SAMPLES: usize = 4;

/// How many of 4 x 4 x 4 evenly spaced points of each voxel a mesh encloses, in the order (x, y, z).
///
/// # Errors
///
/// As [`super::voxelize`].
pub fn shares(vertices: &[[f64; 3]], faces: &[[i64; 3]]) -> Result<Vec<u8>, SolidError> {
    let frame = Frame::around(vertices, faces)?;
    let (mut counts, mut bytes) = (vec![0; CELLS], vec![0; CELLS]);
    for part in 0..SAMPLES.pow(3) {
        let offset = [part / SAMPLES / SAMPLES, part / SAMPLES % SAMPLES, part % SAMPLES];
        let moved = frame.moved(offset.map(|o| 0.5 - (o as f64 + 0.5) / SAMPLES as f64));
        inside(&moved, vertices, faces).write_bytes(&mut bytes);
        counts.iter_mut().zip(&bytes).for_each(|(count, byte)| *count += byte);
    }
    Ok(counts)
}

/// 128^3 voxels over the world grid's cube: 0 or 1, in the order (x, y, z).
pub struct Finer(Vec<u8>);

impl Finer {
    /// # Errors
    ///
    /// As [`super::voxelize`].
    pub fn of_mesh(vertices: &[[f64; 3]], faces: &[[i64; 3]]) -> Result<Self, SolidError> {
        let frame = Frame::around(vertices, faces)?;
        let mut fine = vec![0; FINE * FINE * FINE];
        let mut coarse = vec![0; CELLS];
        for part in 0..8 {
            // Every other voxel along each axis: the centres of a coarse grid, a quarter of its voxels off.
            let offset = [part >> 2 & 1, part >> 1 & 1, part & 1];
            let moved = frame.moved(offset.map(|o| 0.25 - 0.5 * o as f64));
            inside(&moved, vertices, faces).write_bytes(&mut coarse);
            for (column, bytes) in coarse.chunks_exact(SIDE).enumerate() {
                let (x, y) = (2 * (column / SIDE) + offset[0], 2 * (column % SIDE) + offset[1]);
                let line = &mut fine[(x * FINE + y) * FINE + offset[2]..];
                line.iter_mut().step_by(2).zip(bytes).for_each(|(fine, &byte)| *fine = byte);
            }
        }
        Ok(Self(fine))
    }

    /// The share of each camera-grid cell that is inside, 255 for all of it, in the order (slice, row, col): looked at
    /// `rays` x `rays` rays a cell across the image, and at four depths along them.
    pub fn fill_frustum(&self, camera: &Camera, rays: usize, out: &mut [u8]) {
        assert_eq!(out.len(), CELLS);
        fill_cells(&self.0, camera, rays, out);
    }
}

for_each_instruction_set! {
    fn fill_cells(fine: &[u8], camera: &Camera, rays: usize, out: &mut [u8]) {
        let size = SIDE * rays;
        let full = 255.0 / (rays * rays * DEPTHS) as f32;
        let at = |i: usize| (2 * i + 1) as f64 / size as f64 - 1.0;
        let step = (camera.far - camera.near) / (SIDE * DEPTHS) as f64;
        let mut counts = vec![[0_u16; SIDE]; SIDE];
        for row in 0..SIDE {
            counts.fill([0; SIDE]);
            for ray in 0..rays * size {
                let (i, j) = (row * rays + ray / size, ray % size);
                let direction = camera.ray(at(j), at(i));
                // In voxels, from a corner of the grid.
                let scale = FINE as f64;
                let start = (camera.position + direction * (camera.near + 0.5 * step) + 0.5) * scale;
                let by = direction * (step * scale);
                for k in 0..SIDE * DEPTHS {
                    let place = start + by * k as f64;
                    let [x, y, z] = place.to_array().map(|v| v.floor() as i64);
                    let within = |v: i64| (0..FINE as i64).contains(&v);
                    if within(x) && within(y) && within(z) {
                        let voxel = (x as usize * FINE + y as usize) * FINE + z as usize;
                        counts[k / DEPTHS][j / rays] += u16::from(fine[voxel]);
                    }
                }
            }
            for (slice, counts) in counts.iter().enumerate() {
                let cells = &mut out[(slice * SIDE + row) * SIDE..][..SIDE];
                cells.iter_mut().zip(counts).for_each(|(cell, &n)| *cell = (f32::from(n) * full).round() as u8);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box of which the first side is the largest.
    fn cuboid(sides: [f64; 3]) -> (Vec<[f64; 3]>, Vec<[i64; 3]>) {
        let corner = |i: usize| [0, 1, 2].map(|a| sides[a] * f64::from((i >> a & 1) as u32));
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let faces = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        ((0..8).map(corner).collect(), faces)
    }

    #[test]
    fn shares_are_those_of_a_box() {
        // 53.33 voxels long, 32.5 high, 20.25 deep, in the middle of the grid.
        let (vertices, faces) = cuboid([1.0, 32.5 * 1.2 / 64.0, 20.25 * 1.2 / 64.0]);
        let counts = shares(&vertices, &faces).unwrap();
        let along = |i: usize, half: f64| {
            (0..4).filter(|s| ((i * 4 + s) as f64 / 4.0 + 0.125 - 32.0).abs() < half).count()
        };
        for (i, &count) in counts.iter().enumerate() {
            let [x, y, z] = [i / SIDE / SIDE, i / SIDE % SIDE, i % SIDE];
            let expected = along(x, 0.5 * 64.0 / 1.2) * along(y, 16.25) * along(z, 10.125 + 1e-9);
            // The surface along z passes through samples: either side will do.
            let other = along(x, 0.5 * 64.0 / 1.2) * along(y, 16.25) * along(z, 10.125 - 1e-9);
            assert!((other.min(expected)..=other.max(expected)).contains(&usize::from(count)), "{x} {y} {z}");
        }
    }

    #[test]
    fn a_box_fills_its_cells() {
        // A box as wide as the world's 1 / 1.2 each way, seen from the front: slice, row and column bounds are known.
        let (vertices, faces) = cuboid([1.0; 3]);
        let finer = Finer::of_mesh(&vertices, &faces).unwrap();
        let camera = Camera::orbit(0.0, 0.0, 0.0, 2.0);
        let mut out = vec![0; CELLS];
        finer.fill_frustum(&camera, 2, &mut out);
        let half = 0.5 / 1.2;
        let (mut share, mut off) = (0.0, 0);
        for (i, &cell) in out.iter().enumerate() {
            let slice = camera.near + ((i / (SIDE * SIDE)) as f64 + 0.5) * 1.5 / 64.0;
            let across = |k: usize| ((2 * k + 1) as f64 / 64.0 - 1.0) * camera.half_image * slice;
            let [y, z] = [across(i / SIDE % SIDE), across(i % SIDE)].map(f64::abs);
            // Well inside or well outside, by more than a cell's diagonal.
            let margin = (half - (slice - 2.0).abs()).min(half - y).min(half - z);
            off += i32::from(margin > 0.03 && cell != 255) + i32::from(margin < -0.03 && cell != 0);
            let side = 2.0 * camera.half_image * slice / 64.0;
            share += f64::from(cell) / 255.0 * side * side * 1.5 / 64.0;
        }
        assert_eq!(off, 0);
        // Its sides are 106.67 fine voxels, of which 106 have their centres inside.
        let sides = (106.0 / 106.67_f64).powi(3);
        assert!((share / (2.0 * half).powi(3) - sides).abs() < 0.008, "{share}");
    }
}
