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
    tile.choose(caster, image_points(top, size));
    for left in (0..size).step_by(TILE) {
        if tile.cast(caster, &image_points(left, size)) {
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

/// Goes through squares of cells, as many as one tile of rays holds; or one cell by several tiles.
#[inline(always)]
fn fill_tiles(caster: &RayCaster, rays: usize, out: &mut [u8]) {
    let (size, side) = (SIDE * rays, cells_a_side(rays));
    let camera = caster.camera();
    let per_slice = SIDE as f64 / (camera.far - camera.near);
    let slices = |depth: f64| ((depth - camera.near) * per_slice).clamp(0.0, SIDE as f64);
    let full = 255.0 / (rays * rays) as f64;
    // The first ray of each tile, and the cell that each of its rays is in.
    let steps = || (0..side * rays).step_by(TILE);
    let parts: Vec<_> = steps()
        .flat_map(|row| steps().map(move |col| (row, col)))
        .map(|(row, col)| (row, col, cells_of_rays(rays, row, col)))
        .collect();
    let mut tile = Tile::new(caster);
    let mut shares = Shares::new();
    for top in (0..SIDE).step_by(side) {
        for left in (0..SIDE).step_by(side) {
            for (first_row, first_col, cells) in &parts {
                tile.choose(caster, image_points(top * rays + first_row, size));
                if !tile.cast(caster, &image_points(left * rays + first_col, size)) {
                    continue;
                }
                let mut entries = tile.entries(None);
                loop {
                    let exits = tile.exits(&entries.nearness);
                    let (start, end) = (entries.depth(), exits.depth());
                    for r in (0..RAYS).filter(|&r| start[r] < f64::INFINITY) {
                        shares.add(cells[r], slices(start[r]), slices(end[r]));
                    }
                    if !tile.goes_on(&exits.nearness) {
                        break;
                    }
                    entries = tile.entries(Some(&exits.nearness));
                }
            }
            let corner = &mut out[top * SIDE + left..];
            match side {
                8 => shares.write::<8>(full, corner),
                4 => shares.write::<4>(full, corner),
                2 => shares.write::<2>(full, corner),
                _ => shares.write::<1>(full, corner),
            }
        }
    }
}

/// Cells along the side of the square that one tile of rays sees.
#[inline(always)]
fn cells_a_side(rays: usize) -> usize {
    match rays {
        1 => 8,
        2 => 4,
        3 | 4 => 2,
        _ => 1,
    }
}

/// The cell of each ray of a tile; the one after the last for rays that another tile casts as well.
fn cells_of_rays(rays: usize, first_row: usize, first_col: usize) -> [usize; RAYS] {
    let side = cells_a_side(rays);
    std::array::from_fn(|r| {
        let (row, col) = ((first_row + r / TILE) / rays, (first_col + r % TILE) / rays);
        if row < side && col < side { row * side + col } else { RAYS }
    })
}

/// How much of each cell of a square is inside, slice by slice.
struct Shares {
    /// For each slice and cell, how much more of it is inside than of the slice behind it. One cell is nobody's.
    gains: Vec<[f64; RAYS + 1]>,
    /// The slices with any gains.
    slices: std::ops::Range<usize>,
}

impl Shares {
    const NONE: std::ops::Range<usize> = SIDE..0;

    fn new() -> Self {
        Self { gains: vec![[0.0; RAYS + 1]; SIDE + 1], slices: Self::NONE }
    }

    /// Adds what lies between two depths, in slices from the near plane.
    #[inline(always)]
    fn add(&mut self, cell: usize, from: f64, to: f64) {
        self.slices.start = self.slices.start.min((from as usize).saturating_sub(1));
        self.slices.end = self.slices.end.max(to as usize + 1);
        for (depth, sign) in [(to, 1.0), (from, -1.0)] {
            // All slices before this depth, and in part the one that it lies in.
            let slice = depth as usize;
            let part = depth - slice as f64;
            self.gains[slice][cell] += sign * part;
            if slice > 0 {
                self.gains[slice - 1][cell] += sign * (1.0 - part);
            }
        }
    }

    /// Sums up the gains of `N` x `N` cells from the far end, and clears them. `out` begins at the first cell.
    #[inline(always)]
    fn write<const N: usize>(&mut self, full: f64, out: &mut [u8]) {
        let mut inside = [[0.0; N]; N];
        for slice in std::mem::replace(&mut self.slices, Self::NONE).rev() {
            let gains = &mut self.gains[slice];
            let mut bytes = [[0; N]; N];
            for row in 0..N {
                for col in 0..N {
                    inside[row][col] += std::mem::take(&mut gains[row * N + col]);
                    bytes[row][col] = (inside[row][col] * full + 0.5) as i32 as u8;
                }
            }
            if slice < SIDE {
                for (row, bytes) in bytes.iter().enumerate() {
                    out[(slice * SIDE + row) * SIDE..][..N].copy_from_slice(bytes);
                }
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
