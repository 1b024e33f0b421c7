//! What a camera sees of a triangle mesh: a z-buffer.
//!
//! A pixel looks along the ray of its middle, d = (x, y, 1) in the camera's axes. With the corners of a face as seen from
//! the eye, d . (b x c), d . (c x a) and d . (a x b) are the shares of the corners in the point where the ray meets
//! the face, up to a common factor; all are affine over the image, and so is inverse depth, their sum over the volume
//! a . (b x c) (Olano and Greer, "Triangle scan conversion using 2D homogeneous coordinates", 1997). Nothing is divided,
//! so a face that reaches behind the eye needs no clipping. Two faces compute the edge between them by the same
//! products, with opposite signs: no ray slips through.

use crate::buffers::{Buffers, image_points};
use crate::camera::Camera;
use crate::dispatch::for_each_instruction_set;
use crate::error::CoreError;
use crate::intersect::NEAREST;
use crate::surface::Surface;
use glam::DVec3;

/// Faces of less volume than this, as seen from the eye and relative to the lengths of their corners, are edge-on.
const EDGE_ON: f64 = 1e-13;
const NOBODY: u32 = u32::MAX;

/// The round surface above a face, by Phong tessellation (Boubekeur and Alexa, 2008): half way from the face to where the
/// tangent planes of its corners are. Over a chord of an arc that is the arc, and neighbours meet without a fold: else,
/// near the limb, each would be a step of depth.
const ROUND: f64 = 0.5;
/// Rays are followed to that surface as if they met it at no smaller sine.
const GRAZING: f64 = 0.15;

impl Buffers {
    /// The nearest face behind the middle of each pixel.
    pub fn of_mesh(surface: &Surface, camera: &Camera, size: usize) -> Result<Self, CoreError> {
        if surface.holds(camera.position) {
            return Err(CoreError::EyeInside(camera.position.to_array()));
        }
        let mut seen = Seen::nothing(size);
        rasterise(surface, camera, &mut seen);
        Ok(seen.shaded(surface, camera))
    }
}

/// Inverse depth, 0 where nothing is seen, and whose it is.
struct Seen {
    nearness: Vec<f64>,
    face: Vec<u32>,
    size: usize,
}

/// A face as a camera sees it: functions of the image point (x, y), as factors of x, y and 1.
struct Facet {
    /// The shares of the corners, up to a common factor; all at least 0 where a ray meets the face.
    shares: [DVec3; 3],
    /// Inverse depth, and between which values it lies.
    nearness: DVec3,
    range: [f64; 2],
    /// Whether the camera sees the side from which the face runs clockwise.
    behind: bool,
    corners: [DVec3; 3],
}

impl Facet {
    /// `None` for a face that is edge-on, or nowhere in front of the eye.
    #[inline(always)]
    fn new(face: &[DVec3; 3], camera: &Camera) -> Option<Self> {
        let [a, b, c] = face.map(|corner| camera.to_camera(corner));
        let shares = [b.cross(c), c.cross(a), a.cross(b)];
        let volume = a.dot(shares[0]);
        let size = a.length_squared().max(b.length_squared()).max(c.length_squared());
        let front = a.z.max(b.z).max(c.z) * NEAREST > 1.0;
        // Relative to the largest corner, so that a face with one corner near the eye counts.
        if !front || volume.abs() <= EDGE_ON * size * size.sqrt() {
            return None;
        }
        let sign = volume.signum();
        // Rays are told by image points, whose unit is half the image.
        let scale = DVec3::new(camera.half_image, camera.half_image, 1.0);
        let of_image = |share: DVec3| share * sign * scale;
        let nearness = (shares[0] + shares[1] + shares[2]) / volume * scale;
        let near = |corner: DVec3| if corner.z * NEAREST > 1.0 { 1.0 / corner.z } else { NEAREST };
        let ends = [near(a), near(b), near(c)];
        let range = [ends[0].min(ends[1]).min(ends[2]), ends[0].max(ends[1]).max(ends[2])];
        Some(Self { shares: shares.map(of_image), nearness, range, behind: volume > 0.0, corners: [a, b, c] })
    }

