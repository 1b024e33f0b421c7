//! Volumes: made of a shape, read in another grid, and the surface that leaves the package.

use super::arrays::{GRIDS, all_finite, cameras_of, checked, checked_mut, grid, same_count, shape_of};
use crate::mesh::BilateralSettings;
use crate::resample;
use crate::solid;
use crate::voxel::{BitGrid, CELLS};
use numpy::{IntoPyArray, PyArray2, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn};
use pyo3::prelude::*;
use rayon::prelude::*;

#[pyfunction]
pub fn voxelize<'py>(
    py: Python<'py>,
    shape: PyReadonlyArrayDyn<'py, f64>,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let shape = shape_of(&shape)?;
    let voxels = py.detach(|| {
        let mut bytes = vec![0; CELLS];
        BitGrid::of_shape(&shape).write_bytes(&mut bytes);
        bytes
    });
    grid(py, voxels, &[])
}

#[pyfunction]
pub fn voxelize_mesh<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArrayDyn<'py, f64>,
    faces: PyReadonlyArrayDyn<'py, i64>,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let vertices = checked(&vertices, "vertices", &[-1, 3])?.as_chunks::<3>().0;
    let faces = checked(&faces, "faces", &[-1, 3])?.as_chunks::<3>().0;
    let voxels = py.detach(|| {
        let solid = solid::voxelize(vertices, faces)?;
        let mut bytes = vec![0; CELLS];
        solid.write_bytes(&mut bytes);
        Ok::<_, PyErr>(bytes)
    })?;
    grid(py, voxels, &[])
}

#[pyfunction]
pub fn to_camera_grid<'py>(
    py: Python<'py>,
    volumes: PyReadonlyArrayDyn<'py, f32>,
    cameras: PyReadonlyArrayDyn<'py, f64>,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    let cameras = cameras_of(&cameras)?;
    let volumes = checked(&volumes, "volumes", &GRIDS)?;
    all_finite(volumes, "volume")?;
    same_count("cameras", cameras.len(), volumes.len() / CELLS)?;
    let mut out = vec![0.0; volumes.len()];
    py.detach(|| {
        let jobs = out.par_chunks_mut(CELLS).zip(volumes.par_chunks(CELLS)).zip(&cameras);
        jobs.for_each(|((out, volume), camera)| resample::to_camera_grid(volume, camera, out));
    });
    grid(py, out, &[cameras.len()])
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
    all_finite(volumes, "volume")?;
    all_finite(into, "into")?;
    same_count("cameras", cameras.len(), volumes.len() / CELLS)?;
    same_count("into", into.len() / CELLS, cameras.len())?;
    py.detach(|| {
        let jobs = into.par_chunks_mut(CELLS).zip(volumes.par_chunks(CELLS)).zip(&cameras);
        jobs.for_each(|((into, volume), camera)| resample::to_world_grid(volume, camera, into));
    });
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
