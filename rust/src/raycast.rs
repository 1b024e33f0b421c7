//! Where rays are inside a shape: each primitive is one interval of a ray, and the last one that holds a point decides.
//! No tree, no sampling.
//!
//! Rays go in tiles of 8 x 8, which share a list of primitives. Points of a ray are named by their nearness, see
//! `intersect.rs`.

#![expect(clippy::needless_range_loop, reason = "loops over the rays of a tile index many arrays at once")]

use crate::camera::Camera;
use crate::csg::Shape;
use crate::error::CoreError;
pub use crate::intersect::{Lanes, RAYS, TILE};
use crate::intersect::{NEAREST, Placed, less};

/// Gaps and slivers shorter than this (world units) are rounding, not geometry.
const EPSILON: f64 = 1e-9;

/// A shape prepared for the rays of one camera.
pub struct RayCaster<'a> {
    camera: &'a Camera,
    primitives: Vec<Placed>,
}

impl<'a> RayCaster<'a> {
    /// Refuses an eye inside the shape.
    pub fn new(shape: &Shape, camera: &'a Camera) -> Result<Self, CoreError> {
        if shape.contains(camera.position) {
            return Err(CoreError::EyeInside(camera.position.to_array()));
        }
        let primitives = shape.primitives().iter().map(|p| Placed::new(p, camera)).collect();
        Ok(Self { camera, primitives })
    }

    pub fn camera(&self) -> &Camera {
        self.camera
    }
}

/// The rays of one tile, and where they are inside each of the primitives that they meet.
pub struct Tile {
    rows: [f64; TILE],
    /// The primitives that may be seen in these rows.
    candidates: Vec<usize>,
    /// One unit of depth along each ray, in the world.
    direction: [Lanes; 3],
    crossings: Vec<Crossing>,
    /// How many of the crossings are of this tile.
    met: usize,
}

/// Where each ray is inside a primitive: from one nearness to a lesser one; from 0 to `NEAREST` for a ray that misses it.
#[derive(Clone)]
struct Crossing {
    primitive: usize,
    additive: bool,
    start: Lanes,
    end: Lanes,
}

/// The surface that each ray comes to next: how near it is, 0 for none, and whose it is by the number of the crossing.
pub struct Hits {
    pub nearness: Lanes,
    crossing: [u64; RAYS],
}

impl Tile {
    pub fn new(caster: &RayCaster) -> Self {
        let none = Crossing { primitive: 0, additive: true, start: [0.0; RAYS], end: [0.0; RAYS] };
        let crossings = vec![none; caster.primitives.iter().map(Placed::intervals).sum()];
        Self { rows: [0.0; TILE], candidates: Vec::new(), direction: [[0.0; RAYS]; 3], crossings, met: 0 }
    }

    /// Chooses the rows of the image (ascending, [-1, 1] units) that the tiles to come are in.
    #[inline(always)]
    pub fn choose(&mut self, caster: &RayCaster, rows: &[f64; TILE]) {
        self.rows = *rows;
        self.candidates.clear();
        for (index, placed) in caster.primitives.iter().enumerate() {
            if (placed.bounds[2] <= rows[TILE - 1]) & (rows[0] <= placed.bounds[3]) {
                self.candidates.push(index);
            }
        }
    }

    /// Casts rays through these columns of the chosen rows. Whether any meets anything.
    #[inline(always)]
    pub fn cast(&mut self, caster: &RayCaster, columns: &[f64; TILE]) -> bool {
        self.met = 0;
        let mut aimed = false;
        for i in 0..self.candidates.len() {
            let primitive = self.candidates[i];
            let placed = &caster.primitives[primitive];
            let additive = placed.primitive.additive;
            let seen = (placed.bounds[0] <= columns[TILE - 1]) & (columns[0] <= placed.bounds[1]);
            if !seen | ((self.met == 0) & !additive) {
                continue;
            }
            if !aimed {
                self.aim(caster.camera, columns);
                aimed = true;
            }
            let crossing = &mut self.crossings[self.met];
            (crossing.primitive, crossing.additive) = (primitive, additive);
            let met = placed.cross(&self.direction, &mut crossing.start, &mut crossing.end);
            match placed.arc() {
                Some(arc) if met => {
                    // In the box around it.
                    let (stretches, count) = arc.cross(&self.direction, &crossing.start, &crossing.end);
                    for [start, end] in &stretches[..count] {
                        self.crossings[self.met] = Crossing { primitive, additive, start: *start, end: *end };
                        self.met += 1;
                    }
                }
                _ => self.met += usize::from(met),
            }
        }
        self.met > 0
    }

