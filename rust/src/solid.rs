//! The solid inside a triangle mesh: one ray through every column of voxels.
//!
//! **Closed meshes.** A voxel is inside when the surface winds around its centre: when the faces that a ray from
//! afar enters and leaves by do not cancel. For one simple surface that is parity. But parts that overlap, as in most
//! modelled objects, stay solid where parity would hollow them out; cavities stay hollow; and it does not matter
//! whether faces are seen from outside or from inside. Whether a mesh is closed is read off its edges ([`crossings`]),
//! by positions, so vertices that were split for textures or normals do no harm.
//!
//! **Doubled faces.** When the mesh is not closed, or encloses nothing, each face is taken once, whichever way round: some
//! files hold every face twice, for either side of it.
//!
//! **All others**: meshes with holes, with faces turned over, with walls of no thickness. Rays are cast along all three
//! axes, and vote. A ray that leaves as often as it enters votes by winding; else, if it crosses an even number of
//! faces, by parity, which faces turned over do not disturb; else it has gone through a hole, and abstains. The
//! majority decides. Where there is none, the mean winding number as seen from the six sides does: it is a coarse
//! generalised winding number (Jacobson, Kavan, Sorkine-Hornung: "Robust inside-outside segmentation using generalized
//! winding numbers", SIGGRAPH 2013), and a half counts as inside. So a table without undersides is as solid as one with
//! them, and a vase of a single wall is full. A sheet that encloses nothing has no inside, and leaves no voxels.

mod crossings;
mod faces;
mod finer;

use crate::dispatch::for_each_instruction_set;
use crate::voxel::{BitGrid, SIDE};
use crossings::{COLUMNS, Crossings, Vote};
pub(crate) use crossings::{ONE, Point};
pub use finer::{Finer, shares};
use glam::DVec3;
use std::collections::HashSet;

/// The world grid covers this much of a mesh's largest side: the paper's 120 %.
const COVER: f64 = 1.2;

/// Why a mesh has no solid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SolidError {
    #[error("the mesh has no faces; a solid needs triangles around it")]
    NoFaces,
    #[error(
        "face {face} names vertex {index}; with {count} vertices every index must lie between 0 and {count} - 1"
    )]
    Index { face: usize, index: i64, count: usize },
    #[error("vertex {0} has a NaN or infinite coordinate; all must be finite")]
    Vertex(usize),
    #[error("the mesh's largest side is {0}; it must be more than 0, and a finite number")]
    Extent(f64),
    #[error("the crease angle must lie between 0 and 90 degrees, got {0}")]
    Crease(f64),
}

/// The voxels inside a mesh, scaled and centred by the 120 % rule: the grid's cube is 120 % of the largest side of the
/// mesh's bounding box, and their centres coincide. Vertices that no face names do not count.
///
/// Positions are rounded to 2^-20 of a voxel; from there on the arithmetic is exact. A voxel whose centre lies *on* the
/// surface of a closed mesh is inside if the solid goes on above it, towards +z; on an upright surface, towards +x, or
/// else +y. So solids that touch share no voxel, and leave none out.
///
/// # Errors
///
/// [`SolidError`] for no faces, an index out of range, a coordinate that is not finite, or no extent.
pub fn voxelize(vertices: &[[f64; 3]], faces: &[[i64; 3]]) -> Result<BitGrid, SolidError> {
    Ok(inside(&Frame::around(vertices, faces)?, vertices, faces))
}

/// What a mesh encloses of a grid.
fn inside(frame: &Frame, vertices: &[[f64; 3]], faces: &[[i64; 3]]) -> BitGrid {
    let points = frame.place(vertices, AXES[2]);
    let wound = |faces: &[[i64; 3]]| {
        let along_z = Crossings::of(&points, faces);
        let solid = along_z.closed().then(|| along_z.winding());
        solid.filter(|words| words.iter().any(|&word| word != 0))
    };
    let words = wound(faces).unwrap_or_else(|| {
        let single = without_doubles(&points, faces);
        let again = if single.len() < faces.len() { wound(&single) } else { None };
        again.unwrap_or_else(|| vote(frame, vertices, &single))
    });
    BitGrid::of_words(words)
}

