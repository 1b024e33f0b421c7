//! Hatching: strokes across the light in the shade, the closer the darker (Jobard and Lefer's evenly spaced streamlines).

use crate::buffers::Buffers;
use crate::camera::{Camera, IMAGE};
use crate::kinds::view;
use crate::stroke::STEP;
use crate::trace::{Point, Stroke};
use glam::{DVec3, Vec3};

/// Where light comes from, in the camera's axes: the left, above, and from behind the eye.
const LIGHT: DVec3 = DVec3::new(-0.46, -0.76, -0.46);
/// What is brighter has no strokes.
const BRIGHT: f64 = 0.62;
/// Pixels between strokes in the dark, and just before it is bright.
const DENSE: f64 = 3.5;
const SPARSE: f64 = 9.0;
/// Strokes may come so much nearer to each other than they begin.
const CLOSER: f64 = 0.6;
/// Pixels of the shortest and of the longest stroke.
const SHORTEST: usize = 5;
const LONGEST: usize = 160;
/// Normals that differ by more end a stroke (their cosine).
const SAME_FACE: f32 = 0.94;
/// Strokes keep so many pixels off the borders of surfaces.
const MARGIN: i64 = 1;

/// The strokes of an image's shade.
pub fn hatch(buffers: &Buffers, camera: &Camera) -> Vec<Stroke> {
    let field = Field::new(buffers, camera);
    let mut crowd = Crowd::new();
    let mut strokes = Vec::new();
    let mut seeds: Vec<Point> = Vec::new();
    for y in (2..IMAGE).step_by(3) {
        for x in (2..IMAGE).step_by(3) {
            seeds.push([x as f32, y as f32]);
            while let Some(seed) = seeds.pop() {
                let Some(shade) = field.at(seed) else { continue };
                if crowd.nearer(seed, 0.98 * shade.apart) {
                    continue;
                }
                let points = field.stroke(seed, &crowd);
                if points.len() <= SHORTEST {
                    continue;
                }
                points.iter().for_each(|&p| crowd.add(p));
                for p in points.iter().step_by(3) {
                    if let Some(Shade { way: [u, v], apart, .. }) = field.at(*p) {
                        let by = apart as f32;
                        seeds.push([p[0] - by * v, p[1] + by * u]);
                        seeds.push([p[0] + by * v, p[1] - by * u]);
                    }
                }
                strokes.push(Stroke { points: points.into_iter().step_by(STEP).collect(), closed: false });
            }
        }
    }
    strokes
}

/// The direction of strokes at each pixel in the shade, and how far they are apart.
struct Field {
    shades: Vec<Option<Shade>>,
}

#[derive(Clone, Copy)]
struct Shade {
    way: Point,
    apart: f64,
    normal: Vec3,
}

impl Field {
    fn new(buffers: &Buffers, camera: &Camera) -> Self {
        let [right, down, forward] = camera.axes;
        let light = (right * LIGHT.x + down * LIGHT.y + forward * LIGHT.z).normalize();
        let shade = |i: usize| {
            let (x, y) = ((i % IMAGE) as i64, (i / IMAGE) as i64);
            let normal = Vec3::from(buffers.normal[i]);
            let near = 1.0 / buffers.depth[i];
            let whole = (-MARGIN..=MARGIN).all(|k| {
                [[k, 0], [0, k]].into_iter().all(|[dx, dy]| {
                    let side = 0..IMAGE as i64;
                    let inside = side.contains(&(x + dx)) && side.contains(&(y + dy));
                    let j = if inside { ((y + dy) * IMAGE as i64 + x + dx) as usize } else { i };
                    let step = 1.0 / buffers.depth[j] - near;
                    inside
                        && buffers.depth[j].is_finite()
                        && step.abs() < 0.03
                        && normal.dot(Vec3::from(buffers.normal[j])) > SAME_FACE
                })
            });
            let bright = normal.as_dvec3().dot(light).max(0.0);
            if !buffers.depth[i].is_finite() || bright > BRIGHT || !whole {
                return None;
            }
            // Across the light, within the surface; as the image has it.
            let across = normal.as_dvec3().cross(light);
            let ray = view(camera, i);
            let (rx, ry) = (right.dot(ray), down.dot(ray));
            let away = forward.dot(across);
            let (u, v) = (right.dot(across) - rx * away, down.dot(across) - ry * away);
            let long = (u * u + v * v).sqrt();
            let apart = DENSE + (SPARSE - DENSE) * (bright / BRIGHT) * (bright / BRIGHT);
            (long > 1e-3).then(|| Shade { way: [(u / long) as f32, (v / long) as f32], apart, normal })
        };
        Self { shades: (0..IMAGE * IMAGE).map(shade).collect() }
    }