    #[inline(always)]
    fn aim(&mut self, camera: &Camera, columns: &[f64; TILE]) {
        let h = camera.half_image;
        for (axis, direction) in self.direction.iter_mut().enumerate() {
            let [right, down, forward] = camera.axes.map(|a| a[axis]);
            for row in 0..TILE {
                for col in 0..TILE {
                    let (x, y) = (columns[col] * h, self.rows[row] * h);
                    direction[row * TILE + col] = right * x + down * y + forward;
                }
            }
        }
    }

    /// Where each ray enters the shape, in front of the eye; not before `from`, a point outside.
    ///
    /// That is where it enters an additive primitive, moved on to the end of every later subtractive one that holds
    /// the point.
    #[inline(always)]
    pub fn entries(&self, from: Option<&Lanes>) -> Hits {
        let crossings = &self.crossings[..self.met];
        let mut hits = Hits { nearness: [0.0; RAYS], crossing: [0; RAYS] };
        for number in (0..crossings.len()).filter(|&i| crossings[i].additive) {
            hits.offer(crossings, number, from);
        }
        hits
    }

    /// Where each ray leaves the shape after `from`, a point inside.
    #[inline(always)]
    pub fn exits(&self, from: &Lanes) -> Hits {
        let crossings = &self.crossings[..self.met];
        // It enters nothing, of which all additive primitives are taken away; or a subtractive one.
        let mut hits = Hits { nearness: *from, crossing: [0; RAYS] };
        hits.push(crossings, 0, true);
        for number in (0..crossings.len()).filter(|&i| !crossings[i].additive) {
            hits.offer(crossings, number, Some(from));
        }
        hits
    }

    /// Whether any ray may enter the shape again, having left it at `from`.
    #[inline(always)]
    pub fn goes_on(&self, from: &Lanes) -> bool {
        let mut any = 0;
        for crossing in self.crossings[..self.met].iter().filter(|c| c.additive) {
            for r in 0..RAYS {
                any |= u64::from(crossing.end[r] < from[r]);
            }
        }
        any != 0
    }

    /// The unit normals in the world where rays meet the shape, turned towards the eye; 0 where they do not.
    #[inline(always)]
    pub fn normals(&self, caster: &RayCaster, hits: &Hits) -> [Lanes; 3] {
        let mut normals = [[0.0; RAYS]; 3];
        for (number, crossing) in self.crossings[..self.met].iter().enumerate() {
            // How near the hits on this primitive are; 0 at other rays.
            let mut own = [0.0; RAYS];
            let mut any = 0;
            for r in 0..RAYS {
                own[r] = if hits.crossing[r] == number as u64 { hits.nearness[r] } else { 0.0 };
                any |= own[r].to_bits();
            }
            if any != 0 {
                caster.primitives[crossing.primitive].normals(&self.direction, own, &mut normals);
            }
        }
        normals
    }
}

impl Hits {
    /// How deep the surfaces are; infinite for none.
    #[inline(always)]
    pub fn depth(&self) -> Lanes {
        let mut depth = [0.0; RAYS];
        for r in 0..RAYS {
            depth[r] = 1.0 / self.nearness[r];
        }
        depth
    }

