//! Volumes: made of a shape, read in another grid, and the surface that leaves the package.

use super::arrays::{cameras_of, checked, checked_mut, filled, same_count, shape_of};
use crate::camera::Camera;
use crate::error::{CoreError, all_finite};
use crate::mesh::BilateralSettings;
use crate::resample;
use crate::voxel::{BitGrid, SIDE};
use numpy::{
    IntoPyArray, PyArray2, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn,
    PyUntypedArrayMethods,
};
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

/// A solid's voxels as bytes, in `out` or a fresh array.
pub fn voxels<'py>(
    py: Python<'py>,
    out: Option<Bound<'py, PyArrayDyn<u8>>>,
    solid: impl FnOnce() -> PyResult<BitGrid> + Send,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    filled(py, out, &[SIDE; 3], |bytes| {
        solid()?.write_bytes(bytes);
        Ok::<_, PyErr>(())
    })
}

type Kernel = fn(&[f32], &[Camera], &mut [f32]) -> Result<(), CoreError>;

/// Both ways between grids of one size.
struct Resampling {
    side: usize,
    to_camera_grid: Kernel,
    to_world_grid: Kernel,
}

impl Resampling {
    fn of_side<const N: usize>() -> Self {
        let (to_camera_grid, to_world_grid) = (resample::to_camera_grid::<N>, resample::to_world_grid::<N>);
        Self { side: N, to_camera_grid, to_world_grid }
    }

    fn of_shape(volumes: &[usize]) -> Result<Self, CoreError> {
        match *volumes {
            [_, 32, 32, 32] => Ok(Self::of_side::<32>()),
            [_, 64, 64, 64] => Ok(Self::of_side::<64>()),
            [_, 128, 128, 128] => Ok(Self::of_side::<128>()),
            [_, 256, 256, 256] => Ok(Self::of_side::<256>()),
            _ => Err(CoreError::WrongShape {
                what: "volumes",
                expected: "[n, s, s, s], s one of [32, 64, 128, 256]".into(),
                got: format!("{volumes:?}"),
            }),
        }
    }

    fn grids(&self) -> [isize; 4] {
        let side = self.side as isize;
        [-1, side, side, side]
    }
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
    let shape = volumes.shape();
    let kernels = Resampling::of_shape(shape)?;
    let read = checked(&volumes, "volumes", &kernels.grids())?;
    same_count("cameras", cameras.len(), shape[0])?;
    filled(py, out, shape, |out| (kernels.to_camera_grid)(read, &cameras, out))
}

#[pyfunction]
pub fn to_world_grid<'py>(
    py: Python<'py>,
    volumes: PyReadonlyArrayDyn<'py, f32>,
    cameras: PyReadonlyArrayDyn<'py, f64>,
    mut into: PyReadwriteArrayDyn<'py, f32>,
) -> PyResult<()> {
    let cameras = cameras_of(&cameras)?;
    let kernels = Resampling::of_shape(volumes.shape())?;
    let read = checked(&volumes, "volumes", &kernels.grids())?;
    let into = checked_mut(&mut into, "into", &kernels.grids())?;
    all_finite(into, "into")?;
    same_count("cameras", cameras.len(), volumes.shape()[0])?;
    same_count("into", into.len() / kernels.side.pow(3), cameras.len())?;
    py.detach(|| (kernels.to_world_grid)(read, &cameras, into))?;
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
