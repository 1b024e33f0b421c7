//! Feature volumes, read by the cells of the world grid.

use super::arrays::{cameras_of, checked, same_count};
use crate::error::CoreError;
use crate::lift::{COARSE, ENTRIES, HALF, TAPS, fill_taps, read, read_transposed};
use numpy::{PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use rayon::prelude::*;

/// Planes of cells that one thread reads at a time.
const PLANES: usize = 4;

#[pyfunction]
pub fn lift<'py>(
    py: Python<'py>,
    features: PyReadonlyArrayDyn<'py, f32>,
    cameras: PyReadonlyArrayDyn<'py, f64>,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    let cameras = cameras_of(&cameras)?;
    let width = width_of(&features, "features", 1, "[n, 65536, width > 0]")?;
    let features = checked(&features, "features", &[-1, ENTRIES as isize, width as isize])?;
    same_count("features", features.len() / (ENTRIES * width), cameras.len())?;
    let mut out = vec![0.0; cameras.len() * 2 * HALF * width];
    py.detach(|| {
        // A drawing's planes are shared out as well: there may be one drawing alone.
        out.par_chunks_mut(HALF / COARSE * PLANES * 2 * width).enumerate().for_each(|(job, out)| {
            let (drawing, part) = (job / (COARSE / PLANES), job % (COARSE / PLANES));
            let features = &features[drawing * ENTRIES * width..][..ENTRIES * width];
            read(&cameras[drawing], features, width, part * PLANES, out);
        });
    });
    PyArray1::from_vec(py, out).reshape(vec![cameras.len(), HALF, 2 * width])
}

#[pyfunction]
pub fn lift_transposed<'py>(
    py: Python<'py>,
    gradient: PyReadonlyArrayDyn<'py, f32>,
    cameras: PyReadonlyArrayDyn<'py, f64>,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    let cameras = cameras_of(&cameras)?;
    let width = width_of(&gradient, "gradient", 2, "[n, 16384, 2 * width > 0]")?;
    let gradient = checked(&gradient, "gradient", &[-1, HALF as isize, 2 * width as isize])?;
    same_count("gradient", gradient.len() / (2 * HALF * width), cameras.len())?;
    let mut out = vec![0.0; cameras.len() * ENTRIES * width];
    py.detach(|| {
        let jobs = out.par_chunks_mut(ENTRIES * width).zip(gradient.par_chunks(2 * HALF * width));
        jobs.zip(&cameras).for_each(|((out, g), camera)| read_transposed(camera, g, width, out));
    });
    PyArray1::from_vec(py, out).reshape(vec![cameras.len(), ENTRIES, width])
}

/// The width of an array whose last axis is `times` as long; at least 1.
fn width_of(
    array: &PyReadonlyArrayDyn<'_, f32>,
    what: &'static str,
    times: usize,
    expected: &str,
) -> Result<usize, CoreError> {
    match array.shape().last() {
        Some(&last) if last > 0 && last.is_multiple_of(times) => Ok(last / times),
        _ => {
            let (expected, got) = (expected.into(), format!("{:?}", array.shape()));
            Err(CoreError::WrongShape { what, expected, got })
        }
    }
}

type Taps<'py> = (Bound<'py, PyArrayDyn<i32>>, Bound<'py, PyArrayDyn<f32>>);

#[pyfunction]
pub fn lift_taps<'py>(py: Python<'py>, cameras: PyReadonlyArrayDyn<'py, f64>) -> PyResult<Taps<'py>> {
    const EACH: usize = 2 * HALF * TAPS;
    let cameras = cameras_of(&cameras)?;
    let mut rows = vec![0i32; cameras.len() * EACH];
    let mut weights = vec![0f32; rows.len()];
    py.detach(|| {
        let jobs = rows.par_chunks_mut(EACH).zip(weights.par_chunks_mut(EACH));
        jobs.zip(&cameras).for_each(|((rows, weights), camera)| fill_taps(camera, rows, weights));
    });
    let shape = vec![cameras.len(), HALF, 2, TAPS];
    Ok((
        PyArray1::from_vec(py, rows).reshape(shape.clone())?,
        PyArray1::from_vec(py, weights).reshape(shape)?,
    ))
}
