//! The module `sketchcore._core`: the only file that knows about Python. Checks what comes in, lets go of the
//! interpreter, calls a kernel.

use crate::batch::{SampleConfig, Slot, batch};
use crate::buffers::{Buffers, fill_frustum};
use crate::camera::{Camera, DISTANCE, IMAGE, PACKED, VIEWPOINTS};
use crate::csg::Shape;
use crate::error::CoreError;
use crate::lines::{LineConfig, detect};
use crate::mesh::{BilateralSettings, MeshError};
use crate::voxel::{BitGrid, CELLS, SIDE};
use crate::{carve as carving, evidence as fields, resample};
use numpy::{
    Element, IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn,
    PyReadwriteArrayDyn, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rayon::prelude::*;

impl From<CoreError> for PyErr {
    fn from(error: CoreError) -> Self {
        match error {
            CoreError::Threads { .. } | CoreError::NoShape { .. } => {
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

/// A contiguous array's numbers, if its shape is as given; -1 stands for any length.
fn checked<'a, T: Element>(
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

fn checked_mut<'a, T: Element>(
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

fn shape_of(rows: &PyReadonlyArrayDyn<'_, f64>) -> PyResult<Shape> {
    let rows = checked(rows, "shape", &[-1, 8])?;
    Ok(Shape::from_rows(rows.as_chunks().0)?)
}

fn cameras_of(rows: &PyReadonlyArrayDyn<'_, f64>) -> PyResult<Vec<Camera>> {
    let rows = checked(rows, "cameras", &[-1, PACKED as isize])?;
    let cameras = rows.as_chunks::<PACKED>().0.iter().map(Camera::from_packed);
    Ok(cameras.collect::<Result<_, _>>()?)
}

fn camera_of(row: &PyReadonlyArrayDyn<'_, f64>) -> PyResult<Camera> {
    let row = checked(row, "camera", &[PACKED as isize])?;
    Ok(Camera::from_packed(&row.as_chunks::<PACKED>().0[0])?)
}

fn same_count(what: &'static str, got: usize, expected: usize) -> Result<(), CoreError> {
    if got == expected {
        return Ok(());
    }
    Err(CoreError::WrongShape {
        what,
        expected: format!("one for each of the {expected} others"),
        got: got.to_string(),
    })
}

fn all_finite(values: &[f32], what: &'static str) -> Result<(), CoreError> {
    // The sum of absolute values is finite unless an entry is not; and it vectorises.
    let sum: f64 = values.chunks(4096).map(|c| f64::from(c.iter().map(|v| v * 0.0).sum::<f32>())).sum();
    if sum == 0.0 { Ok(()) } else { Err(CoreError::NotFinite { what }) }
}

const GRIDS: [isize; 4] = [-1, SIDE as isize, SIDE as isize, SIDE as isize];
const DRAWINGS: [isize; 3] = [-1, IMAGE as isize, IMAGE as isize];

fn grid<'py, T: Element>(
    py: Python<'py>,
    data: Vec<T>,
    lead: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    let dims = [lead, &[SIDE, SIDE, SIDE]].concat();
    data.into_pyarray(py).reshape(dims)
}

/// The 13 viewpoints, float64 [13, 15].
#[pyfunction]
fn viewpoints<'py>(py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let orbit = |&(azimuth, elevation): &(f64, f64)| Camera::orbit(azimuth, elevation, 0.0, DISTANCE);
    let rows: Vec<f64> = VIEWPOINTS.iter().flat_map(|v| orbit(v).to_packed()).collect();
    rows.into_pyarray(py).reshape([VIEWPOINTS.len(), PACKED])
}

#[pyfunction]
fn voxelize<'py>(
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
fn frustum<'py>(
    py: Python<'py>,
    shape: PyReadonlyArrayDyn<'py, f64>,
    camera: PyReadonlyArrayDyn<'py, f64>,
    rays: i64,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let (shape, camera) = (shape_of(&shape)?, camera_of(&camera)?);
    if !(1..=16).contains(&rays) {
        return Err(PyValueError::new_err(format!("rays must lie between 1 and 16, got {rays}")));
    }
    let rays = rays as usize;
    let mut cells = vec![0; CELLS];
    py.detach(|| fill_frustum(&shape, &camera, rays, &mut cells))?;
    grid(py, cells, &[])
}

type BufferArrays<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray3<f32>>);

fn check_size(size: i64) -> PyResult<usize> {
    if (1..=4096).contains(&size) {
        return Ok(size as usize);
    }
    Err(PyValueError::new_err(format!("size must lie between 1 and 4096 pixels, got {size}")))
}

#[pyfunction]
fn buffers<'py>(
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
fn isosurface<'py>(
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

fn buffer_arrays<'py>(py: Python<'py>, made: Buffers) -> PyResult<BufferArrays<'py>> {
    let size = made.size;
    let depth = made.depth.into_pyarray(py).reshape([size, size])?;
    let normal = made.normal.into_flattened().into_pyarray(py).reshape([size, size, 3])?;
    Ok((depth, normal))
}

#[pyfunction]
fn lines<'py>(
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
    let ink = py.detach(|| detect(&made, &config));
    let bytes: Vec<u8> = ink.iter().map(|&i| if i { 255 } else { 0 }).collect();
    bytes.into_pyarray(py).reshape([size, size])
}

#[pyfunction]
fn draw<'py>(
    py: Python<'py>,
    shape: PyReadonlyArrayDyn<'py, f64>,
    camera: PyReadonlyArrayDyn<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<u8>>> {
    let (shape, camera) = (shape_of(&shape)?, camera_of(&camera)?);
    let mut drawing = vec![0; IMAGE * IMAGE];
    py.detach(|| crate::batch::draw(&shape, &camera, &LineConfig::default(), &mut drawing))?;
    drawing.into_pyarray(py).reshape([IMAGE, IMAGE])
}

#[pyfunction]
fn to_camera_grid<'py>(
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
fn to_world_grid<'py>(
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
fn silhouettes<'py>(
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
fn carve<'py>(
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
fn evidence_fields<'py>(
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
fn evidence<'py>(
    py: Python<'py>,
    fields: PyReadonlyArrayDyn<'py, u8>,
    cameras: PyReadonlyArrayDyn<'py, f64>,
    target: usize,
    mirror: bool,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let cameras = cameras_of(&cameras)?;
    let image = IMAGE as isize;
    let fields = checked(&fields, "fields", &[-1, image, image, 2])?;
    same_count("fields", fields.len() / fields::FIELDS, cameras.len())?;
    if target >= cameras.len() {
        let message = format!("target must be below the number of cameras, {}; got {target}", cameras.len());
        return Err(PyValueError::new_err(message));
    }
    let mut out = vec![0; 2 * CELLS];
    py.detach(|| fields::gather(fields, &cameras, target, mirror, &mut out));
    grid(py, out, &[2])
}

#[pyfunction]
fn default_config() -> String {
    serde_json::to_string_pretty(&SampleConfig::default()).expect("a config is plain data")
}

type Made<'py> = (Vec<Bound<'py, PyArray2<f64>>>, Bound<'py, PyArray3<f64>>);

#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the arrays of a batch, each by name")]
fn generate<'py>(
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

#[pyfunction]
fn bilateral<'py>(
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

#[pymodule]
mod _core {
    #[pymodule_export]
    use super::{
        bilateral, buffers, carve, default_config, draw, evidence, evidence_fields, frustum, generate,
        isosurface, lines, silhouettes, to_camera_grid, to_world_grid, viewpoints, voxelize,
    };
}
