//! Gradients against their formula in 64-bit floats, on every instruction set that this processor has.

use super::super::tests::{in_pool, noise};
use super::*;
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;

/// The largest error that is allowed, in units of the root of the number of products.
const TOLERANCE: f64 = 1e-5;

#[derive(Clone, Copy, Debug)]
struct Case {
    axes: usize,
    samples: usize,
    inputs: usize,
    outputs: usize,
    size: [usize; 3],
    rectify: bool,
}

impl Case {
    fn taps(&self) -> usize {
        3usize.pow(self.axes as u32)
    }

    fn cells(&self) -> usize {
        self.size.iter().product()
    }

    /// Weights, inputs, and the gradient by the outputs.
    fn numbers(&self) -> [Vec<f32>; 3] {
        let cells = self.samples * self.cells();
        [
            noise(self.outputs * self.inputs * self.taps(), 1),
            noise(cells * self.inputs, 2),
            noise(cells * self.outputs, 3),
        ]
    }

    /// Calls `visit` with each output cell, each input cell that it reads, and the tap that it is read by.
    fn for_each_reading(&self, mut visit: impl FnMut(usize, usize, usize)) {
        let [rows, cols, depths] = self.size;
        let deep = if self.axes == 3 { 3 } else { 1 };
        for to in 0..self.samples * self.cells() {
            let (sample, cell) = (to / self.cells(), to % self.cells());
            let place = [cell / depths / cols, cell / depths % cols, cell % depths];
            for tap in 0..self.taps() {
                let at = [tap / deep / 3, tap / deep % 3, if deep == 3 { tap % 3 } else { 1 }];
                let from: [usize; 3] = std::array::from_fn(|a| (place[a] + at[a]).wrapping_sub(1));
                if from[0] < rows && from[1] < cols && from[2] < depths {
                    let from = (from[0] * cols + from[1]) * depths + from[2];
                    visit(to, sample * self.cells() + from, tap);
                }
            }
        }
    }

    /// The gradients by the input and by the weight.
    fn direct(&self, [weight, input, gradient]: &[Vec<f32>; 3]) -> [Vec<f64>; 2] {
        let Self { inputs, outputs, .. } = *self;
        let [mut by_input, mut by_weight] = [vec![0.0; input.len()], vec![0.0; weight.len()]];
        self.for_each_reading(|to, from, tap| {
            for o in 0..outputs {
                for i in 0..inputs {
                    let (x, w) = (from * inputs + i, (o * inputs + i) * self.taps() + tap);
                    if self.rectify && input[x] <= 0.0 {
                        continue;
                    }
                    let dy = f64::from(gradient[to * outputs + o]);
                    by_input[x] += dy * f64::from(weight[w]);
                    by_weight[w] += dy * f64::from(input[x]);
                }
            }
        });
        [by_input, by_weight]
    }

    fn by_weight(&self, by: Instructions, [weight, input, gradient]: &[Vec<f32>; 3]) -> Vec<f32> {
        let mut out = vec![9.0; weight.len()];
        let way = FilterGradient::new(by, [self.inputs, self.outputs], self.axes);
        way.apply(input, gradient, self.size, self.rectify, &mut out);
        out
    }

    fn by_input(&self, [weight, input, gradient]: &[Vec<f32>; 3]) -> Vec<f32> {
        let (channels, was) = ([self.inputs, self.outputs], self.rectify.then_some(&input[..]));
        let mut out = vec![9.0; input.len()];
        input_gradient(gradient, weight, self.size, channels, self.axes, was, &mut out);
        out
    }
}

fn any_case() -> impl Strategy<Value = Case> {
    let channels = (1usize..40, 1usize..40);
    (2usize..4, 1usize..4, channels, [1usize..10, 1..10, 1..7], any::<bool>()).prop_map(
        |(axes, samples, (inputs, outputs), [rows, cols, depths], rectify)| {
            let size = [rows, cols, if axes == 2 { 1 } else { depths }];
            Case { axes, samples, inputs, outputs, size, rectify }
        },
    )
}

fn error(expected: &[f64], got: &[f32], products: usize) -> f64 {
    assert_eq!(expected.len(), got.len());
    let each = expected.iter().zip(got).map(|(e, &g)| (e - f64::from(g)).abs());
    each.fold(0.0, f64::max) / (products as f64).sqrt()
}

fn are_their_formula(case: Case) -> Result<(), TestCaseError> {
    let numbers = case.numbers();
    let [by_input, by_weight] = case.direct(&numbers);
    let off = error(&by_input, &case.by_input(&numbers), case.outputs * case.taps());
    prop_assert!(off < TOLERANCE, "{off} by input");
    for by in Instructions::available() {
        let off = error(&by_weight, &case.by_weight(by, &numbers), case.samples * case.cells());
        prop_assert!(off < TOLERANCE, "{off} by weight on {by:?}");
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn gradients_are_their_formula(case in any_case()) {
        are_their_formula(case)?;
    }

    #[test]
    fn threads_change_nothing(case in any_case(), threads in 2usize..5) {
        let numbers = case.numbers();
        let result = |threads| in_pool(threads, || {
            (case.by_weight(Instructions::best(), &numbers), case.by_input(&numbers))
        });
        prop_assert_eq!(result(1), result(threads));
    }
}

#[test]
fn gradients_of_many_channels_are_their_formula() {
    for (axes, samples, [inputs, outputs], size) in [
        (3, 2, [160, 144], [5, 4, 3]),
        (3, 17, [96, 100], [8, 8, 4]),
        (2, 2, [256, 256], [8, 7, 1]),
        (2, 3, [128, 64], [17, 16, 1]),
    ] {
        are_their_formula(Case { axes, samples, inputs, outputs, size, rectify: true }).unwrap();
    }
}

#[test]
fn no_samples_have_no_gradient() {
    let mut out = [9.0; 27];
    filter_gradient(&[], &[], [4, 4, 4], [1, 1], 3, false, &mut out);
    assert_eq!(out, [0.0; 27]);
}
