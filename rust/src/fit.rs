//! The 120 % rule: a shape is moved to the middle of the world grid and fills so much of it; or it is refused.

use crate::csg::Shape;
use crate::voxel::{BitGrid, CELLS, SIDE};
use glam::DVec3;

/// What is asked of a shape, beside being in one piece.
#[derive(Clone, Copy)]
pub struct Fit {
    /// The world grid covers this much of the largest side.
    pub cover: f64,
    /// Least share of the world grid that is occupied.
    pub min_occupancy: f64,
    /// Smallest extent along any axis, in voxels.
    pub min_extent: usize,
}

impl Fit {
    /// Centres and scales; `None` for what is empty, in pieces, or dust.
    pub fn fit(&self, mut shape: Shape) -> Option<(Shape, BitGrid)> {
        let (mut lo, mut hi) = shape.bounds();
        // A cut may have taken away what reached furthest: then the bounds are those of the voxels left.
        for _ in 0..4 {
            let scale = 1.0 / (self.cover * (hi - lo).max_element());
            shape = shape.moved(0.5 * (lo + hi), scale);
            let expected = (hi - lo) * scale;
            let grid = BitGrid::of_shape(&shape);
            let bounds = grid.bounds()?;
            let edge = |i: usize| i as f64 / SIDE as f64 - 0.5;
            (lo, hi) = (DVec3::from(bounds.map(|b| edge(b.0))), DVec3::from(bounds.map(|b| edge(b.1 + 1))));
            // Within a voxel of what was expected on either side, the exact bounds stand.
            let tolerance = 2.0 / SIDE as f64;
            if (expected - (hi - lo)).abs().max_element() <= tolerance {
                let extents = bounds.map(|b| b.1 + 1 - b.0);
                let acceptable = extents.iter().all(|&e| e >= self.min_extent)
                    && f64::from(grid.count()) >= self.min_occupancy * CELLS as f64
                    && grid.is_connected();
                return acceptable.then_some((shape, grid));
            }
        }
        None
    }
}
