//! Layers against their formula in 64-bit floats, on every instruction set that this processor has.

use super::*;
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;

/// The largest error that is allowed, in units of the root of the number of products: about three times what an output
/// amounts to here. 3e-6 was the largest of thousands of layers; so errors are within 1e-5 of a typical output.
const TOLERANCE: f64 = 1e-5;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Three,
    Halving,
    Point,
}

/// Numbers between -1 and 1, without any pattern.
pub(super) fn noise(count: usize, seed: usize) -> Vec<f32> {
    let mix = |x: u32, shift: u32, by: u32| (x ^ (x >> shift)).wrapping_mul(by);
    let at = |i: usize| mix(mix((i + (seed << 24)) as u32, 16, 0x7feb_352d), 15, 0x846c_a68b) ^ 0x5a5a_5a5a;
    (0..count).map(|i| (mix(at(i), 16, 1) >> 8) as f32 / (1 << 23) as f32 - 1.0).collect()
}

struct Case {
    kind: Kind,
    axes: usize,
    channels: [usize; 2],
    size: [usize; 3],
    rectify: bool,
    add: bool,
    biased: bool,
}

impl Case {
    /// Taps, stride and padding.
    fn shape(&self) -> [[usize; 3]; 3] {
        match (self.kind, self.axes) {
            (Kind::Three, 2) => [[3, 3, 1], [1; 3], [1, 1, 0]],
            (Kind::Three, _) => [[3; 3], [1; 3], [1; 3]],
            (Kind::Halving, 2) => [[3, 3, 1], [2, 2, 1], [1, 1, 0]],
            (Kind::Halving, _) => [[2; 3], [2; 3], [0; 3]],
            (Kind::Point, _) => [[1; 3], [1; 3], [0; 3]],
        }
    }

    fn layer(&self, by: Instructions, weight: &[f32], bias: &[f32]) -> Convolution {
        match self.kind {
            Kind::Three => Convolution::three_by(by, weight, bias, self.channels, self.axes),
            Kind::Halving => Convolution::halving_by(by, weight, bias, self.channels, self.axes),
            Kind::Point => Convolution::point_by(by, weight, bias, self.channels),
        }
    }

    /// Weights, bias, input, and what `out` holds before.
    fn numbers(&self) -> [Vec<f32>; 4] {
        let [inputs, outputs] = self.channels;
        let taps: usize = self.shape()[0].iter().product();
        let cells: usize = self.size.iter().product();
        let before: usize = self.direct_size().iter().product();
        [
            noise(outputs * inputs * taps, 1),
            noise(if self.biased { outputs } else { 0 }, 2),
            noise(cells * inputs, 3),
            noise(before * outputs, 4),
        ]
    }

    fn direct_size(&self) -> [usize; 3] {
        let [taps, stride, padding] = self.shape();
        std::array::from_fn(|a| {
            let padded = self.size[a] + 2 * padding[a];
            if padded < taps[a] { 0 } else { (padded - taps[a]) / stride[a] + 1 }
        })
    }

    fn direct(&self, [weight, bias, input, before]: &[Vec<f32>; 4]) -> Vec<f64> {
        let [taps, stride, padding] = self.shape();
        let [inputs, outputs] = self.channels;
        let [rows, cols, depths] = self.direct_size();
        let mut out = Vec::new();
        for place in 0..rows * cols * depths {
            let place = [place / depths / cols, place / depths % cols, place % depths];
            for o in 0..outputs {
                let mut sum = bias.get(o).map_or(0.0, |&b| f64::from(b));
                for tap in 0..taps.iter().product() {
                    let at = [tap / taps[2] / taps[1], tap / taps[2] % taps[1], tap % taps[2]];
                    let cell: [usize; 3] =
                        std::array::from_fn(|a| (place[a] * stride[a] + at[a]).wrapping_sub(padding[a]));
                    if (0..3).any(|a| cell[a] >= self.size[a]) {
                        continue;
                    }
                    let cell = (cell[0] * self.size[1] + cell[1]) * self.size[2] + cell[2];
                    for i in 0..inputs {
                        let x = f64::from(input[cell * inputs + i]);
                        let x = if self.rectify { x.max(0.0) } else { x };
                        sum += x * f64::from(weight[(o * inputs + i) * taps.iter().product::<usize>() + tap]);
                    }
                }
                out.push(sum + if self.add { f64::from(before[out.len()]) } else { 0.0 });
            }
        }
        out
    }

