//! A bilateral filter against the stair steps that marching cubes leaves on a triangle mesh.
//!
//! Marching cubes on voxels gives slanted and round walls stair steps, one voxel high. Averaging positions would
//! remove them, and round off every edge of the object as well. So the filter averages *normals*, and lets the
//! vertices follow:
//!
//! 1. each face's normal becomes the mean of the normals around it, weighted by area, by a Gaussian of the distance
//!    and by a Gaussian of the difference between the two normals, so that the far side of an edge hardly counts
//!    (Zheng, Fu, Au, Tai: "Bilateral normal filtering for mesh denoising", TVCG 2011; the weights are those of
//!    Jones, Durand, Desbrun: "Non-iterative, feature-preserving mesh smoothing", SIGGRAPH 2003);
//! 2. each vertex moves to fit the planes of its faces (Sun, Rosin, Martin, Langbein: "Fast and effective
//!    feature-preserving mesh denoising", TVCG 2007);
//! 3. where that would fold a face over, collapse it or bring two vertices together, the move is halved until it
//!    does not.
//!
//! The result depends on the input alone, not on the number of threads.

use glam::DVec3;
use rayon::prelude::*;

/// Faces that a normal is averaged over at most, the nearest along the surface first: bounds
/// time and memory for any sigma.
const MAX_NEIGHBOURS: usize = 96;
/// Passes of the vertex update; each about halves what is left of the misfit between vertices and normals.
const VERTEX_PASSES: usize = 12;
/// Times that a move which spoils a face is halved before it is dropped.
const HALVINGS: i32 = 4;
/// A face counts as folded when its cosine to the filtered normal falls below this...
const FOLDED: f64 = 0.2;
/// ... and as collapsed when its area falls below this share of the mean. Vertices meet below this share of the root of
/// the mean area.
const COLLAPSED: f64 = 1e-3;
/// Faces in one task.
const CHUNK: usize = 1024;

/// How strongly to filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BilateralSettings {
    /// Passes over the normals; 0 leaves the mesh as it is.
    pub iterations: usize,
    /// Standard deviation of the Gaussian of distance, in the unit of the vertices; more than 0.
    pub sigma_spatial: f64,
    /// Standard deviation of the Gaussian of the difference between unit normals (0 to 2); more than 0.
    pub sigma_normal: f64,
}

/// Why a mesh was not filtered; it is left untouched.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// A face names a vertex that is not there.
    #[error("face {face} names vertex {index}; with {count} vertices every index must be below {count}")]
    Index {
        /// Which face.
        face: usize,
        /// The index it has.
        index: u32,
        /// How many vertices there are.
        count: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {0} has a NaN or infinite coordinate; all must be finite")]
    Vertex(usize),
    /// A standard deviation is of no use.
    #[error("{name} must be finite and more than 0, got {value}")]
    Sigma {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: f64,
    },
}

/// Filters a mesh in place: moves vertices, keeps faces.
///
/// `faces` are triangles of vertex indices, anticlockwise seen from outside. Faces of no area are allowed, and so
/// are borders and edges of more than two faces.
///
/// # Errors
///
/// [`MeshError`] for an index out of range, a coordinate that is not finite, or a sigma that is not above 0.
pub fn bilateral(
    vertices: &mut [[f64; 3]],
    faces: &[[u32; 3]],
    settings: &BilateralSettings,
) -> Result<(), MeshError> {
    check(vertices, faces, settings)?;
    if settings.iterations == 0 || faces.is_empty() {
        return Ok(());
    }
    let start: Vec<DVec3> = vertices.iter().copied().map(DVec3::from_array).collect();
    let around = Incidence::new(start.len(), faces);
    let normals = filtered_normals(&start, faces, &around, settings);
    let moved = fit_vertices(&start, faces, &around, &normals);
    let kept = without_folds(&start, &moved, faces, &normals);
    for (vertex, position) in vertices.iter_mut().zip(kept) {
        // Of coordinates as large as numbers can be, squares overflow.
        if position.is_finite() {
            *vertex = position.to_array();
        }
    }
    Ok(())
}

fn check(vertices: &[[f64; 3]], faces: &[[u32; 3]], settings: &BilateralSettings) -> Result<(), MeshError> {
    for (name, value) in [("sigma_spatial", settings.sigma_spatial), ("sigma_normal", settings.sigma_normal)]
    {
        if !(value.is_finite() && value > 0.0) {
            return Err(MeshError::Sigma { name, value });
        }
    }
    if let Some(bad) = vertices.iter().position(|v| v.iter().any(|c| !c.is_finite())) {
        return Err(MeshError::Vertex(bad));
    }
    let count = vertices.len();
    for (face, corners) in faces.iter().enumerate() {
        if let Some(&index) = corners.iter().find(|&&index| index as usize >= count) {
            return Err(MeshError::Index { face, index, count });
        }
    }
    Ok(())
}

