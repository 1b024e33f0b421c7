//! What all drawings together say about each voxel of the world grid.
//!
//! Shapes are symmetric about z = 0: the half z > 0 tells all, and each drawing speaks twice about a voxel, at the
//! projection of its centre and at that of its mirror image.
//!
//! * **hull**: the least signed distance to a silhouette's border: inside the visual hull it is positive;
//! * **nearness** to lines: its mean, high where lines of all drawings meet (a plane sweep), and its least.

use crate::camera::{Camera, IMAGE};
use crate::carve::{INK, silhouette};
use crate::column::{Column, DEEP};
use crate::distance::{REACH, squared_distance};
use crate::voxel::{CELLS, SIDE};
use rayon::prelude::*;
use std::sync::LazyLock;

/// Bytes of one drawing's fields: signed silhouette distance and nearness to ink, one pair a pixel.
pub const FIELDS: usize = 2 * IMAGE * IMAGE;
/// Voxels of the half grid in a plane across x.
const PLANE: usize = SIDE * DEEP;
/// The signed distance of an outline.
pub const BORDER: u8 = 128;
/// What that distance grows by in one pixel, inwards.
pub const PIXEL: u8 = 8;

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
        pair[0] = (f32::from(BORDER) + f32::from(PIXEL) * signed).round().clamp(0.0, 255.0) as u8;
        pair[1] = (255.0 - 2.0 * f32::from(PIXEL) * distance(to_ink[i])).round().max(0.0) as u8;
    }
}

/// Gathers the evidence of all drawings for the half z > 0 of the world grid, each drawing read at a voxel's place and
/// at its mirror image's.
///
/// `fields` holds `FIELDS` bytes a drawing; `out` takes 3 x 64 x 64 x 32 bytes: hull, mean nearness, least nearness,
/// each (x, y, z).
pub fn gather(fields: &[u8], cameras: &[Camera], out: &mut [u8]) {
    assert_eq!(fields.len(), cameras.len() * FIELDS);
    assert_eq!(out.len(), 3 * CELLS / 2);
    let (hull, rest) = out.split_at_mut(CELLS / 2);
    let (mean, least) = rest.split_at_mut(CELLS / 2);
    let share = 0.5 / cameras.len().max(1) as f32;
    let planes = hull.par_chunks_mut(PLANE).zip(mean.par_chunks_mut(PLANE)).zip(least.par_chunks_mut(PLANE));
    planes.with_min_len(8).enumerate().for_each(|(x, ((hull, mean), least))| {
        for y in 0..SIDE {
            let column = y * DEEP..(y + 1) * DEEP;
            let (hull, least) = (&mut hull[column.clone()], &mut least[column.clone()]);
            hull.fill(255);
            least.fill(255);
            let mut total = [0u32; DEEP];
            for (camera, field) in cameras.iter().zip(fields.chunks_exact(FIELDS)) {
                for column in Column::seen_by(camera, x, y) {
                    for (k, &pixel) in pixels_of(&column, camera).iter().enumerate() {
                        let (signed, nearness) = match pixel {
                            OUTSIDE => (0, 0),
                            _ => (field[2 * pixel as usize], field[2 * pixel as usize + 1]),
                        };
                        hull[k] = hull[k].min(signed);
                        least[k] = least[k].min(nearness);
                        total[k] += u32::from(nearness);
                    }
                }
            }
            for (m, t) in mean[column].iter_mut().zip(total) {
                *m = (t as f32 * share).round() as u8;
            }
        }
    });
}

const OUTSIDE: u32 = u32::MAX;

/// The pixel that each voxel of a column falls into.
fn pixels_of(column: &Column, camera: &Camera) -> [u32; DEEP] {
    let half = 0.5 * IMAGE as f32;
    let focal = half / camera.half_image as f32;
    std::array::from_fn(|k| {
        let p = column.center(k);
        let scale = focal / p.z;
        let (x, y) = (p.x * scale + half, p.y * scale + half);
        let seen = p.z > 0.0 && x >= 0.0 && y >= 0.0 && x < IMAGE as f32 && y < IMAGE as f32;
        if seen { y as u32 * IMAGE as u32 + x as u32 } else { OUTSIDE }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{DISTANCE, VIEWPOINTS};

    fn gathered(fields: &[u8], cameras: &[Camera]) -> [Vec<u8>; 3] {
        let mut out = vec![7; 3 * CELLS / 2];
        gather(fields, cameras, &mut out);
        std::array::from_fn(|i| out[i * CELLS / 2..(i + 1) * CELLS / 2].to_vec())
    }

    fn viewpoint(i: usize) -> Camera {
        Camera::orbit(VIEWPOINTS[i].0, VIEWPOINTS[i].1, 0.0, DISTANCE)
    }

    #[test]
    fn hull_and_least_are_the_least_and_the_mean_is_the_mean() {
        let cameras = [0, 4, 8].map(viewpoint);
        let fields: Vec<u8> =
            [[200, 10], [150, 41], [180, 0]].iter().flat_map(|f| f.repeat(FIELDS / 2)).collect();
        let [hull, mean, least] = gathered(&fields, &cameras);
        let middle = (SIDE / 2 * SIDE + SIDE / 2) * DEEP;
        assert_eq!([hull[middle], mean[middle], least[middle]], [150, 17, 0]);
        // From here the image is 0.84 wide at the voxel nearest to the eye.
        let close = Camera::orbit(0.0, 0.0, 0.0, 1.5);
        let border = (63 * SIDE + SIDE / 2) * DEEP + DEEP - 1;
        assert_eq!(gathered(&fields[..FIELDS], &[close]).map(|v| v[border]), [0; 3], "outside the image");
    }

    #[test]
    fn a_voxel_is_read_at_its_own_place_and_at_its_mirror_images() {
        // Seen along -x, +z is on the left: what lies there is missed by the mirror image, and half the mean is left.
        let camera = viewpoint(8);
        let left = |i: usize| i % IMAGE < IMAGE / 2;
        let fields: Vec<u8> =
            (0..IMAGE * IMAGE).flat_map(|i| if left(i) { [255, 200] } else { [100, 0] }).collect();
        let [hull, mean, least] = gathered(&fields, &[camera]);
        let voxel = (SIDE / 2 * SIDE + SIDE / 2) * DEEP + 4;
        assert_eq!([hull[voxel], mean[voxel], least[voxel]], [100, 100, 0]);
    }
}
