//! Exponentials and logarithms many at a time: the standard library's are computed one after the other.

use crate::dispatch::for_each_instruction_set;

/// Added to a number of magnitude below 2^22 and subtracted again, it rounds it to a whole number.
const ROUND: f32 = 12_582_912.0;
/// ln 2, in a part of few digits and a rest.
const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];
/// Of the polynomial for `exp(r) - 1 - r` over `r` squared, the highest power first (Cephes).
const POWERS: [f32; 6] = [1.987_569_1e-4, 1.398_199_9e-3, 8.333_452e-3, 4.166_579_6e-2, 1.666_666_5e-1, 0.5];

/// e to the `x`, to 2^-22 of itself; what is beyond the range of `f32` is as its ends, and NaN stays NaN.
#[inline(always)]
pub fn exponential(x: f32) -> f32 {
    let x = if x < -87.0 { -87.0 } else { x };
    let x = if x > 88.0 { 88.0 } else { x };
    let shifted = x * std::f32::consts::LOG2_E + ROUND;
    let whole = shifted - ROUND;
    let r = x - whole * LN_2[0] - whole * LN_2[1];
    let mut polynomial = POWERS[0];
    for power in &POWERS[1..] {
        polynomial = polynomial * r + power;
    }
    // The lowest digits of `shifted` are the whole number: moved to where a float has its exponent.
    let scale = f32::from_bits((shifted.to_bits() << 23).wrapping_add(1.0f32.to_bits()));
    (polynomial * r * r + r + 1.0) * scale
}

/// The square root of one half, of which `logarithm` counts the doublings.
const ROOT: u32 = std::f32::consts::FRAC_1_SQRT_2.to_bits();
/// Of the polynomial for `ln(1 + f) - f + f^2 / 2` over `f` cubed, the highest power first (Cephes).
const LOGARITHM: [f32; 9] = [
    7.037_683_6e-2,
    -1.151_461e-1,
    1.167_699_9e-1,
    -1.242_014_1e-1,
    1.424_932_3e-1,
    -1.666_805_7e-1,
    2.000_071_5e-1,
    -2.499_999_4e-1,
    3.333_333e-1,
];

/// The natural logarithm of a finite, normal, positive number, to 2^-22 of itself or of 1, where that is more.
#[inline(always)]
pub fn logarithm(x: f32) -> f32 {
    let above = x.to_bits().wrapping_sub(ROOT);
    let doublings = (above as i32 >> 23) as f32;
    let f = f32::from_bits((above & 0x007f_ffff) + ROOT) - 1.0;
    let mut polynomial = LOGARITHM[0];
    for power in &LOGARITHM[1..] {
        polynomial = polynomial * f + power;
    }
    let small = polynomial * f * f * f + doublings * LN_2[1] - 0.5 * f * f;
    f + small + doublings * LN_2[0]
}

for_each_instruction_set! {
/// Logits become probabilities.
pub fn sigmoid(values: &mut [f32]) {
    for value in values {
        *value = 1.0 / (1.0 + exponential(-*value));
    }
}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponentials_are_those_of_the_standard_library() {
        for i in -86_000..=87_000 {
            let x = i as f32 / 1000.0;
            let exact = f64::from(x).exp();
            let off = (f64::from(exponential(x)) - exact) / exact;
            assert!(off.abs() < 2.4e-7, "{x}: {off}");
        }
    }

    #[test]
    fn logarithms_are_those_of_the_standard_library() {
        for i in -87_000..=88_000 {
            let x = (f64::from(i) / 1000.0).exp() as f32;
            let exact = f64::from(x).ln();
            let off = (f64::from(logarithm(x)) - exact) / exact.abs().max(1.0);
            assert!(off.abs() < 2.4e-7, "{x}: {off}");
        }
        assert_eq!(logarithm(1.0), 0.0);
    }

    #[test]
    fn beyond_the_range_there_is_no_surprise() {
        assert!(exponential(f32::NAN).is_nan());
        assert_eq!(exponential(0.0), 1.0);
        for x in [88.0, 1e6, f32::INFINITY] {
            assert!(exponential(x) > 1e38 && exponential(x).is_finite());
            assert!(exponential(-x) < 1e-37 && exponential(-x) >= 0.0);
        }
        let mut values = [0.0, f32::INFINITY, f32::NEG_INFINITY, 2.0];
        sigmoid(&mut values);
        assert_eq!(values[..2], [0.5, 1.0]);
        assert!(values[2] < 1e-37 && (values[3] - 0.880_797).abs() < 1e-6);
    }
}
