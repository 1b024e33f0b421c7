//! The module `sketchcore._core`: this file and those in `python/` alone know about Python. They check what comes in,
//! let go of the interpreter, and call a kernel.

mod arrays;
mod convolution;
mod drawings;
mod lift;
mod meshes;
mod network;
mod pools;
mod samples;
mod strokes;
mod views;
mod volumes;

use crate::error::CoreError;
use crate::mesh::MeshError;
use crate::solid::SolidError;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

impl From<CoreError> for PyErr {
    fn from(error: CoreError) -> Self {
        match error {
            CoreError::Threads { .. } | CoreError::NoShape { .. } | CoreError::Stopped => {
                PyRuntimeError::new_err(error.to_string())
            }
            _ => PyValueError::new_err(error.to_string()),
        }
    }
}

impl From<MeshError> for PyErr {
    fn from(error: MeshError) -> Self {
        PyValueError::new_err(error.to_string())
    }
}

impl From<SolidError> for PyErr {
    fn from(error: SolidError) -> Self {
        PyValueError::new_err(error.to_string())
    }
}

#[pymodule]
mod _core {
    #[pymodule_export]
    use super::convolution::{convolve, convolve_transposed, filter_gradient_of};
    #[pymodule_export]
    use super::drawings::{carve, evidence, evidence_fields, heed_outlines, silhouettes};
    #[pymodule_export]
    use super::lift::{lift, lift_taps, lift_transposed};
    #[pymodule_export]
    use super::meshes::{draw_mesh, draw_mesh_views, mesh_buffers, mesh_frusta, mesh_shares, voxelize_mesh};
    #[pymodule_export]
    use super::network::CompactNetwork;
    #[pymodule_export]
    use super::samples::{default_config, fit, generate};
    #[pymodule_export]
    use super::strokes::{
        check_style, draw_kinds, hidden_lines, random_style, redraw, straight, style_camera, trace,
    };
    #[pymodule_export]
    use super::views::{buffers, draw, frustum, isosurface, lines, viewpoints, widened};
    #[pymodule_export]
    use super::volumes::{bilateral, to_camera_grid, to_world_grid, voxelize};
}
