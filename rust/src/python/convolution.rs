//! Convolutions of three cells a side, and their gradients, for batches of images and volumes.

use super::arrays::{checked, same_count};
use crate::convolution::{Convolution, filter_gradient, input_gradient};
use crate::error::CoreError;
use numpy::{PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

type Array<'py> = Bound<'py, PyArrayDyn<f32>>;

/// What a batch is: samples, cells along each axis, channels last.
struct Batch {
    sides: Vec<usize>,
}

impl Batch {
    fn of(array: &PyReadonlyArrayDyn<'_, f32>, what: &'static str) -> Result<Self, CoreError> {
        let sides = array.shape().to_vec();
        if (4..=5).contains(&sides.len()) && sides[1..].iter().all(|&side| side > 0) {
            return Ok(Self { sides });
        }
        let expected =
            "[n, rows > 0, cols > 0, channels > 0] or [n, x > 0, y > 0, z > 0, channels > 0]".into();
        Err(CoreError::WrongShape { what, expected, got: format!("{sides:?}") })
    }

    fn axes(&self) -> usize {
        self.sides.len() - 2
    }

    fn samples(&self) -> usize {
        self.sides[0]
    }

    fn size(&self) -> [usize; 3] {
        [self.sides[1], self.sides[2], if self.axes() == 3 { self.sides[3] } else { 1 }]
    }

    fn channels(&self) -> usize {
        self.sides[self.sides.len() - 1]
    }

    /// The sides of the same cells with other channels.
    fn with_channels(&self, channels: usize) -> Vec<usize> {
        [&self.sides[..self.sides.len() - 1], &[channels]].concat()
    }
}

/// The weight's numbers and its outputs and inputs, of which `known` are so many: 0 outputs, 1 inputs.
fn weight_of<'a>(
    weight: &'a PyReadonlyArrayDyn<'_, f32>,
    batch: &Batch,
    known: usize,
) -> PyResult<(&'a [f32], [usize; 2])> {
    let mut shape = vec![3; batch.axes() + 2];
    shape[known] = batch.channels() as isize;
    shape[1 - known] = -1;
    let numbers = checked(weight, "weight", &shape)?;
    let [outputs, inputs] = [weight.shape()[0], weight.shape()[1]];
    if outputs * inputs > 0 {
        return Ok((numbers, [outputs, inputs]));
    }
    let (expected, got) = ("at least one channel".into(), format!("{:?}", weight.shape()));
    Err(CoreError::WrongShape { what: "weight", expected, got }.into())
}

#[pyfunction]
#[pyo3(signature = (input, weight, bias=None, *, rectify=false))]
pub fn convolve<'py>(
    py: Python<'py>,
    input: PyReadonlyArrayDyn<'py, f32>,
    weight: PyReadonlyArrayDyn<'py, f32>,
    bias: Option<PyReadonlyArrayDyn<'py, f32>>,
    rectify: bool,
) -> PyResult<Array<'py>> {
    let batch = Batch::of(&input, "input")?;
    let (weight, [outputs, inputs]) = weight_of(&weight, &batch, 1)?;
    let bias = bias.as_ref().map(|bias| checked(bias, "bias", &[outputs as isize])).transpose()?;
    let sides = batch.with_channels(outputs);
    let input = checked(&input, "input", &signed(&batch.sides))?;
    let mut out = vec![0.0; sides.iter().product()];
    py.detach(|| {
        let layer = Convolution::three(weight, bias.unwrap_or_default(), inputs, outputs, batch.axes());
        layer.apply_to_all(batch.samples(), input, batch.size(), rectify, false, &mut out);
    });
    PyArray1::from_vec(py, out).reshape(sides)
}

#[pyfunction]
#[pyo3(signature = (gradient, weight, *, rectified=None))]
pub fn convolve_transposed<'py>(
    py: Python<'py>,
    gradient: PyReadonlyArrayDyn<'py, f32>,
    weight: PyReadonlyArrayDyn<'py, f32>,
    rectified: Option<PyReadonlyArrayDyn<'py, f32>>,
) -> PyResult<Array<'py>> {
    let batch = Batch::of(&gradient, "gradient")?;
    let (weight, [outputs, inputs]) = weight_of(&weight, &batch, 0)?;
    let sides = batch.with_channels(inputs);
    let gradient = checked(&gradient, "gradient", &signed(&batch.sides))?;
    let rectified = rectified.as_ref().map(|was| checked(was, "rectified", &signed(&sides))).transpose()?;
    let mut out = vec![0.0; sides.iter().product()];
    py.detach(|| {
        let channels = [inputs, outputs];
        input_gradient(gradient, weight, batch.size(), channels, batch.axes(), rectified, &mut out);
    });
    PyArray1::from_vec(py, out).reshape(sides)
}

#[pyfunction(name = "filter_gradient")]
#[pyo3(signature = (input, gradient, *, rectify=false))]
pub fn filter_gradient_of<'py>(
    py: Python<'py>,
    input: PyReadonlyArrayDyn<'py, f32>,
    gradient: PyReadonlyArrayDyn<'py, f32>,
    rectify: bool,
) -> PyResult<Array<'py>> {
    let [read, made] = [Batch::of(&input, "input")?, Batch::of(&gradient, "gradient")?];
    let [inputs, outputs] = [read.channels(), made.channels()];
    same_count("gradient", made.samples(), read.samples())?;
    let input = checked(&input, "input", &signed(&read.sides))?;
    let gradient = checked(&gradient, "gradient", &signed(&read.with_channels(outputs)))?;
    let sides = [&[outputs, inputs][..], &vec![3; read.axes()]].concat();
    let mut out = vec![0.0; sides.iter().product()];
    py.detach(|| {
        filter_gradient(input, gradient, read.size(), [inputs, outputs], read.axes(), rectify, &mut out);
    });
    PyArray1::from_vec(py, out).reshape(sides)
}

fn signed(sides: &[usize]) -> Vec<isize> {
    sides.iter().map(|&side| side as isize).collect()
}
