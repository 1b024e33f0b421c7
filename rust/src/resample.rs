//! World grid <-> camera grid, trilinear, zero outside the grid that is read.
//!
//! Both ways cells are read in lines of 64. Where the cells of a plane lie in the other grid, up to a division by depth,
//! is an affine function of row and column: a number for each row plus a number for each column, and from these
//! follows the run of each line that lies inside.

use crate::camera::Camera;
use crate::dispatch::for_each_instruction_set;
use crate::error::CoreError;
use crate::trilinear::{Padded, Taps};
use crate::voxel::{CELLS, SIDE, voxel_center};
use glam::DVec3;
use rayon::prelude::*;
use std::cell::Cell;
use std::ops::Range;

/// A number for each row or column of a plane.
type Line = [f32; SIDE];
type Plane = [Line; SIDE];

/// Reads world volumes `[x, y, z]` at the cells' centres of camera grids `[slice, row, col]`, one a camera.
///
/// Refuses a volume that is not finite; `out` holds anything then.
pub fn to_camera_grid(worlds: &[f32], cameras: &[Camera], out: &mut [f32]) -> Result<(), CoreError> {
    each_plane(worlds, cameras, out, camera_plane)
}

/// Reads camera volumes `[slice, row, col]` at the voxels' centres of world grids `[x, y, z]`, one a camera; voxels
/// outside the frustum keep what `out` holds.
///
/// Refuses a volume that is not finite; `out` holds anything then.
pub fn to_world_grid(volumes: &[f32], cameras: &[Camera], out: &mut [f32]) -> Result<(), CoreError> {
    each_plane(volumes, cameras, out, world_plane)
}

type FillPlane = fn(&Padded, &Camera, usize, &mut Plane);

/// Fills the planes of all grids side by side. A single grid is left to the calling thread: to wake others would take
/// as long as what they would spare it.
fn each_plane(
    volumes: &[f32],
    cameras: &[Camera],
    out: &mut [f32],
    fill_plane: FillPlane,
) -> Result<(), CoreError> {
    assert_eq!((volumes.len(), out.len()), (cameras.len() * CELLS, cameras.len() * CELLS));
    let fill_grid = |((volume, out), camera): ((&[f32; CELLS], &mut [f32; CELLS]), &Camera)| {
        let mut padded = SPARE.take().unwrap_or_default();
        let finite = pad(volume, &mut padded);
        if finite {
            let planes: &mut [Plane] = out.as_chunks_mut().0.as_chunks_mut().0;
            let fill = |(i, plane): (usize, &mut Plane)| fill_plane(&padded, camera, i, plane);
            if cameras.len() == 1 {
                planes.iter_mut().enumerate().for_each(fill);
            } else {
                planes.par_iter_mut().enumerate().for_each(fill);
            }
        }
        SPARE.set(Some(padded));
        if finite { Ok(()) } else { Err(CoreError::NotFinite { what: "volume" }) }
    };
    let (volumes, out) = (volumes.as_chunks().0, out.as_chunks_mut().0);
    if cameras.len() == 1 {
        return volumes.iter().zip(out).zip(cameras).try_for_each(fill_grid);
    }
    volumes.par_iter().zip(out).zip(cameras).try_for_each(fill_grid)
}

thread_local! {
    /// The padded copy of the last volume that this thread read, for the next one.
    static SPARE: Cell<Option<Padded>> = const { Cell::new(None) };
}

for_each_instruction_set! {
    fn pad(volume: &[f32; CELLS], padded: &mut Padded) -> bool {
        padded.fill(volume)
    }
}

for_each_instruction_set! {
    fn camera_plane(world: &Padded, camera: &Camera, slice: usize, out: &mut Plane) {
        camera_plane_plain(world, camera, slice, out);
    }
}

for_each_instruction_set! {
    fn world_plane(volume: &Padded, camera: &Camera, x: usize, out: &mut Plane) {
        world_plane_plain(volume, camera, x, out);
    }
}

#[inline(always)]
fn camera_plane_plain(world: &Padded, camera: &Camera, slice: usize, out: &mut Plane) {
    let (side, depth) = (SIDE as f64, camera.slice_depth(slice));
    // In cells of the padded world grid.
    let [per_col, per_row] = [camera.axes[0], camera.axes[1]].map(|a| a * (2.0 * camera.half_image * depth));
    let middle = (camera.position + camera.axes[2] * depth + 0.5) * side + 0.5;
    let corner = middle - (per_row + per_col) * (0.5 * (side - 1.0));
    let rows: [Line; 3] = std::array::from_fn(|a| affine(corner[a], per_row[a]));
    let cols: [Line; 3] = std::array::from_fn(|a| affine(0.0, per_col[a]));
    let mut runs = Runs::default();
    for (at, slope) in rows.iter().zip(per_col.to_array()) {
        runs.restrict(at, slope as f32);
        runs.restrict(&at.map(|at| (SIDE + 1) as f32 - at), -slope as f32);
    }
    let mut taps = Taps::default();
    for (row, line) in out.iter_mut().enumerate() {
        line.fill(0.0);
        let run = runs.of(row);
        if !run.is_empty() {
            taps.fill(|col| std::array::from_fn(|a| rows[a][row] + cols[a][col]));
            taps.read(world, run, line);
        }
    }
}

