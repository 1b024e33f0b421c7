//! What a camera sees of a shape or of a volume.

use super::arrays::{camera_of, check_rays, check_size, checked, filled, grid, shape_of};
use crate::buffers::{Buffers, fill_frustum};
use crate::camera::{Camera, DISTANCE, IMAGE, PACKED, VIEWPOINTS};
use crate::error::all_finite;
use crate::lines::{LineConfig, detect};
use crate::voxel::{CELLS, SIDE};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// The 13 viewpoints, float64 [13, 15].
#[pyfunction]
pub fn viewpoints<'py>(py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let orbit = |&(azimuth, elevation): &(f64, f64)| Camera::orbit(azimuth, elevation, 0.0, DISTANCE);
    let rows: Vec<f64> = VIEWPOINTS.iter().flat_map(|v| orbit(v).to_packed()).collect();
    rows.into_pyarray(py).reshape([VIEWPOINTS.len(), PACKED])
}

/// The camera with a field of view larger by a share, from where what lies at the origin looks as large; float64 [15].
#[pyfunction]
pub fn widened<'py>(
    py: Python<'py>,
    camera: PyReadonlyArrayDyn<'py, f64>,
    share: f64,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    Ok(camera_of(&camera)?.widened(share).to_packed().to_vec().into_pyarray(py))
}

#[pyfunction]
pub fn frustum<'py>(
    py: Python<'py>,
    shape: PyReadonlyArrayDyn<'py, f64>,
    camera: PyReadonlyArrayDyn<'py, f64>,
    rays: i64,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let (shape, camera) = (shape_of(&shape)?, camera_of(&camera)?);
    let rays = check_rays(rays)?;
    let mut cells = vec![0; CELLS];
    py.detach(|| fill_frustum(&shape, &camera, rays, &mut cells))?;
    grid(py, cells, &[])
}

pub type BufferArrays<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray3<f32>>);

#[pyfunction]
pub fn buffers<'py>(
    py: Python<'py>,
    shape: PyReadonlyArrayDyn<'py, f64>,
    camera: PyReadonlyArrayDyn<'py, f64>,
    size: i64,
) -> PyResult<BufferArrays<'py>> {
    let (shape, camera) = (shape_of(&shape)?, camera_of(&camera)?);
    let size = check_size(size)?;
    buffer_arrays(py, py.detach(|| Buffers::of_shape(&shape, &camera, size))?)
}

#[pyfunction]
pub fn isosurface<'py>(
    py: Python<'py>,
    volume: PyReadonlyArrayDyn<'py, f32>,
    level: f32,
    camera: PyReadonlyArrayDyn<'py, f64>,
    size: i64,
) -> PyResult<BufferArrays<'py>> {
    let camera = camera_of(&camera)?;
    let volume = checked(&volume, "volume", &[SIDE as isize; 3])?;
    all_finite(volume, "volume")?;
    let size = check_size(size)?;
    buffer_arrays(py, py.detach(|| crate::isosurface::cast(volume, level, &camera, size)))
}

pub fn buffer_arrays<'py>(py: Python<'py>, made: Buffers) -> PyResult<BufferArrays<'py>> {
    let size = made.size;
    let depth = made.depth.into_pyarray(py).reshape([size, size])?;
    let normal = made.normal.into_flattened().into_pyarray(py).reshape([size, size, 3])?;
    Ok((depth, normal))
}

#[pyfunction]
pub fn lines<'py>(
    py: Python<'py>,
    depth: PyReadonlyArrayDyn<'py, f32>,
    normal: PyReadonlyArrayDyn<'py, f32>,
    depth_step: f32,
    crease_degrees: f32,
) -> PyResult<Bound<'py, PyArray2<u8>>> {
    let size = check_size(depth.shape().first().map_or(0, |&s| s as i64))?;
    let side = size as isize;
    let depth = checked(&depth, "depth", &[side, side])?.to_vec();
    let normal = checked(&normal, "normal", &[side, side, 3])?.as_chunks::<3>().0.to_vec();
    all_finite(normal.as_flattened(), "normal")?;
    if depth.iter().any(|d| d.is_nan() || *d <= 0.0) {
        let message = "depth must be more than 0 everywhere, infinite where nothing is seen";
        return Err(PyValueError::new_err(message));
    }
    let made = Buffers { depth, normal, size };
    let config = LineConfig { depth_step, crease_degrees };
    config.check()?;
    let mut ink = vec![0; size * size];
    py.detach(|| detect(&made, &config, &mut ink));
    ink.into_pyarray(py).reshape([size, size])
}

#[pyfunction]
#[pyo3(signature = (shape, camera, out=None))]
pub fn draw<'py>(
    py: Python<'py>,
    shape: PyReadonlyArrayDyn<'py, f64>,
    camera: PyReadonlyArrayDyn<'py, f64>,
    out: Option<Bound<'py, PyArrayDyn<u8>>>,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let (shape, camera) = (shape_of(&shape)?, camera_of(&camera)?);
    filled(py, out, &[IMAGE; 2], |out| crate::lines::draw(&shape, &camera, &LineConfig::default(), out))
}