/// The faces around each vertex, in ascending order, all in one array.
struct Incidence {
    starts: Vec<u32>,
    faces: Vec<u32>,
}

impl Incidence {
    fn new(vertices: usize, faces: &[[u32; 3]]) -> Self {
        let mut starts = vec![0_u32; vertices + 1];
        for &corner in faces.iter().flatten() {
            starts[corner as usize + 1] += 1;
        }
        for vertex in 0..vertices {
            starts[vertex + 1] += starts[vertex];
        }
        let mut next = starts.clone();
        let mut list = vec![0_u32; 3 * faces.len()];
        for (face, corners) in (0_u32..).zip(faces) {
            for &corner in corners {
                list[next[corner as usize] as usize] = face;
                next[corner as usize] += 1;
            }
        }
        Self { starts, faces: list }
    }

    fn of(&self, vertex: usize) -> &[u32] {
        &self.faces[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }
}

/// A face as the filter sees it. `normal` has length 1, or 0 for a face of no area.
#[derive(Clone, Copy)]
struct Facet {
    center: DVec3,
    normal: DVec3,
    area: f64,
}

fn facet(positions: &[DVec3], corners: [u32; 3]) -> Facet {
    let [a, b, c] = corners.map(|corner| positions[corner as usize]);
    let doubled = (b - a).cross(c - a);
    Facet { center: (a + b + c) / 3.0, normal: doubled.normalize_or_zero(), area: 0.5 * doubled.length() }
}

fn filtered_normals(
    positions: &[DVec3],
    faces: &[[u32; 3]],
    around: &Incidence,
    settings: &BilateralSettings,
) -> Vec<DVec3> {
    let facets: Vec<Facet> = faces.iter().map(|&corners| facet(positions, corners)).collect();
    let by_turn = 0.5 / (settings.sigma_normal * settings.sigma_normal);
    let neighbourhoods: Vec<Neighbourhoods> = (0..faces.len())
        .into_par_iter()
        .step_by(CHUNK)
        .map(|first| Neighbourhoods::new(first, &facets, faces, around, settings.sigma_spatial))
        .collect();
    let mut normals: Vec<DVec3> = facets.iter().map(|facet| facet.normal).collect();
    let mut next = normals.clone();
    for _ in 0..settings.iterations {
        next.par_chunks_mut(CHUNK).zip(&neighbourhoods).enumerate().for_each(|(chunk, (out, near))| {
            for (offset, normal) in out.iter_mut().enumerate() {
                let here = normals[chunk * CHUNK + offset];
                let sum: DVec3 = near
                    .of(offset)
                    .iter()
                    .map(|&(face, weight)| {
                        let there = normals[face as usize];
                        there * (f64::from(weight) * gaussian(by_turn * here.distance_squared(there)))
                    })
                    .sum();
                *normal = sum.try_normalize().unwrap_or(here);
            }
        });
        std::mem::swap(&mut normals, &mut next);
    }
    normals
}

/// exp(-x) for x >= 0, nearly: (1 - x/16)^16, and 0 from 16 on. Without the call it costs a tenth.
fn gaussian(x: f64) -> f64 {
    let base = (1.0 - x / 16.0).max(0.0);
    let fourth = (base * base) * (base * base);
    (fourth * fourth) * (fourth * fourth)
}

/// The faces near each face of one chunk, and what they weigh by area and distance: all that stays the same from
/// pass to pass.
struct Neighbourhoods {
    starts: Vec<u32>,
    entries: Vec<(u32, f32)>,
}

impl Neighbourhoods {
    /// Walks over the surface away from each face of the chunk. The marks say for which face a vertex or a face was
    /// seen last, so that they need no clearing in between.
    fn new(first: usize, facets: &[Facet], faces: &[[u32; 3]], around: &Incidence, sigma: f64) -> Self {
        let last = (first + CHUNK).min(faces.len());
        let reach = (2.0 * sigma) * (2.0 * sigma);
        let mut seen_vertices = vec![u32::MAX; around.starts.len() - 1];
        let mut seen_faces = vec![u32::MAX; faces.len()];
        let mut queue: Vec<u32> = Vec::new();
        let mut starts = vec![0];
        let mut entries = Vec::new();
        for face in first..last {
            let (mark, here) = (face as u32, facets[face]);
            let full = entries.len() + MAX_NEIGHBOURS;
            let mut visit = |face: u32, weight: f64, queue: &mut Vec<u32>| {
                entries.push((face, weight as f32));
                for corner in faces[face as usize] {
                    if std::mem::replace(&mut seen_vertices[corner as usize], mark) != mark {
                        queue.push(corner);
                    }
                }
                entries.len() < full
            };
            seen_faces[face] = mark;
            queue.clear();
            visit(mark, here.area, &mut queue);
            let mut next = 0;
            'walk: while let Some(&vertex) = queue.get(next) {
                next += 1;
                for &other in around.of(vertex as usize) {
                    if std::mem::replace(&mut seen_faces[other as usize], mark) == mark {
                        continue;
                    }
                    let there = facets[other as usize];
                    let distance = here.center.distance_squared(there.center);
                    let weight = there.area * gaussian(0.5 * distance / (sigma * sigma));
                    if distance <= reach && !visit(other, weight, &mut queue) {
                        break 'walk;
                    }
                }
            }
            starts.push(entries.len() as u32);
        }
        entries.shrink_to_fit();
        Self { starts, entries }
    }