#[inline(always)]
fn world_plane_plain(volume: &Padded, camera: &Camera, x: usize, out: &mut Plane) {
    let half = 0.5 * SIDE as f64;
    let focal = half / camera.half_image;
    let per_slice = SIDE as f64 / (camera.far - camera.near);
    // Slices from the near plane; row and column from the image's middle, both times depth; depth.
    let [right, down, forward] = camera.axes;
    let measures = [forward * per_slice, down * focal, right * focal, forward];
    let corner = DVec3::new(voxel_center(x), voxel_center(0), voxel_center(0)) - camera.position;
    let start = |a: usize| measures[a].dot(corner) - if a == 0 { camera.near * per_slice } else { 0.0 };
    let rows: [Line; 4] = std::array::from_fn(|a| affine(start(a), measures[a].y / SIDE as f64));
    let cols: [Line; 4] = std::array::from_fn(|a| affine(0.0, measures[a].z / SIDE as f64));
    let slopes = measures.map(|m| (m.z / SIDE as f64) as f32);
    let mut runs = Runs::default();
    runs.restrict(&rows[0], slopes[0]);
    runs.restrict(&rows[0].map(|slice| SIDE as f32 - slice), -slopes[0]);
    let half = half as f32;
    for a in [1, 2] {
        for sign in [1.0, -1.0] {
            let slack = std::array::from_fn(|y| half * rows[3][y] + sign * rows[a][y]);
            runs.restrict(&slack, half * slopes[3] + sign * slopes[a]);
        }
    }
    let mut taps = Taps::default();
    for (y, line) in out.iter_mut().enumerate() {
        let run = runs.of(y);
        if run.is_empty() {
            continue;
        }
        taps.fill(|z| {
            let [slice, row, col, depth] = std::array::from_fn(|a| rows[a][y] + cols[a][z]);
            let scale = 1.0 / depth;
            [slice + 0.5, row * scale + (half + 0.5), col * scale + (half + 0.5)]
        });
        if run == (0..SIDE) {
            taps.read(volume, run, line);
        } else {
            let mut read = [0.0; SIDE];
            taps.read(volume, run.clone(), &mut read);
            line[run.clone()].copy_from_slice(&read[run]);
        }
    }
}

fn affine(start: f64, step: f64) -> Line {
    std::array::from_fn(|i| (start + step * i as f64) as f32)
}

/// For each line of a plane, the cells for which all of some conditions hold.
struct Runs {
    first: Line,
    last: Line,
}

impl Default for Runs {
    fn default() -> Self {
        Self { first: [0.0; SIDE], last: [(SIDE - 1) as f32; SIDE] }
    }
}

impl Runs {
    /// Leaves the cells for which `slack + slope * cell` is not negative.
    #[inline(always)]
    fn restrict(&mut self, slack: &Line, slope: f32) {
        // Where the slope is 0 the quotient is infinite, and its sign is right; it is NaN, and ignored, at 0 / 0.
        if slope >= 0.0 {
            self.first.iter_mut().zip(slack).for_each(|(first, s)| *first = first.max(-s / slope.abs()));
        } else {
            self.last.iter_mut().zip(slack).for_each(|(last, s)| *last = last.min(s / -slope));
        }
    }

    #[inline(always)]
    fn of(&self, line: usize) -> Range<usize> {
        let (first, last) = (self.first[line], self.last[line]);
        if first > last {
            return 0..0;
        }
        let whole = first as usize;
        whole + usize::from(whole as f32 != first)..last as usize + 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trilinear::trilinear;
    use glam::Vec3;
    use proptest::prelude::*;

    const SIZE: f32 = SIDE as f32;

    fn any_camera() -> impl Strategy<Value = Camera> {
        (0.0..360.0, -90.0..90.0, 0.0..360.0, 0.8..4.0, 20.0..100.0, 0.1..1.5, 0.2..3.0).prop_map(
            |(azimuth, elevation, roll, distance, fov, near, depth)| {
                let orbit = Camera::orbit(azimuth, elevation, roll, distance);
                Camera::new(orbit.position, orbit.axes, fov, near, near + depth).unwrap()
            },
        )
    }

    fn noise() -> Vec<f32> {
        (0..CELLS as u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 16) as f32 / 65536.0).collect()
    }

    fn cell(i: usize) -> [usize; 3] {
        [i / 4096, i / 64 % 64, i % 64]
    }

