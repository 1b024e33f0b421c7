//! Vectors of floats of the instruction sets, and the choice among them.
//!
//! Elsewhere loops are left to the compiler (`dispatch.rs`). Products of matrices are the one kernel in which it
//! matters that sums stay in registers and are fused with products, so that these say what they want.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

/// A vector of floats.
///
/// # Safety
///
/// All of it may only be used in `Task::run`, which `Instructions::run` calls where the processor has the
/// instructions; what is read from or written to must hold `LANES` floats.
pub(super) trait Vector: Copy {
    /// Floats in a vector.
    const LANES: usize;
    /// Rows of a matrix that are multiplied at a time: as many as make a block that fits the registers.
    const ROWS: usize;

    unsafe fn splat(value: f32) -> Self;
    unsafe fn load(from: *const f32) -> Self;
    unsafe fn store(self, to: *mut f32);
    unsafe fn plus(self, other: Self) -> Self;
    unsafe fn minus(self, other: Self) -> Self;
    /// `self * factor + addend`, in one rounding where there is an instruction for it.
    unsafe fn times_plus(self, factor: Self, addend: Self) -> Self;
    /// The larger of both; `self` where one is not a number.
    unsafe fn at_least(self, other: Self) -> Self;
}

/// Has what lies there, if anything does, on its way to the nearest cache.
#[inline(always)]
pub(super) fn prefetch(at: *const f32) {
    // SAFETY: nothing is read that the program would see.
    #[cfg(target_arch = "x86_64")]
    unsafe {
        _mm_prefetch::<_MM_HINT_T0>(at.cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = at;
}

/// Implements `Vector` by intrinsics: floats in one, rows, and the names of the instructions.
#[cfg(target_arch = "x86_64")]
macro_rules! vector {
    ($name:ident, $lanes:expr, $rows:expr, $splat:ident, $load:ident, $store:ident, $add:ident, $sub:ident,
     $max:ident, |$a:ident, $b:ident, $c:ident| $fused:expr) => {
        // SAFETY of all: the trait's own conditions.
        impl Vector for $name {
            const LANES: usize = $lanes;
            const ROWS: usize = $rows;
            #[inline(always)]
            unsafe fn splat(value: f32) -> Self {
                unsafe { $splat(value) }
            }
            #[inline(always)]
            unsafe fn load(from: *const f32) -> Self {
                unsafe { $load(from) }
            }
            #[inline(always)]
            unsafe fn store(self, to: *mut f32) {
                unsafe { $store(to, self) }
            }
            #[inline(always)]
            unsafe fn plus(self, other: Self) -> Self {
                unsafe { $add(self, other) }
            }
            #[inline(always)]
            unsafe fn minus(self, other: Self) -> Self {
                unsafe { $sub(self, other) }
            }
            #[inline(always)]
            unsafe fn times_plus(self, factor: Self, addend: Self) -> Self {
                let ($a, $b, $c) = (self, factor, addend);
                unsafe { $fused }
            }
            #[inline(always)]
            unsafe fn at_least(self, other: Self) -> Self {
                unsafe { $max(other, self) }
            }
        }
    };
}

#[cfg(target_arch = "x86_64")]
vector!(
    __m512,
    16,
    14,
    _mm512_set1_ps,
    _mm512_loadu_ps,
    _mm512_storeu_ps,
    _mm512_add_ps,
    _mm512_sub_ps,
    _mm512_max_ps,
    |a, b, c| _mm512_fmadd_ps(a, b, c)
);
#[cfg(target_arch = "x86_64")]
vector!(
    __m256,
    8,
    6,
    _mm256_set1_ps,
    _mm256_loadu_ps,
    _mm256_storeu_ps,
    _mm256_add_ps,
    _mm256_sub_ps,
    _mm256_max_ps,
    |a, b, c| _mm256_fmadd_ps(a, b, c)
);
#[cfg(target_arch = "x86_64")]
vector!(
    __m128,
    4,
    6,
    _mm_set1_ps,
    _mm_loadu_ps,
    _mm_storeu_ps,
    _mm_add_ps,
    _mm_sub_ps,
    _mm_max_ps,
    |a, b, c| _mm_add_ps(_mm_mul_ps(a, b), c)
);

/// What any processor has.
#[cfg(target_arch = "x86_64")]
type Plain = __m128;
#[cfg(not(target_arch = "x86_64"))]
type Plain = [f32; 4];

#[cfg(not(target_arch = "x86_64"))]
impl Vector for [f32; 4] {
    const LANES: usize = 4;
    const ROWS: usize = if cfg!(target_arch = "aarch64") { 12 } else { 6 };
    #[inline(always)]
    unsafe fn splat(value: f32) -> Self {
        [value; 4]
    }
    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: the trait's own conditions.
        unsafe { from.cast::<Self>().read() }
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        // SAFETY: the trait's own conditions.
        unsafe { to.cast::<Self>().write(self) }
    }
    #[inline(always)]
    unsafe fn plus(self, other: Self) -> Self {
        std::array::from_fn(|i| self[i] + other[i])
    }
    #[inline(always)]
    unsafe fn minus(self, other: Self) -> Self {
        std::array::from_fn(|i| self[i] - other[i])
    }
    #[inline(always)]
    unsafe fn times_plus(self, factor: Self, addend: Self) -> Self {
        let fused = cfg!(any(target_arch = "aarch64", target_feature = "fma"));
        let of = |a: f32, b: f32, c: f32| if fused { a.mul_add(b, c) } else { a * b + c };
        std::array::from_fn(|i| of(self[i], factor[i], addend[i]))
    }
    #[inline(always)]
    unsafe fn at_least(self, other: Self) -> Self {
        std::array::from_fn(|i| if other[i] > self[i] { other[i] } else { self[i] })
    }
}

/// Something to do with vectors. `run` must be `#[inline(always)]`, as all that it calls, or it is compiled for the
/// plain architecture.
pub(super) trait Task {
    /// # Safety
    ///
    /// The processor has the instructions of `V`.
    unsafe fn run<V: Vector>(self);
}

/// An instruction set. One that the processor does not have must not come into being: `available` lists the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Instructions {
    #[cfg(target_arch = "x86_64")]
    Avx512,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    Plain,
}

impl Instructions {
    /// Those that this processor has, the best first.
    pub fn available() -> Vec<Self> {
        let mut all = Vec::new();
        #[cfg(target_arch = "x86_64")]
        {
            let avx2 = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
            if avx2 && is_x86_feature_detected!("avx512f") {
                all.push(Self::Avx512);
            }
            if avx2 {
                all.push(Self::Avx2);
            }
        }
        all.push(Self::Plain);
        all
    }

    pub fn best() -> Self {
        Self::available()[0]
    }

    /// Floats in a vector.
    pub fn lanes(self) -> usize {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => __m512::LANES,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => __m256::LANES,
            Self::Plain => Plain::LANES,
        }
    }

    pub fn run<T: Task>(self, task: T) {
        // SAFETY: an instruction set that the processor lacks does not come into being.
        unsafe {
            match self {
                #[cfg(target_arch = "x86_64")]
                Self::Avx512 => avx512(task),
                #[cfg(target_arch = "x86_64")]
                Self::Avx2 => avx2(task),
                Self::Plain => task.run::<Plain>(),
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx2,fma")]
unsafe fn avx512<T: Task>(task: T) {
    // SAFETY: the caller's.
    unsafe { task.run::<__m512>() }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
unsafe fn avx2<T: Task>(task: T) {
    // SAFETY: the caller's.
    unsafe { task.run::<__m256>() }
}
