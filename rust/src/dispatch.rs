//! One wheel for every processor: hot functions are compiled once for each instruction set, and the best that the
//! processor has is chosen when they are called.

/// Compiles a function for AVX-512, for AVX2 and for the plain architecture. What it calls must be `#[inline(always)]`,
/// or it is compiled for the plain architecture alone.
macro_rules! for_each_instruction_set {
    ($($function:tt)*) => {
        #[multiversion::multiversion(targets(
            "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+fma+bmi1+bmi2+lzcnt+popcnt",
            "x86_64+avx2+fma+bmi1+bmi2+lzcnt+popcnt",
        ))]
        $($function)*
    };
}

pub(crate) use for_each_instruction_set;