    fn at(&self, [x, y]: Point) -> Option<Shade> {
        let last = (IMAGE - 1) as f32;
        let inside = (0.0..=last).contains(&x) && (0.0..=last).contains(&y);
        if inside { self.shades[(y + 0.5) as usize * IMAGE + (x + 0.5) as usize] } else { None }
    }

    /// The stroke through a point, a pixel from point to point.
    fn stroke(&self, seed: Point, crowd: &Crowd) -> Vec<Point> {
        let mut points = Vec::new();
        for sign in [-1.0, 1.0] {
            points.reverse();
            let mut at = seed;
            let mut before: Option<Shade> = None;
            while let Some(shade) = self.at(at) {
                let same = before.is_none_or(|b| b.normal.dot(shade.normal) > SAME_FACE);
                if !same || points.len() > LONGEST || crowd.nearer(at, CLOSER * shade.apart) {
                    break;
                }
                if before.is_some() || sign < 0.0 {
                    points.push(at);
                }
                at = [at[0] + sign * shade.way[0], at[1] + sign * shade.way[1]];
                before = Some(shade);
            }
        }
        points
    }
}

/// Points of strokes, found by place.
struct Crowd {
    cells: Vec<Vec<Point>>,
}

const CELL: f32 = 8.0;
const CELLS: usize = IMAGE / CELL as usize;

impl Crowd {
    fn new() -> Self {
        Self { cells: vec![Vec::new(); CELLS * CELLS] }
    }

    fn add(&mut self, point: Point) {
        let [x, y] = point.map(|v| (v / CELL) as usize);
        self.cells[y.min(CELLS - 1) * CELLS + x.min(CELLS - 1)].push(point);
    }

    /// Whether any point is nearer than that, which is at most twice the side of a cell.
    fn nearer(&self, [x, y]: Point, than: f64) -> bool {
        let reach = (than as f32 / CELL).ceil() as usize;
        let cells = |v: f32| {
            let cell = (v / CELL) as usize;
            cell.saturating_sub(reach)..(cell + reach + 1).min(CELLS)
        };
        let least = (than * than) as f32;
        cells(y).any(|row| {
            cells(x).any(|col| {
                let near = |p: &Point| (p[0] - x) * (p[0] - x) + (p[1] - y) * (p[1] - y) < least;
                self.cells[row * CELLS + col].iter().any(near)
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::csg::{Kind, Primitive, Shape};

    #[test]
    fn shade_has_strokes_apart_and_light_has_none() {
        let half = DVec3::splat(0.3);
        let primitive = Primitive { kind: Kind::Cuboid, additive: true, center: DVec3::ZERO, half };
        let shape = Shape::new(vec![primitive]).unwrap();
        let camera = Camera::orbit(37.5, 38.0, 0.0, 2.0);
        let buffers = Buffers::of_shape(&shape, &camera, IMAGE).unwrap();
        let strokes = hatch(&buffers, &camera);
        assert!(strokes.len() > 10);
        let normal = |p: &Point| buffers.normal[p[1].round() as usize * IMAGE + p[0].round() as usize];
        assert!(strokes.iter().flat_map(|s| &s.points).all(|p| normal(p)[1] == 0.0), "the top is lit");
        for (i, a) in strokes.iter().enumerate() {
            for b in &strokes[..i] {
                let near = |p: &Point, q: &Point| (p[0] - q[0]).hypot(p[1] - q[1]);
                let least = a.points.iter().flat_map(|p| b.points.iter().map(move |q| near(p, q)));
                assert!(least.fold(f32::INFINITY, f32::min) >= (CLOSER * DENSE) as f32);
            }
        }
        let [faces_x, faces_z] = [0, 2].map(|axis| {
            let of_face = |s: &&Stroke| normal(&s.points[s.points.len() / 2])[axis] != 0.0;
            strokes.iter().filter(of_face).map(|s| s.points.len()).sum::<usize>()
        });
        assert!(faces_x != faces_z, "one side is darker");
    }
}
