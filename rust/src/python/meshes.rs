//! Triangle meshes: their voxels, and what cameras see of them.

use super::arrays::{camera_of, cameras_of, check_rays, check_size, checked, checked_mut, filled, grid};
use super::views::{BufferArrays, buffer_arrays};
use super::volumes::voxels;
use crate::batch::{SampleConfig, draw_views};
use crate::buffers::Buffers;
use crate::camera::{Camera, IMAGE, PACKED, VIEWPOINTS};
use crate::error::CoreError;
use crate::lines::LineConfig;
use crate::solid::{self, Finer};
use crate::subject::Subject;
use crate::surface::Surface;
use crate::voxel::CELLS;
use numpy::{
    IntoPyArray, PyArray2, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

type Faces<'a> = (&'a [[f64; 3]], &'a [[i64; 3]]);

fn faces_of<'a>(
    vertices: &'a PyReadonlyArrayDyn<'_, f64>,
    faces: &'a PyReadonlyArrayDyn<'_, i64>,
) -> PyResult<Faces<'a>> {
    let vertices = checked(vertices, "vertices", &[-1, 3])?.as_chunks::<3>().0;
    Ok((vertices, checked(faces, "faces", &[-1, 3])?.as_chunks::<3>().0))
}

#[pyfunction]
#[pyo3(signature = (vertices, faces, out=None))]
pub fn voxelize_mesh<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArrayDyn<'py, f64>,
    faces: PyReadonlyArrayDyn<'py, i64>,
    out: Option<Bound<'py, PyArrayDyn<u8>>>,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let (vertices, faces) = faces_of(&vertices, &faces)?;
    voxels(py, out, || Ok(solid::voxelize(vertices, faces)?))
}

/// Of 64 points of each voxel, how many are inside: uint8 [64, 64, 64].
#[pyfunction]
pub fn mesh_shares<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArrayDyn<'py, f64>,
    faces: PyReadonlyArrayDyn<'py, i64>,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let (vertices, faces) = faces_of(&vertices, &faces)?;
    let counts = py.detach(|| solid::shares(vertices, faces))?;
    grid(py, counts, &[])
}

#[pyfunction]
pub fn mesh_frusta<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArrayDyn<'py, f64>,
    faces: PyReadonlyArrayDyn<'py, i64>,
    cameras: PyReadonlyArrayDyn<'py, f64>,
    rays: i64,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let (vertices, faces) = faces_of(&vertices, &faces)?;
    let (cameras, rays) = (cameras_of(&cameras)?, check_rays(rays)?);
    let mut cells = vec![0; cameras.len() * CELLS];
    py.detach(|| {
        let finer = Finer::of_mesh(vertices, faces)?;
        let grids = cells.chunks_exact_mut(CELLS).zip(&cameras);
        grids.for_each(|(cells, camera)| finer.fill_frustum(camera, rays, cells));
        Ok::<_, PyErr>(())
    })?;
    grid(py, cells, &[cameras.len()])
}

#[pyfunction]
pub fn mesh_buffers<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArrayDyn<'py, f64>,
    faces: PyReadonlyArrayDyn<'py, i64>,
    crease_degrees: f64,
    camera: PyReadonlyArrayDyn<'py, f64>,
    size: i64,
) -> PyResult<BufferArrays<'py>> {
    let (vertices, faces) = faces_of(&vertices, &faces)?;
    let (camera, size) = (camera_of(&camera)?, check_size(size)?);
    let made = py.detach(|| {
        let surface = Surface::new(vertices, faces, crease_degrees)?;
        Ok::<_, PyErr>(Buffers::of_mesh(&surface, &camera, size)?)
    });
    buffer_arrays(py, made?)
}

#[pyfunction]
#[pyo3(signature = (vertices, faces, crease_degrees, camera, out=None))]
pub fn draw_mesh<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArrayDyn<'py, f64>,
    faces: PyReadonlyArrayDyn<'py, i64>,
    crease_degrees: f64,
    camera: PyReadonlyArrayDyn<'py, f64>,
    out: Option<Bound<'py, PyArrayDyn<u8>>>,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let (vertices, faces) = faces_of(&vertices, &faces)?;
    let camera = camera_of(&camera)?;
    filled(py, out, &[IMAGE; 2], |out| {
        let surface = Surface::new(vertices, faces, crease_degrees)?;
        Ok::<_, PyErr>(surface.draw(&camera, &LineConfig::default(), out)?)
    })
}

/// The drawings of sample `index` of a mesh, into `drawings` [n, 256, 256]; the cameras of their truth, [n, 15].
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "a mesh is two arrays, a sample a config and two numbers")]
pub fn draw_mesh_views<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArrayDyn<'py, f64>,
    faces: PyReadonlyArrayDyn<'py, i64>,
    crease_degrees: f64,
    config: &str,
    seed: u64,
    index: u64,
    mut drawings: PyReadwriteArrayDyn<'py, u8>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (vertices, faces) = faces_of(&vertices, &faces)?;
    let config = SampleConfig::from_json(config)?;
    let views = *drawings.shape().first().unwrap_or(&0);
    if !(1..=VIEWPOINTS.len()).contains(&views) {
        return Err(CoreError::Views(views).into());
    }
    let drawings = checked_mut(&mut drawings, "drawings", &[views as isize, IMAGE as isize, IMAGE as isize])?;
    let cameras = py.detach(|| {
        let surface = Surface::new(vertices, faces, crease_degrees)?;
        Ok::<_, PyErr>(draw_views(&config, &surface, seed, index, drawings)?)
    })?;
    let packed: Vec<f64> = cameras.iter().flat_map(Camera::to_packed).collect();
    packed.into_pyarray(py).reshape([views, PACKED])
}
