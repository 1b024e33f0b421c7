//! Exponentials many at a time: the standard library's are computed one after the other.

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
