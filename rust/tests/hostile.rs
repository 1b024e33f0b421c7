//! Any numbers at all, given to every kernel that takes arrays from outside: a result without NaN, or an error; no
//! panic, and (in this profile) no overflow of an integer. `PROPTEST_CASES` says how many of each.

use _core::batch::SampleConfig;
use _core::buffers::{Buffers, fill_frustum};
use _core::camera::{Camera, IMAGE, PACKED};
use _core::csg::{NARROW, Shape, WIDE};
use _core::fit::Fit;
use _core::lines::{self, LineConfig};
use _core::mesh::{BilateralSettings, bilateral};
use _core::random::Random;
use _core::solid::{self, Finer};
use _core::style::LineStyle;
use _core::subject::Subject;
use _core::surface::Surface;
use _core::trace::TraceConfig;
use _core::voxel::{BitGrid, CELLS};
use _core::{carve, evidence, isosurface, kinds, lift, resample, stroke, trace};
use proptest::collection::vec;
use proptest::prelude::*;

const SPECIAL: [f64; 16] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    5e-324,
    1e154,
    -1e154,
    1e-154,
    1e20,
];

/// Mostly numbers of the world, at times special ones, and at times any bits.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        24 => -0.6..0.6,
        4 => -3.0..3.0,
        2 => prop::sample::select(SPECIAL.to_vec()),
        1 => any::<u64>().prop_map(f64::from_bits),
    ]
}

/// The same, without those that are refused at once.
fn finite() -> impl Strategy<Value = f64> {
    number().prop_map(|v| if v.is_finite() { v } else { 0.25 })
}

fn mesh() -> impl Strategy<Value = (Vec<[f64; 3]>, Vec<[i64; 3]>)> {
    let vertices =
        prop_oneof![vec(prop::array::uniform3(finite()), 1..12), vec(prop::array::uniform3(number()), 0..12)];
    (vertices, vec(prop::array::uniform3(any::<i64>()), 0..20), 0..10u8).prop_map(
        |(vertices, faces, wild)| {
            let count = vertices.len().max(1) as i64;
            let kept = faces.into_iter().map(|f| if wild == 0 { f } else { f.map(|i| i.rem_euclid(count)) });
            let kept = kept.collect();
            (vertices, kept)
        },
    )
}

fn rows<const N: usize>() -> impl Strategy<Value = Vec<[f64; N]>> {
    let one = (0..27u8, 0..10u8, prop::array::uniform::<_, N>(number()));
    vec(one, 0..8).prop_map(|rows| {
        let row = |(kind, op, mut row): (u8, u8, [f64; N])| {
            row[0] = f64::from(kind);
            row[1] = f64::from(op.min(2) / 2);
            (5..8).for_each(|i| row[i] = row[i].abs().max(f64::MIN_POSITIVE));
            row
        };
        rows.into_iter().map(row).collect()
    })
}

/// Cameras that are let in: of any place, turned by quarters, with any field of view and planes.
fn camera() -> impl Strategy<Value = Camera> {
    let orbit = (-360.0..360.0, -90.0..90.0, -180.0..180.0, 0.05..9.0)
        .prop_map(|(azimuth, elevation, roll, distance)| Camera::orbit(azimuth, elevation, roll, distance));
    let turn = prop::sample::select(vec![[0, 1, 2], [1, 2, 0], [2, 0, 1]]);
    let anywhere = (prop::array::uniform3(finite()), turn, finite(), finite(), finite()).prop_filter_map(
        "a camera",
        |(position, turn, fov, near, far)| {
            let mut row = [0.0; PACKED];
            row[..3].copy_from_slice(&position);
            turn.iter().enumerate().for_each(|(i, &axis)| row[3 + 3 * i + axis] = 1.0);
            row[12..].copy_from_slice(&[fov.abs() * 90.0, near.abs(), near.abs() + far.abs()]);
            Camera::from_packed(&row).ok()
        },
    );
    prop_oneof![orbit, anywhere]
}

fn check(seen: &Buffers) {
    assert!(seen.depth.iter().all(|d| !d.is_nan()), "NaN in depth");
    assert!(seen.normal.as_flattened().iter().all(|n| !n.is_nan()), "NaN in a normal");
}

/// As many cases as `PROPTEST_CASES` says, or a share of them; findings become tests of their own, and no files.
fn cases(share: u32) -> ProptestConfig {
    let all = ProptestConfig { failure_persistence: None, ..ProptestConfig::default() };
    ProptestConfig { cases: all.cases / share + 1, ..all }
}

