//! Weights by the names that `CompactNet.state_dict()` has for them in Python. Whoever takes one says which sides it must
//! have, in the order of that dictionary, and only then makes something of it: so a config can ask for no more memory
//! than its weights fill.

use crate::convolution::Convolution;
use crate::error::CoreError;
use std::collections::BTreeMap;

/// An array that was given as a weight.
pub struct Given<'a> {
    pub sides: Vec<usize>,
    /// What numbers it has, as numpy says it.
    pub kind: String,
    /// Its numbers, if they are `float32`.
    pub values: Option<&'a [f32]>,
}

/// Those weights that nobody has taken yet.
pub struct Weights<'a>(BTreeMap<String, Given<'a>>);

impl<'a> Weights<'a> {
    pub fn new(given: impl IntoIterator<Item = (String, Given<'a>)>) -> Self {
        Self(given.into_iter().collect())
    }

    /// The numbers of one weight.
    ///
    /// # Errors
    /// If it is missing, has other sides, or is not of `float32`.
    pub fn take(&mut self, name: &str, sides: &[usize]) -> Result<&'a [f32], CoreError> {
        let given = self.0.remove(name).ok_or_else(|| misfit(format!("there is no {name}")))?;
        match given.values {
            Some(values) if given.sides == sides && values.len() == sides.iter().product::<usize>() => {
                Ok(values)
            }
            _ => {
                let (has, kind) = (&given.sides[..given.sides.len().min(8)], given.kind);
                Err(misfit(format!("{name} must be {sides:?}, got {has:?} of {kind}")))
            }
        }
    }

    /// A vector `name.bias` or the like.
    pub fn vector(&mut self, name: &str, length: usize) -> Result<&'a [f32], CoreError> {
        self.take(name, &[length])
    }

    /// A layer `name` of linear maps: its weight, `outputs` x `inputs`, followed by so many sides of 1; and its bias.
    pub fn linear(
        &mut self,
        name: &str,
        inputs: usize,
        outputs: usize,
        ones: usize,
    ) -> Result<(&'a [f32], &'a [f32]), CoreError> {
        let sides = [&[outputs, inputs][..], &vec![1; ones]].concat();
        let weight = self.take(&format!("{name}.weight"), &sides)?;
        Ok((weight, self.vector(&format!("{name}.bias"), outputs)?))
    }

    /// The convolution `name` of 1 cell a side.
    pub fn point(
        &mut self,
        name: &str,
        inputs: usize,
        outputs: usize,
        axes: usize,
    ) -> Result<Convolution, CoreError> {
        let (weight, bias) = self.linear(name, inputs, outputs, axes)?;
        Ok(Convolution::point(weight, bias, inputs, outputs))
    }

    /// The convolution `name` of 3 cells a side, with or without a bias.
    pub fn three(
        &mut self,
        name: &str,
        [inputs, outputs]: [usize; 2],
        axes: usize,
        biased: bool,
    ) -> Result<Convolution, CoreError> {
        let sides = [&[outputs, inputs][..], &vec![3; axes]].concat();
        let weight = self.take(&format!("{name}.weight"), &sides)?;
        let bias = if biased { self.vector(&format!("{name}.bias"), outputs)? } else { &[] };
        Ok(Convolution::three(weight, bias, inputs, outputs, axes))
    }

    /// The convolution `name` that halves every side: of 3 pixels in images, of 2 cells in volumes.
    pub fn halving(
        &mut self,
        name: &str,
        inputs: usize,
        outputs: usize,
        axes: usize,
    ) -> Result<Convolution, CoreError> {
        let side = if axes == 2 { 3 } else { 2 };
        let sides = [&[outputs, inputs][..], &vec![side; axes]].concat();
        let weight = self.take(&format!("{name}.weight"), &sides)?;
        let bias = self.vector(&format!("{name}.bias"), outputs)?;
        Ok(Convolution::halving(weight, bias, inputs, outputs, axes))
    }

    /// # Errors
    /// If there is a weight that nobody took.
    pub fn finish(self) -> Result<(), CoreError> {
        match self.0.into_keys().next() {
            None => Ok(()),
            Some(name) => Err(misfit(format!("it has no {}", name.chars().take(80).collect::<String>()))),
        }
    }
}

fn misfit(fault: String) -> CoreError {
    CoreError::Misfit(fault)
}
