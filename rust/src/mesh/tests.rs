//! Tests of the bilateral filter.

use super::*;
use std::collections::HashMap;

type Mesh = (Vec<[f64; 3]>, Vec<[u32; 3]>);

const USUAL: BilateralSettings = BilateralSettings { iterations: 8, sigma_spatial: 1.25, sigma_normal: 0.35 };

/// The surface of the cube [-n/2, n/2]^3 in unit squares, normals outward.
fn cube(n: i32) -> Mesh {
    let mut indices: HashMap<[i32; 3], u32> = HashMap::new();
    let mut vertices = Vec::new();
    let mut faces = Vec::new();
    for axis in 0..3 {
        for side in [0, n] {
            for (u, v) in (0..n).flat_map(|u| (0..n).map(move |v| (u, v))) {
                let mut corner = |u: i32, v: i32| {
                    let mut at = [side; 3];
                    (at[(axis + 1) % 3], at[(axis + 2) % 3]) = (u, v);
                    *indices.entry(at).or_insert_with(|| {
                        vertices.push(at.map(|c| f64::from(c) - 0.5 * f64::from(n)));
                        vertices.len() as u32 - 1
                    })
                };
                let (a, b, c, d) = (corner(u, v), corner(u + 1, v), corner(u + 1, v + 1), corner(u, v + 1));
                faces.extend(if side == 0 { [[a, c, b], [a, d, c]] } else { [[a, b, c], [a, c, d]] });
            }
        }
    }
    (vertices, faces)
}

/// A ball of radius 20 whose surface is rough by a third of a unit.
fn rough_ball() -> Mesh {
    let (mut vertices, faces) = cube(32);
    for (i, vertex) in vertices.iter_mut().enumerate() {
        let roughness = 0.33 * (i as f64 * 2.4).sin();
        *vertex = (DVec3::from_array(*vertex).normalize() * (20.0 + roughness)).to_array();
    }
    (vertices, faces)
}

fn volume((vertices, faces): &Mesh) -> f64 {
    let at = |corner: u32| DVec3::from_array(vertices[corner as usize]);
    faces.iter().map(|&[a, b, c]| at(a).dot(at(b).cross(at(c))) / 6.0).sum()
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value * value, count + 1.0));
    (sum / count).sqrt()
}

#[test]
fn stairs_on_a_slanted_plane_become_flat() {
    let (n, slope) = (40_u32, 0.3);
    let mut vertices = Vec::new();
    let mut faces = Vec::new();
    for (x, y) in (0..n).flat_map(|x| (0..n).map(move |y| (x, y))) {
        vertices.push([f64::from(x), f64::from(y), (slope * f64::from(x)).round()]);
        if x + 1 < n && y + 1 < n {
            let a = x * n + y;
            faces.extend([[a, a + n, a + n + 1], [a, a + n + 1, a + 1]]);
        }
    }
    let misfit = |vertices: &[[f64; 3]]| {
        rms(vertices
            .iter()
            .filter(|v| (4.0..36.0).contains(&v[0]) && (4.0..36.0).contains(&v[1]))
            .map(|v| (v[2] - slope * v[0]) / (1.0 + slope * slope).sqrt()))
    };
    let before = misfit(&vertices);
    bilateral(&mut vertices, &faces, &USUAL).unwrap();
    assert!(before > 0.25, "the stairs are there to begin with: {before}");
    assert!(misfit(&vertices) < 0.3 * before, "{before} became {}", misfit(&vertices));
}

#[test]
fn a_box_keeps_its_edges_and_corners() {
    let (before, faces) = cube(20);
    let mut after = before.clone();
    bilateral(&mut after, &faces, &USUAL).unwrap();
    for (a, b) in before.iter().zip(&after) {
        let moved = DVec3::from_array(*a).distance(DVec3::from_array(*b));
        assert!(moved < 0.1, "the vertex at {a:?} moved by {moved}");
    }
}

#[test]
fn a_rough_ball_becomes_smooth_and_keeps_its_volume() {
    let mut ball = rough_ball();
    let roughness = |ball: &Mesh| rms(ball.0.iter().map(|v| DVec3::from_array(*v).length() - 20.0));
    let (rough, full) = (roughness(&ball), volume(&ball));
    let faces = ball.1.clone();
    bilateral(&mut ball.0, &faces, &USUAL).unwrap();
    assert!(roughness(&ball) < 0.3 * rough, "{rough} became {}", roughness(&ball));
    assert!((volume(&ball) / full - 1.0).abs() < 0.01, "{full} became {}", volume(&ball));
}

