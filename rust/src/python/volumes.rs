//! Volumes: made of a shape, read in another grid, and the surface that leaves the package.

use super::arrays::{GRIDS, all_finite, cameras_of, checked, checked_mut, filled, same_count, shape_of};
use crate::mesh::BilateralSettings;
use crate::resample;
use crate::solid;
use crate::voxel::{BitGrid, CELLS, SIDE};
use numpy::{IntoPyArray, PyArray2, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn};
use pyo3::prelude::*;

#[pyfunction]
#[pyo3(signature = (shape, out=None))]
pub fn voxelize<'py>(
    py: Python<'py>,
    shape: PyReadonlyArrayDyn<'py, f64>,
    out: Option<Bound<'py, PyArrayDyn<u8>>>,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let shape = shape_of(&shape)?;
    voxels(py, out, || Ok(BitGrid::of_shape(&shape)))
}

#[pyfunction]
#[pyo3(signature = (vertices, faces, out=None))]
pub fn voxelize_mesh<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArrayDyn<'py, f64>,
    faces: PyReadonlyArrayDyn<'py, i64>,
    out: Option<Bound<'py, PyArrayDyn<u8>>>,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let vertices = checked(&vertices, "vertices", &[-1, 3])?.as_chunks::<3>().0;
    let faces = checked(&faces, "faces", &[-1, 3])?.as_chunks::<3>().0;
    voxels(py, out, || Ok(solid::voxelize(vertices, faces)?))
}

/// A solid's voxels as bytes, in `out` or a fresh array.
fn voxels<'py>(
    py: Python<'py>,
    out: Option<Bound<'py, PyArrayDyn<u8>>>,
    solid: impl FnOnce() -> PyResult<BitGrid> + Send,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    filled(py, out, &[SIDE; 3], |bytes| {
        solid()?.write_bytes(bytes);
        Ok::<_, PyErr>(())
    })
}

#[pyfunction]
#[pyo3(signature = (volumes, cameras, out=None))]
pub fn to_camera_grid<'py>(
    py: Python<'py>,
    volumes: PyReadonlyArrayDyn<'py, f32>,
    cameras: PyReadonlyArrayDyn<'py, f64>,
    out: Option<Bound<'py, PyArrayDyn<f32>>>,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    let cameras = cameras_of(&cameras)?;
    let volumes = checked(&volumes, "volumes", &GRIDS)?;
    same_count("cameras", cameras.len(), volumes.len() / CELLS)?;
    let shape = [cameras.len(), SIDE, SIDE, SIDE];
    filled(py, out, &shape, |out| resample::to_camera_grid(volumes, &cameras, out))
}

#[pyfunction]
pub fn to_world_grid<'py>(
    py: Python<'py>,
    volumes: PyReadonlyArrayDyn<'py, f32>,
    cameras: PyReadonlyArrayDyn<'py, f64>,
    mut into: PyReadwriteArrayDyn<'py, f32>,
) -> PyResult<()> {
    let cameras = cameras_of(&cameras)?;
    let volumes = checked(&volumes, "volumes", &GRIDS)?;
    let into = checked_mut(&mut into, "into", &GRIDS)?;
    all_finite(into, "into")?;
    same_count("cameras", cameras.len(), volumes.len() / CELLS)?;
    same_count("into", into.len() / CELLS, cameras.len())?;
    py.detach(|| resample::to_world_grid(volumes, &cameras, into))?;
    Ok(())
}

#[pyfunction]
pub fn bilateral<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArrayDyn<'py, f64>,
    faces: PyReadonlyArrayDyn<'py, u32>,
    iterations: usize,
    sigma_spatial: f64,
    sigma_normal: f64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let mut vertices = checked(&vertices, "vertices", &[-1, 3])?.as_chunks::<3>().0.to_vec();
    let faces = checked(&faces, "faces", &[-1, 3])?.as_chunks::<3>().0;
    let settings = BilateralSettings { iterations, sigma_spatial, sigma_normal };
    py.detach(|| crate::mesh::bilateral(&mut vertices, faces, &settings))?;
    let count = vertices.len();
    vertices.into_flattened().into_pyarray(py).reshape([count, 3])
}
