//! Columns of the half world grid z > 0 as cameras see them: shapes are symmetric about z = 0, so each voxel is seen
//! twice, at its own place and at its mirror image's.

use crate::camera::Camera;
use crate::voxel::{SIDE, voxel_center};
use glam::{DVec3, Vec3};

/// Voxels in a column: those along z of the half grid.
pub const DEEP: usize = SIDE / 2;

/// The centres of a column's voxels, or of their mirror images, in camera coordinates.
pub struct Column {
    foot: Vec3,
    /// What a unit of height adds.
    up: Vec3,
}

impl Column {
    /// The voxels `[x, y]`, and their mirror images.
    #[inline(always)]
    pub fn seen_by(camera: &Camera, x: usize, y: usize) -> [Self; 2] {
        let foot = camera.to_camera(DVec3::new(voxel_center(x), voxel_center(y), 0.0)).as_vec3();
        let up = |side: f64| camera.to_camera(camera.position + side * DVec3::Z).as_vec3();
        [1.0, -1.0].map(|side| Self { foot, up: up(side) })
    }

    #[inline(always)]
    pub fn center(&self, k: usize) -> Vec3 {
        self.foot + self.up * ((k as f32 + 0.5) / SIDE as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn centers_are_those_of_voxels_and_of_their_mirror_images() {
        let camera = Camera::orbit(37.5, 38.0, 5.0, 2.0);
        for (x, y, k) in [(0, 0, 0), (5, 60, 31), (63, 17, 8)] {
            let own = DVec3::from([x, y, DEEP + k].map(voxel_center));
            for (column, at) in
                Column::seen_by(&camera, x, y).iter().zip([own, own * DVec3::new(1.0, 1.0, -1.0)])
            {
                assert!((column.center(k).as_dvec3() - camera.to_camera(at)).length() < 1e-6);
            }
        }
    }
}