proptest! {
    #![proptest_config(cases(1))]

    #[test]
    fn any_camera_is_one_or_refused(row in prop::array::uniform15(number())) {
        if let Ok(camera) = Camera::from_packed(&row) {
            prop_assert_eq!(camera.to_packed(), row);
        }
    }

    #[test]
    fn any_mesh_has_voxels_and_buffers_or_is_refused((vertices, faces) in mesh(), camera in camera(), degrees in finite()) {
        let grid = solid::voxelize(&vertices, &faces);
        let surface = Surface::new(&vertices, &faces, (degrees * 90.0).clamp(0.0, 90.0));
        prop_assert_eq!(grid.is_err(), surface.is_err());
        if let Ok(seen) = surface.map(|surface| Buffers::of_mesh(&surface, &camera, 24)) {
            seen.iter().for_each(check);
        }
        prop_assert!(Surface::new(&vertices, &faces, f64::NAN).is_err());
    }

    #[test]
    fn any_shape_has_voxels_and_buffers_or_is_refused(
        wide in rows::<WIDE>(), narrow in rows::<NARROW>(), camera in camera(),
    ) {
        for shape in [Shape::from_rows(&wide), Shape::from_rows(&narrow)].into_iter().flatten() {
            BitGrid::of_shape(&shape);
            if let Ok(seen) = Buffers::of_shape(&shape, &camera, 24) {
                check(&seen);
            }
            if let Some((fitted, grid)) = (Fit { cover: 1.2, min_occupancy: 0.0, min_extent: 1 }).fit(shape) {
                prop_assert!(grid.count() > 0);
                let (low, high) = fitted.bounds();
                prop_assert!(low.is_finite() && high.is_finite());
            }
        }
    }

    #[test]
    fn any_faces_are_smoothed_or_refused((vertices, faces) in mesh(), spatial in number(), normal in number()) {
        let mut vertices = vertices;
        let faces: Vec<[u32; 3]> = faces.iter().map(|f| f.map(|i| i as u32)).collect();
        let settings = BilateralSettings { iterations: 2, sigma_spatial: spatial.abs(), sigma_normal: normal.abs() };
        if bilateral(&mut vertices, &faces, &settings).is_ok() {
            prop_assert!(vertices.as_flattened().iter().all(|v| v.is_finite()));
        }
    }

    #[test]
    fn any_text_is_a_config_or_refused(text in ".{0,60}", key in "[a-z_]{1,12}", value in number(), whole in any::<i64>()) {
        for text in [text, format!("{{\"{key}\": {value}}}"), format!("{{\"{key}\": [{whole}, {value}]}}")] {
            let _ = (SampleConfig::from_json(&text), LineStyle::from_json(&text));
        }
    }
}

proptest! {
    // What draws whole pictures, or reads whole grids, takes a while in this profile.
    #![proptest_config(cases(8))]

    #[test]
    fn any_mesh_is_drawn_or_refused((vertices, faces) in mesh(), camera in camera()) {
        let mut ink = vec![0; IMAGE * IMAGE];
        if let Ok(surface) = Surface::new(&vertices, &faces, 40.0) {
            let _ = surface.draw(&camera, &LineConfig::default(), &mut ink);
        }
        if let Ok(finer) = Finer::of_mesh(&vertices, &faces) {
            finer.fill_frustum(&camera, 1, &mut vec![0; CELLS]);
        }
    }

    #[test]
    fn any_shape_is_drawn_or_refused(rows in rows::<WIDE>(), camera in camera()) {
        if let Ok(shape) = Shape::from_rows(&rows) {
            let _ = lines::draw(&shape, &camera, &LineConfig::default(), &mut vec![0; IMAGE * IMAGE]);
            let _ = kinds::hidden_lines(&shape, &camera);
            let _ = fill_frustum(&shape, &camera, 1, &mut vec![0; CELLS]);
        }
    }

    #[test]
    fn any_grid_is_resampled_or_refused(numbers in vec(number(), 64), camera in camera()) {
        let cells: Vec<f32> = (0..32 * 32 * 32).map(|i| numbers[i * i % 61] as f32).collect();
        let finite = cells.iter().all(|v| v.is_finite());
        let mut out = vec![0.0; cells.len()];
        prop_assert_eq!(resample::to_camera_grid::<32>(&cells, &[camera], &mut out).is_ok(), finite);
        prop_assert_eq!(resample::to_world_grid::<32>(&cells, &[camera], &mut out).is_ok(), finite);
    }

    #[test]
    fn any_features_are_read(numbers in vec(finite(), 64), camera in camera()) {
        let features: Vec<f32> = (0..lift::ENTRIES).map(|i| numbers[i % 61] as f32).collect();
        let mut out = vec![0.0; 2 * lift::HALF];
        lift::read(&camera, &features, 1, 0, &mut out);
        lift::read_transposed(&camera, &out, 1, &mut vec![0.0; lift::ENTRIES]);
        let mut taps = vec![0; 2 * lift::HALF * lift::TAPS];
        lift::fill_taps(&camera, &mut taps, &mut vec![0.0; 2 * lift::HALF * lift::TAPS]);
        prop_assert!(taps.iter().all(|&row| (0..lift::ENTRIES as i32).contains(&row)));
    }

    #[test]
    fn any_volume_is_seen(numbers in vec(finite(), 64), level in number(), camera in camera()) {
        let cells: Vec<f32> = (0..CELLS).map(|i| numbers[i * i % 61] as f32).collect();
        if cells.iter().all(|v| v.is_finite()) {
            check(&isosurface::cast(&cells, level as f32, &camera, 24));
        }
    }

    #[test]
    fn any_pixels_are_a_drawing(seed in any::<u64>(), share in 0.0..1.0, step in 1..300usize, camera in camera()) {
        let mut random = Random::new(seed, 0, 0);
        let pixels: Vec<u8> = (0..IMAGE * IMAGE)
            .map(|_| if random.chance(share * share) { random.below(256) as u8 } else { 0 })
            .collect();
        let inside = carve::silhouette(&pixels);
        carve::carve(&[inside], &[camera], &mut vec![0; CELLS]);
        let mut fields = vec![0; evidence::FIELDS];
        evidence::fill_fields(&pixels, &mut fields);
        evidence::gather(&fields, &[camera], &mut vec![0; 3 * CELLS / 2]);
        for through in [false, true] {
            let strokes = trace::trace(&pixels, 64, TraceConfig { step, through });
            prop_assert!(strokes.iter().all(|s| s.points.as_flattened().iter().all(|p| p.is_finite())));
        }
        let style = SampleConfig::default().styles.draw(&mut random);
        stroke::redraw(&pixels, &style, &mut random, &mut vec![0; IMAGE * IMAGE]);
    }
}
