//! The surface of a triangle mesh in the world, with normals that are smooth where it is.
//!
//! A mesh is made of flat faces, and most of what it stands for is round. A corner's normal is the mean of the faces
//! around its vertex whose normals are within the crease angle of its own face's, weighted by their angles there (Thürmer
//! and Wüthrich, "Computing vertex normals from polygonal facets", 1998), so it does not depend on how a polygon was cut
//! into triangles. So facets of a vase show no lines, and edges of a box do. Vertices are the same where their positions
//! are; which way round a face is does not matter, as it does not for the solid.

use crate::solid::{Frame, ONE, Point, SolidError};
use glam::DVec3;
use std::collections::HashMap;

/// Edges at which a mesh bends by less are round: more than the 36 degrees of ten facets, less than an octagon's 45.
pub const CREASE_DEGREES: f64 = 40.0;

/// The faces of a mesh, placed in the world as its voxels are.
pub struct Surface {
    /// Each face's corners.
    pub faces: Vec<[DVec3; 3]>,
    /// Unit normals at the corners.
    pub normals: Vec<[DVec3; 3]>,
}

impl Surface {
    /// The mesh, scaled and centred by the 120 % rule like [`crate::solid::voxelize`]; faces without area are left out.
    ///
    /// # Errors
    ///
    /// [`SolidError`] for no faces, an index out of range, a coordinate that is not finite, no extent, or a crease angle
    /// that is none.
    pub fn new(vertices: &[[f64; 3]], faces: &[[i64; 3]], crease_degrees: f64) -> Result<Self, SolidError> {
        if !(0.0..=90.0).contains(&crease_degrees) {
            return Err(SolidError::Crease(crease_degrees));
        }
        let frame = Frame::around(vertices, faces)?;
        let places: Vec<DVec3> = vertices.iter().map(|&vertex| frame.world(vertex)).collect();
        let (same, count) = merged(&frame.points(vertices));
        let corners = faces.iter().map(|face| face.map(|i| i as usize));
        let (mut kept, mut names, mut flat) = (Vec::new(), Vec::new(), Vec::new());
        for face in corners {
            let [a, b, c] = face.map(|i| places[i]);
            if let Some(normal) = (b - a).cross(c - a).try_normalize() {
                kept.push([a, b, c]);
                names.push(face.map(|i| same[i]));
                flat.push(normal);
            }
        }
        let normals = smooth(&kept, &names, &flat, count, crease_degrees.to_radians().cos());
        Ok(Self { faces: kept, normals })
    }

    /// The least and the largest coordinates of what can be seen.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        self.faces.iter().flatten().fold(none, |(low, high), &p| (low.min(p), high.max(p)))
    }

    /// Whether a point lies inside: whether the surface winds around it by more than a half, seen from there (Jacobson,
    /// Kavan, Sorkine-Hornung, 2013; the solid angle of a triangle is van Oosterom and Strackee's).
    pub fn holds(&self, point: DVec3) -> bool {
        let (low, high) = self.bounds();
        if !(point.cmpge(low) & point.cmple(high)).all() {
            return false;
        }
        let angle = |face: &[DVec3; 3]| {
            let [a, b, c] = face.map(|corner| corner - point);
            let [la, lb, lc] = [a.length(), b.length(), c.length()];
            let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
            2.0 * a.dot(b.cross(c)).atan2(below)
        };
        self.faces.iter().map(angle).sum::<f64>().abs() > std::f64::consts::TAU
    }
}

/// Vertices this near to each other, 2^-10 of a voxel, are one: files round them to a few digits.
const NEAR: i32 = ONE >> 10;
/// Bits of a coordinate that tell places within a cell of the table below.
const CELL: u32 = 13;

