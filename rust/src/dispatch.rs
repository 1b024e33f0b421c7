//! Instruction sets, chosen when the program runs: one wheel is fast on every processor.

/// Compiles a function for AVX-512, for AVX2 and for the baseline, and calls the best one that the processor has.
///
/// Nothing is written in intrinsics: kernels are plain loops over arrays, which the compiler vectorises. What a
/// dispatched function calls has to be `#[inline(always)]`, or it is compiled for the baseline alone. Multiplications
/// and additions are never fused, so that results are the same bits on every processor.
macro_rules! dispatched {
    ($($function:tt)*) => {
        #[multiversion::multiversion(targets(
            "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+fma+bmi1+bmi2+lzcnt+popcnt",
            "x86_64+avx2+fma+bmi1+bmi2+lzcnt+popcnt",
        ))]
        $($function)*
    };
}

pub(crate) use dispatched;