    fn of(&self, offset: usize) -> &[(u32, f32)] {
        &self.entries[self.starts[offset] as usize..self.starts[offset + 1] as usize]
    }
}

/// Moves each vertex towards the planes through the centres of its faces, again and again.
fn fit_vertices(start: &[DVec3], faces: &[[u32; 3]], around: &Incidence, normals: &[DVec3]) -> Vec<DVec3> {
    let mut positions = start.to_vec();
    let mut centers = vec![DVec3::ZERO; faces.len()];
    for _ in 0..VERTEX_PASSES {
        centers.par_iter_mut().zip(faces).for_each(|(center, corners)| {
            *center = corners.iter().map(|&corner| positions[corner as usize]).sum::<DVec3>() / 3.0;
        });
        positions.par_iter_mut().enumerate().for_each(|(vertex, position)| {
            let around = around.of(vertex);
            let step: DVec3 = around
                .iter()
                .map(|&face| {
                    let normal = normals[face as usize];
                    normal * normal.dot(centers[face as usize] - *position)
                })
                .sum();
            *position += step / around.len().max(1) as f64;
        });
    }
    positions
}

/// The moved vertices, except that moves are halved, and at last dropped, where they fold a face over, collapse it, or
/// bring two vertices together.
///
/// What was no better before is left alone. So a mesh without any move always passes, and the loop ends.
fn without_folds(start: &[DVec3], moved: &[DVec3], faces: &[[u32; 3]], normals: &[DVec3]) -> Vec<DVec3> {
    let before: Vec<Facet> = faces.iter().map(|&corners| facet(start, corners)).collect();
    let mean = before.iter().map(|facet| facet.area).sum::<f64>() / faces.len() as f64;
    let mut halvings = vec![0_i32; start.len()];
    let mut positions = moved.to_vec();
    loop {
        let spoilt = faces.par_iter().zip(&before).zip(normals).filter(|&((&corners, was), &normal)| {
            let now = facet(&positions, corners);
            now.normal.dot(normal) < was.normal.dot(normal).min(FOLDED)
                || now.area < was.area.min(COLLAPSED * mean)
        });
        let mut again: Vec<u32> = spoilt.flat_map_iter(|((&corners, _), _)| corners).collect();
        again.extend(met(&positions, start, COLLAPSED * mean.sqrt()));
        if again.is_empty() {
            return positions;
        }
        again.par_sort_unstable();
        again.dedup();
        for vertex in again.into_iter().map(|vertex| vertex as usize) {
            halvings[vertex] += 1;
            positions[vertex] = if halvings[vertex] > HALVINGS {
                start[vertex]
            } else {
                start[vertex].lerp(moved[vertex], 0.5_f64.powi(halvings[vertex]))
            };
        }
    }
}

/// Vertices that came closer to another than `gap`, and closer than they were at the start.
///
/// Readers of mesh files take vertices at one place for one vertex, and then the mesh is no longer closed.
fn met(positions: &[DVec3], start: &[DVec3], gap: f64) -> Vec<u32> {
    // Each vertex is listed in every cell that a ball of half the gap around it touches; of two that met, both are
    // listed where the middle between them is.
    let cell = 16.0 * gap;
    let mut listed: Vec<([i64; 3], u32)> = Vec::with_capacity(2 * positions.len());
    for (vertex, &position) in (0_u32..).zip(positions) {
        let [low, high] =
            [-0.5, 0.5].map(|side| ((position + side * gap) / cell).floor().as_i64vec3().to_array());
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                listed.extend((low[2]..=high[2]).map(|z| ([x, y, z], vertex)));
            }
        }
    }
    listed.par_sort_unstable();
    let mut found = Vec::new();
    for group in listed.chunk_by(|a, b| a.0 == b.0) {
        for (i, &(_, a)) in group.iter().enumerate() {
            for &(_, b) in &group[i + 1..] {
                let (a_, b_) = (a as usize, b as usize);
                let distance = positions[a_].distance(positions[b_]);
                if distance < gap.min(start[a_].distance(start[b_])) {
                    found.extend([a, b]);
                }
            }
        }
    }
    found
}

#[cfg(test)]
mod tests;
