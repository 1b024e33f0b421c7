//! The world grid: 64^3 voxels over the cube [-1/2, 1/2]^3, one bit each.

use crate::csg::{Kind, Primitive, Shape, cross_axes};
use crate::dispatch::for_each_instruction_set;

/// Voxels along each side of a grid.
pub const SIDE: usize = 64;
/// Voxels of a grid.
pub const CELLS: usize = SIDE * SIDE * SIDE;

/// The world coordinate of a voxel's centre along one axis.
pub const fn voxel_center(index: usize) -> f64 {
    center_among(index, SIDE)
}

/// The same in a grid with so many voxels along each side.
pub const fn center_among(index: usize, side: usize) -> f64 {
    (index as f64 + 0.5) / side as f64 - 0.5
}

/// The world coordinates of all voxels' centres along one axis.
const CENTERS: [f64; SIDE] = {
    let mut centers = [0.0; SIDE];
    let mut i = 0;
    while i < SIDE {
        centers[i] = voxel_center(i);
        i += 1;
    }
    centers
};

/// A binary grid: word `x * 64 + y` holds a column along z, bit z of it the voxel (x, y, z).
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct BitGrid {
    words: Vec<u64>,
}

impl Default for BitGrid {
    fn default() -> Self {
        Self { words: vec![0; SIDE * SIDE] }
    }
}

impl BitGrid {
    /// The grid of 64 x 64 words, in the order of the columns.
    pub fn of_words(words: Vec<u64>) -> Self {
        assert_eq!(words.len(), SIDE * SIDE, "a grid has one word for each column");
        Self { words }
    }

    /// The voxels whose centre lies inside the shape.
    pub fn of_shape(shape: &Shape) -> Self {
        let mut grid = Self::default();
        write_shape(&mut grid.words, shape.primitives());
        grid
    }

    pub fn count(&self) -> u32 {
        count_ones(&self.words)
    }

    /// One byte a voxel, 0 or 1, in the order (x, y, z).
    pub fn write_bytes(&self, out: &mut [u8]) {
        write_words(&self.words, out);
    }

    /// Inclusive index bounds of the occupied voxels along each axis; `None` when there are none.
    pub fn bounds(&self) -> Option<[(usize, usize); 3]> {
        let (mut layers, mut rows) = (0, [0; SIDE]);
        for (x, layer) in self.words.as_chunks::<SIDE>().0.iter().enumerate() {
            layers |= u64::from(layer.iter().fold(0, |all, word| all | word) != 0) << x;
            rows.iter_mut().zip(layer).for_each(|(row, word)| *row |= word);
        }
        let columns = rows.iter().fold(0, |all, word| all | word);
        let ends = |bits: u64| (bits.trailing_zeros() as usize, 63 - bits.leading_zeros() as usize);
        (layers != 0).then(|| [ends(layers), ends(mask(|y| rows[y] != 0)), ends(columns)])
    }

    /// Whether the occupied voxels hang together through their faces. An empty grid does not.
    pub fn is_connected(&self) -> bool {
        let Some(start) = self.words.iter().position(|&w| w != 0) else {
            return false;
        };
        let mut seen = vec![0u64; self.words.len()];
        seen[start] = 1 << self.words[start].trailing_zeros();
        let mut stack = vec![start];
        while let Some(i) = stack.pop() {
            seen[i] = spread(seen[i], self.words[i]);
            let (x, y) = (i / SIDE, i % SIDE);
            let neighbours = [
                (x > 0).then(|| i - SIDE),
                (x + 1 < SIDE).then_some(i + SIDE),
                (y > 0).then(|| i - 1),
                (y + 1 < SIDE).then_some(i + 1),
            ];
            for n in neighbours.into_iter().flatten() {
                let reached = seen[n] | (seen[i] & self.words[n]);
                if reached != seen[n] {
                    seen[n] = reached;
                    stack.push(n);
                }
            }
        }
        seen == self.words
    }
}

/// The runs of ones of `within` that `seed` touches.
fn spread(mut seed: u64, within: u64) -> u64 {
    loop {
        let next = (seed | seed << 1 | seed >> 1) & within;
        if next == seed {
            return seed;
        }
        seed = next;
    }
}

for_each_instruction_set! {
    fn write_shape(words: &mut [u64], primitives: &[Primitive]) {
        write_primitives(words, primitives);
    }
}

for_each_instruction_set! {
    fn count_ones(words: &[u64]) -> u32 {
        words.iter().map(|w| w.count_ones()).sum()
    }
}