/// A number for each vertex, the same for those in the same place; and how many numbers there are.
fn merged(points: &[Point]) -> (Vec<usize>, usize) {
    // A table of the first vertex at each place, by cells; what is not in a vertex's own cell is near its border.
    const NOBODY: u32 = u32::MAX;
    let slots = (2 * points.len()).next_power_of_two();
    let slot_of = |cell: [i32; 3]| {
        let mix = |v: i32, by: u64| u64::from(v as u32).wrapping_mul(by);
        let h = mix(cell[0], 0x9E37_79B9_7F4A_7C15)
            ^ mix(cell[1], 0xC2B2_AE3D_27D4_EB4F)
            ^ mix(cell[2], 0x1656_67B1_9E37_79F9);
        (h ^ h >> 29) as usize & (slots - 1)
    };
    let near = |p: &Point, q: &Point| (0..3).all(|a| (p[a] - q[a]).abs() <= NEAR);
    let mut table = vec![NOBODY; slots];
    let (mut same, mut count) = (vec![0; points.len()], 0);
    for (i, point) in points.iter().enumerate() {
        let cells =
            [0, 1, 2].map(|a| [point[a] >> CELL, (point[a] - NEAR) >> CELL, (point[a] + NEAR) >> CELL]);
        let beside = cells.map(|[own, below, above]| if below == own { above } else { below });
        let mut found = None;
        for corner in 0..8 {
            let cell: [i32; 3] =
                std::array::from_fn(|a| if corner >> a & 1 == 0 { cells[a][0] } else { beside[a] });
            if (0..3).any(|a| corner >> a & 1 == 1 && beside[a] == cells[a][0]) {
                continue;
            }
            let mut slot = slot_of(cell);
            while found.is_none() && table[slot] != NOBODY {
                found = Some(table[slot]).filter(|&other| near(point, &points[other as usize]));
                slot = (slot + 1) & (slots - 1);
            }
        }
        if let Some(other) = found {
            same[i] = same[other as usize];
            continue;
        }
        let mut slot = slot_of(cells.map(|[own, ..]| own));
        while table[slot] != NOBODY {
            slot = (slot + 1) & (slots - 1);
        }
        table[slot] = i as u32;
        same[i] = count;
        count += 1;
    }
    (same, count)
}

/// Of the faces around a vertex, more than so many are taken together where their normals are about the same.
const MANY: usize = 64;

/// Normals that are the same to about a hundredth, as one of them, and the sum of what they weigh: the hub of a wheel of
/// thousands of spokes would else compare each to all.
fn grouped(each: impl Iterator<Item = (DVec3, DVec3)>) -> Vec<(DVec3, DVec3)> {
    let mut groups: Vec<(DVec3, DVec3)> = Vec::new();
    let mut named = HashMap::new();
    for (normal, weight) in each {
        let group = *named.entry((normal * 100.0).round().as_ivec3()).or_insert(groups.len());
        match groups.get_mut(group) {
            Some((_, sum)) => *sum += weight,
            None => groups.push((normal, weight)),
        }
    }
    groups
}

