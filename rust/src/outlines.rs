//! What every outline demands of a solid: to be covered where it is drawn, and empty beyond.
//!
//! A network weighs probabilities voxel by voxel, and nothing makes it say "somewhere along this ray": where it knows
//! that there is something and not how deep, each voxel may stay below one half and the solid has a hole. Its
//! probabilities still say where along the ray the solid is most likely, so that is where it is raised.

use crate::camera::Camera;
use crate::column::{Column, DEEP};
use crate::dispatch::for_each_instruction_set;
use crate::error::{CoreError, all_finite};
use crate::evidence::{BORDER, PIXEL};
use crate::exponential::{exponential, logarithm};
use crate::resample::greatest_along_rays;
use crate::voxel::{CELLS, SIDE};
use rayon::prelude::*;

/// How far beyond 0 the logits are moved, for the surface is interpolated between voxels.
const MARGIN: f32 = 0.4;
/// What a logit should grow by in one pixel inside the outline, up to the margin: so that the surface ends at it.
const SLOPE: f32 = 0.6;
/// How far inside the ink's outer border the outline is, in pixels: lines are drawn about it.
const STROKE: f32 = 0.5;
/// Cells over which what is missing is spread, since drawings err: a normal distribution's standard deviation.
const BLUR: f64 = 0.5;
/// The most that a logit is moved: drawings err, and networks may know better.
const LIMIT: f32 = 2.0;
/// Logits are between -FAR and FAR.
const FAR: f32 = 12.0;
/// A pixel outside the outline of some drawing, in the hull's steps: up to here, voxels are raised.
const RAISED: u8 = BORDER - PIXEL;
/// Two pixels outside: beyond, they are cleared.
const CLEARED: u8 = BORDER - 2 * PIXEL;

/// Cells of an image of the camera grid.
pub const RAYS: usize = SIDE * SIDE;
/// Cells of an image with a border of zeros.
const WIDE: usize = SIDE + 2;

type Image = [[f32; WIDE]; WIDE];

/// The volume with every outline filled as far as its probabilities allow, and what lies beyond one cleared.
///
/// `volume`: probabilities `[x, y, z]`, symmetric about z = 0; `depths`: how far inside each drawing's outline a cell
/// of its camera's grid is, in pixels, `[drawing, row, col]`; `hull`: the first part of the evidence. Refuses a volume
/// that is not finite.
pub fn heed(
    volume: &[f32],
    depths: &[f32],
    cameras: &[Camera],
    hull: &[u8],
    out: &mut [f32],
) -> Result<(), CoreError> {
    assert_eq!((volume.len(), out.len(), hull.len()), (CELLS, CELLS, CELLS / 2));
    assert_eq!(depths.len(), cameras.len() * RAYS);
    all_finite(volume, "volume")?;
    // Until the end `out` has logits, all positive: outside the grid is 0, and there is nothing.
    let planes = |out: &mut [f32], change: &(dyn Fn(usize, &mut [f32]) + Sync)| {
        out.par_chunks_mut(RAYS).with_min_len(4).enumerate().for_each(|(x, plane)| change(x, plane));
    };
    planes(out, &|x, plane| to_logits(&volume[x * RAYS..][..RAYS], plane));
    let mut along = vec![0.0; cameras.len() * RAYS];
    greatest_along_rays::<SIDE>(out, cameras, &mut along)?;
    let lacks: Vec<Image> = (along.chunks_exact(RAYS).zip(depths.chunks_exact(RAYS)))
        .map(|(along, depths)| lack(along, depths))
        .collect();
    planes(out, &|x, plane| move_logits(x, &lacks, cameras, &hull[x * RAYS / 2..][..RAYS / 2], plane));
    Ok(())
}

for_each_instruction_set! {
    fn to_logits(probabilities: &[f32], out: &mut [f32]) {
        let least = 1.0 / (1.0 + exponential(FAR));
        for (out, &p) in out.iter_mut().zip(probabilities) {
            let p = p.max(least).min(1.0 - least);
            *out = logarithm(p / (1.0 - p)) + FAR;
        }
    }
}

/// What the likeliest voxel along each ray lacks, at most `LIMIT`, a little spread.
fn lack(along: &[f32], depths: &[f32]) -> Image {
    let mut lack = [[0.0; SIDE]; SIDE];
    for ((lack, along), &pixels) in lack.as_flattened_mut().iter_mut().zip(along).zip(depths) {
        if pixels > 0.0 {
            let asked = (SLOPE * (pixels - STROKE)).min(MARGIN);
            *lack = (asked - (along - FAR)).clamp(0.0, LIMIT);
        }
    }
    let lack = transposed(&spread(&transposed(&spread(&lack))));
    let mut image = [[0.0; WIDE]; WIDE];
    for (row, lack) in image[1..].iter_mut().zip(&lack) {
        row[1..=SIDE].copy_from_slice(lack);
    }
    image
}

/// Each row is the mean of rows near it; beyond the border lies the image's mirror image.
fn spread(rows: &[[f32; SIDE]; SIDE]) -> [[f32; SIDE]; SIDE] {
    let share = |far: f64| (-0.5 * (far / BLUR).powi(2)).exp();
    let total = share(0.0) + 2.0 * (share(1.0) + share(2.0));
    let shares = [2.0, 1.0, 0.0, 1.0, 2.0].map(|far| (share(far) / total) as f32);
    let last = SIDE as isize - 1;
    std::array::from_fn(|row| {
        let mut mean = [0.0; SIDE];
        for (share, near) in shares.iter().zip(row as isize - 2..) {
            let near = if near < 0 { -1 - near } else { near.min(2 * last + 1 - near) };
            mean.iter_mut().zip(rows[near as usize]).for_each(|(mean, value)| *mean += share * value);
        }
        mean
    })
}

