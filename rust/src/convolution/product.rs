//! Products of matrices: rows of one by columns of another that lie in panels.

use super::memory::Aligned;
use super::vector::{Instructions, Task, Vector, prefetch};

/// Vectors across a panel.
pub(super) const ACROSS: usize = 2;
/// Rows of a panel that are multiplied at a time, so that they stay in the nearest cache: those of 32 columns take
/// 32 KB.
const DEPTH: usize = 256;

/// How far ahead of the products panels are fetched, in floats: a few hundred products, which takes about as long as
/// the way from the last cache.
const AHEAD: usize = 1024;

/// A matrix of `depth` x `columns`, cut into panels of two vectors of columns. In each, rows follow each other. If one
/// vector is enough for the last panel, it is as wide as that; columns that it has too many are zeros.
pub(super) struct Panels {
    pub depth: usize,
    pub columns: usize,
    instructions: Instructions,
    values: Aligned,
}

impl Panels {
    /// Of a matrix, given as a function of row and column.
    pub fn new(
        instructions: Instructions,
        depth: usize,
        columns: usize,
        value: impl Fn(usize, usize) -> f32,
    ) -> Self {
        let width = Self::width(instructions, columns);
        let mut values = Aligned::zeros(depth * width);
        fill(instructions, depth, columns, &mut values, value);
        Self { depth, columns, instructions, values }
    }

    /// Columns with those that are added to fill vectors.
    pub fn width(instructions: Instructions, columns: usize) -> usize {
        columns.next_multiple_of(instructions.lanes())
    }

    pub fn as_ref(&self) -> PanelsRef<'_> {
        let Self { depth, columns, instructions, .. } = *self;
        PanelsRef { depth, columns, instructions, values: &self.values }
    }
}

/// Panels that lie elsewhere.
#[derive(Clone, Copy)]
pub(super) struct PanelsRef<'a> {
    pub depth: usize,
    pub columns: usize,
    pub instructions: Instructions,
    pub values: &'a [f32],
}

/// Fills panels from a function of row and column.
pub(super) fn fill(
    instructions: Instructions,
    depth: usize,
    columns: usize,
    values: &mut [f32],
    value: impl Fn(usize, usize) -> f32,
) {
    let lanes = instructions.lanes();
    assert_eq!(values.len(), depth * columns.next_multiple_of(lanes));
    for first in (0..columns).step_by(ACROSS * lanes) {
        let width = (columns - first).min(ACROSS * lanes).next_multiple_of(lanes);
        let panel = &mut values[depth * first..][..depth * width];
        for (row, line) in panel.chunks_exact_mut(width).enumerate() {
            for (i, entry) in line.iter_mut().enumerate() {
                *entry = if first + i < columns { value(row, first + i) } else { 0.0 };
            }
        }
    }
}

/// Rows that are multiplied: row `i` starts at `i * stride`.
#[derive(Clone, Copy)]
pub(super) struct Rows<'a> {
    pub values: &'a [f32],
    pub stride: usize,
    pub count: usize,
}

/// Where a product goes: row `i` starts at `i * stride`. It is written over what was there or, if `add`, added to it;
/// `bias`, which may be empty, is added to each row.
pub(super) struct Target<'a> {
    pub values: &'a mut [f32],
    pub stride: usize,
    pub add: bool,
    pub bias: &'a [f32],
}

/// Multiplies rows by a matrix in panels.
pub(super) fn multiply_panels(rows: Rows, panels: PanelsRef, target: Target) {
    let PanelsRef { depth, columns, .. } = panels;
    if rows.count == 0 || columns == 0 {
        return;
    }
    assert!(rows.values.len() >= (rows.count - 1) * rows.stride + depth);
    assert!(target.values.len() >= (rows.count - 1) * target.stride + columns && target.stride >= columns);
    assert_eq!(panels.values.len(), depth * Panels::width(panels.instructions, columns));
    assert!(target.bias.is_empty() || target.bias.len() == columns);
    panels.instructions.run(Multiply { rows, panels, target });
}

struct Multiply<'a> {
    rows: Rows<'a>,
    panels: PanelsRef<'a>,
    target: Target<'a>,
}