    /// Takes the first point in one primitive, not before `from`, but in no later one of the other sign, where that
    /// point is nearer.
    #[inline(always)]
    fn offer(&mut self, crossings: &[Crossing], number: usize, from: Option<&Lanes>) {
        let Crossing { start, end, additive, .. } = &crossings[number];
        let cut = crossings[number..].iter().any(|c| c.additive != *additive);
        if !cut && from.is_none() {
            for r in 0..RAYS {
                let nearer = (start[r] > self.nearness[r]) & (start[r] < NEAREST);
                self.nearness[r] = if nearer { start[r] } else { self.nearness[r] };
                self.crossing[r] = if nearer { number as u64 } else { self.crossing[r] };
            }
            return;
        }
        let from = from.unwrap_or(&[NEAREST; RAYS]);
        let mut first = Hits { nearness: *start, crossing: [number as u64; RAYS] };
        for r in 0..RAYS {
            first.nearness[r] = less(start[r], from[r]);
        }
        if cut {
            first.push(crossings, number + 1, !additive);
        }
        for r in 0..RAYS {
            let at = first.nearness[r];
            let begins = (at == start[r]) & (at < from[r]);
            let there = begins | (at - end[r] > EPSILON * at * at);
            let nearer = there & (at > self.nearness[r]) & (at < NEAREST);
            self.nearness[r] = if nearer { at } else { self.nearness[r] };
            self.crossing[r] = if nearer { first.crossing[r] } else { self.crossing[r] };
        }
    }

