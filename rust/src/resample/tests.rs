//! Tests of the resampling, for each size.

use super::*;
use crate::trilinear::trilinear;
use crate::voxel::{CELLS, SIDE, voxel_center};
use glam::Vec3;
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;

fn any_camera() -> impl Strategy<Value = Camera> {
    (0.0..360.0, -90.0..90.0, 0.0..360.0, 0.8..4.0, 20.0..100.0, 0.1..1.5, 0.2..3.0).prop_map(
        |(azimuth, elevation, roll, distance, fov, near, depth)| {
            let orbit = Camera::orbit(azimuth, elevation, roll, distance);
            Camera::new(orbit.position, orbit.axes, fov, near, near + depth).unwrap()
        },
    )
}

fn noise<const N: usize>() -> Vec<f32> {
    let at = |i: u32| (i.wrapping_mul(2_654_435_761) >> 16) as f32 / 65536.0;
    (0..(N * N * N) as u32).map(at).collect()
}

fn padded<const N: usize>(volume: &[f32]) -> Padded<N> {
    let grids: &[Grid<N>] = volume.as_chunks().0.as_chunks().0.as_chunks().0;
    let mut padded = Padded::default();
    assert!(padded.fill(&grids[0]));
    padded
}

fn cells_are_read_where_their_centres_are<const N: usize>(camera: &Camera) -> Result<(), TestCaseError> {
    let (cells, size) = (N * N * N, N as f64);
    // Positions have an ulp or two of N cells along each axis; noise may change by 1 within a cell.
    let tolerance = 3.0 * 3.0 * N as f32 * f32::EPSILON;
    let volume = noise::<N>();
    let (mut seen, mut back) = (vec![9.0; cells], vec![-1.0; cells]);
    to_camera_grid::<N>(&volume, &[*camera], &mut seen).unwrap();
    to_world_grid::<N>(&volume, &[*camera], &mut back).unwrap();
    for i in (0..cells).step_by((cells / 7000) | 1) {
        let cell = [i / (N * N), i / N % N, i % N];
        let [slice, row, col] = cell;
        let at = |i: usize| (2 * i + 1) as f64 / size - 1.0;
        let p = camera.position + camera.ray(at(col), at(row)) * camera.slice_depth(slice, N);
        let at = ((p + 0.5) * size - 0.5).as_vec3();
        // Beyond a few cells outside, positions are as coarse as they are large, and read 0 all the same.
        if at.abs().max_element() < 2.0 * N as f32 {
            let expected = trilinear::<N>(&volume, at);
            prop_assert!((seen[i] - expected).abs() < tolerance, "{i} {} {expected}", seen[i]);
        } else {
            prop_assert_eq!(seen[i], 0.0);
        }
        let p = camera.to_camera(DVec3::from(cell.map(|c| center_among(c, N))));
        let slice = (p.z - camera.near) / (camera.far - camera.near);
        let [row, col] = [p.y, p.x].map(|c| 0.5 + 0.5 * c / (p.z * camera.half_image));
        let at = DVec3::new(slice, row, col) * size;
        let outside = (at - at.clamp(DVec3::ZERO, DVec3::splat(size))).abs().max_element();
        let margin = at.min(DVec3::splat(size) - at).abs().min_element();
        if margin < 1e-3 {
            continue;
        }
        if outside > 0.0 || p.z < 0.0 {
            prop_assert_eq!(back[i], -1.0);
        } else {
            let expected = trilinear::<N>(&volume, (at - 0.5).as_vec3());
            prop_assert!((back[i] - expected).abs() < tolerance, "{i} {} {expected}", back[i]);
        }
    }
    Ok(())
}

fn instruction_sets_agree<const N: usize>(camera: &Camera, plane: f64) -> Result<(), TestCaseError> {
    let (padded, plane) = (padded::<N>(&noise::<N>()), (plane * N as f64) as usize);
    let mut chosen = vec![[0.25; N]; N];
    let mut plain = chosen.clone();
    let [chosen, plain] = [&mut chosen, &mut plain].map(|plane| plane.first_chunk_mut::<N>().unwrap());
    camera_plane(&padded, camera, plane, chosen);
    camera_plane_plain(&padded, camera, plane, plain);
    prop_assert!(chosen == plain);
    world_plane(&padded, camera, plane, chosen);
    world_plane_plain(&padded, camera, plane, plain);
    prop_assert!(chosen == plain);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn each_cell_is_read_where_its_centre_is(camera in any_camera()) {
        cells_are_read_where_their_centres_are::<32>(&camera)?;
        cells_are_read_where_their_centres_are::<64>(&camera)?;
    }

    #[test]
    fn every_instruction_set_reads_the_same(camera in any_camera(), plane in 0.0..1.0) {
        instruction_sets_agree::<32>(&camera, plane)?;
        instruction_sets_agree::<64>(&camera, plane)?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4))]
    #[test]
    fn each_cell_of_a_large_grid_is_read_where_its_centre_is(camera in any_camera()) {
        cells_are_read_where_their_centres_are::<128>(&camera)?;
        cells_are_read_where_their_centres_are::<256>(&camera)?;
    }

    #[test]
    fn every_instruction_set_reads_the_same_of_a_large_grid(camera in any_camera(), plane in 0.0..1.0) {
        instruction_sets_agree::<128>(&camera, plane)?;
        instruction_sets_agree::<256>(&camera, plane)?;
    }
}