/// How a mesh's coordinates become a grid's.
pub(crate) struct Frame {
    middle: [f64; 3],
    scale: f64,
}

impl Frame {
    pub(crate) fn around(vertices: &[[f64; 3]], faces: &[[i64; 3]]) -> Result<Self, SolidError> {
        if faces.is_empty() {
            return Err(SolidError::NoFaces);
        }
        let count = vertices.len();
        let indices = faces.as_flattened();
        // Negative indices are large ones.
        if largest(indices) >= count as u64 {
            let i = indices.iter().position(|&index| index as u64 >= count as u64).unwrap_or(0);
            return Err(SolidError::Index { face: i / 3, index: indices[i], count });
        }
        let mut named = vec![false; count];
        indices.iter().for_each(|&index| named[index as usize] = true);
        let used = |i: &usize| named[*i];
        let (low, high, finite) = if named.iter().all(|&n| n) {
            bounds(vertices)
        } else {
            bounds(&(0..count).filter(used).map(|i| vertices[i]).collect::<Vec<_>>())
        };
        if !finite {
            let bad = (0..count).filter(used).find(|&i| vertices[i].iter().any(|v| !v.is_finite()));
            return Err(SolidError::Vertex(bad.unwrap_or(0)));
        }
        let side = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max);
        let scale = SIDE as f64 * f64::from(ONE) / (COVER * side);
        if !(scale > 0.0 && scale.is_finite()) {
            return Err(SolidError::Extent(side));
        }
        Ok(Self { middle: [0, 1, 2].map(|a| low[a] / 2.0 + high[a] / 2.0), scale })
    }

    /// A frame in which a mesh lies so many voxels further along each axis.
    fn moved(&self, voxels: [f64; 3]) -> Self {
        let by = voxels.map(|v| v * f64::from(ONE) / self.scale);
        Self { middle: std::array::from_fn(|a| self.middle[a] - by[a]), scale: self.scale }
    }

    /// A vertex in the world.
    pub(crate) fn world(&self, vertex: [f64; 3]) -> DVec3 {
        (DVec3::from(vertex) - DVec3::from(self.middle)) * (self.scale / (SIDE as f64 * f64::from(ONE)))
    }

    /// The vertices in the grid, by which it is told which of them are the same.
    pub(crate) fn points(&self, vertices: &[[f64; 3]]) -> Vec<Point> {
        self.place(vertices, AXES[2])
    }

    /// The vertices in the grid, their axes in the given order: columns run along the last of them.
    fn place(&self, vertices: &[[f64; 3]], axes: [usize; 3]) -> Vec<Point> {
        placed(self, vertices, axes)
    }
}

for_each_instruction_set! {
    fn largest(indices: &[i64]) -> u64 {
        let mut largest = 0;
        for &index in indices {
            largest = largest.max(index as u64);
        }
        largest
    }
}

for_each_instruction_set! {
    /// The least and the largest coordinate along each axis, and whether all are finite.
    fn bounds(vertices: &[[f64; 3]]) -> ([f64; 3], [f64; 3], bool) {
        // Eight vertices side by side are three whole vectors.
        let (eights, rest) = vertices.as_flattened().as_chunks::<24>();
        let (mut low, mut high, mut nothing) = ([f64::INFINITY; 24], [f64::NEG_INFINITY; 24], [0.0; 24]);
        let mut grow = |i: usize, v: f64| {
            low[i] = if v < low[i] { v } else { low[i] };
            high[i] = if v > high[i] { v } else { high[i] };
            nothing[i] += v * 0.0; // NaN, if v is not finite
        };
        for eight in eights {
            eight.iter().enumerate().for_each(|(i, &v)| grow(i, v));
        }
        rest.iter().enumerate().for_each(|(i, &v)| grow(i, v));
        let along = |all: [f64; 24], first: f64, pick: fn(f64, f64) -> f64| {
            [0, 1, 2].map(|axis| all.iter().skip(axis).step_by(3).fold(first, |one, &v| pick(one, v)))
        };
        (along(low, f64::INFINITY, f64::min), along(high, f64::NEG_INFINITY, f64::max), nothing == [0.0; 24])
    }
}

