//! Linear maps of a few numbers: what a network makes of its condition, and of that for each of its blocks.

use super::weights::Weights;
use crate::error::CoreError;

/// A linear map with its bias.
pub struct Dense {
    /// `inputs` x `outputs`, transposed: outputs are summed side by side.
    weight: Vec<f32>,
    bias: Vec<f32>,
}

impl Dense {
    pub fn of(
        weights: &mut Weights<'_>,
        name: &str,
        inputs: usize,
        outputs: usize,
    ) -> Result<Self, CoreError> {
        let (weight, bias) = weights.linear(name, inputs, outputs, 0)?;
        Ok(Self { weight: transposed(weight, inputs, outputs), bias: bias.to_vec() })
    }

    pub fn apply(&self, input: &[f32]) -> Vec<f32> {
        assert_eq!(input.len() * self.bias.len(), self.weight.len());
        let mut out = self.bias.clone();
        for (value, weights) in input.iter().zip(self.weight.chunks_exact(out.len())) {
            out.iter_mut().zip(weights).for_each(|(o, w)| *o += value * w);
        }
        out
    }

    /// The same, with what is negative set to 0.
    pub fn rectified(&self, input: &[f32]) -> Vec<f32> {
        let mut out = self.apply(input);
        out.iter_mut().for_each(|o| *o = if *o < 0.0 { 0.0 } else { *o });
        out
    }
}

/// `outputs` x `inputs` numbers as `inputs` x `outputs`.
pub fn transposed(weight: &[f32], inputs: usize, outputs: usize) -> Vec<f32> {
    let place = |i: usize| weight[i % outputs * inputs + i / outputs];
    (0..inputs * outputs).map(place).collect()
}