    /// Moves points on until they lie in none of the crossings of one sign from number `first` on.
    #[inline(always)]
    fn push(&mut self, crossings: &[Crossing], first: usize, additive: bool) {
        let others = crossings.iter().skip(first).filter(|c| c.additive == additive).count();
        let mut moved = others > 0;
        while moved {
            moved = false;
            for (number, c) in
                crossings.iter().enumerate().skip(first).filter(|(_, c)| c.additive == additive)
            {
                let mut any = 0;
                for r in 0..RAYS {
                    let at = self.nearness[r];
                    let slack = EPSILON * at * at;
                    let within = (c.start[r] >= at - slack) & (at - slack > c.end[r]);
                    self.nearness[r] = if within { c.end[r] } else { at };
                    self.crossing[r] = if within { number as u64 } else { self.crossing[r] };
                    any |= u64::from(within);
                }
                moved |= (any != 0) & (others > 1);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::csg::tests::any_kind;
    use crate::csg::{Kind, Primitive};
    use glam::DVec3;
    use proptest::prelude::*;

    fn any_shape() -> impl Strategy<Value = Shape> {
        let triple = |lo: f64, hi: f64| [lo..hi, lo..hi, lo..hi];
        let primitive = (any_kind(), any::<bool>(), triple(-0.3, 0.3), triple(0.02, 0.25)).prop_map(
            |(kind, additive, center, half)| Primitive {
                kind,
                additive,
                center: center.into(),
                half: half.into(),
            },
        );
        prop::collection::vec(primitive, 1..9).prop_map(|p| Shape::new(p).unwrap())
    }

    /// The stretches of one ray inside the shape; the other rays of its tile go elsewhere.
    fn spans(shape: &Shape, camera: &Camera, x: f64, y: f64) -> Vec<(f64, f64)> {
        let (_, tile) = cast(shape, camera, x, y);
        let (mut from, mut spans) = (None, Vec::new());
        loop {
            let entries = tile.entries(from.as_ref());
            let exits = tile.exits(&entries.nearness);
            if entries.nearness[0] == 0.0 {
                return spans;
            }
            spans.push((entries.depth()[0], exits.depth()[0]));
            from = Some(exits.nearness);
        }
    }

    fn normal(shape: &Shape, camera: &Camera, x: f64, y: f64) -> DVec3 {
        let (caster, tile) = cast(shape, camera, x, y);
        DVec3::from(tile.normals(&caster, &tile.entries(None)).map(|n| n[0]))
    }

    fn cast<'a>(shape: &Shape, camera: &'a Camera, x: f64, y: f64) -> (RayCaster<'a>, Tile) {
        let caster = RayCaster::new(shape, camera).unwrap();
        let mut tile = Tile::new(&caster);
        let from = |at: f64| std::array::from_fn(|i| at + 0.03 * i as f64);
        tile.choose(&caster, &from(y));
        tile.cast(&caster, &from(x));
        (caster, tile)
    }

    proptest! {
        #[test]
        fn spans_agree_with_points_along_the_ray(
            shape in any_shape(), x in -0.9..0.9, y in -0.9..0.9, azimuth in 0.0..360.0, elevation in -80.0..80.0
        ) {
            let camera = Camera::orbit(azimuth, elevation, 0.0, 2.0);
            let direction = camera.ray(x, y);
            let spans = spans(&shape, &camera, x, y);
            for pair in spans.windows(2) {
                prop_assert!(pair[0].1 < pair[1].0);
            }
            for k in 0..400 {
                let depth = 1.25 + 1.5 * (f64::from(k) + 0.37) / 400.0;
                let near_an_end = spans.iter().any(|s| (s.0 - depth).abs().min((s.1 - depth).abs()) < 1e-7);
                if !near_an_end {
                    let within = spans.iter().any(|s| s.0 < depth && depth < s.1);
                    prop_assert_eq!(within, shape.contains(camera.position + direction * depth));
                }
            }
        }
    }

    #[test]
    fn a_shared_face_leaves_no_gap_and_a_hole_shows_its_far_wall() {
        let cuboid = |center: [f64; 3], half: [f64; 3], additive| Primitive {
            kind: Kind::Cuboid,
            additive,
            center: center.into(),
            half: half.into(),
        };
        let shape = Shape::new(vec![
            cuboid([0.1, 0.0, 0.0], [0.1, 0.2, 0.2], true),
            cuboid([-0.1, 0.0, 0.0], [0.1, 0.2, 0.2], true),
            cuboid([0.2, 0.0, 0.0], [0.1, 0.1, 0.1], false),
        ])
        .unwrap();
        let camera = Camera::orbit(0.0, 0.0, 0.0, 2.0);
        let spans = spans(&shape, &camera, 0.0, 0.0);
        assert_eq!(spans.len(), 1);
        assert!((spans[0].0 - 1.9).abs() < 1e-12 && (spans[0].1 - 2.2).abs() < 1e-12);
        let normal = normal(&shape, &camera, 0.0, 0.0);
        assert!((normal - DVec3::X).length() < 1e-12, "{normal}");
    }

    #[test]
    fn a_shape_has_any_number_of_primitives() {
        // Shells around each other: every other cuboid is taken away again.
        let half = |i: usize| 0.5 - i as f64 / 256.0;
        let shell = |i: usize| Primitive {
            kind: Kind::Cuboid,
            additive: i.is_multiple_of(2),
            center: DVec3::ZERO,
            half: DVec3::splat(half(i)),
        };
        let shape = Shape::new((0..100).map(shell).collect()).unwrap();
        let spans = spans(&shape, &Camera::orbit(0.0, 0.0, 0.0, 2.0), 0.0, 0.0);
        assert_eq!(spans.len(), 100);
        for (i, (front, back)) in (0..50).map(|i| (2 * i, (spans[i], spans[99 - i]))) {
            let ends = [front.0 - 2.0, front.1 - 2.0, 2.0 - back.1, 2.0 - back.0];
            let expected = [-half(i), -half(i + 1), -half(i), -half(i + 1)];
            assert!(ends.iter().zip(expected).all(|(end, half)| (end - half).abs() < 1e-12), "{i}: {ends:?}");
        }
    }

    #[test]
    fn a_slanted_face_has_its_depth_and_its_normal() {
        // Seen from the front, the ray along -x meets x / 0.2 + y / 0.1 = 0, the face of a ramp, at the origin; one
        // through height y at depth 1 where 2 - depth = -2 y depth.
        let camera = Camera::orbit(0.0, 0.0, 0.0, 2.0);
        let kind = Kind::Wedge { axis: 2, corner: [-1, -1] };
        let half = DVec3::new(0.2, 0.1, 0.3);
        let primitive = Primitive { kind, additive: true, center: DVec3::ZERO, half };
        let shape = Shape::new(vec![primitive]).unwrap();
        for image_y in [-0.1, 0.0, 0.1] {
            let spans = spans(&shape, &camera, 0.0, image_y);
            let expected = 2.0 / (1.0 - 2.0 * camera.ray(0.0, image_y).y);
            assert_eq!(spans.len(), 1);
            assert!((spans[0].0 - expected).abs() < 1e-12, "{} {expected}", spans[0].0);
            let normal = normal(&shape, &camera, 0.0, image_y);
            let across = DVec3::new(1.0, 2.0, 0.0).normalize();
            assert!((normal - across).length() < 1e-12, "{normal}");
        }
    }
}
