//! From image planes to the world: where each cell of a coarse world grid finds its features in a drawing.
//!
//! A network describes a drawing by a *feature volume* in its camera's frustum: `PLANE`^2 pixels, `BINS` depths
//! between near and far. A cell of the world grid reads it at the projection of its centre, linearly between pixels
//! and depths. Shapes are symmetric about z = 0, so that cells are those of the half z > 0, and each reads twice: at
//! its own place, and at its mirror image's.

use crate::camera::Camera;
use crate::dispatch::for_each_instruction_set;
use glam::DVec3;
use std::ops::Range;

/// Pixels along each side of the feature volume.
pub const PLANE: usize = 64;
/// Depths of the feature volume.
pub const BINS: usize = 16;
/// Entries of the feature volume.
pub const ENTRIES: usize = PLANE * PLANE * BINS;
/// Cells along x and y of the half grid; half as many along z.
pub const COARSE: usize = 32;
/// Cells of the half grid.
pub const HALF: usize = COARSE * COARSE * COARSE / 2;
/// Entries of the feature volume that a cell reads.
pub const TAPS: usize = 8;

/// Rows (pixel by pixel, depths within) and weights of the entries that one reading combines; weights are 0 outside
/// the image.
type Taps = [(usize, f32); TAPS];

/// Reads a feature volume, `PLANE`^2 x `BINS` x `width`, at the cells of as many planes x = `first`, `first` + 1, ...
/// as `out` has room for: (`COARSE`^2 / 2) x 2 x `width` each, own place then mirror image.
pub fn read(camera: &Camera, features: &[f32], width: usize, first: usize, out: &mut [f32]) {
    assert_eq!(features.len(), ENTRIES * width);
    assert_eq!(out.len() % (HALF / COARSE * 2 * width), 0);
    let planes = first..first + out.len() / (HALF / COARSE * 2 * width);
    assert!(planes.end <= COARSE);
    read_planes(camera, features, width, planes, out);
}

/// Features that are summed side by side: a vector of AVX-512.
const LANES: usize = 16;

for_each_instruction_set! {
fn read_planes(camera: &Camera, features: &[f32], width: usize, planes: Range<usize>, out: &mut [f32]) {
    for_each_reading(camera, planes, |reading, taps| {
        let (lanes, rest) = out[reading * width..][..width].as_chunks_mut::<LANES>();
        for (i, out) in lanes.iter_mut().enumerate() {
            let mut sum = [0.0; LANES];
            for (row, weight) in taps {
                let feature: &[f32; LANES] = features[row * width + i * LANES..].first_chunk().expect("a row");
                for lane in 0..LANES {
                    sum[lane] += weight * feature[lane];
                }
            }
            *out = sum;
        }
        let done = width - rest.len();
        rest.fill(0.0);
        for (row, weight) in taps {
            let feature = &features[row * width..][done..width];
            rest.iter_mut().zip(feature).for_each(|(o, f)| *o += weight * f);
        }
    });
}
}

/// The transpose of `read`: adds every cell's gradient to the entries that it was read from.
pub fn read_transposed(camera: &Camera, gradient: &[f32], width: usize, out: &mut [f32]) {
    assert_eq!(out.len(), ENTRIES * width);
    assert_eq!(gradient.len(), 2 * HALF * width);
    add_readings(camera, gradient, width, out);
}

for_each_instruction_set! {
fn add_readings(camera: &Camera, gradient: &[f32], width: usize, out: &mut [f32]) {
    for_each_reading(camera, 0..COARSE, |reading, taps| {
        let (lanes, rest) = gradient[reading * width..][..width].as_chunks::<LANES>();
        for (row, weight) in taps {
            let (out, out_rest) = out[row * width..][..width].as_chunks_mut::<LANES>();
            for (out, gradient) in out.iter_mut().zip(lanes) {
                for lane in 0..LANES {
                    out[lane] += weight * gradient[lane];
                }
            }
            out_rest.iter_mut().zip(rest).for_each(|(o, g)| *o += weight * g);
        }
    });
}
}

