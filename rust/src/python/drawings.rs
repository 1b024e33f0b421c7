//! What drawings say about space, and what they ask of a volume.

use super::arrays::{DRAWINGS, cameras_of, checked, filled, grid, same_count};
use crate::camera::IMAGE;
use crate::error::all_finite;
use crate::voxel::{CELLS, SIDE};
use crate::{carve as carving, evidence as fields, outlines};
use numpy::{IntoPyArray, PyArray1, PyArray3, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use rayon::prelude::*;

#[pyfunction]
pub fn silhouettes<'py>(
    py: Python<'py>,
    drawings: PyReadonlyArrayDyn<'py, u8>,
) -> PyResult<Bound<'py, PyArray3<u8>>> {
    let drawings = checked(&drawings, "drawings", &DRAWINGS)?;
    let inside: Vec<u8> = py.detach(|| {
        let each = drawings.par_chunks(IMAGE * IMAGE).map(carving::silhouette);
        each.flatten_iter().map(u8::from).collect()
    });
    let count = drawings.len() / (IMAGE * IMAGE);
    inside.into_pyarray(py).reshape([count, IMAGE, IMAGE])
}

#[pyfunction]
pub fn carve<'py>(
    py: Python<'py>,
    drawings: PyReadonlyArrayDyn<'py, u8>,
    cameras: PyReadonlyArrayDyn<'py, f64>,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let cameras = cameras_of(&cameras)?;
    let drawings = checked(&drawings, "drawings", &DRAWINGS)?;
    same_count("cameras", cameras.len(), drawings.len() / (IMAGE * IMAGE))?;
    let carved = py.detach(|| {
        let inside: Vec<_> = drawings.par_chunks(IMAGE * IMAGE).map(carving::silhouette).collect();
        let mut out = vec![0; CELLS];
        carving::carve(&inside, &cameras, &mut out);
        out
    });
    grid(py, carved, &[])
}

#[pyfunction]
pub fn evidence_fields<'py>(
    py: Python<'py>,
    drawings: PyReadonlyArrayDyn<'py, u8>,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let drawings = checked(&drawings, "drawings", &DRAWINGS)?;
    let count = drawings.len() / (IMAGE * IMAGE);
    let mut out = vec![0; count * fields::FIELDS];
    py.detach(|| {
        let jobs = out.par_chunks_mut(fields::FIELDS).zip(drawings.par_chunks(IMAGE * IMAGE));
        jobs.for_each(|(out, drawing)| fields::fill_fields(drawing, out));
    });
    PyArray1::from_vec(py, out).reshape(vec![count, IMAGE, IMAGE, 2])
}

#[pyfunction]
pub fn evidence<'py>(
    py: Python<'py>,
    fields: PyReadonlyArrayDyn<'py, u8>,
    cameras: PyReadonlyArrayDyn<'py, f64>,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let cameras = cameras_of(&cameras)?;
    let image = IMAGE as isize;
    let fields = checked(&fields, "fields", &[-1, image, image, 2])?;
    same_count("fields", fields.len() / fields::FIELDS, cameras.len())?;
    let mut out = vec![0; 3 * CELLS / 2];
    py.detach(|| fields::gather(fields, &cameras, &mut out));
    PyArray1::from_vec(py, out).reshape(vec![3, SIDE, SIDE, SIDE / 2])
}

#[pyfunction]
pub fn heed_outlines<'py>(
    py: Python<'py>,
    volume: PyReadonlyArrayDyn<'py, f32>,
    depths: PyReadonlyArrayDyn<'py, f32>,
    cameras: PyReadonlyArrayDyn<'py, f64>,
    hull: PyReadonlyArrayDyn<'py, u8>,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    let cameras = cameras_of(&cameras)?;
    let side = SIDE as isize;
    let volume = checked(&volume, "volume", &[side, side, side])?;
    let depths = checked(&depths, "depths", &[-1, side, side])?;
    same_count("depths", depths.len() / outlines::RAYS, cameras.len())?;
    let hull = checked(&hull, "hull", &[side, side, side / 2])?;
    all_finite(depths, "depths")?;
    filled(py, None, &[SIDE; 3], |out| outlines::heed(volume, depths, &cameras, hull, out))
}
