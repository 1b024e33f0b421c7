//! Depth and normal buffers, and the fractional camera grid: both by casting rays at the shape itself.

#![expect(clippy::needless_range_loop, reason = "loops over the rays of a tile index many arrays at once")]

use crate::camera::Camera;
use crate::csg::Shape;
use crate::dispatch::for_each_instruction_set;
use crate::error::CoreError;
use crate::raycast::{Hits, RAYS, RayCaster, TILE, Tile};
use crate::voxel::{CELLS, SIDE};

/// What a camera sees of a shape, pixel by pixel, row by row.
pub struct Buffers {
    /// Depth along the camera's z axis in world units; infinite where nothing is seen.
    pub depth: Vec<f32>,
    /// Unit normal in the world, towards the eye; zero where nothing is seen.
    pub normal: Vec<[f32; 3]>,
    /// Pixels along each side.
    pub size: usize,
}

impl Buffers {
    /// Casts one ray through the middle of each pixel.
    pub fn of_shape(shape: &Shape, camera: &Camera, size: usize) -> Result<Self, CoreError> {
        let caster = RayCaster::new(shape, camera)?;
        let depth = vec![f32::INFINITY; size * size];
        let normal = vec![[0.0; 3]; size * size];
        let mut buffers = Self { depth, normal, size };
        cast_image(&caster, &mut buffers);
        Ok(buffers)
    }
}

for_each_instruction_set! {
    fn cast_image(caster: &RayCaster, buffers: &mut Buffers) {
        cast_tiles(caster, buffers);
    }
}

#[inline(always)]
fn cast_tiles(caster: &RayCaster, buffers: &mut Buffers) {
    let size = buffers.size;
    let mut tile = Tile::new(caster);
    for top in (0..size).step_by(TILE) {
        tile.choose(caster, &image_points(top, size));
        for left in (0..size).step_by(TILE) {
            let Some(Pixels { depth, normal }) = Pixels::seen(caster, &mut tile, &image_points(left, size))
            else {
                continue;
            };
            for (row, lanes) in (top..size).zip((0..RAYS).step_by(TILE)) {
                for (col, lane) in (left..size).zip(lanes..lanes + TILE) {
                    buffers.depth[row * size + col] = depth[lane];
                    buffers.normal[row * size + col] = [normal[0][lane], normal[1][lane], normal[2][lane]];
                }
            }
        }
    }
}

/// What is seen in one tile, row by row, as in `Buffers`.
pub struct Pixels {
    pub depth: [f32; RAYS],
    pub normal: [[f32; RAYS]; 3],
}

impl Pixels {
    /// What the chosen rows of a tile show at these columns; `None` if there is nothing.
    #[inline(always)]
    pub fn seen(caster: &RayCaster, tile: &mut Tile, columns: &[f64; TILE]) -> Option<Self> {
        if !tile.cast(caster, columns) {
            return None;
        }
        Some(Self::of(caster, tile, &tile.entries(None)))
    }

    /// The surfaces that the rays of a tile meet.
    #[inline(always)]
    pub fn of(caster: &RayCaster, tile: &Tile, hits: &Hits) -> Self {
        let (depth, normal) = (hits.depth(), tile.normals(caster, hits));
        let mut pixels = Self { depth: [0.0; RAYS], normal: [[0.0; RAYS]; 3] };
        for r in 0..RAYS {
            pixels.depth[r] = depth[r] as f32;
            for axis in 0..3 {
                pixels.normal[axis][r] = normal[axis][r] as f32;
            }
        }
        pixels
    }
}

impl Buffers {
    /// The tile whose first pixel is in this column and row, blank beyond the image; `None` if it shows nothing.
    #[inline(always)]
    pub fn tile(&self, left: usize, top: usize) -> Option<Pixels> {
        let mut pixels = Pixels { depth: [f32::INFINITY; RAYS], normal: [[0.0; RAYS]; 3] };
        let mut seen = false;
        for row in 0..TILE.min(self.size - top) {
            let from = (top + row) * self.size + left;
            let to = from + TILE.min(self.size - left);
            let (depth, normal) = (&self.depth[from..to], &self.normal[from..to]);
            if depth.iter().fold(true, |blank, &d| blank & (d == f32::INFINITY)) {
                continue;
            }
            seen = true;
            for col in 0..depth.len() {
                let lane = row * TILE + col;
                pixels.depth[lane] = depth[col];
                [pixels.normal[0][lane], pixels.normal[1][lane], pixels.normal[2][lane]] = normal[col];
            }
        }
        seen.then_some(pixels)
    }
}