impl Task for Multiply<'_> {
    #[inline(always)]
    unsafe fn run<V: Vector>(self) {
        let Self { rows, panels, mut target } = self;
        let whole = ACROSS * V::LANES;
        // Once even where there is no depth: zeros are written, or the bias.
        for start in (0..panels.depth.max(1)).step_by(DEPTH) {
            let depth = (panels.depth - start).min(DEPTH);
            for first in (0..panels.columns).step_by(whole) {
                let columns = (panels.columns - first).min(whole);
                let width = columns.next_multiple_of(V::LANES);
                let panel = &panels.values[panels.depth * first + start * width..];
                let a = Rows { values: &rows.values[start..], ..rows };
                // SAFETY: the instructions are there, as the caller says; `multiply_panels` has compared lengths.
                unsafe {
                    if width == whole {
                        by_panel::<V, ACROSS>(a, depth, panel, first..first + columns, &mut target);
                    } else {
                        by_panel::<V, 1>(a, depth, panel, first..first + columns, &mut target);
                    }
                }
            }
            target.add = true;
            target.bias = &[];
        }
    }
}

/// Multiplies all rows by one panel, in blocks of about as many rows each.
#[inline(always)]
unsafe fn by_panel<V: Vector, const C: usize>(
    rows: Rows,
    depth: usize,
    panel: &[f32],
    columns: std::ops::Range<usize>,
    target: &mut Target,
) {
    let blocks = rows.count.div_ceil(V::ROWS);
    let mut row = 0;
    for block in 0..blocks {
        let end = rows.count * (block + 1) / blocks;
        macro_rules! by_count {
            ($($count:literal)*) => {
                match end - row {
                    // SAFETY: the caller's; the rows are among `rows.count`.
                    $($count if $count <= V::ROWS => unsafe {
                        let a = rows.values.as_ptr().add(row * rows.stride);
                        by_block::<V, $count, C>(a, rows.stride, depth, panel, row, columns.clone(), target);
                    },)*
                    _ => unreachable!("blocks have 1 to V::ROWS rows"),
                }
            };
        }
        by_count!(1 2 3 4 5 6 7 8 9 10 11 12 13 14);
        row = end;
    }
}

/// Multiplies `R` rows by a panel of `C` vectors of columns. The sums stay in registers; each is made in the order of
/// the rows of the panel, whatever `R` is.
#[inline(always)]
unsafe fn by_block<V: Vector, const R: usize, const C: usize>(
    a: *const f32,
    stride: usize,
    depth: usize,
    panel: &[f32],
    first_row: usize,
    columns: std::ops::Range<usize>,
    target: &mut Target,
) {
    let width = C * V::LANES;
    debug_assert!(panel.len() >= depth * width);
    // SAFETY: of each row `depth` floats are read, of the panel `depth` lines; `multiply_panels` has seen that they
    // are there. Lines are stored to the target where they are whole, and otherwise by way of a buffer.
    unsafe {
        let mut sums = [[V::splat(0.0); C]; R];
        let mut line = panel.as_ptr();
        for k in 0..depth {
            let mut b = [V::splat(0.0); C];
            for (c, b) in b.iter_mut().enumerate() {
                *b = V::load(line.add(c * V::LANES));
                prefetch(line.wrapping_add(AHEAD + c * V::LANES));
            }
            for (r, sums) in sums.iter_mut().enumerate() {
                let factor = V::splat(*a.add(r * stride + k));
                for (sum, b) in sums.iter_mut().zip(b) {
                    *sum = factor.times_plus(b, *sum);
                }
            }
            line = line.add(width);
        }
        for (r, sums) in sums.iter().enumerate() {
            let start = (first_row + r) * target.stride + columns.start;
            let out = &mut target.values[start..][..columns.len()];
            let bias = if target.bias.is_empty() { target.bias } else { &target.bias[columns.clone()] };
            if columns.len() == width {
                for (c, &sum) in sums.iter().enumerate() {
                    let to = out.as_mut_ptr().add(c * V::LANES);
                    let mut sum = sum;
                    if target.add {
                        sum = sum.plus(V::load(to));
                    }
                    if !bias.is_empty() {
                        sum = sum.plus(V::load(bias.as_ptr().add(c * V::LANES)));
                    }
                    sum.store(to);
                }
            } else {
                let mut buffer = [0.0; 32];
                for (c, sum) in sums.iter().enumerate() {
                    sum.store(buffer[c * V::LANES..][..V::LANES].as_mut_ptr());
                }
                for (i, (out, sum)) in out.iter_mut().zip(buffer).enumerate() {
                    let before = if target.add { *out } else { 0.0 };
                    *out = sum + before + bias.get(i).unwrap_or(&0.0);
                }
            }
        }
    }
}
