//! Whole samples, in parallel.

use super::arrays::{checked_mut, same_count, shape_of};
use super::pools::pool;
use crate::batch::{SampleConfig, Slot, Watch, batch};
use crate::camera::{Camera, IMAGE, PACKED, VIEWPOINTS};
use crate::csg::Shape;
use crate::error::CoreError;
use crate::fit::Fit;
use crate::voxel::{CELLS, SIDE};
use numpy::{
    IntoPyArray, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use rayon::Scope;
use std::sync::mpsc::channel;
use std::time::Duration;

#[pyfunction]
pub fn default_config() -> String {
    serde_json::to_string_pretty(&SampleConfig::default()).expect("a config is plain data")
}

type Made<'py> = (Vec<Bound<'py, PyArray2<f64>>>, Bound<'py, PyArray3<f64>>);

#[pyfunction]
#[pyo3(signature = (config, seed, first, threads, drawings, world, frusta, progress=None, shapes=None))]
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
    progress: Option<Py<PyAny>>,
    shapes: Option<Vec<PyReadonlyArrayDyn<'py, f64>>>,
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
    let given: Option<Vec<Shape>> = shapes.map(|shapes| shapes.iter().map(shape_of).collect()).transpose()?;
    if let Some(given) = &given {
        same_count("shapes", given.len(), count)?;
    }
    let watch = Watch::default();
    let made = py.detach(|| {
        let work = || batch(&config, seed, first, given.as_deref(), slots, &watch);
        match threads {
            None => rayon::in_place_scope(|scope| watched(scope, work, &watch, progress.as_ref())),
            Some(threads) => {
                let pool = pool(threads)?;
                pool.in_place_scope(|scope| watched(scope, work, &watch, progress.as_ref()))
            }
        }
    })?;
    let packed: Vec<f64> =
        made.iter().flat_map(|(_, cameras)| cameras.iter().flat_map(Camera::to_packed)).collect();
    let cameras = packed.into_pyarray(py).reshape([count, views, PACKED])?;
    let shapes = made.iter().map(|(shape, _)| rows(py, shape));
    Ok((shapes.collect::<PyResult<_>>()?, cameras))
}

fn rows<'py>(py: Python<'py>, shape: &Shape) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (numbers, width) = shape.to_rows();
    let count = numbers.len() / width;
    numbers.into_pyarray(py).reshape([count, width])
}

/// A shape by the 120 % rule; `None` if it is empty, in pieces, or dust.
#[pyfunction]
pub fn fit<'py>(
    py: Python<'py>,
    shape: PyReadonlyArrayDyn<'py, f64>,
    cover: f64,
    min_occupancy: f64,
    min_extent: usize,
) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
    let shape = shape_of(&shape)?;
    let fitted = py.detach(|| Fit { cover, min_occupancy, min_extent }.fit(shape));
    fitted.map(|(shape, _)| rows(py, &shape)).transpose()
}

/// How often the calling thread looks for signals and says how far the work is.
const TICK: Duration = Duration::from_millis(50);

/// Has the pool of `scope` do the work, while the calling thread minds Python: a signal (Ctrl-C), or an exception that
/// `progress` raises, stops the work and is raised when the last thread has left it.
fn watched<'scope, T: Send + 'scope>(
    scope: &Scope<'scope>,
    work: impl FnOnce() -> Result<T, CoreError> + Send + 'scope,
    watch: &Watch,
    progress: Option<&Py<PyAny>>,
) -> PyResult<T> {
    let (sender, receiver) = channel();
    // Nobody listens any more only where the calling thread panics.
    scope.spawn(move |_| drop(sender.send(work())));
    let mut said = 0;
    let mut tell = |py: Python<'_>| {
        let finished = watch.finished();
        match progress {
            Some(progress) if finished != said => {
                said = finished;
                progress.call1(py, (finished,)).map(drop)
            }
            _ => Ok(()),
        }
    };
    loop {
        match receiver.recv_timeout(TICK) {
            Ok(result) => {
                let made = result?;
                Python::attach(tell)?;
                return Ok(made);
            }
            Err(_) => {
                let halted = Python::attach(|py| py.check_signals().and_then(|()| tell(py)));
                if let Err(error) = halted {
                    watch.stop();
                    // The last samples end, and their result with them.
                    drop(receiver.recv());
                    return Err(error);
                }
            }
        }
    }
}
