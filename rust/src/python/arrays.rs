//! Arrays and numbers from Python: checked, and packed again on the way back.

use crate::camera::{Camera, IMAGE, PACKED};
use crate::csg::{NARROW, Shape, WIDE};
use crate::error::CoreError;
use crate::voxel::SIDE;
use numpy::{
    Element, IntoPyArray, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

pub const DRAWINGS: [isize; 3] = [-1, IMAGE as isize, IMAGE as isize];

/// A contiguous array's numbers, if its shape is as given; -1 stands for any length.
pub fn checked<'a, T: Element>(
    array: &'a PyReadonlyArrayDyn<'_, T>,
    what: &'static str,
    shape: &[isize],
) -> PyResult<&'a [T]> {
    check_shape(array.shape(), what, shape)?;
    // `as_slice` alone would take Fortran order as well.
    if !array.is_c_contiguous() {
        return Err(not_contiguous(what));
    }
    array.as_slice().map_err(|_| not_contiguous(what))
}

pub fn checked_mut<'a, T: Element>(
    array: &'a mut PyReadwriteArrayDyn<'_, T>,
    what: &'static str,
    shape: &[isize],
) -> PyResult<&'a mut [T]> {
    check_shape(array.shape(), what, shape)?;
    if !array.is_c_contiguous() {
        return Err(not_contiguous(what));
    }
    array.as_slice_mut().map_err(|_| not_contiguous(what))
}

fn check_shape(got: &[usize], what: &'static str, shape: &[isize]) -> Result<(), CoreError> {
    let fits = |(&g, &s): (&usize, &isize)| s < 0 || g == s as usize;
    if got.len() == shape.len() && got.iter().zip(shape).all(fits) {
        return Ok(());
    }
    let names = shape.iter().map(|&s| if s < 0 { "n".into() } else { s.to_string() });
    Err(CoreError::WrongShape {
        what,
        expected: format!("[{}]", names.collect::<Vec<_>>().join(", ")),
        got: format!("{got:?}"),
    })
}

fn not_contiguous(what: &str) -> PyErr {
    PyValueError::new_err(format!("{what} must be C-contiguous; numpy.ascontiguousarray makes it so"))
}

pub fn same_count(what: &'static str, got: usize, expected: usize) -> Result<(), CoreError> {
    if got == expected {
        return Ok(());
    }
    Err(CoreError::WrongShape {
        what,
        expected: format!("one for each of the {expected} others"),
        got: got.to_string(),
    })
}

/// Fills `out`, or a fresh array where there is none, and returns it.
pub fn filled<'py, T: Element, E: Into<PyErr> + Send>(
    py: Python<'py>,
    out: Option<Bound<'py, PyArrayDyn<T>>>,
    shape: &[usize],
    fill: impl FnOnce(&mut [T]) -> Result<(), E> + Send,
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    let array = out.unwrap_or_else(|| PyArrayDyn::zeros(py, shape, false));
    let mut writable = array.try_readwrite()?;
    let expected: Vec<isize> = shape.iter().map(|&s| s as isize).collect();
    let cells = checked_mut(&mut writable, "out", &expected)?;
    py.detach(|| fill(cells)).map_err(Into::into)?;
    drop(writable);
    Ok(array)
}

pub fn check_size(size: i64) -> PyResult<usize> {
    if (1..=4096).contains(&size) {
        return Ok(size as usize);
    }
    Err(PyValueError::new_err(format!("size must lie between 1 and 4096 pixels, got {size}")))
}

pub fn check_rays(rays: i64) -> PyResult<usize> {
    if (1..=16).contains(&rays) {
        return Ok(rays as usize);
    }
    Err(PyValueError::new_err(format!("rays must lie between 1 and 16, got {rays}")))
}

pub fn shape_of(rows: &PyReadonlyArrayDyn<'_, f64>) -> PyResult<Shape> {
    let width = if rows.shape().get(1) == Some(&WIDE) { WIDE } else { NARROW };
    let numbers = checked(rows, "shape", &[-1, width as isize])?;
    Ok(match width {
        WIDE => Shape::from_rows(numbers.as_chunks::<WIDE>().0)?,
        _ => Shape::from_rows(numbers.as_chunks::<NARROW>().0)?,
    })
}

pub fn cameras_of(rows: &PyReadonlyArrayDyn<'_, f64>) -> PyResult<Vec<Camera>> {
    let rows = checked(rows, "cameras", &[-1, PACKED as isize])?;
    let cameras = rows.as_chunks::<PACKED>().0.iter().map(Camera::from_packed);
    Ok(cameras.collect::<Result<_, _>>()?)
}

pub fn camera_of(row: &PyReadonlyArrayDyn<'_, f64>) -> PyResult<Camera> {
    let row = checked(row, "camera", &[PACKED as isize])?;
    Ok(Camera::from_packed(&row.as_chunks::<PACKED>().0[0])?)
}

pub fn grid<'py, T: Element>(
    py: Python<'py>,
    data: Vec<T>,
    lead: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    let dims = [lead, &[SIDE, SIDE, SIDE]].concat();
    data.into_pyarray(py).reshape(dims)
}
