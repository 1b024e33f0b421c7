//! Depth and normal buffers, and the fractional camera grid: both by casting rays at the shape itself.

use crate::camera::Camera;
use crate::csg::Shape;
use crate::dispatch::dispatched;
use crate::error::CoreError;
use crate::raycast::{RAYS, RayCaster, TILE, Tile};
use crate::voxel::{CELLS, SIDE};

/// What a camera sees of a shape, pixel by pixel, row by row.
pub struct Buffers {
    /// Depth along the camera's z axis in world units; infinite where nothing is seen.
    pub depth: Vec<f32>,
    /// Unit normal in the world, towards the eye, by its components; zero where nothing is seen.
    pub normal: [Vec<f32>; 3],
    /// Pixels along each side.
    pub size: usize,
}

impl Buffers {
    /// Casts one ray through the middle of each pixel.
    pub fn of_shape(shape: &Shape, camera: &Camera, size: usize) -> Result<Self, CoreError> {
        let caster = RayCaster::new(shape, camera)?;
        let depth = vec![f32::INFINITY; size * size];
        let normal = [(); 3].map(|()| vec![0.0; size * size]);
        let mut buffers = Self { depth, normal, size };
        cast_image(&caster, &mut buffers);
        Ok(buffers)
    }
}

dispatched! {
    fn cast_image(caster: &RayCaster, buffers: &mut Buffers) {
        let size = buffers.size;
        let mut tile = Tile::new(caster);
        for top in (0..size).step_by(TILE) {
            cast_row(caster, &mut tile, size, top, |left, depth, normal| {
                let all = buffers.normal.iter_mut().zip(normal).chain([(&mut buffers.depth, depth)]);
                for (out, lanes) in all {
                    for (row, lanes) in (top..size).zip(lanes.as_chunks::<TILE>().0) {
                        let out = &mut out[row * size + left..(row + 1) * size];
                        out.iter_mut().zip(lanes).for_each(|(out, &lane)| *out = lane);
                    }
                }
            });
        }
    }
}

/// Casts a row of tiles, `top` the first row of its pixels, and gives each that sees something to `write`: its first
/// column, depths and normals.
#[inline(always)]
pub fn cast_row(
    caster: &RayCaster,
    tile: &mut Tile,
    size: usize,
    top: usize,
    mut write: impl FnMut(usize, &[f32; RAYS], &[[f32; RAYS]; 3]),
) {
    let ys = image_points(top, size);
    for left in (0..size).step_by(TILE) {
        if tile.cast(caster, &image_points(left, size), &ys) {
            let hits = tile.entries(None);
            let (depth, normals) = (hits.depth(), tile.normals(caster, &hits));
            let mut narrow = [[0.0; RAYS]; 4];
            for (narrow, wide) in narrow.iter_mut().zip([&depth, &normals[0], &normals[1], &normals[2]]) {
                narrow.iter_mut().zip(wide).for_each(|(narrow, &wide)| *narrow = wide as f32);
            }
            let [depth, normals @ ..] = &narrow;
            write(left, depth, normals);
        }
    }
}

/// The middles of `TILE` pixels from `first` on, of `size` along the side of the image, in [-1, 1] units.
#[inline(always)]
fn image_points(first: usize, size: usize) -> [f64; TILE] {
    std::array::from_fn(|i| (2 * (first + i).min(size - 1) + 1) as f64 / size as f64 - 1.0)
}

/// The share of each camera-grid cell that is inside the shape, 255 for all of it, in the order (slice, row, col).
///
/// Exact along depth; across the image by `rays` x `rays` rays a cell.
pub fn fill_frustum(shape: &Shape, camera: &Camera, rays: usize, out: &mut [u8]) -> Result<(), CoreError> {
    assert_eq!(out.len(), CELLS);
    let caster = RayCaster::new(shape, camera)?;
    out.fill(0);
    fill_cells(&caster, rays, out);
    Ok(())
}

dispatched! {
    fn fill_cells(caster: &RayCaster, rays: usize, out: &mut [u8]) {
        fill_tiles(caster, rays, out);
    }
}

/// Squares of cells, as many as one tile of rays holds, or one cell by several tiles.
#[inline(always)]
fn fill_tiles(caster: &RayCaster, rays: usize, out: &mut [u8]) {
    let size = SIDE * rays;
    let side = (TILE / rays).max(1);
    let camera = caster.camera();
    let per_slice = SIDE as f64 / (camera.far - camera.near);
    let full = 255.0 / (rays * rays) as f64;
    let mut tile = Tile::new(caster);
    // For each slice and cell, how much more of it is inside than of the slice behind it.
    let mut gains = [0.0; (SIDE + 1) * RAYS];
    for top in (0..SIDE).step_by(side) {
        for left in (0..SIDE).step_by(side) {
            let mut any = false;
            for first_row in (0..side * rays).step_by(TILE) {
                for first_col in (0..side * rays).step_by(TILE) {
                    let xs = image_points(left * rays + first_col, size);
                    let ys = image_points(top * rays + first_row, size);
                    if !tile.cast(caster, &xs, &ys) {
                        continue;
                    }
                    any = true;
                    let cells: [usize; RAYS] = std::array::from_fn(|r| {
                        let (row, col) = (first_row + r / TILE, first_col + r % TILE);
                        let within = row < side * rays && col < side * rays;
                        if within { row / rays * side + col / rays } else { usize::MAX }
                    });
                    let mut from = None;
                    loop {
                        let entries = tile.entries(from.as_ref());
                        if entries.nearness.iter().fold(0, |any, w| any | w.to_bits()) == 0 {
                            break;
                        }
                        let exits = tile.exits(&entries.nearness);
                        let (start, end) = (entries.depth(), exits.depth());
                        for r in 0..RAYS {
                            if start[r] < f64::INFINITY && cells[r] != usize::MAX {
                                let slices = |depth: f64| (depth - camera.near) * per_slice;
                                gain(&mut gains, side * side, cells[r], slices(end[r]), 1.0);
                                gain(&mut gains, side * side, cells[r], slices(start[r]), -1.0);
                            }
                        }
                        from = Some(exits.nearness);
                    }
                }
            }
            if any {
                write_cells(&mut gains, side, full, top, left, out);
            }
        }
    }
}