    /// The first and the last pixel along an axis that may see the face.
    #[inline(always)]
    fn pixels(&self, axis: usize, camera: &Camera, size: usize) -> [i64; 2] {
        let last = size as i64 - 1;
        if self.range[1] >= NEAREST {
            return [0, last];
        }
        let at = self.corners.map(|corner| corner[axis] / (corner.z * camera.half_image));
        let pixel = |at: f64| ((at + 1.0) * size as f64 - 1.0) / 2.0;
        let (low, high) = (at[0].min(at[1]).min(at[2]), at[0].max(at[1]).max(at[2]));
        [((pixel(low) - 1e-6).ceil() as i64).max(0), ((pixel(high) + 1e-6).floor() as i64).min(last)]
    }
}

impl Seen {
    fn nothing(size: usize) -> Self {
        Self { nearness: vec![0.0; size * size], face: vec![NOBODY; size * size], size }
    }

    /// Depths of the round surfaces that the faces stand for, and their normals, turned towards the eye.
    fn shaded(self, surface: &Surface, camera: &Camera) -> Buffers {
        let size = self.size;
        let mut buffers =
            Buffers { depth: vec![f32::INFINITY; size * size], normal: vec![[0.0; 3]; size * size], size };
        let at = |i: usize| image_points(i, size)[0];
        for (i, (&face, &nearness)) in self.face.iter().zip(&self.nearness).enumerate() {
            if face == NOBODY {
                continue;
            }
            let Some(facet) = Facet::new(&surface.faces[face as usize], camera) else { continue };
            let point = DVec3::new(at(i % size), at(i / size), 1.0);
            let ray = camera.ray(point.x, point.y);
            let depth = 1.0 / nearness;
            let met = camera.position + ray * depth;
            let shares = facet.shares.map(|share| share.dot(point).max(0.0));
            let whole: f64 = shares.iter().sum();
            let (mut sum, mut rise) = (DVec3::ZERO, DVec3::ZERO);
            for (k, share) in shares.iter().enumerate() {
                let (corner, normal) = (surface.faces[face as usize][k], surface.normals[face as usize][k]);
                sum += normal * *share;
                rise += normal * (normal.dot(corner - met) * ROUND * share / whole);
            }
            let towards = if facet.behind { -sum } else { sum }.normalize_or_zero();
            // Where the mesh is coarser than what it stands for, it may be seen beyond the limb.
            let facing = towards.dot(ray);
            let normal = towards - ray * (facing.max(0.0) / ray.length_squared());
            let normal = normal.try_normalize().unwrap_or(-ray.normalize());
            let nearer = rise.dot(towards) / facing.min(-GRAZING * ray.length());
            buffers.depth[i] = (depth + nearer).max(0.5 * depth) as f32;
            buffers.normal[i] = normal.as_vec3().to_array();
        }
        buffers
    }
}

for_each_instruction_set! {
    fn rasterise(surface: &Surface, camera: &Camera, seen: &mut Seen) {
        add_faces(surface, camera, seen);
    }
}

#[inline(always)]
fn add_faces(surface: &Surface, camera: &Camera, seen: &mut Seen) {
    let size = seen.size;
    let points: Vec<f64> = (0..size).map(|i| (2 * i + 1) as f64 / size as f64 - 1.0).collect();
    for (number, face) in surface.faces.iter().enumerate() {
        let Some(facet) = Facet::new(face, camera) else { continue };
        let [left, right] = facet.pixels(0, camera, size);
        let [top, bottom] = facet.pixels(1, camera, size);
        if left > right {
            continue;
        }
        let columns = left as usize..right as usize + 1;
        for row in top..bottom + 1 {
            let row = row as usize;
            // What is the same all along a row; the edges' signs stay exactly opposite on both sides of them.
            let along = |f: DVec3| (f.x, f.y * points[row] + f.z);
            let [a, b, c] = facet.shares.map(along);
            let (slope, start) = along(facet.nearness);
            let [far, near] = facet.range;
            let pixels = row * size + columns.start..row * size + columns.end;
            let own = seen.nearness[pixels.clone()].iter_mut().zip(&mut seen.face[pixels]);
            for ((nearness, face), &x) in own.zip(&points[columns.clone()]) {
                let met = (a.0 * x + a.1 >= 0.0) & (b.0 * x + b.1 >= 0.0) & (c.0 * x + c.1 >= 0.0);
                let here = slope * x + start;
                let here = if here > near { near } else { here };
                let here = if here < far { far } else { here };
                let first = met & (here > *nearness) & (here < NEAREST);
                *nearness = if first { here } else { *nearness };
                *face = if first { number as u32 } else { *face };
            }
        }
    }
}

#[cfg(test)]
mod tests;