/// Rows and weights of all readings, for devices that gather by themselves.
pub fn fill_taps(camera: &Camera, rows: &mut [i32], weights: &mut [f32]) {
    assert_eq!(rows.len(), 2 * HALF * TAPS);
    assert_eq!(weights.len(), rows.len());
    for_each_reading(camera, 0..COARSE, |reading, taps| {
        for (i, (row, weight)) in taps.into_iter().enumerate() {
            rows[reading * TAPS + i] = row as i32;
            weights[reading * TAPS + i] = weight;
        }
    });
}

#[inline(always)]
fn for_each_reading(camera: &Camera, planes: Range<usize>, mut visit: impl FnMut(usize, Taps)) {
    let at = |i: usize| (i as f64 + 0.5) / COARSE as f64 - 0.5;
    let along_z = camera.to_camera(camera.position + DVec3::Z);
    let mut reading = 0;
    for x in planes {
        for y in 0..COARSE {
            let foot = camera.to_camera(DVec3::new(at(x), at(y), 0.0));
            for z in COARSE / 2..COARSE {
                for side in [1.0, -1.0] {
                    visit(reading, taps(camera, foot + along_z * (side * at(z))));
                    reading += 1;
                }
            }
        }
    }
}

/// The entries around a point in camera coordinates.
#[inline(always)]
fn taps(camera: &Camera, p: DVec3) -> Taps {
    if p.z <= 0.0 {
        return [(0, 0.0); TAPS];
    }
    let focal = 0.5 * PLANE as f64 / camera.half_image / p.z;
    let middle = 0.5 * (PLANE - 1) as f64;
    let depth = (p.z - camera.near) / (camera.far - camera.near) * BINS as f64 - 0.5;
    let (col, cols) = pair(p.x * focal + middle, PLANE);
    let (row, rows) = pair(p.y * focal + middle, PLANE);
    let (bin, bins) = pair(depth.clamp(0.0, (BINS - 1) as f64), BINS);
    std::array::from_fn(|i| {
        let (dx, dy, dd) = (i >> 1 & 1, i >> 2, i & 1);
        (((row[dy] * PLANE) + col[dx]) * BINS + bin[dd], rows[dy] * cols[dx] * bins[dd])
    })
}