fn centres_read_their_cells<const N: usize>() {
    let volume = noise::<N>();
    let (mut taps, padded) = (Taps::<N>::default(), padded::<N>(&volume));
    for i in [0, 1, N - 2, N - 1] {
        let mut read = [9.0; N];
        taps.fill(|k| [i as f32 + 1.0, (N - 1 - i) as f32 + 1.0, k as f32 + 1.0]);
        taps.read(&padded, 0..N, &mut read);
        assert_eq!(read, volume[(i * N + N - 1 - i) * N..][..N]);
        taps.fill(|_| [f32::NAN, -1e30, 1e30]);
        taps.read(&padded, 0..N, &mut read);
        assert_eq!(read, [0.0; N], "held to the layer of zeros");
    }
}

#[test]
fn a_position_at_a_centre_reads_that_cell() {
    centres_read_their_cells::<32>();
    centres_read_their_cells::<64>();
    centres_read_their_cells::<128>();
    centres_read_their_cells::<256>();
}

#[test]
fn holes_in_a_volume_are_refused() {
    let camera = Camera::orbit(0.0, 0.0, 0.0, 2.0);
    for hole in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut broken = noise::<SIDE>();
        broken[CELLS - 1] = hole;
        let mut out = vec![0.0; CELLS];
        assert!(to_camera_grid::<SIDE>(&broken, &[camera], &mut out).is_err());
        assert!(to_world_grid::<SIDE>(&broken, &[camera], &mut out).is_err());
    }
}

/// The padded copy of one size is no copy of another.
#[test]
fn sizes_may_take_turns() {
    let camera = [Camera::orbit(37.5, 38.0, 0.0, 2.0)];
    let (small, large) = (noise::<32>(), noise::<SIDE>());
    let mut seen = [(); 4].map(|()| vec![0.0; CELLS]);
    for [first, second] in seen.as_chunks_mut().0 {
        to_camera_grid::<32>(&small, &camera, &mut first[..32 * 32 * 32]).unwrap();
        to_camera_grid::<SIDE>(&large, &camera, second).unwrap();
    }
    assert!(seen[0] == seen[2] && seen[1] == seen[3]);
}

/// World -> camera -> world on a smooth blob loses little.
#[test]
fn a_smooth_field_comes_back() {
    let blob: Vec<f32> = (0..CELLS)
        .map(|i| {
            let p = Vec3::from([i / 4096, i / 64 % 64, i % 64].map(|c| voxel_center(c) as f32));
            (-(p - Vec3::new(0.05, -0.1, 0.0)).length_squared() / 0.02).exp()
        })
        .collect();
    for azimuth in [0.0, 37.5, 200.0] {
        let camera = Camera::orbit(azimuth, 38.0, 0.0, 2.0);
        let (mut seen, mut back) = (vec![0.0; CELLS], vec![0.0; CELLS]);
        to_camera_grid::<SIDE>(&blob, &[camera], &mut seen).unwrap();
        to_world_grid::<SIDE>(&seen, &[camera], &mut back).unwrap();
        let worst = blob.iter().zip(&back).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst < 0.03, "{worst}");
    }
}

#[test]
fn a_constant_field_stays_constant_well_inside() {
    let camera = Camera::orbit(52.5, 38.0, 0.0, 2.0);
    let (mut seen, mut back) = (vec![9.0; CELLS], vec![-1.0; CELLS]);
    to_camera_grid::<SIDE>(&vec![1.0; CELLS], &[camera], &mut seen).unwrap();
    assert!((seen[32 * 4096 + 32 * 64 + 32] - 1.0).abs() < 1e-6);
    assert_eq!(seen[0], 0.0, "outside the world grid");
    to_world_grid::<SIDE>(&vec![1.0; CELLS], &[camera], &mut back).unwrap();
    assert!((back[32 * 4096 + 32 * 64 + 32] - 1.0).abs() < 1e-6);
    assert!(back.contains(&-1.0), "some corners lie outside the frustum and stay");
}
