//! Depth and normal buffers, and the fractional camera grid: both by casting rays at the shape itself.

use crate::camera::Camera;
use crate::csg::Shape;
use crate::error::CoreError;
use crate::raycast::RayCaster;
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

/// Pixels along each side of the tiles that share a list of primitives.
const TILE: usize = 8;

impl Buffers {
    /// Casts one ray through the middle of each pixel.
    pub fn of_shape(shape: &Shape, camera: &Camera, size: usize) -> Result<Self, CoreError> {
        refuse_eye_inside(shape, camera)?;
        let caster = RayCaster::new(shape, camera);
        let mut depth = vec![f32::INFINITY; size * size];
        let mut normal = vec![[0.0; 3]; size * size];
        let (mut candidates, mut spans) = (Vec::new(), Vec::new());
        let at = |i: usize| (2 * i + 1) as f64 / size as f64 - 1.0;
        for top in (0..size).step_by(TILE) {
            let bottom = (top + TILE).min(size);
            for left in (0..size).step_by(TILE) {
                let right = (left + TILE).min(size);
                caster.visible((at(left), at(right - 1)), (at(top), at(bottom - 1)), &mut candidates);
                if candidates.is_empty() {
                    continue;
                }
                for row in top..bottom {
                    for col in left..right {
                        let direction = camera.ray(at(col), at(row));
                        caster.spans(direction, &candidates, &mut spans);
                        if let Some(hit) = spans.first() {
                            let n = caster.normal(hit.entry, direction, hit.start);
                            depth[row * size + col] = hit.start as f32;
                            normal[row * size + col] = n.as_vec3().to_array();
                        }
                    }
                }
            }
        }
        Ok(Self { depth, normal, size })
    }
}

/// The share of each camera-grid cell that is inside the shape, 255 for all of it, in the order (slice, row, col).
///
/// Exact along depth; across the image by `rays` x `rays` rays a cell.
pub fn fill_frustum(shape: &Shape, camera: &Camera, rays: usize, out: &mut [u8]) -> Result<(), CoreError> {
    refuse_eye_inside(shape, camera)?;
    assert_eq!(out.len(), CELLS);
    let caster = RayCaster::new(shape, camera);
    let per_slice = SIDE as f64 / (camera.far - camera.near);
    let full = 255.0 / (rays * rays) as f64;
    let at = |i: usize| (2 * i + 1) as f64 / (SIDE * rays) as f64 - 1.0;
    let (mut candidates, mut spans) = (Vec::new(), Vec::new());
    out.fill(0);
    for row in 0..SIDE {
        let ys = (at(row * rays), at(row * rays + rays - 1));
        for col in 0..SIDE {
            let xs = (at(col * rays), at(col * rays + rays - 1));
            caster.visible(xs, ys, &mut candidates);
            if candidates.is_empty() {
                continue;
            }
            let mut inside = [0.0f64; SIDE];
            for y in 0..rays {
                for x in 0..rays {
                    let direction = camera.ray(at(col * rays + x), at(row * rays + y));
                    caster.spans(direction, &candidates, &mut spans);
                    for span in &spans {
                        let from = (span.start - camera.near) * per_slice;
                        let to = (span.end - camera.near) * per_slice;
                        cover(&mut inside, from, to);
                    }
                }
            }
            for (slice, share) in inside.iter().enumerate() {
                out[(slice * SIDE + row) * SIDE + col] = (share * full).round() as u8;
            }
        }
    }
    Ok(())
}

/// Adds to each slice the share of it that lies between two depths, in slices from the near plane.
fn cover(inside: &mut [f64; SIDE], from: f64, to: f64) {
    let (from, to) = (from.max(0.0), to.min(SIDE as f64));
    if from >= to {
        return;
    }
    let (first, last) = (from as usize, (to as usize).min(SIDE - 1));
    if first == last {
        inside[first] += to - from;
        return;
    }
    inside[first] += (first + 1) as f64 - from;
    inside[first + 1..last].iter_mut().for_each(|s| *s += 1.0);
    inside[last] += to - last as f64;
}

fn refuse_eye_inside(shape: &Shape, camera: &Camera) -> Result<(), CoreError> {
    if shape.contains(camera.position) {
        return Err(CoreError::EyeInside(camera.position.to_array()));
    }
    Ok(())
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

    #[test]
    fn an_eye_inside_is_refused() {
        let camera = Camera::orbit(0.0, 0.0, 0.0, 0.1);
        let shape = one(Kind::Cuboid, [0.3; 3]);
        assert!(matches!(Buffers::of_shape(&shape, &camera, 64), Err(CoreError::EyeInside(_))));
        assert!(fill_frustum(&shape, &camera, 2, &mut vec![0; CELLS]).is_err());
    }
}