/// Adds and subtracts in order.
#[inline(always)]
fn write_primitives(words: &mut [u64], primitives: &[Primitive]) {
    for p in primitives {
        let within: [u64; 3] = std::array::from_fn(|a| covered(p.center[a], p.half[a]));
        match p.kind {
            Kind::Cuboid => {
                let layer = std::array::from_fn(|y| if within[1] >> y & 1 == 1 { within[2] } else { 0 });
                write_layers(words, p.additive, within[0], |_| layer);
            }
            Kind::Cylinder { axis } => write_prism(words, p, &within, axis, |a, b| a * a + b * b <= 1.0),
            Kind::Wedge { axis, corner } => {
                let [u, v] = corner.map(f64::from);
                write_prism(words, p, &within, axis, |a, b| u * a + v * b >= 0.0);
            }
            Kind::Frustum(frustum) => {
                let (slopes, axis) = (frustum.slopes(p.half), frustum.axis);
                if frustum.round {
                    write_points(words, p, axis, |d| slopes.hold(true, d));
                } else {
                    write_points(words, p, axis, |d| slopes.hold(false, d));
                }
            }
            Kind::Torus(torus) => {
                let ring = torus.ring(p.half);
                write_points(words, p, torus.axis, |d| ring.hold(d));
            }
        }
    }
}

/// The voxels whose centre lies within `half` of `center` along one axis, a bit each.
#[inline(always)]
fn covered(center: f64, half: f64) -> u64 {
    mask(|i| (CENTERS[i] - center).abs() <= half)
}

/// Writes the same section all along an axis; `inside` is asked by offsets along the two cross axes, in half sizes.
#[inline(always)]
fn write_prism(
    words: &mut [u64],
    p: &Primitive,
    within: &[u64; 3],
    axis: usize,
    inside: impl Fn(f64, f64) -> bool,
) {
    let (u, v) = cross_axes(axis);
    let offsets =
        |a: usize| -> [f64; SIDE] { std::array::from_fn(|i| (CENTERS[i] - p.center[a]) / p.half[a]) };
    let (along_u, along_v) = (offsets(u), offsets(v));
    // Columns along z in the order of y: one for each y, or the same for all of them.
    let section = |i: usize| within[2] & mask(|z| inside(along_u[i], along_v[z]));
    let rows = |column: u64| std::array::from_fn(|y| if within[1] >> y & 1 == 1 { column } else { 0 });
    match axis {
        0 => {
            let layer = std::array::from_fn(|y| if within[1] >> y & 1 == 1 { section(y) } else { 0 });
            write_layers(words, p.additive, within[0], |_| layer);
        }
        1 => write_layers(words, p.additive, within[0], |x| rows(section(x))),
        _ => write_layers(words, p.additive, within[0], |x| {
            let row: [u64; SIDE] = rows(within[2]);
            std::array::from_fn(|y| if inside(along_u[x], along_v[y]) { row[y] } else { 0 })
        }),
    }
}

/// Writes the voxels that are inside, in the box around a primitive; `inside` is asked by offsets from its centre, along
/// the two cross axes and its own.
#[inline(always)]
fn write_points(words: &mut [u64], p: &Primitive, axis: usize, inside: impl Fn([f64; 3]) -> bool) {
    let (lo, hi) = p.bounds();
    // Not exactly the box: whether a point in its surface is inside is for `inside` to say.
    let range = |a: usize| {
        let (from, to) = ((lo[a] + 0.5) * SIDE as f64 - 1.0, (hi[a] + 0.5) * SIDE as f64 + 1.0);
        from.clamp(0.0, SIDE as f64) as usize..to.clamp(0.0, SIDE as f64) as usize
    };
    let offsets = |a: usize| -> [f64; SIDE] { std::array::from_fn(|i| CENTERS[i] - p.center[a]) };
    let (dx, dy, dz) = (offsets(0), offsets(1), offsets(2));
    for x in range(0) {
        for y in range(1) {
            let column = match axis {
                0 => mask(|z| inside([dy[y], dz[z], dx[x]])),
                1 => mask(|z| inside([dx[x], dz[z], dy[y]])),
                _ => mask(|z| inside([dx[x], dy[y], dz[z]])),
            };
            let word = &mut words[x * SIDE + y];
            *word = if p.additive { *word | column } else { *word & !column };
        }
    }
}

/// Adds or takes away one layer of columns, 64 along y, at each of the set bits of `xs`.
#[inline(always)]
fn write_layers(words: &mut [u64], additive: bool, xs: u64, layer: impl Fn(usize) -> [u64; SIDE]) {
    let layers = &mut words.as_chunks_mut::<SIDE>().0;
    for x in xs.trailing_zeros() as usize..SIDE - xs.leading_zeros() as usize {
        let columns = layer(x);
        if additive {
            layers[x].iter_mut().zip(columns).for_each(|(word, column)| *word |= column);
        } else {
            layers[x].iter_mut().zip(columns).for_each(|(word, column)| *word &= !column);
        }
    }
}

#[inline(always)]
fn mask(inside: impl Fn(usize) -> bool) -> u64 {
    (0..SIDE).fold(0, |word, i| word | u64::from(inside(i)) << i)
}

