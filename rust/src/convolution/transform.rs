//! Winograd's transforms: tiles of cells into products' factors, and products into tiles of cells.
//!
//! `TILE` neighbouring outputs of a convolution with three taps are read from `TILE + 2` inputs, and are as many sums
//! of `TILE + 2` products of a transformed input and a transformed filter: polynomials are multiplied by their values
//! at a few points and at infinity. In several axes, transforms are made in one after the other.

use super::vector::Vector;
use std::marker::PhantomData;

/// The most inputs that a tile has along an axis.
pub(super) const WIDEST: usize = 6;

/// What is done along one axis.
pub(super) trait Axis {
    /// Cells of the output in a tile.
    const TILE: usize;
    /// Cells of the input that they are read from.
    const WIDE: usize;

    /// Transforms the first `WIDE` inputs.
    ///
    /// # Safety
    ///
    /// That of `Vector`.
    unsafe fn forward<V: Vector>(line: &mut [V; WIDEST]);

    /// Makes the first `WIDE` products into `TILE` outputs.
    ///
    /// # Safety
    ///
    /// That of `Vector`.
    unsafe fn backward<V: Vector>(line: &mut [V; WIDEST]);

    /// The transpose of `backward`: `TILE` outputs, which follow a cell of the margin, are made into `WIDE` products.
    ///
    /// # Safety
    ///
    /// That of `Vector`.
    unsafe fn backward_transposed<V: Vector>(line: &mut [V; WIDEST]);
}

/// An axis whose way forward is the transpose of the way back of another.
pub(super) struct Turned<A>(PhantomData<A>);

impl<A: Axis> Axis for Turned<A> {
    const TILE: usize = A::TILE;
    const WIDE: usize = A::WIDE;
    #[inline(always)]
    unsafe fn forward<V: Vector>(line: &mut [V; WIDEST]) {
        // SAFETY: the caller's.
        unsafe { A::backward_transposed(line) }
    }
    #[inline(always)]
    unsafe fn backward<V: Vector>(_: &mut [V; WIDEST]) {
        unreachable!("gradients of outputs have no way back");
    }
    #[inline(always)]
    unsafe fn backward_transposed<V: Vector>(_: &mut [V; WIDEST]) {
        unreachable!("gradients of outputs have no way back");
    }
}

/// An axis along which nothing is convolved.
pub(super) struct One;
/// Two outputs of four products, instead of six; by the points 0, 1, -1 and infinity.
pub(super) struct Two;
/// Four outputs of six products, instead of twelve.
pub(super) struct Four;

impl Axis for One {
    const TILE: usize = 1;
    const WIDE: usize = 1;
    #[inline(always)]
    unsafe fn forward<V: Vector>(_: &mut [V; WIDEST]) {}
    #[inline(always)]
    unsafe fn backward<V: Vector>(_: &mut [V; WIDEST]) {}
    #[inline(always)]
    unsafe fn backward_transposed<V: Vector>(_: &mut [V; WIDEST]) {}
}

impl Axis for Two {
    const TILE: usize = 2;
    const WIDE: usize = 4;

    #[inline(always)]
    unsafe fn forward<V: Vector>(line: &mut [V; WIDEST]) {
        let [a, b, c, d, ..] = *line;
        // SAFETY: the caller's.
        unsafe {
            line[0] = a.minus(c);
            line[1] = b.plus(c);
            line[2] = c.minus(b);
            line[3] = d.minus(b);
        }
    }

    #[inline(always)]
    unsafe fn backward<V: Vector>(line: &mut [V; WIDEST]) {
        let [a, b, c, d, ..] = *line;
        // SAFETY: the caller's.
        unsafe {
            line[0] = a.plus(b.plus(c));
            line[1] = b.minus(c).plus(d);
        }
    }

    #[inline(always)]
    unsafe fn backward_transposed<V: Vector>(line: &mut [V; WIDEST]) {
        let [_, a, b, ..] = *line;
        // SAFETY: the caller's.
        unsafe {
            line[0] = a;
            line[1] = a.plus(b);
            line[2] = a.minus(b);
            line[3] = b;
        }
    }
}