#[test]
fn no_face_of_a_wild_mesh_is_folded_over_or_collapsed() {
    let (mut vertices, faces) = cube(12);
    for (i, vertex) in vertices.iter_mut().enumerate() {
        for (axis, c) in vertex.iter_mut().enumerate() {
            *c += 0.9 * ((3 * i + axis) as f64 * 12.9898).sin();
        }
    }
    let start: Vec<DVec3> = vertices.iter().copied().map(DVec3::from_array).collect();
    let normals = filtered_normals(&start, &faces, &Incidence::new(start.len(), &faces), &USUAL);
    bilateral(&mut vertices, &faces, &USUAL).unwrap();
    let end: Vec<DVec3> = vertices.iter().copied().map(DVec3::from_array).collect();
    assert_ne!(start, end);
    for (&corners, normal) in faces.iter().zip(normals) {
        let (was, now) = (facet(&start, corners), facet(&end, corners));
        assert!(now.normal.dot(normal) >= was.normal.dot(normal).min(FOLDED));
        assert!(now.area > 0.0);
    }
}

#[test]
fn vertices_that_meet_are_found_across_cells() {
    let start = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    // The first two straddle the border between two cells of 1.6; the last vertex stays where it was.
    let end = [DVec3::splat(1.59), DVec3::splat(1.61), DVec3::new(5.0, 1.0, 1.0), DVec3::Z];
    let mut found = met(&end, &start, 0.1);
    found.sort_unstable();
    found.dedup();
    assert_eq!(found, [0, 1]);
    assert_eq!(met(&end, &end, 0.1), [0_u32; 0]);
}

#[test]
fn the_result_does_not_depend_on_the_threads() {
    let (vertices, faces) = rough_ball();
    let filtered = |threads: usize| {
        let mut vertices = vertices.clone();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| bilateral(&mut vertices, &faces, &USUAL)).unwrap();
        vertices
    };
    assert_eq!(filtered(1), filtered(3));
}

#[test]
fn faces_of_no_area_stay_finite() {
    let (mut vertices, mut faces) = cube(4);
    faces.extend([[0, 0, 0], [0, 1, 1]]);
    bilateral(&mut vertices, &faces, &USUAL).unwrap();
    assert!(vertices.iter().flatten().all(|c| c.is_finite()));
}

#[test]
fn wrong_input_is_named_and_left_alone() {
    let triangle = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let error = |vertices: &[[f64; 3]], face: [u32; 3], settings: BilateralSettings| {
        let mut vertices = vertices.to_vec();
        bilateral(&mut vertices, &[face], &settings).unwrap_err()
    };
    assert_eq!(error(&triangle, [0, 1, 3], USUAL), MeshError::Index { face: 0, index: 3, count: 3 });
    let mut hole = triangle.clone();
    hole[1][2] = f64::NAN;
    assert_eq!(error(&hole, [0, 1, 2], USUAL), MeshError::Vertex(1));
    for value in [0.0, -1.0, f64::INFINITY] {
        let spatial = BilateralSettings { sigma_spatial: value, ..USUAL };
        assert_eq!(error(&triangle, [0, 1, 2], spatial), MeshError::Sigma { name: "sigma_spatial", value });
        let normal = BilateralSettings { sigma_normal: value, ..USUAL };
        assert_eq!(error(&triangle, [0, 1, 2], normal), MeshError::Sigma { name: "sigma_normal", value });
    }
}

#[test]
fn nothing_to_do_changes_nothing() {
    let (before, faces) = rough_ball();
    let mut after = before.clone();
    bilateral(&mut after, &faces, &BilateralSettings { iterations: 0, ..USUAL }).unwrap();
    assert_eq!(before, after);
    bilateral(&mut [], &[], &USUAL).unwrap();
}

#[test]
fn coordinates_as_large_as_numbers_can_be_stay_finite() {
    let mut vertices = vec![[0.0; 3], [0.0; 3], [0.0, 0.0, f64::MAX]];
    bilateral(&mut vertices, &[[2, 2, 0]], &USUAL).unwrap();
    assert!(vertices.as_flattened().iter().all(|v| v.is_finite()));
}
