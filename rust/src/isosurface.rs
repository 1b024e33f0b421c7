//! What a camera sees of a volume's iso-surface, normals from the volumetric gradient (paper, section 5.3).

use crate::buffers::Buffers;
use crate::camera::Camera;
use crate::trilinear::trilinear;
use crate::voxel::{CELLS, SIDE};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Steps along a ray for each voxel's width, and halvings of the step in which the surface was crossed.
const STEPS: f64 = 2.0;
const HALVINGS: usize = 8;

/// Casts one ray a pixel at the surface where the world volume `[x, y, z]` crosses `level`.
pub fn cast(volume: &[f32], level: f32, camera: &Camera, size: usize) -> Buffers {
    assert_eq!(volume.len(), CELLS);
    // Around the outermost centres the volume falls to 0 within one voxel more.
    let reach = DVec3::splat(0.5 + 1.0 / SIDE as f64);
    let read = |p: DVec3| trilinear::<SIDE>(volume, ((p + 0.5) * SIDE as f64 - 0.5).as_vec3());
    let at = |i: usize| (2 * i + 1) as f64 / size as f64 - 1.0;
    let pixels: Vec<(f32, [f32; 3])> = (0..size * size)
        .into_par_iter()
        .map(|i| {
            let direction = camera.ray(at(i % size), at(i / size));
            let (a, b) = ((-reach - camera.position) / direction, (reach - camera.position) / direction);
            let (from, to) = (a.min(b).max_element().max(1e-6), a.max(b).min_element());
            let point = |t: f64| camera.position + direction * t;
            let step = 1.0 / (STEPS * SIDE as f64 * direction.length());
            let mut before = from;
            let mut t = from;
            while t < to {
                if read(point(t)) > level {
                    let (mut outside, mut inside) = (before, t);
                    for _ in 0..HALVINGS {
                        let middle = 0.5 * (outside + inside);
                        if read(point(middle)) > level {
                            inside = middle;
                        } else {
                            outside = middle;
                        }
                    }
                    return (inside as f32, normal(&read, point(inside), direction));
                }
                before = t;
                t += step;
            }
            (f32::INFINITY, [0.0; 3])
        })
        .collect();
    let (depth, normal) = pixels.into_iter().unzip();
    Buffers { depth, normal, size }
}

/// Down the gradient, over two voxels so that stair steps do not show.
fn normal(read: &impl Fn(DVec3) -> f32, at: DVec3, direction: DVec3) -> [f32; 3] {
    let reach = 2.0 / SIDE as f64;
    let slope = |axis: DVec3| read(at - axis * reach) - read(at + axis * reach);
    let gradient = Vec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z));
    gradient.try_normalize().unwrap_or((-direction).normalize().as_vec3()).to_array()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::voxel::voxel_center;

    #[test]
    fn a_ball_has_its_depth_and_normals() {
        let radius = 0.3;
        let ball: Vec<f32> = (0..CELLS)
            .map(|i| {
                let p = DVec3::from([i / 4096, i / 64 % 64, i % 64].map(voxel_center));
                (0.5 + 32.0 * (radius - p.length())).clamp(0.0, 1.0) as f32
            })
            .collect();
        let camera = Camera::orbit(37.5, 38.0, 0.0, 2.0);
        let seen = cast(&ball, 0.5, &camera, 65);
        let middle = 32 * 65 + 32;
        assert!((f64::from(seen.depth[middle]) - (2.0 - radius)).abs() < 1e-3, "{}", seen.depth[middle]);
        let away = camera.position.normalize().as_vec3();
        assert!(Vec3::from(seen.normal[middle]).dot(away) > 0.999);
        assert_eq!(seen.depth[0], f32::INFINITY);
        // The outline of a ball at distance 2: sin of its angle is radius / 2.
        let tangent = (radius / 2.0).asin().tan() / camera.half_image * 65.0 / 2.0;
        let area = seen.depth.iter().filter(|d| d.is_finite()).count() as f64;
        assert!((area / (std::f64::consts::PI * tangent * tangent) - 1.0).abs() < 0.03, "{area}");
    }

    #[test]
    fn an_empty_volume_shows_nothing() {
        let camera = Camera::orbit(0.0, 0.0, 0.0, 2.0);
        let seen = cast(&vec![0.0; CELLS], 0.5, &camera, 32);
        assert!(seen.depth.iter().all(|d| d.is_infinite()));
    }
}
