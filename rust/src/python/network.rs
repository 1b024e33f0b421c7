//! The compact network for Python.

use super::arrays::{checked, same_count};
use crate::camera::{IMAGE, PACKED};
use crate::lift::{COARSE, HALF};
use crate::network::weights::{Given, Weights};
use crate::network::widths::Widths;
use crate::network::{self, VOXELS};
use crate::voxel::SIDE;
use numpy::{
    PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::collections::BTreeMap;

#[pyclass(frozen, module = "sketchcore._core")]
pub struct CompactNetwork(network::CompactNetwork);

#[pymethods]
impl CompactNetwork {
    #[new]
    #[pyo3(signature = (weights, *, stem, image, features, fused, world, groups))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords")]
    fn new(
        py: Python<'_>,
        weights: BTreeMap<String, Bound<'_, PyUntypedArray>>,
        stem: usize,
        image: [usize; 3],
        features: usize,
        fused: usize,
        world: [usize; 3],
        groups: usize,
    ) -> PyResult<Self> {
        let widths = Widths { stem, image, features, fused, world, groups };
        let borrowed = weights.iter().map(|(name, array)| Ok((name, array, numbers(name, array)?)));
        let borrowed = borrowed.collect::<PyResult<Vec<_>>>()?;
        let given = borrowed.iter().map(|(name, array, numbers)| {
            let values = numbers.as_ref().and_then(|numbers| numbers.as_slice().ok());
            let (sides, kind) = (array.shape().to_vec(), array.dtype().to_string());
            ((*name).clone(), Given { sides, kind, values })
        });
        let weights = Weights::new(given);
        Ok(Self(py.detach(|| network::CompactNetwork::new(weights, &widths))?))
    }

    fn read<'py>(
        &self,
        py: Python<'py>,
        drawings: PyReadonlyArrayDyn<'py, u8>,
        fields: PyReadonlyArrayDyn<'py, u8>,
        cameras: PyReadonlyArrayDyn<'py, f64>,
        counts: Vec<usize>,
        evidence: PyReadonlyArrayDyn<'py, u8>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        const SIDES: [isize; 3] = [-1, IMAGE as isize, IMAGE as isize];
        let drawings = checked(&drawings, "drawings", &SIDES)?;
        let fields = checked(&fields, "fields", &[SIDES[0], SIDES[1], SIDES[2], 2])?;
        let cameras = checked(&cameras, "cameras", &[-1, PACKED as isize])?.as_chunks::<PACKED>().0;
        let side = SIDE as isize;
        let evidence = checked(&evidence, "evidence", &[-1, 3, side, side, side / 2])?;
        same_count("drawings", drawings.len() / (IMAGE * IMAGE), cameras.len())?;
        same_count("fields", fields.len() / (2 * IMAGE * IMAGE), cameras.len())?;
        same_count("evidence", evidence.len() / network::EVIDENCE_BYTES, counts.len())?;
        let out = py.detach(|| self.0.read(drawings, fields, cameras, &counts, evidence))?;
        PyArray1::from_vec(py, out).reshape(vec![counts.len(), HALF, self.0.outputs()])
    }

    #[pyo3(signature = (readings, prior, counts))]
    fn decide<'py>(
        &self,
        py: Python<'py>,
        readings: PyReadonlyArrayDyn<'py, f32>,
        prior: Option<PyReadonlyArrayDyn<'py, f32>>,
        counts: Vec<usize>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let grid = [COARSE, COARSE, COARSE / 2, VOXELS];
        let outputs = self.0.outputs();
        let readings = checked(&readings, "readings", &[-1, HALF as isize, outputs as isize])?;
        same_count("readings", readings.len() / (HALF * outputs), counts.len())?;
        let shape = [-1, grid[0] as isize, grid[1] as isize, grid[2] as isize, grid[3] as isize];
        let prior = prior.as_ref().map(|prior| checked(prior, "prior", &shape)).transpose()?;
        if let Some(prior) = prior {
            same_count("prior", prior.len() / (HALF * VOXELS), counts.len())?;
        }
        let out = py.detach(|| self.0.decide(readings, prior, &counts))?;
        PyArray1::from_vec(py, out).reshape([&[counts.len()][..], &grid].concat())
    }
}

/// The numbers of a weight, if they are `float32`.
fn numbers<'py>(
    name: &str,
    array: &Bound<'py, PyUntypedArray>,
) -> PyResult<Option<PyReadonlyArrayDyn<'py, f32>>> {
    let Ok(array) = array.cast::<PyArrayDyn<f32>>() else { return Ok(None) };
    if !array.is_c_contiguous() {
        let name: String = name.chars().take(80).collect();
        let how = "must be C-contiguous; numpy.ascontiguousarray makes it so";
        return Err(PyValueError::new_err(format!("{name} {how}")));
    }
    Ok(Some(array.try_readonly()?))
}