/// The normals at all corners. `names` says which vertex each of a face's corners is, `flat` is the faces' own normals.
fn smooth(
    faces: &[[DVec3; 3]],
    names: &[[usize; 3]],
    flat: &[DVec3],
    vertices: usize,
    cos_crease: f64,
) -> Vec<[DVec3; 3]> {
    // Corners by vertex: those of vertex v are `around[first[v]..first[v + 1]]`, each as 3 face + corner.
    let mut first = vec![0; vertices + 1];
    names.iter().flatten().for_each(|&v| first[v + 1] += 1);
    (0..vertices).for_each(|v| first[v + 1] += first[v]);
    let mut next = first.clone();
    let mut around = vec![0; 3 * faces.len()];
    for (corner, &v) in names.iter().flatten().enumerate() {
        around[next[v]] = corner;
        next[v] += 1;
    }
    let weight = |corner: usize| {
        let (face, k) = (&faces[corner / 3], corner % 3);
        let (p, q) = (face[(k + 1) % 3] - face[k], face[(k + 2) % 3] - face[k]);
        p.cross(q).length().atan2(p.dot(q))
    };
    let weighted: Vec<DVec3> = around.iter().map(|&c| flat[c / 3] * weight(c)).collect();
    let mut normals = vec![[DVec3::ZERO; 3]; faces.len()];
    for v in 0..vertices {
        let here = &around[first[v]..first[v + 1]];
        let each = here.iter().zip(&weighted[first[v]..first[v + 1]]).map(|(&c, &w)| (flat[c / 3], w));
        let groups = if here.len() > MANY { grouped(each) } else { each.collect() };
        for &corner in here {
            let own = flat[corner / 3];
            let mut sum = DVec3::ZERO;
            for &(normal, w) in &groups {
                let cosine = own.dot(normal);
                if cosine.abs() >= cos_crease - 1e-9 {
                    sum += if cosine < 0.0 { -w } else { w };
                }
            }
            normals[corner / 3][corner % 3] = sum.try_normalize().unwrap_or(own);
        }
    }
    normals
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of two rectangles, the second bent down by so many degrees, its vertices apart by a hair.
    fn bent(degrees: f64, apart: f64) -> Surface {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let mut vertices = Vec::new();
        for z in [0.0, 1.0] {
            vertices.extend([[-1.0, 0.0, z], [0.0, 0.0, z], [apart, 0.0, z], [cosine, -sine, z]]);
        }
        let faces = [[0, 1, 5], [0, 5, 4], [2, 6, 7], [2, 7, 3]];
        Surface::new(&vertices, &faces, CREASE_DEGREES).unwrap()
    }

    #[test]
    fn normals_are_smooth_within_the_crease_angle_alone() {
        for apart in [0.0, 1e-6] {
            let smooth = bent(30.0, apart);
            // In the middle of the bend, whichever way round the faces are: the second strip's run the other way.
            let middle = DVec3::new(15f64.to_radians().sin(), 15f64.to_radians().cos(), 0.0);
            for normal in
                [smooth.normals[0][1], smooth.normals[1][1], smooth.normals[2][0], smooth.normals[3][0]]
            {
                assert!(normal.dot(middle).abs() > 1.0 - 1e-9, "{normal}");
            }
            let sharp = bent(41.0, apart);
            assert!((0..3).all(|k| sharp.normals[0][k].dot(DVec3::Y).abs() > 1.0 - 1e-12));
        }
        assert!(bent(30.0, 1e-3).normals[0][1].dot(DVec3::Y).abs() > 1.0 - 1e-12, "not the same vertices");
    }

    #[test]
    fn a_normal_does_not_depend_on_how_polygons_were_cut() {
        // A corner of a box whose faces are smooth: one of them is cut into three triangles there.
        let vertices = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.3, 0.7, 0.0],
            [0.7, 0.3, 0.0],
        ];
        let faces = [[0, 4, 2], [0, 5, 4], [0, 1, 5], [0, 2, 3], [0, 3, 1]];
        let surface = Surface::new(&vertices, &faces, 90.0).unwrap();
        let corner = DVec3::splat(1.0 / 3f64.sqrt());
        assert!(surface.normals.iter().all(|n| n[0].dot(corner).abs() > 1.0 - 1e-9));
    }

    #[test]
    fn vertices_are_merged_where_they_are_near_and_nowhere_else() {
        // Against all pairs: a cloud around the corner of a cell, a few of the distance across.
        let mut random = crate::random::Random::new(1, 2, 3);
        let mut place = || random.below(7 * NEAR as usize) as i32 - 3 * NEAR;
        let points: Vec<Point> = (0..600).map(|_| [place(), place(), place(), 0]).collect();
        let (same, count) = merged(&points);
        let near = |p: &Point, q: &Point| (0..3).all(|a| (p[a] - q[a]).abs() <= NEAR);
        let mut firsts: Vec<usize> = Vec::new();
        for i in 0..points.len() {
            match firsts.iter().position(|&f| near(&points[i], &points[f])) {
                Some(_) => {
                    assert!(firsts.iter().any(|&f| same[f] == same[i] && near(&points[i], &points[f])))
                }
                None => {
                    assert_eq!(same[i], firsts.len());
                    firsts.push(i);
                }
            }
        }
        assert_eq!(count, firsts.len());
        assert!((20..500).contains(&count), "{count}");
    }

    #[test]
    fn the_hub_of_many_spokes_is_as_smooth_as_that_of_few() {
        // A flat cone: every normal at its tip is upright, however many faces meet there.
        let cone = |spokes: i64| {
            let rim = |i: i64| {
                let angle = i as f64 / spokes as f64 * std::f64::consts::TAU;
                [angle.cos(), 0.0, angle.sin()]
            };
            let mut vertices: Vec<_> = (0..spokes).map(rim).collect();
            vertices.push([0.0, 0.2, 0.0]);
            let faces: Vec<_> = (0..spokes).map(|i| [i, (i + 1) % spokes, spokes]).collect();
            Surface::new(&vertices, &faces, CREASE_DEGREES).unwrap()
        };
        for spokes in [20, 60, 600, 20_000] {
            let cone = cone(spokes);
            let least = cone.normals.iter().map(|n| n[2].y.abs()).fold(1.0, f64::min);
            assert!(least > 1.0 - 1e-6, "{spokes}: {least}");
        }
    }

    #[test]
    fn crease_angles_are_checked() {
        let vertices = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        for degrees in [-1.0, 91.0, f64::NAN] {
            let made = Surface::new(&vertices, &[[0, 1, 2]], degrees);
            assert!(matches!(made, Err(SolidError::Crease(_))));
        }
        assert_eq!(Surface::new(&vertices, &[], 40.0).err(), Some(SolidError::NoFaces));
    }
}
