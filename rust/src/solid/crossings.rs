//! How often a mesh's faces cross the columns of a grid, below every voxel, upwards and downwards.
//!
//! Coordinates are integers, 2^20 to a voxel's side, so that it is *exact* on which side of an edge a ray passes. A ray
//! that meets an edge or a vertex counts as one that passes a hair towards +x, and by a hair of that hair towards +y:
//! every edge gives it to one of its two faces, whichever way round they are. No ray slips through a closed surface.

use crate::dispatch::for_each_instruction_set;
use crate::voxel::SIDE;

/// Columns of a grid; column `i * 64 + j` lies at i along the first axis, j along the second.
pub const COLUMNS: usize = SIDE * SIDE;
/// A voxel's side.
pub const ONE: i32 = 1 << FRACTION;
const FRACTION: u32 = 20;
const HALF: i32 = ONE / 2;
/// Added to a small number, leaves the nearest integer in the low bits of the sum.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// Faces that are looked through at a time for those that meet a ray.
const CHUNK: usize = 512;

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

impl Crossings {
    pub fn of(points: &[Point], faces: &[[i64; 3]]) -> Self {
        let mut crossings = Self { first: [[0; 2]; COLUMNS], higher: Vec::new(), boundary: 0 };
        add_faces(&mut crossings, points, faces);
        crossings
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
    fn add_face(&mut self, a: Point, mut b: Point, mut c: Point) {
        let [(x0, x1), (y0, y1)] = columns(a, b, c);
        let along = |p: Point, q: Point, axis: usize| i64::from(q[axis] - p[axis]);
        // Twice the area as seen from above, more than 0 where the face's outside is.
        let mut area = along(a, b, 0) * along(a, c, 1) - along(a, b, 1) * along(a, c, 0);
        if area == 0 {
            return;
        }
        let side = usize::from(area > 0);
        if area < 0 {
            std::mem::swap(&mut b, &mut c);
            area = -area;
        }
        let at = [x0, y0].map(|i| i * ONE + HALF);
        let edges = [Edge::of(b, c, at), Edge::of(c, a, at), Edge::of(a, b, at)];
        // The height of the plane above the rays, in voxels, is affine in their place.
        let [rise_b, rise_c] = [along(a, b, 2), along(a, c, 2)];
        let slope_x = (along(a, c, 1) * rise_b - along(a, b, 1) * rise_c) as f64 / area as f64;
        let slope_y = (along(a, b, 0) * rise_c - along(a, c, 0) * rise_b) as f64 / area as f64;
        let [from_x, from_y] = [0, 1].map(|axis| f64::from(at[axis] - a[axis]));
        let mut row_height = (f64::from(a[2] - HALF) + slope_x * from_x + slope_y * from_y) / f64::from(ONE);
        // Rounding leaves less than a thousandth of this.
        let unsure = 1e-10 * (1.0 + slope_x.abs() + slope_y.abs());
        let mut row = edges.map(|edge| edge.margin);
        for i in x0..=x1 {
            let (mut margins, mut height) = (row, row_height);
            for j in y0..=y1 {
                if margins[0] | margins[1] | margins[2] >= 0 {
                    let rounded = height + ROUND;
                    let over = height - (rounded - ROUND);
                    let mut first = rounded.to_bits() as u32 + u32::from(over > 0.0);
                    if over.abs() < unsure {
                        let shares = [margins[1] - edges[1].tie, margins[2] - edges[2].tie];
                        first = first_above(shares, [rise_b, rise_c], a[2], area);
                    }
                    self.add(i as usize * SIDE + j as usize, side, u64::MAX << (first % SIDE as u32));
                }
                (0..3).for_each(|e| margins[e] += edges[e].step_y);
                height += slope_y;
            }
            (0..3).for_each(|e| row[e] += edges[e].step_x);
            row_height += slope_x;
        }
    }

    /// Adds one to the crossings of some voxels of a column.
    #[inline(always)]
    fn add(&mut self, column: usize, side: usize, voxels: u64) {
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
        let corners = |face: &[i64; 3]| face.map(|i| points[i as usize]);
        let mut kept = [0; CHUNK];
        for faces in faces.chunks(CHUNK) {
            let mut count = 0;
            for (i, face) in faces.iter().enumerate() {
                let [a, b, c] = corners(face);
                crossings.boundary = crossings.boundary.wrapping_add(boundary([a, b, c].map(|p| p[3])));
                let [x, y] = columns(a, b, c);
                kept[count] = i;
                count += usize::from((x.0 <= x.1) & (y.0 <= y.1));
            }
            for &i in &kept[..count] {
                let [a, b, c] = corners(&faces[i]);
                crossings.add_face(a, b, c);
            }
        }
    }
}

fn differing([up, down]: &[u64; 2]) -> u64 {
    up ^ down
}

/// One edge of a face that is seen anticlockwise.
#[derive(Clone, Copy)]
struct Edge {
    /// How far the first ray lies within the edge, times its length; less than 0 outside. On the edge it is 0 if
    /// the edge keeps its rays, else -1.
    margin: i64,
    /// What is in the margin because of that.
    tie: i64,
    /// How the margin grows from ray to ray.
    step_x: i64,
    step_y: i64,
}

impl Edge {
    #[inline(always)]
    fn of(p: Point, q: Point, at: [i32; 2]) -> Self {
        let [dx, dy] = [0, 1].map(|axis| i64::from(q[axis] - p[axis]));
        let [x, y] = [0, 1].map(|axis| i64::from(at[axis] - p[axis]));
        let keeps = dy < 0 || dy == 0 && dx > 0;
        let tie = i64::from(keeps) - 1;
        Self { margin: dx * y - dy * x + tie, tie, step_x: -dy << FRACTION, step_y: dx << FRACTION }
    }
}

/// The columns whose rays pass the bounding box of a face: first and last along either axis.
#[inline(always)]
fn columns(a: Point, b: Point, c: Point) -> [(i32, i32); 2] {
    [0, 1].map(|axis| {
        let (low, high) = (a[axis].min(b[axis]).min(c[axis]), a[axis].max(b[axis]).max(c[axis]));
        ((low + (HALF - 1)) >> FRACTION, (high - HALF) >> FRACTION)
    })
}

#[inline(always)]
fn boundary(numbers: [i32; 3]) -> i64 {
    let [p, q, r] = numbers.map(i64::from);
    (p - q).wrapping_mul(q - r).wrapping_mul(r - p)
}

/// The first voxel of a column whose centre is not below a face, exactly. `shares` are the areas that b and c have of
/// the face where the ray meets it, `rises` their heights above a.
#[cold]
fn first_above(shares: [i64; 2], rises: [i64; 2], a: i32, area: i64) -> u32 {
    let [shares, rises] = [shares, rises].map(|pair| pair.map(i128::from));
    let area = i128::from(area);
    let height = shares[0] * rises[0] + shares[1] * rises[1] + i128::from(a - HALF) * area;
    -(-height).div_euclid(area << FRACTION) as u32
}
