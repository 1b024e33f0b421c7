//! How often a mesh's faces cross the columns of a grid, below every voxel, upwards and downwards.
//!
//! Coordinates are integers, 2^20 to a voxel's side, so that it is *exact* on which side of an edge a ray passes. A ray
//! that meets an edge or a vertex counts as one that passes a hair towards +x, and by a hair of that hair towards +y:
//! every edge gives it to one of its two faces, whichever way round they are. No ray slips through a closed surface.

use super::faces::{ALONE, FACES, Faces, PATCH};
use crate::dispatch::for_each_instruction_set;
use crate::voxel::SIDE;

/// Columns of a grid; column `i * 64 + j` lies at i along the first axis, j along the second.
pub const COLUMNS: usize = SIDE * SIDE;
/// A voxel's side.
pub const ONE: i32 = 1 << 20;
pub const HALF: i32 = ONE / 2;
/// Added to a small number, leaves the nearest integer in the low bits of the sum.
pub const ROUND: f64 = 6_755_399_441_055_744.0;

/// A vertex: x, y, z, and a random number of its own.
pub type Point = [i32; 4];

/// The vertex at a place in the grid, counted in 1/2^20 of a voxel.
#[inline(always)]
pub fn point(place: [f64; 3]) -> Point {
    let [x, y, z] = place.map(|v| (v + ROUND).to_bits() as i32);
    let mix = |v: i32, by: u64| u64::from(v as u32).wrapping_mul(by);
    let h = mix(x, 0x9E37_79B9_7F4A_7C15) ^ mix(y, 0xC2B2_AE3D_27D4_EB4F) ^ mix(z, 0x1656_67B1_9E37_79F9);
    let h = (h ^ h >> 32).wrapping_mul(0xD6E8_FEB8_6659_FD93);
    [x, y, z, (h >> 32) as i32]
}

/// Crossings along the last axis, in binary digits: word by word, digit k of the number of faces that a ray from below
/// has crossed before it reaches each voxel.
pub struct Crossings {
    /// The lowest digits: of crossings into what lies on the far side of a face, and of those out of it.
    first: [[u64; 2]; COLUMNS],
    /// The higher digits, as many as it takes.
    higher: Vec<Box<[[u64; 2]; COLUMNS]>>,
    boundary: i64,
}

/// What the rays of one column say of its voxels; where neither bit is set, nothing.
#[derive(Clone, Copy, Default)]
pub struct Vote {
    pub inside: u64,
    pub outside: u64,
}

impl Default for Crossings {
    fn default() -> Self {
        Self { first: [[0; 2]; COLUMNS], higher: Vec::new(), boundary: 0 }
    }
}

impl Crossings {
    pub fn of(points: &[Point], faces: &[[i64; 3]]) -> Self {
        let mut crossings = Self::default();
        add_faces(&mut crossings, points, faces);
        crossings
    }

    /// Adds all faces; compiled for the plain architecture where it is called from elsewhere than [`Self::of`].
    #[inline(always)]
    pub fn add(&mut self, points: &[Point], faces: &[[i64; 3]]) {
        let mut prepared = Faces::default();
        for some in faces.chunks(FACES) {
            self.boundary = self.boundary.wrapping_add(prepared.prepare(points, some));
            (0..some.len()).for_each(|face| self.add_face(&prepared, face));
        }
    }

    /// Whether every edge is run along as often in one direction as in the other: then the mesh is a closed surface,
    /// seen from the same side all over, or several of them.
    ///
    /// A random check that fails to see an open edge once in some thousand million meshes. Give every vertex
    /// a random number, and every edge from p to q the number pq(p - q): the other direction's is its negative. So the sum
    /// over all faces' edges is 0 when each edge cancels, and else hardly ever. Over one triangle it is
    /// -(p - q)(q - r)(r - p).
    pub fn closed(&self) -> bool {
        self.boundary == 0
    }

    /// The voxels around which the surface winds.
    pub fn winding(&self) -> Vec<u64> {
        let mut words: Vec<u64> = self.first.iter().map(differing).collect();
        for digit in &self.higher {
            words.iter_mut().zip(digit.iter().map(differing)).for_each(|(word, more)| *word |= more);
        }
        words
    }

    /// A ray that leaves as often as it enters votes by winding, one that crosses an even number of faces by parity.
    pub fn votes(&self) -> Vec<Vote> {
        let vote = |(wound, digit): (u64, &[u64; 2])| {
            let odd = differing(digit);
            match (wound >> (SIDE - 1), odd >> (SIDE - 1)) {
                (0, _) => Vote { inside: wound, outside: !wound },
                (_, 0) => Vote { inside: odd, outside: !odd },
                _ => Vote::default(),
            }
        };
        self.winding().into_iter().zip(&self.first).map(vote).collect()
    }

    /// The winding number of a voxel as seen from below plus that as seen from above.
    pub fn winding_both_ways(&self, column: usize, voxel: usize) -> i64 {
        2 * self.balance(column, voxel) - self.balance(column, SIDE - 1)
    }

    fn balance(&self, column: usize, voxel: usize) -> i64 {
        let bit = |word: u64| (word >> voxel & 1) as i64;
        let digits = std::iter::once(&self.first)
            .chain(self.higher.iter().map(|digit| &**digit))
            .map(|digit| digit[column]);
        digits.enumerate().map(|(k, [up, down])| (bit(up) - bit(down)) << k).sum()
    }

    /// Adds one to the crossings above a face, in every column whose ray it meets.
    #[inline(always)]
    fn add_face(&mut self, faces: &Faces, face: usize) {
        let mut met = faces.met[face];
        if met == ALONE {
            faces.each_ray(face, |i, j| self.add_ray(faces, face, i, j));
            return;
        }
        while met != 0 {
            let ray = met.trailing_zeros() as usize % (PATCH * PATCH);
            self.add_ray(faces, face, ray / PATCH, ray % PATCH);
            met &= met - 1;
        }
    }

    /// Adds one to the crossings above a face in one column, counted from the face's first.
    #[inline(always)]
    fn add_ray(&mut self, faces: &Faces, face: usize, i: usize, j: usize) {
        let [i0, j0] = faces.first.each_ref().map(|first| first[face] as usize);
        let above = u64::MAX << (faces.first_above(face, i, j) % SIDE as u32);
        self.add_above((i0 + i) * SIDE + j0 + j, usize::from(faces.area[face] > 0), above);
    }

    /// Adds one to the crossings of some voxels of a column.
    #[inline(always)]
    fn add_above(&mut self, column: usize, side: usize, voxels: u64) {
        let digit = &mut self.first[column % COLUMNS][side];
        let carry = *digit & voxels;
        *digit ^= voxels;
        if carry != 0 {
            self.carry(column, side, carry);
        }
    }

    fn carry(&mut self, column: usize, side: usize, mut carry: u64) {
        for digits in &mut self.higher {
            let digit = &mut digits[column][side];
            let next = *digit & carry;
            *digit ^= carry;
            carry = next;
            if carry == 0 {
                return;
            }
        }
        let mut digits = Box::new([[0; 2]; COLUMNS]);
        digits[column][side] = carry;
        self.higher.push(digits);
    }
}

for_each_instruction_set! {
    fn add_faces(crossings: &mut Crossings, points: &[Point], faces: &[[i64; 3]]) {
        crossings.add(points, faces);
    }
}

fn differing([up, down]: &[u64; 2]) -> u64 {
    up ^ down
}