    /// Positions have an ulp or two of 64 cells along each axis; noise may change by 1 within a cell.
    const TOLERANCE: f32 = 3.0 * 3.0 * 64.0 * f32::EPSILON;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn each_cell_is_read_where_its_centre_is(camera in any_camera()) {
            let volume = noise();
            let (mut seen, mut back) = (vec![9.0; CELLS], vec![-1.0; CELLS]);
            to_camera_grid(&volume, &[camera], &mut seen).unwrap();
            to_world_grid(&volume, &[camera], &mut back).unwrap();
            let half = camera.half_image;
            for i in (0..CELLS).step_by(37) {
                let [slice, row, col] = cell(i);
                let at = |i: usize| (2 * i + 1) as f64 / SIDE as f64 - 1.0;
                let p = camera.position + camera.ray(at(col), at(row)) * camera.slice_depth(slice);
                let at = ((p + 0.5) * SIDE as f64 - 0.5).as_vec3();
                // Beyond a few cells outside, positions are as coarse as they are large, and read 0 all the same.
                if at.abs().max_element() < 2.0 * SIZE {
                    let expected = trilinear(&volume, at);
                    prop_assert!((seen[i] - expected).abs() < TOLERANCE, "{i} {} {expected}", seen[i]);
                } else {
                    prop_assert_eq!(seen[i], 0.0);
                }
                let p = camera.to_camera(DVec3::from(cell(i).map(voxel_center)));
                let slice = (p.z - camera.near) / (camera.far - camera.near);
                let [row, col] = [p.y, p.x].map(|c| 0.5 + 0.5 * c / (p.z * half));
                let at = DVec3::new(slice, row, col) * SIDE as f64;
                let outside = (at - at.clamp(DVec3::ZERO, DVec3::splat(SIDE as f64))).abs().max_element();
                let margin = at.min(DVec3::splat(SIDE as f64) - at).abs().min_element();
                if margin < 1e-3 {
                    continue;
                }
                if outside > 0.0 || p.z < 0.0 {
                    prop_assert_eq!(back[i], -1.0);
                } else {
                    let expected = trilinear(&volume, (at - 0.5).as_vec3());
                    prop_assert!((back[i] - expected).abs() < TOLERANCE, "{i} {} {expected}", back[i]);
                }
            }
        }

        #[test]
        fn every_instruction_set_reads_the_same(camera in any_camera(), plane in 0..SIDE) {
            let mut padded = Padded::default();
            prop_assert!(padded.fill(noise().first_chunk().unwrap()));
            let mut chosen = [[0.25; SIDE]; SIDE];
            let mut plain = chosen;
            camera_plane(&padded, &camera, plane, &mut chosen);
            camera_plane_plain(&padded, &camera, plane, &mut plain);
            prop_assert_eq!(chosen, plain);
            world_plane(&padded, &camera, plane, &mut chosen);
            world_plane_plain(&padded, &camera, plane, &mut plain);
            prop_assert_eq!(chosen, plain);
        }
    }

    #[test]
    fn a_position_at_a_centre_reads_that_cell() {
        let (volume, camera) = (noise(), Camera::orbit(0.0, 0.0, 0.0, 2.0));
        let mut taps = crate::trilinear::Taps::default();
        let mut padded = Padded::default();
        assert!(padded.fill(volume.first_chunk().unwrap()));
        for i in [0, 1, 62, 63] {
            let mut read = [9.0; SIDE];
            taps.fill(|k| [i as f32 + 1.0, (63 - i) as f32 + 1.0, k as f32 + 1.0]);
            taps.read(&padded, 0..SIDE, &mut read);
            assert_eq!(read, volume[i * 4096 + (63 - i) * 64..][..SIDE]);
            taps.fill(|_| [f32::NAN, -1e30, 1e30]);
            taps.read(&padded, 0..SIDE, &mut read);
            assert_eq!(read, [0.0; SIDE], "held to the layer of zeros");
        }
        for hole in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut broken = volume.clone();
            broken[CELLS - 1] = hole;
            let mut out = vec![0.0; CELLS];
            assert!(to_camera_grid(&broken, &[camera], &mut out).is_err());
            assert!(to_world_grid(&broken, &[camera], &mut out).is_err());
        }
    }

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
            to_camera_grid(&blob, &[camera], &mut seen).unwrap();
            to_world_grid(&seen, &[camera], &mut back).unwrap();
            let worst = blob.iter().zip(&back).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst < 0.03, "{worst}");
        }
    }

    #[test]
    fn a_constant_field_stays_constant_well_inside() {
        let camera = Camera::orbit(52.5, 38.0, 0.0, 2.0);
        let (mut seen, mut back) = (vec![9.0; CELLS], vec![-1.0; CELLS]);
        to_camera_grid(&vec![1.0; CELLS], &[camera], &mut seen).unwrap();
        assert!((seen[32 * 4096 + 32 * 64 + 32] - 1.0).abs() < 1e-6);
        assert_eq!(seen[0], 0.0, "outside the world grid");
        to_world_grid(&vec![1.0; CELLS], &[camera], &mut back).unwrap();
        assert!((back[32 * 4096 + 32 * 64 + 32] - 1.0).abs() < 1e-6);
        assert!(back.contains(&-1.0), "some corners lie outside the frustum and stay");
    }
}
