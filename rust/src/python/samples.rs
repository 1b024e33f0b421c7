//! Whole samples, in parallel.

use super::arrays::checked_mut;
use crate::batch::{SampleConfig, Slot, batch};
use crate::camera::{Camera, IMAGE, PACKED, VIEWPOINTS};
use crate::error::CoreError;
use crate::voxel::{CELLS, SIDE};
use numpy::{IntoPyArray, PyArray2, PyArray3, PyArrayMethods, PyReadwriteArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

#[pyfunction]
pub fn default_config() -> String {
    serde_json::to_string_pretty(&SampleConfig::default()).expect("a config is plain data")
}

type Made<'py> = (Vec<Bound<'py, PyArray2<f64>>>, Bound<'py, PyArray3<f64>>);

#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the arrays of a batch, each by name")]
pub fn generate<'py>(
    py: Python<'py>,
    config: &str,
    seed: u64,
    first: u64,
    threads: Option<usize>,
    mut drawings: PyReadwriteArrayDyn<'py, u8>,
    mut world: PyReadwriteArrayDyn<'py, u8>,
    mut frusta: PyReadwriteArrayDyn<'py, u8>,
) -> PyResult<Made<'py>> {
    let config = SampleConfig::from_json(config)?;
    let (image, side) = (IMAGE as isize, SIDE as isize);
    let [count, views] = *drawings.shape().first_chunk().unwrap_or(&[0, 0]);
    if !(1..=VIEWPOINTS.len()).contains(&views) {
        return Err(CoreError::Views(views).into());
    }
    let (n, v) = (count as isize, views as isize);
    let drawings = checked_mut(&mut drawings, "drawings", &[n, v, image, image])?;
    let world = checked_mut(&mut world, "world", &[n, side, side, side])?;
    let frusta = checked_mut(&mut frusta, "frusta", &[n, v, side, side, side])?;
    let slots = drawings
        .chunks_exact_mut(views * IMAGE * IMAGE)
        .zip(world.chunks_exact_mut(CELLS))
        .zip(frusta.chunks_exact_mut(views * CELLS))
        .map(|((drawings, world), frusta)| Slot { drawings, world, frusta })
        .collect();
    let made = py.detach(|| match threads {
        None => batch(&config, seed, first, slots),
        Some(threads) => rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|e| CoreError::Threads { threads, reason: e.to_string() })?
            .install(|| batch(&config, seed, first, slots)),
    })?;
    let packed: Vec<f64> =
        made.iter().flat_map(|(_, cameras)| cameras.iter().flat_map(Camera::to_packed)).collect();
    let cameras = packed.into_pyarray(py).reshape([count, views, PACKED])?;
    let shapes = made.iter().map(|(shape, _)| {
        let rows = shape.to_rows();
        let count = rows.len();
        rows.into_flattened().into_pyarray(py).reshape([count, 8])
    });
    Ok((shapes.collect::<PyResult<_>>()?, cameras))
}