/// Adds `sign` to all slices up to `depth` (in slices from the near plane), in part to the one that it lies in.
#[inline(always)]
fn gain(gains: &mut [f64], cells: usize, cell: usize, depth: f64, sign: f64) {
    let depth = depth.clamp(0.0, SIDE as f64);
    let slice = depth as usize;
    let part = depth - slice as f64;
    gains[slice * cells + cell] += sign * part;
    if slice > 0 {
        gains[(slice - 1) * cells + cell] += sign * (1.0 - part);
    }
}

/// Sums up the gains of `side` x `side` cells from the far end, and clears them.
#[inline(always)]
fn write_cells(gains: &mut [f64], side: usize, full: f64, top: usize, left: usize, out: &mut [u8]) {
    let cells = side * side;
    let mut inside = [0.0; RAYS];
    let mut bytes = [0u8; RAYS];
    for slice in (0..SIDE + 1).rev() {
        let gains = &mut gains[slice * cells..][..cells];
        for ((inside, gain), byte) in inside.iter_mut().zip(gains).zip(&mut bytes) {
            *inside += *gain;
            *gain = 0.0;
            *byte = (*inside * full + 0.5) as u8;
        }
        if slice < SIDE {
            for row in 0..side {
                let at = (slice * SIDE + top + row) * SIDE + left;
                out[at..at + side].copy_from_slice(&bytes[row * side..][..side]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::csg::{Kind, Primitive};
    use glam::DVec3;

    fn one(kind: Kind, half: [f64; 3]) -> Shape {
        let primitive = Primitive { kind, additive: true, center: DVec3::ZERO, half: half.into() };
        Shape::new(vec![primitive]).unwrap()
    }

    #[test]
    fn a_plane_has_its_depth() {
        let camera = Camera::orbit(0.0, 0.0, 0.0, 2.0);
        let buffers = Buffers::of_shape(&one(Kind::Cuboid, [0.2, 0.3, 0.3]), &camera, 256).unwrap();
        let hits = buffers.depth.iter().filter(|d| d.is_finite());
        assert!(hits.clone().all(|d| (d - 1.8).abs() < 1e-6));
        // The face is 0.6 wide at depth 1.8; the image is 2 * 1.8 * tan(22.5 degrees) there.
        let pixels = 0.6 / (3.6 * 22.5f64.to_radians().tan()) * 256.0;
        assert!((hits.count() as f64 - pixels * pixels).abs() < 4.0 * pixels);
        assert_eq!([0, 1, 2].map(|axis| buffers.normal[axis][128 * 256 + 128]), [1.0, 0.0, 0.0]);
    }

    #[test]
    fn a_frustum_holds_the_volume() {
        let camera = Camera::orbit(30.0, 20.0, 0.0, 2.0);
        let pi = std::f64::consts::PI;
        for (kind, exact) in [
            (Kind::Cuboid, 0.216),
            (Kind::Cylinder { axis: 0 }, pi * 0.09 * 0.6),
            (Kind::Wedge { axis: 1, corner: [1, -1] }, 0.108),
        ] {
            let mut out = vec![0; CELLS];
            fill_frustum(&one(kind, [0.3; 3]), &camera, 4, &mut out).unwrap();
            let depth = (camera.far - camera.near) / SIDE as f64;
            let volume: f64 = (0..SIDE)
                .map(|k| {
                    let (z0, z1) = (camera.near + k as f64 * depth, camera.near + (k + 1) as f64 * depth);
                    let side = 2.0 * camera.half_image / SIDE as f64;
                    let cell = side * side * (z1.powi(3) - z0.powi(3)) / 3.0;
                    let shares = &out[k * SIDE * SIDE..(k + 1) * SIDE * SIDE];
                    shares.iter().map(|&s| f64::from(s)).sum::<f64>() / 255.0 * cell
                })
                .sum();
            assert!((volume / exact - 1.0).abs() < 0.004, "{volume} {exact}");
        }
    }

    #[test]
    fn an_eye_inside_is_refused() {
        let camera = Camera::orbit(0.0, 0.0, 0.0, 0.1);
        let shape = one(Kind::Cuboid, [0.3; 3]);
        assert!(matches!(Buffers::of_shape(&shape, &camera, 64), Err(CoreError::EyeInside(_))));
        assert!(fill_frustum(&shape, &camera, 2, &mut vec![0; CELLS]).is_err());
    }
}