// Four words of 64 bits are what this is made for: with eight, the compiler takes eight columns at a time and scatters
// their bytes.
#[multiversion::multiversion(targets("x86_64+avx2"))]
fn write_words(words: &[u64], out: &mut [u8]) {
    words.iter().zip(out.as_chunks_mut().0).for_each(|(&word, bytes)| *bytes = spread_bits(word));
}

/// One byte a bit, 0 or 1.
#[inline(always)]
fn spread_bits(word: u64) -> [u8; SIDE] {
    let mut bytes = [0; SIDE];
    if word != 0 {
        for (k, eight) in bytes.as_chunks_mut().0.iter_mut().enumerate() {
            // Eight bits, repeated in eight bytes, of which each keeps its own; that is then carried to the top.
            let bits = ((word >> (8 * k) & 0xff) * 0x0101_0101_0101_0101) & 0x8040_2010_0804_0201;
            *eight = ((bits + 0x7f7f_7f7f_7f7f_7f7f) >> 7 & 0x0101_0101_0101_0101).to_le_bytes();
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::csg::tests::any_kind;
    use glam::DVec3;
    use proptest::prelude::*;

    pub fn any_primitive() -> impl Strategy<Value = Primitive> {
        let triple = |lo: f64, hi: f64| [lo..hi, lo..hi, lo..hi];
        let solid = (any::<bool>(), triple(-0.4, 0.4), triple(0.01, 0.3));
        (any_kind(), solid).prop_map(|(kind, (additive, center, half))| Primitive {
            kind,
            additive,
            center: center.into(),
            half: half.into(),
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn a_voxel_is_occupied_when_its_centre_is_inside(
            primitives in prop::collection::vec(any_primitive(), 1..8)
        ) {
            let shape = Shape::new(primitives).unwrap();
            let grid = BitGrid::of_shape(&shape);
            let mut baseline = BitGrid::default();
            write_primitives(&mut baseline.words, shape.primitives());
            prop_assert_eq!(&grid, &baseline);
            let mut bytes = vec![0; CELLS];
            grid.write_bytes(&mut bytes);
            for (i, &byte) in bytes.iter().enumerate() {
                let at = [i / 4096, i / 64 % 64, i % 64].map(voxel_center);
                prop_assert_eq!(byte == 1, shape.contains(DVec3::from(at)));
            }
        }
    }

    proptest! {
        #[test]
        fn a_primitive_and_its_mirror_image_are_mirror_images(primitive in any_primitive()) {
            let grid = |p| BitGrid::of_shape(&Shape::new(vec![p]).unwrap());
            let primitive = Primitive { additive: true, ..primitive };
            let mirrored: Vec<u64> = grid(primitive).words.iter().map(|w| w.reverse_bits()).collect();
            prop_assert_eq!(grid(primitive.mirrored()).words, mirrored);
        }
    }

    #[test]
    fn a_wedge_is_half_of_its_box() {
        for code in 4..16 {
            let wedge = Primitive {
                kind: Kind::from_code(f64::from(code), [0.0; 4]).unwrap(),
                additive: true,
                center: DVec3::ZERO,
                half: DVec3::splat(0.25),
            };
            // 32 voxels a side; those on the diagonal belong to it.
            let count = BitGrid::of_shape(&Shape::new(vec![wedge]).unwrap()).count();
            assert_eq!(count, 32 * 33 / 2 * 32);
        }
    }

    #[test]
    fn a_cylinder_has_its_volume() {
        for axis in 0..3 {
            let cylinder = Primitive {
                kind: Kind::Cylinder { axis },
                additive: true,
                center: DVec3::ZERO,
                half: DVec3::splat(0.4),
            };
            let count = BitGrid::of_shape(&Shape::new(vec![cylinder]).unwrap()).count();
            let exact = std::f64::consts::PI * 0.4 * 0.4 * 0.8 * CELLS as f64;
            assert!((f64::from(count) / exact - 1.0).abs() < 0.02, "{count} {exact}");
        }
    }

    #[test]
    fn connection_goes_through_faces_only() {
        let at = |c: [f64; 3]| Primitive {
            kind: Kind::Cuboid,
            additive: true,
            center: c.into(),
            half: DVec3::splat(0.125),
        };
        let grid = |b| BitGrid::of_shape(&Shape::new(vec![at([0.0; 3]), at(b)]).unwrap());
        assert!(grid([0.25, 0.0, 0.0]).is_connected());
        assert!(grid([0.0, 0.25, 0.0]).is_connected());
        assert!(grid([0.0, 0.0, 0.25]).is_connected());
        assert!(!grid([0.25, 0.25, 0.0]).is_connected());
        assert!(!grid([0.0, 0.0, 0.3]).is_connected());
        assert!(!BitGrid::default().is_connected());
        assert_eq!(grid([0.25, 0.0, 0.0]).bounds(), Some([(24, 55), (24, 39), (24, 39)]));
    }
}