/// The points of `Four` are 0, `NEAR`, `-NEAR`, `FAR`, `-FAR` and infinity. With 1 and 2, sums would be a little shorter
/// and their largest errors eight times as large; these, too, have squares and products that are exact.
const NEAR: f32 = 0.75;
const FAR: f32 = 1.5;

impl Axis for Four {
    const TILE: usize = 4;
    const WIDE: usize = 6;

    #[inline(always)]
    unsafe fn forward<V: Vector>(line: &mut [V; WIDEST]) {
        const SUM: f32 = NEAR * NEAR + FAR * FAR;
        const PRODUCT: f32 = NEAR * NEAR * FAR * FAR;
        let [a, b, c, d, e, f] = *line;
        // SAFETY: the caller's.
        unsafe {
            let [sum, product] = [V::splat(-SUM), V::splat(PRODUCT)];
            line[0] = a.times_plus(product, c.times_plus(sum, e));
            line[5] = b.times_plus(product, d.times_plus(sum, f));
            let far = V::splat(-FAR * FAR);
            let (even, odd) = (c.times_plus(far, e), b.times_plus(far, d));
            line[1] = odd.times_plus(V::splat(NEAR), even);
            line[2] = odd.times_plus(V::splat(-NEAR), even);
            let near = V::splat(-NEAR * NEAR);
            let (even, odd) = (c.times_plus(near, e), b.times_plus(near, d));
            line[3] = odd.times_plus(V::splat(FAR), even);
            line[4] = odd.times_plus(V::splat(-FAR), even);
        }
    }

    #[inline(always)]
    unsafe fn backward<V: Vector>(line: &mut [V; WIDEST]) {
        let [a, b, c, d, e, f] = *line;
        // SAFETY: the caller's.
        unsafe {
            let (near, near_odd) = (b.plus(c), b.minus(c));
            let (far, far_odd) = (d.plus(e), d.minus(e));
            let of = |near: V, by_near: f32, far: V, by_far: f32, rest: V| {
                near.times_plus(V::splat(by_near), far.times_plus(V::splat(by_far), rest))
            };
            line[0] = a.plus(near).plus(far);
            line[1] = of(near_odd, NEAR, far_odd, FAR, V::splat(0.0));
            line[2] = of(near, NEAR * NEAR, far, FAR * FAR, V::splat(0.0));
            line[3] = of(near_odd, NEAR * NEAR * NEAR, far_odd, FAR * FAR * FAR, f);
        }
    }

    #[inline(always)]
    unsafe fn backward_transposed<V: Vector>(line: &mut [V; WIDEST]) {
        let [_, a, b, c, d, _] = *line;
        // SAFETY: the caller's.
        unsafe {
            let at = |point: f32| {
                let square = V::splat(point * point);
                let (even, odd) = (c.times_plus(square, a), d.times_plus(square, b));
                let up = odd.times_plus(V::splat(point), even);
                (up, odd.times_plus(V::splat(-point), even))
            };
            line[0] = a;
            (line[1], line[2]) = at(NEAR);
            (line[3], line[4]) = at(FAR);
            line[5] = d;
        }
    }
}

/// What becomes of the taps of a filter along an axis whose tiles have that many outputs: a row for each product.
pub(super) fn filter_rows(tile: usize) -> &'static [&'static [f64]] {
    match tile {
        1 => &[&[1.0]],
        2 => &[&[1.0, 0.0, 0.0], &[0.5, 0.5, 0.5], &[0.5, -0.5, 0.5], &[0.0, 0.0, 1.0]],
        4 => &FOUR,
        _ => unreachable!("tiles have 1, 2 or 4 outputs"),
    }
}

const FOUR: [&[f64]; 6] = {
    const N: f64 = NEAR as f64;
    const F: f64 = FAR as f64;
    const BY_N: f64 = 1.0 / (2.0 * N * N * (N * N - F * F));
    const BY_F: f64 = 1.0 / (2.0 * F * F * (F * F - N * N));
    [
        &[1.0 / (N * N * F * F), 0.0, 0.0],
        &[BY_N, N * BY_N, N * N * BY_N],
        &[BY_N, -N * BY_N, N * N * BY_N],
        &[BY_F, F * BY_F, F * F * BY_F],
        &[BY_F, -F * BY_F, F * F * BY_F],
        &[0.0, 0.0, 1.0],
    ]
};
