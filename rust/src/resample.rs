//! World grid <-> camera grid, trilinear, zero outside the grid that is read.
//!
//! Both ways cells are read line by line. Where the cells of a plane lie in the other grid, up to a division by depth,
//! is an affine function of row and column: a number for each row plus a number for each column, and from these
//! follows the run of each line that lies inside. Grids have N cells along each side; all is compiled for each N.

use crate::camera::Camera;
use crate::dispatch::for_each_instruction_set;
use crate::error::CoreError;
use crate::trilinear::{Grid, Line, Padded, Taps};
use crate::voxel::center_among;
use glam::DVec3;
use rayon::prelude::*;
use std::any::Any;
use std::cell::Cell;
use std::ops::Range;

type Plane<const N: usize> = [Line<N>; N];

/// Reads world volumes `[x, y, z]` at the cells' centres of camera grids `[slice, row, col]`, one a camera.
///
/// Refuses a volume that is not finite; `out` holds anything then.
pub fn to_camera_grid<const N: usize>(
    worlds: &[f32],
    cameras: &[Camera],
    out: &mut [f32],
) -> Result<(), CoreError> {
    each_plane::<N>(worlds, cameras, out, camera_plane)
}

/// Reads camera volumes `[slice, row, col]` at the voxels' centres of world grids `[x, y, z]`, one a camera; voxels
/// outside the frustum keep what `out` holds.
///
/// Refuses a volume that is not finite; `out` holds anything then.
pub fn to_world_grid<const N: usize>(
    volumes: &[f32],
    cameras: &[Camera],
    out: &mut [f32],
) -> Result<(), CoreError> {
    each_plane::<N>(volumes, cameras, out, world_plane)
}

type FillPlane<const N: usize> = fn(&Padded<N>, &Camera, usize, &mut Plane<N>);

/// Fills the planes of all grids side by side. A single small grid is left to the calling thread: to wake others would
/// take as long as what they would spare it.
fn each_plane<const N: usize>(
    volumes: &[f32],
    cameras: &[Camera],
    out: &mut [f32],
    fill_plane: FillPlane<N>,
) -> Result<(), CoreError> {
    let cells = cameras.len() * N * N * N;
    assert_eq!((volumes.len(), out.len()), (cells, cells));
    let fill_grid = |((volume, out), camera): ((&Grid<N>, &mut Grid<N>), &Camera)| {
        with_padded(volume, |padded| {
            let fill = |(i, plane): (usize, &mut Plane<N>)| fill_plane(padded, camera, i, plane);
            if cameras.len() == 1 && N <= 64 {
                out.iter_mut().enumerate().for_each(fill);
            } else {
                out.par_iter_mut().enumerate().for_each(fill);
            }
        })
    };
    let volumes: &[Grid<N>] = volumes.as_chunks().0.as_chunks().0.as_chunks().0;
    let out: &mut [Grid<N>] = out.as_chunks_mut().0.as_chunks_mut().0.as_chunks_mut().0;
    if cameras.len() == 1 {
        return volumes.iter().zip(out).zip(cameras).try_for_each(fill_grid);
    }
    volumes.par_iter().zip(out).zip(cameras).try_for_each(fill_grid)
}

/// Calls `read` with a padded copy of a volume, unless that is not finite.
fn with_padded<const N: usize>(volume: &Grid<N>, read: impl FnOnce(&Padded<N>)) -> Result<(), CoreError> {
    let spare = if N <= KEPT { SPARE.take() } else { None };
    let mut padded: Box<Padded<N>> = spare.and_then(|spare| spare.downcast().ok()).unwrap_or_default();
    let finite = pad(volume, &mut padded);
    if finite {
        read(&padded);
    }
    if N <= KEPT {
        SPARE.set(Some(padded));
    }
    if finite { Ok(()) } else { Err(CoreError::NotFinite { what: "volume" }) }
}

/// The greatest of what `to_camera_grid` would read along each ray `[row, col]` of each camera, in a volume that is
/// nowhere negative.
///
/// Refuses a volume that is not finite; `out` holds anything then.
pub fn greatest_along_rays<const N: usize>(
    world: &[f32],
    cameras: &[Camera],
    out: &mut [f32],
) -> Result<(), CoreError> {
    let worlds: &[Grid<N>] = world.as_chunks().0.as_chunks().0.as_chunks().0;
    let out: &mut [Plane<N>] = out.as_chunks_mut().0.as_chunks_mut().0;
    assert_eq!((world.len(), worlds.len(), out.len()), (N * N * N, 1, cameras.len()));
    with_padded(&worlds[0], |world| {
        let threads = rayon::current_num_threads();
        for (camera, out) in cameras.iter().zip(out) {
            let parts: Vec<Box<[Plane<N>; 2]>> = (0..threads)
                .into_par_iter()
                .map(|part| {
                    let mut planes = Box::new([[[0.0; N]; N]; 2]);
                    for slice in N * part / threads..N * (part + 1) / threads {
                        let [most, plane] = planes.as_mut();
                        camera_plane(world, camera, slice, plane);
                        raise(most, plane);
                    }
                    planes
                })
                .collect();
            *out = [[0.0; N]; N];
            parts.iter().for_each(|part| raise(out, &part[0]));
        }
    })
}