/// The two of `count` places around `at`, and their shares; a place that does not exist has none, and stands for 0.
#[inline(always)]
fn pair(at: f64, count: usize) -> ([usize; 2], [f32; 2]) {
    let low = at.floor();
    let share = at - low;
    let place = |at: f64, share: f64| {
        let exists = at >= 0.0 && at < count as f64;
        if exists { (at as usize, share as f32) } else { (0, 0.0) }
    };
    let ((i, a), (j, b)) = (place(low, 1.0 - share), place(low + 1.0, share));
    ([i, j], [a, b])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{DISTANCE, VIEWPOINTS};

    /// A volume whose entries are `value(row of the image, column, depth)`.
    fn volume(value: impl Fn(f64, f64, f64) -> f64) -> Vec<f32> {
        let at = |i: usize| {
            value((i / (PLANE * BINS)) as f64, (i / BINS % PLANE) as f64, (i % BINS) as f64) as f32
        };
        (0..ENTRIES).map(at).collect()
    }

    /// Own and mirrored reading of the cell (x, y, z) of the half grid.
    fn reading(camera: &Camera, features: &[f32], [x, y, z]: [usize; 3]) -> [f32; 2] {
        let mut out = vec![9.0; 2 * HALF];
        read(camera, features, 1, 0, &mut out);
        out.as_chunks().0[(x * COARSE + y) * COARSE / 2 + z]
    }

    #[test]
    fn a_cell_is_read_at_its_projection_and_at_its_mirror_images() {
        let camera = Camera::orbit(0.0, 0.0, 0.0, DISTANCE);
        // Seen along -x from (2, 0, 0): right is -z, down is -y. The cell is centred on (5, 3, 7) / 64.
        let (x, y, z) = (5.0 / 64.0, 3.0 / 64.0, 7.0 / 64.0);
        let focal = 0.5 * PLANE as f64 / camera.half_image / (DISTANCE - x);
        let cell = [18, 17, 3];
        let rows = reading(&camera, &volume(|row, _, _| row), cell);
        let cols = reading(&camera, &volume(|_, col, _| col), cell);
        let depths = reading(&camera, &volume(|_, _, depth| depth), cell);
        let expected = [
            [31.5 - y * focal; 2],
            [31.5 - z * focal, 31.5 + z * focal],
            [(DISTANCE - x - camera.near) / (camera.far - camera.near) * BINS as f64 - 0.5; 2],
        ];
        for (got, expected) in [rows, cols, depths].as_flattened().iter().zip(expected.as_flattened()) {
            assert!((f64::from(*got) - expected).abs() < 1e-4, "{got} {expected}");
        }
    }

    #[test]
    fn depths_beyond_the_outermost_are_read_there_and_nothing_is_behind_the_eye() {
        let depths = volume(|_, _, depth| depth + 1.0);
        let middle = [COARSE / 2, COARSE / 2, 0];
        let camera = Camera::orbit(0.0, 0.0, 0.0, DISTANCE);
        let at = |near: f64, far: f64| reading(&Camera { near, far, ..camera }, &depths, middle);
        assert!(at(3.0, 4.0).iter().all(|v| (v - 1.0).abs() < 1e-6));
        assert!(at(0.5, 1.0).iter().all(|v| (v - BINS as f32).abs() < 1e-5));
        let beyond = Camera { position: -camera.position, ..camera };
        assert_eq!(reading(&beyond, &depths, middle), [0.0; 2]);
    }

    #[test]
    fn the_transpose_of_reading_is_its_transpose() {
        let wave = |n: usize, pace: f64| (0..n).map(|i| (i as f64 * pace).sin() as f32).collect::<Vec<_>>();
        let (features, gradient) = (wave(2 * ENTRIES, 0.7), wave(4 * HALF, 1.3));
        let dot = |a: &[f32], b: &[f32]| -> f64 {
            a.iter().zip(b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum()
        };
        for (azimuth, elevation) in VIEWPOINTS {
            let camera = Camera::orbit(azimuth, elevation, 0.1, DISTANCE);
            let (mut there, mut back) = (vec![0.0; 4 * HALF], vec![0.0; 2 * ENTRIES]);
            read(&camera, &features, 2, 0, &mut there);
            read_transposed(&camera, &gradient, 2, &mut back);
            let (a, b) = (dot(&there, &gradient), dot(&features, &back));
            assert!((a - b).abs() < 1e-2, "{a} {b}");
        }
    }

    #[test]
    fn taps_are_what_reading_combines() {
        let camera = Camera::orbit(37.5, 38.0, 0.0, DISTANCE);
        let (mut rows, mut weights) = (vec![-1; 2 * HALF * TAPS], vec![-1.0; 2 * HALF * TAPS]);
        fill_taps(&camera, &mut rows, &mut weights);
        let features = volume(|row, col, depth| (row * 0.9 + col * 0.4 + depth).sin());
        let mut out = vec![0.0; 2 * HALF];
        read(&camera, &features, 1, 0, &mut out);
        let taps = rows.as_chunks::<TAPS>().0.iter().zip(weights.as_chunks::<TAPS>().0);
        for ((rows, weights), got) in taps.zip(out) {
            let sum: f32 = rows.iter().zip(weights).map(|(&r, w)| w * features[r as usize]).sum();
            assert_eq!(sum, got);
        }
    }
}
