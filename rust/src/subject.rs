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

    /// Draws it: 255 where there is ink, 0 elsewhere, row by row.
    fn draw(&self, camera: &Camera, config: &LineConfig, ink: &mut [u8]) -> Result<(), CoreError>;
}

impl Subject for Shape {
    fn bounds(&self) -> (DVec3, DVec3) {
        Shape::bounds(self)
    }

    fn draw(&self, camera: &Camera, config: &LineConfig, ink: &mut [u8]) -> Result<(), CoreError> {
        draw(self, camera, config, ink)
    }
}

impl Subject for Surface {
    fn bounds(&self) -> (DVec3, DVec3) {
        Surface::bounds(self)
    }

    fn draw(&self, camera: &Camera, config: &LineConfig, ink: &mut [u8]) -> Result<(), CoreError> {
        detect(&Buffers::of_mesh(self, camera, IMAGE)?, config, ink);
        Ok(())
    }
}