    /// The largest error on an instruction set, in the units of `TOLERANCE`.
    fn error(&self, by: Instructions) -> f64 {
        let numbers = self.numbers();
        let layer = self.layer(by, &numbers[0], &numbers[1]);
        assert_eq!(layer.output_size(self.size), self.direct_size());
        let mut out = numbers[3].clone();
        layer.apply(&numbers[2], self.size, self.rectify, self.add, &mut out);
        let products = self.shape()[0].iter().product::<usize>() * self.channels[0];
        let unit = (products as f64).sqrt().max(1.0);
        self.direct(&numbers)
            .iter()
            .zip(out)
            .map(|(d, o)| (d - f64::from(o)).abs() / unit)
            .fold(0.0, f64::max)
    }
}

fn any_case() -> impl Strategy<Value = Case> {
    let kind = prop_oneof![Just(Kind::Three), Just(Kind::Halving), Just(Kind::Point)];
    let flags = (any::<bool>(), any::<bool>(), any::<bool>());
    (kind, 2usize..4, [1usize..70, 1..70], [1usize..12, 1..12, 1..8], flags).prop_map(
        |(kind, axes, channels, mut size, (rectify, add, biased))| {
            if axes == 2 {
                size[2] = 1;
            }
            Case { kind, axes, channels, size, rectify, add, biased }
        },
    )
}

impl std::fmt::Debug for Case {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let Self { kind, axes, channels, size, rectify, add, biased } = self;
        write!(f, "{kind:?} {axes} {channels:?} {size:?} {rectify} {add} {biased}")
    }
}

pub(super) fn in_pool<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

fn product_is_its_formula(by: Instructions, [m, k, n]: [usize; 3], add: bool) -> Result<(), TestCaseError> {
    let (a, b, mut out) = (noise(m * k, 1), noise(k * n, 2), noise(m * n, 3));
    let before = out.clone();
    multiply_by(by, &a, &b, [m, k, n], add, &mut out);
    for (i, got) in out.iter().enumerate() {
        let at = |l: usize| f64::from(a[i / n * k + l]) * f64::from(b[l * n + i % n]);
        let sum = (0..k).map(at).sum::<f64>() + if add { f64::from(before[i]) } else { 0.0 };
        prop_assert!((sum - f64::from(*got)).abs() < 1e-6 * (k as f64).sqrt().max(1.0) + 1e-6);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn every_layer_is_its_formula(case in any_case()) {
        for by in Instructions::available() {
            let error = case.error(by);
            prop_assert!(error < TOLERANCE, "{error} on {by:?}");
        }
    }

    #[test]
    fn a_product_is_its_formula(size in [1usize..40, 0..600, 1..70], add in any::<bool>()) {
        for by in Instructions::available() {
            product_is_its_formula(by, size, add)?;
        }
    }

    #[test]
    fn threads_change_nothing(case in any_case(), threads in 2usize..5) {
        let [weight, bias, input, before] = case.numbers();
        let layer = case.layer(Instructions::best(), &weight, &bias);
        let result = |threads| in_pool(threads, || {
            let mut out = before.clone();
            layer.apply(&input, case.size, case.rectify, case.add, &mut out);
            out
        });
        prop_assert_eq!(result(1), result(threads));
    }
}

#[test]
fn layers_of_many_channels_are_their_formula() {
    for (kind, axes, channels, size) in [
        (Kind::Three, 3, [96, 96], [8, 8, 4]),
        (Kind::Three, 3, [192, 192], [5, 4, 3]),
        (Kind::Three, 2, [192, 192], [9, 6, 1]),
        (Kind::Three, 2, [128, 64], [17, 16, 1]),
        (Kind::Halving, 3, [96, 192], [8, 8, 4]),
        (Kind::Halving, 2, [192, 256], [8, 8, 1]),
        (Kind::Point, 2, [256, 192], [8, 8, 1]),
    ] {
        let case = Case { kind, axes, channels, size, rectify: true, add: false, biased: true };
        for by in Instructions::available() {
            let error = case.error(by);
            assert!(error < TOLERANCE, "{error}: {case:?} on {by:?}");
        }
    }
}

#[test]
fn a_filter_of_one_tap_moves_the_input() {
    let size = [6, 5, 7];
    let input = noise(6 * 5 * 7, 5);
    let mut weight = [0.0; 27];
    // What lies one cell further along the last axis.
    weight[14] = 1.0;
    let mut out = vec![9.0; input.len()];
    Convolution::three(&weight, &[], 1, 1, 3).apply(&input, size, false, false, &mut out);
    for (i, got) in out.iter().enumerate() {
        let expected = if i % 7 == 6 { 0.0 } else { input[i + 1] };
        assert!((got - expected).abs() < 1e-5, "{i}: {got} {expected}");
    }
}

#[test]
#[should_panic]
fn a_weight_of_another_length_is_refused() {
    Convolution::three(&[0.0; 10], &[], 1, 1, 2);
}