/// The middles of `TILE` pixels from `first` on, of `size` along the side of the image, in [-1, 1] units.
#[inline(always)]
pub fn image_points(first: usize, size: usize) -> [f64; TILE] {
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

for_each_instruction_set! {
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
                tile.choose(caster, &image_points(top * rays + first_row, size));
                if !tile.cast(caster, &image_points(left * rays + first_col, size)) {
                    continue;
                }
                let mut entries = tile.entries(None);
                loop {
                    let exits = tile.exits(&entries.nearness);
                    let (start, end) = (entries.depth(), exits.depth());
                    let (mut from, mut to) = ([0.0; RAYS], [0.0; RAYS]);
                    for r in 0..RAYS {
                        from[r] = ((start[r] - camera.near) * per_slice).clamp(0.0, SIDE as f64);
                        to[r] = ((end[r] - camera.near) * per_slice).clamp(0.0, SIDE as f64);
                    }
                    for r in 0..RAYS {
                        if from[r] < to[r] {
                            shares.add(cells[r], from[r], to[r]);
                        }
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

/// Halves of a step are rounded up, as exact ones that the sums have left a little less: half of a cell is 128.
const HALF: f64 = 0.5 + 1e-9;

/// How much of each cell of a square is inside, slice by slice.
struct Shares {
    /// For each slice and cell, how much more of it is inside than of the slice behind it. One cell is nobody's.
    gains: Vec<[f64; RAYS + 1]>,
    /// The first slice with any gains, and the one after the last.
    slices: [usize; 2],
}

impl Shares {
    const NO_SLICES: [usize; 2] = [SIDE, 0];

    fn new() -> Self {
        Self { gains: vec![[0.0; RAYS + 1]; SIDE + 1], slices: Self::NO_SLICES }
    }

    /// Adds what lies between two depths, in slices from the near plane.
    #[inline(always)]
    fn add(&mut self, cell: usize, from: f64, to: f64) {
        let [first, end] = self.slices;
        self.slices = [first.min((from as usize).saturating_sub(1)), end.max(to as usize + 1)];
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
        let [first, end] = std::mem::replace(&mut self.slices, Self::NO_SLICES);
        for slice in (first..end).rev() {
            let gains = &mut self.gains[slice];
            let mut bytes = [[0; N]; N];
            for row in 0..N {
                for col in 0..N {
                    inside[row][col] += std::mem::take(&mut gains[row * N + col]);
                    bytes[row][col] = (inside[row][col] * full + HALF) as i32 as u8;
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
    use crate::camera::VIEWPOINTS;
    use crate::csg::{Frustum, Kind, Primitive, Torus};
    use crate::grammar::GrammarConfig;
    use crate::random::Random;
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
        assert_eq!(buffers.normal[128 * 256 + 128], [1.0, 0.0, 0.0]);
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

    /// A slanted leg, a cone on its point, an arc, and a ring taken away, among others.
    fn with_all_kinds(shape: &Shape) -> Shape {
        let frustum =
            |round, taper| Kind::Frustum(Frustum { axis: 1, round, shear: [0.1, -0.05], taper: [taper; 2] });
        let torus = |tube, arc| Kind::Torus(Torus { axis: 2, tube, arc });
        let kinds =
            [frustum(false, 0.3), frustum(true, 1.0), torus(0.2, [30.0, 290.0]), torus(0.3, [0.0, 360.0])];
        let more = kinds.into_iter().enumerate().map(|(i, kind)| {
            let half = DVec3::new(0.2, 0.15, 0.1) * (1.0 + 0.3 * i as f64);
            Primitive { kind, additive: i < 3, center: DVec3::splat(0.1 - 0.05 * i as f64), half }
        });
        Shape::new(shape.primitives().iter().copied().chain(more).collect()).unwrap()
    }

    #[test]
    fn every_instruction_set_sees_the_same() {
        let grammar = GrammarConfig { wedges: 0.2, ..GrammarConfig::default() };
        for (i, (azimuth, elevation)) in (0..).zip(VIEWPOINTS) {
            let (shape, _) = grammar.draw(&mut Random::new(5, i, 0)).unwrap();
            let shape = if i % 2 == 0 { with_all_kinds(&shape) } else { shape };
            let camera = Camera::orbit(azimuth, elevation, 0.0, 2.0);
            let caster = RayCaster::new(&shape, &camera).unwrap();
            let best = Buffers::of_shape(&shape, &camera, 100).unwrap();
            let mut baseline =
                Buffers { depth: vec![f32::INFINITY; 10_000], normal: vec![[0.0; 3]; 10_000], size: 100 };
            cast_tiles(&caster, &mut baseline);
            assert!(best.depth == baseline.depth && best.normal == baseline.normal);
            let (mut best, mut baseline) = (vec![0; CELLS], vec![0; CELLS]);
            for rays in 1..=9 {
                fill_frustum(&shape, &camera, rays, &mut best).unwrap();
                baseline.fill(0);
                fill_tiles(&caster, rays, &mut baseline);
                assert!(best == baseline);
            }
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