for_each_instruction_set! {
    fn raise<const N: usize>(most: &mut Plane<N>, plane: &Plane<N>) {
        for (most, &value) in most.as_flattened_mut().iter_mut().zip(plane.as_flattened()) {
            *most = most.max(value);
        }
    }
}

/// Padded copies up to this side are kept: 9 MB, where the next size would hold 69 MB in every thread.
const KEPT: usize = 128;

thread_local! {
    /// The padded copy of the last volume that this thread read, for the next one of its size.
    static SPARE: Cell<Option<Box<dyn Any>>> = const { Cell::new(None) };
}

for_each_instruction_set! {
    fn pad<const N: usize>(volume: &Grid<N>, padded: &mut Padded<N>) -> bool {
        padded.fill(volume)
    }
}

for_each_instruction_set! {
    fn camera_plane<const N: usize>(world: &Padded<N>, camera: &Camera, slice: usize, out: &mut Plane<N>) {
        camera_plane_plain(world, camera, slice, out);
    }
}

for_each_instruction_set! {
    fn world_plane<const N: usize>(volume: &Padded<N>, camera: &Camera, x: usize, out: &mut Plane<N>) {
        world_plane_plain(volume, camera, x, out);
    }
}

#[inline(always)]
fn camera_plane_plain<const N: usize>(world: &Padded<N>, camera: &Camera, slice: usize, out: &mut Plane<N>) {
    let (side, depth) = (N as f64, camera.slice_depth(slice, N));
    // In cells of the padded world grid.
    let [per_col, per_row] = [camera.axes[0], camera.axes[1]].map(|a| a * (2.0 * camera.half_image * depth));
    let middle = (camera.position + camera.axes[2] * depth + 0.5) * side + 0.5;
    let corner = middle - (per_row + per_col) * (0.5 * (side - 1.0));
    let rows: [Line<N>; 3] = std::array::from_fn(|a| affine(corner[a], per_row[a]));
    let cols: [Line<N>; 3] = std::array::from_fn(|a| affine(0.0, per_col[a]));
    let mut runs = Runs::default();
    for (at, slope) in rows.iter().zip(per_col.to_array()) {
        runs.restrict(at, slope as f32);
        runs.restrict(&at.map(|at| (N + 1) as f32 - at), -slope as f32);
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
fn world_plane_plain<const N: usize>(volume: &Padded<N>, camera: &Camera, x: usize, out: &mut Plane<N>) {
    let half = 0.5 * N as f64;
    let focal = half / camera.half_image;
    let per_slice = N as f64 / (camera.far - camera.near);
    // Slices from the near plane; row and column from the image's middle, both times depth; depth.
    let [right, down, forward] = camera.axes;
    let measures = [forward * per_slice, down * focal, right * focal, forward];
    let corner = DVec3::from([x, 0, 0].map(|i| center_among(i, N))) - camera.position;
    let start = |a: usize| measures[a].dot(corner) - if a == 0 { camera.near * per_slice } else { 0.0 };
    let rows: [Line<N>; 4] = std::array::from_fn(|a| affine(start(a), measures[a].y / N as f64));
    let cols: [Line<N>; 4] = std::array::from_fn(|a| affine(0.0, measures[a].z / N as f64));
    let slopes = measures.map(|m| (m.z / N as f64) as f32);
    let mut runs = Runs::default();
    runs.restrict(&rows[0], slopes[0]);
    runs.restrict(&rows[0].map(|slice| N as f32 - slice), -slopes[0]);
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
        if run == (0..N) {
            taps.read(volume, run, line);
        } else {
            let mut read = [0.0; N];
            taps.read(volume, run.clone(), &mut read);
            line[run.clone()].copy_from_slice(&read[run]);
        }
    }
}

fn affine<const N: usize>(start: f64, step: f64) -> Line<N> {
    std::array::from_fn(|i| (start + step * i as f64) as f32)
}

/// For each line of a plane, the cells for which all of some conditions hold.
struct Runs<const N: usize> {
    first: Line<N>,
    last: Line<N>,
}

impl<const N: usize> Default for Runs<N> {
    fn default() -> Self {
        Self { first: [0.0; N], last: [(N - 1) as f32; N] }
    }
}

impl<const N: usize> Runs<N> {
    /// Leaves the cells for which `slack + slope * cell` is not negative.
    #[inline(always)]
    fn restrict(&mut self, slack: &Line<N>, slope: f32) {
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
mod tests;
