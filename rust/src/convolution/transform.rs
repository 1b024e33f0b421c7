//! Winograd's transforms: tiles of cells into products' factors, and products into tiles of cells.
//!
//! `TILE` neighbouring outputs of a convolution with three taps are read from `TILE + 2` inputs, and are as many sums
//! of `TILE + 2` products of a transformed input and a transformed filter: polynomials are multiplied by their values
//! at the points 0, 1, -1 (and 2, -2) and at infinity. In several axes, transforms are made in one after the other.

use super::vector::Vector;

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
}

/// An axis along which nothing is convolved.
pub(super) struct One;
/// Two outputs of four products, instead of six.
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
}

impl Axis for Four {
    const TILE: usize = 4;
    const WIDE: usize = 6;

    #[inline(always)]
    unsafe fn forward<V: Vector>(line: &mut [V; WIDEST]) {
        let [a, b, c, d, e, f] = *line;
        // SAFETY: the caller's.
        unsafe {
            let [two, four, five] = [V::splat(2.0), V::splat(-4.0), V::splat(-5.0)];
            let (even, odd) = (c.times_plus(four, e), b.times_plus(four, d));
            let (near, far) = (e.minus(c), d.minus(b));
            line[0] = a.times_plus(V::splat(4.0), c.times_plus(five, e));
            line[1] = even.plus(odd);
            line[2] = even.minus(odd);
            line[3] = far.times_plus(two, near);
            line[4] = far.times_plus(V::splat(-2.0), near);
            line[5] = b.times_plus(V::splat(4.0), d.times_plus(five, f));
        }
    }

    #[inline(always)]
    unsafe fn backward<V: Vector>(line: &mut [V; WIDEST]) {
        let [a, b, c, d, e, f] = *line;
        // SAFETY: the caller's.
        unsafe {
            let (even, odd) = (b.plus(c), b.minus(c));
            let (far_even, far_odd) = (d.plus(e), d.minus(e));
            line[0] = a.plus(even).plus(far_even);
            line[1] = far_odd.times_plus(V::splat(2.0), odd);
            line[2] = far_even.times_plus(V::splat(4.0), even);
            line[3] = far_odd.times_plus(V::splat(8.0), odd).plus(f);
        }
    }
}

/// What becomes of the taps of a filter along an axis whose tiles have that many outputs: a row for each product.
pub(super) fn filter_rows(tile: usize) -> &'static [&'static [f64]] {
    match tile {
        1 => &[&[1.0]],
        2 => &[&[1.0, 0.0, 0.0], &[0.5, 0.5, 0.5], &[0.5, -0.5, 0.5], &[0.0, 0.0, 1.0]],
        4 => &[
            &[1.0 / 4.0, 0.0, 0.0],
            &[-1.0 / 6.0, -1.0 / 6.0, -1.0 / 6.0],
            &[-1.0 / 6.0, 1.0 / 6.0, -1.0 / 6.0],
            &[1.0 / 24.0, 1.0 / 12.0, 1.0 / 6.0],
            &[1.0 / 24.0, -1.0 / 12.0, 1.0 / 6.0],
            &[0.0, 0.0, 1.0],
        ],
        _ => unreachable!("tiles have 1, 2 or 4 outputs"),
    }
}
