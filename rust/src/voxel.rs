//! The world grid: 64^3 voxels over the cube [-1/2, 1/2]^3, one bit each.

use crate::csg::{Kind, Shape, cross_axes};

/// Voxels along each side of a grid.
pub const SIDE: usize = 64;
/// Voxels of a grid.
pub const CELLS: usize = SIDE * SIDE * SIDE;

/// The world coordinate of a voxel's centre along one axis.
pub fn voxel_center(index: usize) -> f64 {
    (index as f64 + 0.5) / SIDE as f64 - 0.5
}

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
        for p in shape.primitives() {
            // Offsets from the primitive's centre in half sizes, along each axis.
            let parts: [[f64; SIDE]; 3] =
                std::array::from_fn(|a| std::array::from_fn(|i| (voxel_center(i) - p.center[a]) / p.half[a]));
            let within: [[bool; SIDE]; 3] = std::array::from_fn(|a| {
                std::array::from_fn(|i| (voxel_center(i) - p.center[a]).abs() <= p.half[a])
            });
            match p.kind {
                Kind::Cuboid => {
                    let z_mask = mask(|z| within[2][z]);
                    grid.write(p.additive, &within, |_, _| z_mask);
                }
                Kind::Cylinder { axis } => {
                    grid.write_prism(p.additive, &within, &parts, axis, |a, b| a * a + b * b <= 1.0);
                }
                Kind::Wedge { axis, corner } => {
                    let [u, v] = corner.map(f64::from);
                    grid.write_prism(p.additive, &within, &parts, axis, |a, b| u * a + v * b >= 0.0);
                }
            }
        }
        grid
    }

    /// Writes the same section all along an axis; `inside` is asked by offsets along the two cross axes.
    fn write_prism(
        &mut self,
        additive: bool,
        within: &[[bool; SIDE]; 3],
        parts: &[[f64; SIDE]; 3],
        axis: usize,
        inside: impl Fn(f64, f64) -> bool,
    ) {
        let (u, v) = cross_axes(axis);
        if axis == 2 {
            let z_mask = mask(|z| within[2][z]);
            self.write(additive, within, |x, y| if inside(parts[u][x], parts[v][y]) { z_mask } else { 0 });
        } else {
            let section: [u64; SIDE] =
                std::array::from_fn(|i| mask(|z| within[2][z] && inside(parts[u][i], parts[v][z])));
            self.write(additive, within, |x, y| section[[x, y][u]]);
        }
    }

    fn write(&mut self, additive: bool, within: &[[bool; SIDE]; 3], column: impl Fn(usize, usize) -> u64) {
        for x in (0..SIDE).filter(|&x| within[0][x]) {
            for y in (0..SIDE).filter(|&y| within[1][y]) {
                let word = &mut self.words[x * SIDE + y];
                if additive {
                    *word |= column(x, y);
                } else {
                    *word &= !column(x, y);
                }
            }
        }
    }

    pub fn count(&self) -> u32 {
        self.words.iter().map(|w| w.count_ones()).sum()
    }

    /// One byte a voxel, 0 or 1, in the order (x, y, z).
    pub fn write_bytes(&self, out: &mut [u8]) {
        for (word, bytes) in self.words.iter().zip(out.chunks_exact_mut(SIDE)) {
            for (z, byte) in bytes.iter_mut().enumerate() {
                *byte = (word >> z & 1) as u8;
            }
        }
    }

    /// Inclusive index bounds of the occupied voxels along each axis; `None` when there are none.
    pub fn bounds(&self) -> Option<[(usize, usize); 3]> {
        let mut all = 0;
        let mut bounds = [(SIDE, 0); 3];
        for (i, &word) in self.words.iter().enumerate().filter(|(_, w)| **w != 0) {
            all |= word;
            for (b, at) in bounds.iter_mut().zip([i / SIDE, i % SIDE]) {
                *b = (b.0.min(at), b.1.max(at));
            }
        }
        bounds[2] = (all.trailing_zeros() as usize, 63 - (all.leading_zeros() as usize).min(63));
        (all != 0).then_some(bounds)
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

fn mask(inside: impl Fn(usize) -> bool) -> u64 {
    (0..SIDE).fold(0, |word, z| word | u64::from(inside(z)) << z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::csg::Primitive;
    use glam::DVec3;
    use proptest::prelude::*;

    pub fn any_primitive() -> impl Strategy<Value = Primitive> {
        let triple = |lo: f64, hi: f64| [lo..hi, lo..hi, lo..hi];
        (0..16u8, any::<bool>(), triple(-0.4, 0.4), triple(0.01, 0.3)).prop_map(
            |(kind, additive, center, half)| Primitive {
                kind: Kind::from_code(kind.into()).unwrap(),
                additive,
                center: center.into(),
                half: half.into(),
            },
        )
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn a_voxel_is_occupied_when_its_centre_is_inside(
            primitives in prop::collection::vec(any_primitive(), 1..8)
        ) {
            let shape = Shape::new(primitives).unwrap();
            let mut bytes = vec![0; CELLS];
            BitGrid::of_shape(&shape).write_bytes(&mut bytes);
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
                kind: Kind::from_code(f64::from(code)).unwrap(),
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
