//! What cameras see, whatever it is made of: a shape by casting rays, a mesh by its z-buffer.

use crate::buffers::Buffers;
use crate::camera::{Camera, IMAGE};
use crate::csg::Shape;
use crate::error::CoreError;
use crate::lines::{LineConfig, detect, draw};
use crate::surface::Surface;
use glam::DVec3;

pub trait Subject {
    /// The least and the largest coordinates.
    fn bounds(&self) -> (DVec3, DVec3);

    /// Whether a point may lie inside it.
    fn may_hold(&self, point: DVec3) -> bool;

    /// Draws it: 255 where there is ink, 0 elsewhere, row by row.
    fn draw(&self, camera: &Camera, config: &LineConfig, ink: &mut [u8]) -> Result<(), CoreError>;
}

impl Subject for Shape {
    fn bounds(&self) -> (DVec3, DVec3) {
        Shape::bounds(self)
    }

    fn may_hold(&self, point: DVec3) -> bool {
        self.contains(point)
    }

    fn draw(&self, camera: &Camera, config: &LineConfig, ink: &mut [u8]) -> Result<(), CoreError> {
        draw(self, camera, config, ink)
    }
}

impl Subject for Surface {
    fn bounds(&self) -> (DVec3, DVec3) {
        Surface::bounds(self)
    }

    /// Within its box: a surface that is open has no inside.
    fn may_hold(&self, point: DVec3) -> bool {
        let (low, high) = Surface::bounds(self);
        point.cmpge(low).all() && point.cmple(high).all()
    }

    fn draw(&self, camera: &Camera, config: &LineConfig, ink: &mut [u8]) -> Result<(), CoreError> {
        detect(&Buffers::of_mesh(self, camera, IMAGE)?, config, ink);
        Ok(())
    }
}