fn transposed(image: &[[f32; SIDE]; SIDE]) -> [[f32; SIDE]; SIDE] {
    std::array::from_fn(|col| std::array::from_fn(|row| image[row][col]))
}

for_each_instruction_set! {
    /// From logits above `-FAR` of a plane of voxels, `[y, z]`, to probabilities that heed the outlines.
    fn move_logits(x: usize, lacks: &[Image], cameras: &[Camera], hull: &[u8], plane: &mut [f32]) {
        let columns = plane.chunks_exact_mut(SIDE).zip(hull.chunks_exact(DEEP));
        for (y, (column, hull)) in columns.enumerate() {
            let mut missing = [0.0; DEEP];
            if hull.iter().any(|&hull| hull >= RAISED) {
                for (camera, lack) in cameras.iter().zip(lacks) {
                    for column in Column::seen_by(camera, x, y) {
                        raise(&column, camera, lack, &mut missing);
                    }
                }
            }
            let mut half = [0.0; DEEP];
            for k in 0..DEEP {
                let logit = column[DEEP + k] - FAR;
                let raise = if hull[k] >= RAISED { missing[k] } else { 0.0 };
                let cut = if hull[k] < CLEARED { (logit + MARGIN).clamp(0.0, LIMIT) } else { 0.0 };
                half[k] = 1.0 / (1.0 + exponential(cut - raise - logit));
            }
            let (below, above) = column.split_at_mut(DEEP);
            above.copy_from_slice(&half);
            below.iter_mut().zip(half.iter().rev()).for_each(|(below, &half)| *below = half);
        }
    }
}

/// Raises `missing` to what is lacking along the rays through a column's voxels.
#[inline(always)]
fn raise(column: &Column, camera: &Camera, lack: &Image, missing: &mut [f32; DEEP]) {
    let half = 0.5 * SIDE as f32;
    let focal = half / camera.half_image as f32;
    let (near, far) = (camera.near as f32, camera.far as f32);
    let (mut first, mut right, mut down) = ([0; DEEP], [0.0; DEEP], [0.0; DEEP]);
    let mut seen = [0.0; DEEP];
    for k in 0..DEEP {
        let p = column.center(k);
        let scale = focal / p.z;
        let (col, row) = (p.x * scale, p.y * scale);
        let inside = (col.abs() <= half) & (row.abs() <= half) & (p.z >= near) & (p.z <= far);
        seen[k] = if inside { 1.0 } else { 0.0 };
        // In cells of the image with its border, where a cell's centre is a whole number.
        let (col, row) = (col + (half + 0.5), row + (half + 0.5));
        let (col, row) = if inside { (col, row) } else { (0.0, 0.0) };
        let (left, top) = (col as u32, row as u32);
        (right[k], down[k]) = (col - left as f32, row - top as f32);
        first[k] = top * WIDE as u32 + left;
    }
    let lack = &lack.as_flattened()[..WIDE * WIDE];
    for k in 0..DEEP {
        // The last row and column are read where a point lies on the image's border.
        let at = (first[k] as usize).min(WIDE * WIDE - WIDE - 2);
        let four = [lack[at], lack[at + 1], lack[at + WIDE], lack[at + WIDE + 1]];
        let (top, bottom) =
            (four[0] + right[k] * (four[1] - four[0]), four[2] + right[k] * (four[3] - four[2]));
        missing[k] = missing[k].max(seen[k] * (top + down[k] * (bottom - top)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{DISTANCE, VIEWPOINTS};

    fn viewpoint(i: usize) -> Camera {
        Camera::orbit(VIEWPOINTS[i].0, VIEWPOINTS[i].1, 0.0, DISTANCE)
    }

    fn heeded(p: f32, depth: f32, hull: u8) -> Vec<f32> {
        let mut out = vec![7.0; CELLS];
        let hull = vec![hull; CELLS / 2];
        heed(&vec![p; CELLS], &vec![depth; RAYS], &[viewpoint(0)], &hull, &mut out).unwrap();
        out
    }

    const MIDDLE: usize = (SIDE / 2 * SIDE + SIDE / 2) * SIDE + SIDE / 2;

    #[test]
    fn inside_the_outline_logits_are_raised_to_the_margin_and_beyond_it_lowered_below() {
        let probability = |logit: f32| 1.0 / (1.0 + (-logit).exp());
        for (p, depth, hull, logit) in [
            (0.3, 5.0, 200, MARGIN),
            (0.05, 5.0, 200, logarithm(0.05 / 0.95) + LIMIT),
            (0.9, 5.0, 200, logarithm(9.0)),
            (0.6, -5.0, 0, -MARGIN),
            (0.99, -5.0, 0, logarithm(99.0) - LIMIT),
            (0.2, -5.0, 0, logarithm(0.25)),
            (0.4, -5.0, 120, logarithm(2.0 / 3.0)),
        ] {
            let got = heeded(p, depth, hull)[MIDDLE];
            assert!((got - probability(logit)).abs() < 1e-5, "{p}, {depth}, {hull}: {got}");
        }
    }

    #[test]
    fn what_is_not_finite_is_refused() {
        for wrong in [f32::NAN, f32::INFINITY] {
            let mut volume = vec![0.5; CELLS];
            volume[MIDDLE] = wrong;
            let (depths, hull) = (vec![0.0; RAYS], vec![0; CELLS / 2]);
            let mut out = vec![0.0; CELLS];
            assert!(heed(&volume, &depths, &[viewpoint(0)], &hull, &mut out).is_err());
        }
    }
}
