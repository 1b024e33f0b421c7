use super::*;
use crate::camera::VIEWPOINTS;
use crate::surface::CREASE_DEGREES;

type Mesh = (Vec<[f64; 3]>, Vec<[i64; 3]>);

/// A ball of rings and sectors, of radius 1.
fn ball(rings: i64, sectors: i64) -> Mesh {
    let place = |i: i64, j: i64| {
        let (latitude, longitude) = (
            i as f64 / rings as f64 * std::f64::consts::PI,
            j as f64 / sectors as f64 * std::f64::consts::TAU,
        );
        [latitude.sin() * longitude.cos(), latitude.cos(), latitude.sin() * longitude.sin()]
    };
    let vertices = (0..=rings).flat_map(|i| (0..sectors).map(move |j| place(i, j))).collect();
    let name = |i: i64, j: i64| i * sectors + j % sectors;
    let square = |i: i64, j: i64| {
        let [a, b, c, d] = [name(i, j), name(i, j + 1), name(i + 1, j + 1), name(i + 1, j)];
        [[a, b, c], [a, c, d]]
    };
    (vertices, (0..rings).flat_map(|i| (0..sectors).flat_map(move |j| square(i, j))).collect())
}

fn surface((vertices, faces): &Mesh) -> Surface {
    Surface::new(vertices, faces, CREASE_DEGREES).unwrap()
}

#[test]
fn a_ball_has_its_depth_and_its_normals() {
    let ball = surface(&ball(24, 48));
    let radius = 0.5 / 1.2;
    for (azimuth, elevation) in VIEWPOINTS {
        let camera = Camera::orbit(azimuth, elevation, 0.0, 2.0);
        let seen = Buffers::of_mesh(&ball, &camera, 128).unwrap();
        let mut count = 0;
        for (i, &depth) in seen.depth.iter().enumerate() {
            let at = |i: usize| (2 * i + 1) as f64 / 128.0 - 1.0;
            let ray = camera.ray(at(i % 128), at(i / 128));
            let (far, square) = (camera.position.dot(ray), ray.length_squared());
            let inside = far * far - square * (4.0 - radius * radius);
            // The mesh lies at most 0.5 % of the radius below the ball.
            if inside < 0.0 {
                assert!(depth.is_infinite());
            } else if depth.is_finite() {
                count += 1;
                let point = camera.position + ray * f64::from(depth);
                assert!((point.length() - radius).abs() < 0.006 * radius, "{}", point.length());
                let normal = DVec3::from(seen.normal[i].map(f64::from));
                assert!((normal.length() - 1.0).abs() < 1e-6 && normal.dot(ray) < 1e-6);
                assert!(normal.dot(point.normalize()) > 0.998, "{}", normal.dot(point.normalize()));
            }
        }
        let tangent = (radius / 2.0f64).asin().tan() / camera.half_image * 64.0;
        let area = std::f64::consts::PI * tangent * tangent;
        assert!((f64::from(count) / area - 1.0).abs() < 0.02, "{count} {area}");
    }
}

#[test]
fn every_instruction_set_sees_the_same() {
    let ball = surface(&ball(9, 14));
    for (azimuth, elevation) in VIEWPOINTS {
        let camera = Camera::orbit(azimuth, elevation, 0.0, 2.0);
        let (mut best, mut baseline) = (Seen::nothing(100), Seen::nothing(100));
        rasterise(&ball, &camera, &mut best);
        add_faces(&ball, &camera, &mut baseline);
        assert!(best.nearness == baseline.nearness && best.face == baseline.face);
    }
}

#[test]
fn no_ray_slips_through() {
    // Seen from inside its bounding box, a fine ball without a face on the far side fills the image but for that face.
    let mesh = ball(40, 80);
    let open = Surface::new(&mesh.0, &mesh.1[3..], CREASE_DEGREES).unwrap();
    let camera = Camera::orbit(10.0, 20.0, 0.0, 0.44);
    let wide = Camera::new(camera.position, camera.axes, 20.0, 0.01, 2.0).unwrap();
    let seen = Buffers::of_mesh(&open, &wide, 256).unwrap();
    assert!(seen.depth.iter().all(|d| d.is_finite()));
}

#[test]
fn faces_may_reach_behind_the_eye() {
    // A floor under the eye, which stands in its middle and looks level.
    let vertices = [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]];
    let surface = Surface::new(&vertices, &[[0, 1, 2], [0, 2, 3], [1, 1, 3]], CREASE_DEGREES).unwrap();
    assert_eq!(surface.faces.len(), 2, "a face without area is left out");
    let ahead = Camera::orbit(0.0, 0.0, 0.0, 2.0);
    let camera = Camera::new(DVec3::ZERO, ahead.axes, 90.0, 0.1, 3.0).unwrap();
    let seen = Buffers::of_mesh(&surface, &camera, 64).unwrap();
    let above = Camera::new(DVec3::new(0.0, 0.1, 0.0), ahead.axes, 90.0, 0.1, 3.0).unwrap();
    assert!(seen.depth.iter().all(|d| d.is_infinite()), "edge-on");
    let seen = Buffers::of_mesh(&surface, &above, 64).unwrap();
    let half = 0.5 / 1.2;
    for (i, &depth) in seen.depth.iter().enumerate() {
        let down = (2 * (i / 64) + 1) as f64 / 64.0 - 1.0;
        let expected = 0.1 / down;
        let across = ((2 * (i % 64) + 1) as f64 / 64.0 - 1.0) * expected;
        let hit = down > 0.0 && expected < half && across.abs() < half;
        assert_eq!(depth.is_finite(), hit, "{i}");
        if hit {
            assert!((f64::from(depth) - expected).abs() < 1e-6);
            assert_eq!(seen.normal[i], [0.0, 1.0, 0.0]);
        }
    }
}

#[test]
fn an_eye_inside_is_refused() {
    let ball = surface(&ball(8, 12));
    let camera = Camera::orbit(0.0, 0.0, 0.0, 0.3);
    assert!(matches!(Buffers::of_mesh(&ball, &camera, 8), Err(CoreError::EyeInside(_))));
    assert!(
        Buffers::of_mesh(&ball, &Camera::orbit(45.0, 35.0, 0.0, 0.45), 8).is_ok(),
        "in a corner of its box"
    );
}