for_each_instruction_set! {
    fn placed(frame: &Frame, vertices: &[[f64; 3]], axes: [usize; 3]) -> Vec<Point> {
        let half = f64::from(ONE) * (SIDE / 2) as f64;
        let middle = axes.map(|a| frame.middle[a]);
        let mut points = vec![Point::default(); vertices.len()];
        for (point, vertex) in points.iter_mut().zip(vertices) {
            let mut place = [0.0; 3];
            for (k, &a) in axes.iter().enumerate() {
                place[k] = (vertex[a] - middle[k]) * frame.scale + half;
            }
            *point = crossings::point(place);
        }
        points
    }
}

/// The faces that have other corners than all before them, whichever way round.
fn without_doubles(points: &[Point], faces: &[[i64; 3]]) -> Vec<[i64; 3]> {
    let mut seen = HashSet::new();
    let corners = |face: &[i64; 3]| {
        let mut corners = face.map(|i| points[i as usize]);
        corners.sort_unstable();
        corners
    };
    faces.iter().filter(|face| seen.insert(corners(face))).copied().collect()
}

/// The axes across the columns, and the axis along them, for rays along x, y, z. Even permutations keep faces' sides.
const AXES: [[usize; 3]; 3] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]];

/// The majority of the rays along the three axes, as words along z.
fn vote(frame: &Frame, vertices: &[[f64; 3]], faces: &[[i64; 3]]) -> Vec<u64> {
    let rays = AXES.map(|axes| Crossings::of(&frame.place(vertices, axes), faces));
    let [x, y, along_z] = rays.each_ref().map(Crossings::votes);
    let along_x = turned(&x, |y, z| y * SIDE + z, |y, x| x * SIDE + y);
    let along_y = turned(&y, |x, z| z * SIDE + x, |x, y| x * SIDE + y);
    let column = |column: usize| {
        let votes = [along_x[column], along_y[column], along_z[column]];
        let [one, two] = counted(votes.map(|v| v.inside));
        let [one_against, two_against] = counted(votes.map(|v| v.outside));
        let mut inside = two | one & !one_against;
        let mut undecided = !(one | one_against) | one & one_against & !two & !two_against;
        while undecided != 0 {
            let z = undecided.trailing_zeros() as usize;
            undecided &= undecided - 1;
            let at = [column / SIDE, column % SIDE, z];
            let seen =
                rays.iter().zip(AXES).map(|(r, [u, v, w])| r.winding_both_ways(at[u] * SIDE + at[v], at[w]));
            inside |= u64::from(seen.sum::<i64>().abs() >= 3) << z;
        }
        inside
    };
    (0..COLUMNS).map(column).collect()
}

/// Where at least one of three bits is set, and where at least two are.
fn counted([a, b, c]: [u64; 3]) -> [u64; 2] {
    [a | b | c, a & b | b & c | c & a]
}

/// Votes of columns along another axis, as columns along z. `from` says which column of a slice's lies at a z, `to`
/// which column along z a bit of them belongs to.
fn turned(
    votes: &[Vote],
    from: impl Fn(usize, usize) -> usize,
    to: impl Fn(usize, usize) -> usize,
) -> Vec<Vote> {
    let mut turned = vec![Vote::default(); COLUMNS];
    for slice in 0..SIDE {
        let rows = |pick: fn(&Vote) -> u64| transposed(std::array::from_fn(|z| pick(&votes[from(slice, z)])));
        let (inside, outside) = (rows(|v| v.inside), rows(|v| v.outside));
        for bit in 0..SIDE {
            turned[to(slice, bit)] = Vote { inside: inside[bit], outside: outside[bit] };
        }
    }
    turned
}

/// The transpose of a matrix of bits: blocks off the diagonal change places, of half the size each time.
fn transposed(mut rows: [u64; SIDE]) -> [u64; SIDE] {
    let (mut half, mut mask) = (SIDE / 2, u64::from(u32::MAX));
    while half > 0 {
        for i in (0..SIDE).filter(|i| i & half == 0) {
            let swap = (rows[i] >> half ^ rows[i + half]) & mask;
            rows[i] ^= swap << half;
            rows[i + half] ^= swap;
        }
        half /= 2;
        mask ^= mask << half;
    }
    rows
}

#[cfg(test)]
mod tests;
