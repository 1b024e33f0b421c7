//! The paper's shape grammar (section 4.1): cuboids and cylinders grown onto each other, symmetric about z = 0;
//! and wedges, cut edges, bores, bent sheets and bars, which are ours, where a config asks for them.
//!
//! Only sums, products, quotients, square roots and comparisons of 64-bit floats are used, so a seed's shapes are
//! bit-identical on every machine.

use crate::csg::{Kind, Primitive, Shape, cross_axes};
use crate::error::CoreError;
use crate::fit::Fit;
use crate::random::Random;
use crate::voxel::{BitGrid, SIDE};
use glam::DVec3;
use serde::{Deserialize, Serialize};

mod bar;
mod bore;
mod sheet;
pub use bar::BarConfig;
pub use bore::BoreConfig;
pub use sheet::SheetConfig;

/// Every amplitude and count of the grammar. Pairs are ranges that are drawn from evenly; sizes are relative to
/// each other only, since the finished shape is scaled to the world grid.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct GrammarConfig {
    /// Least and most growth steps, the first primitive included; mirrored copies are not counted.
    pub steps: [usize; 2],
    /// Share of cylinders.
    pub cylinders: f64,
    /// Share of wedges; with the cylinders at most 1. The paper has none.
    pub wedges: f64,
    /// Share of the added wedges that are cut down to slanted slabs, such as a strut or half a roof.
    pub slabs: f64,
    /// Thickness of a slab as a share of its wedge's.
    pub slab_thickness: [f64; 2],
    /// Share of the added cuboids whose edges along one axis are cut off: a house with its roof, a nut.
    pub chamfered: f64,
    /// How much of a side such a cut takes, at most one half; every second one takes that half, so that two of them meet in
    /// a ridge.
    pub chamfer: [f64; 2],
    /// Share of the cuboids cut at all four edges that become a hexagonal or octagonal bar.
    pub regular: f64,
    /// Holes along the axis of an added cuboid or cylinder: a ring, a pipe, a cup; the paper has none.
    pub bores: BoreConfig,
    /// Bent sheets to begin with; the paper has none.
    pub sheets: SheetConfig,
    /// Hexagonal and octagonal bars to begin with; the paper has none.
    pub bars: BarConfig,
    /// Share of subtracted primitives.
    pub subtracted: f64,
    /// Half sizes of the first primitive.
    pub first_half: [f64; 2],
    /// Half sizes of the others.
    pub half: [f64; 2],
    /// Chance that a primitive is displaced along its face, in each of the two directions.
    pub displaced: f64,
    /// Largest such displacement, in half sizes of the primitive that it is placed on.
    pub displacement: f64,
    /// Chance that a cuboid or wedge is as wide as what it is placed on, in each of the two directions along the face: a
    /// roof on its house.
    pub fitted: f64,
    /// Deepest overlap with that primitive, in half sizes of the smaller.
    pub overlap: f64,
    /// How far a subtracted primitive's centre lies from the face, in its own half sizes.
    pub sink: f64,
    /// The world grid covers this much of the largest side: the paper's 120 %.
    pub cover: f64,
    /// Least share of the world grid that is occupied.
    pub min_occupancy: f64,
    /// Smallest extent along any axis, in voxels.
    pub min_extent: usize,
    /// How often to try before giving up.
    pub attempts: u32,
}

impl Default for GrammarConfig {
    fn default() -> Self {
        Self {
            steps: [2, 10],
            cylinders: 0.4,
            wedges: 0.0,
            slabs: 0.0,
            slab_thickness: [0.15, 0.5],
            chamfered: 0.0,
            chamfer: [0.1, 0.5],
            regular: 0.0,
            bores: BoreConfig::default(),
            sheets: SheetConfig::default(),
            bars: BarConfig::default(),
            subtracted: 0.33,
            first_half: [0.1, 0.4],
            half: [0.03, 0.25],
            displaced: 0.5,
            displacement: 0.9,
            fitted: 0.0,
            overlap: 0.2,
            sink: 0.1,
            cover: 1.2,
            min_occupancy: 0.01,
            min_extent: 8,
            attempts: 1000,
        }
    }
}

impl GrammarConfig {
    /// Says which entry no shape could be drawn with.
    pub fn check(&self) -> Result<(), CoreError> {
        let bad = |message: &str| Err(CoreError::Config(format!("grammar.{message}")));
        let amplitude = |v: f64| v >= 0.0 && v.is_finite();
        match self {
            c if !(1..=c.steps[1]).contains(&c.steps[0]) => bad("steps must be [least, most], from 1"),
            c if c.steps[1] > 500 => bad("steps must be at most 500"),
            c if ![
                c.cylinders,
                c.wedges,
                c.slabs,
                c.chamfered,
                c.regular,
                c.fitted,
                c.subtracted,
                c.displaced,
            ]
            .into_iter()
            .all(is_share) =>
            {
                bad(
                    "cylinders, wedges, slabs, chamfered, regular, fitted, subtracted and displaced are shares between \
                     0 and 1",
                )
            }
            c if c.cylinders + c.wedges > 1.0 => bad("cylinders and wedges must be at most 1 together"),
            c if !(is_range(c.first_half) && is_range(c.half)) => {
                bad("first_half and half must be [least, most], more than 0")
            }
            c if !is_inner(c.slab_thickness) => bad("slab_thickness must be [least, most], between 0 and 1"),
            c if !(is_range(c.chamfer) && c.chamfer[1] <= 0.5) => {
                bad("chamfer must be [least, most], more than 0 and at most 0.5")
            }
            c if !(amplitude(c.displacement) && amplitude(c.overlap) && amplitude(c.sink)) => {
                bad("displacement, overlap and sink must be 0 or more")
            }
            c if !(c.cover >= 1.0 && c.cover.is_finite()) => bad("cover must be at least 1"),
            c if !(0.0..1.0).contains(&c.min_occupancy) => bad("min_occupancy must lie in [0, 1)"),
            c if c.min_extent >= SIDE => bad("min_extent must be less than 64"),
            c if c.attempts == 0 => bad("attempts must be at least 1"),
            c => c.bores.check().and_then(|()| c.sheets.check()).and_then(|()| c.bars.check()),
        }
    }

    /// Draws shapes until one is acceptable: one piece, not empty, not dust.
    pub fn draw(&self, random: &mut Random) -> Result<(Shape, BitGrid), CoreError> {
        let &Self { cover, min_occupancy, min_extent, .. } = self;
        let fit = Fit { cover, min_occupancy, min_extent };
        for _ in 0..self.attempts {
            let grown = Shape::new(self.grow(random))?;
            if let Some(accepted) = fit.fit(grown) {
                return Ok(accepted);
            }
        }
        let attempts = self.attempts;
        Err(CoreError::NoShape { attempts })
    }

    fn grow(&self, random: &mut Random) -> Vec<Primitive> {
        let steps = self.steps[0] + random.below(self.steps[1] - self.steps[0] + 1);
        let mut shape = Vec::new();
        if self.sheets.share > 0.0 && random.chance(self.sheets.share) {
            shape = self.sheets.draw(random);
        } else if self.bars.share > 0.0 && random.chance(self.bars.share) {
            shape = self.bars.draw(random);
            if random.chance(self.bars.alone) {
                return shape;
            }
        } else {
            let first = self.primitive(self.first_half, true, random);
            push_symmetric(&mut shape, first);
            self.cut(&mut shape, first, random);
        }
        for _ in 1..steps {
            let additive = !random.chance(self.subtracted);
            let mut new = self.primitive(self.half, additive, random);
            let faces: Vec<Primitive> = shape.iter().filter(|p| p.additive).copied().collect();
            self.place(&mut new, &faces[random.below(faces.len())], random);
            let added = shape.len();
            push_symmetric(&mut shape, new);
            let slab = additive && self.slabs > 0.0 && matches!(new.kind, Kind::Wedge { .. });
            if slab && random.chance(self.slabs) {
                let thickness = random.between(self.slab_thickness);
                shape.extend_from_within(added..);
                let cut = (added + shape.len()) / 2;
                shape[cut..].iter_mut().for_each(|wedge| *wedge = beyond_slab(*wedge, thickness));
            }
            self.cut(&mut shape, new, random);
        }
        shape
    }

    /// What is taken at once from a primitive that was just added: edges, and a bore.
    fn cut(&self, shape: &mut Vec<Primitive>, on: Primitive, random: &mut Random) {
        self.cut_edges(shape, on, random);
        if let Some(bore) = self.bores.draw(on, random) {
            push_symmetric(shape, bore);
        }
    }

    /// Cuts off edges of some of the added cuboids, along one axis: on one side or on both, mostly in pairs.
    fn cut_edges(&self, shape: &mut Vec<Primitive>, on: Primitive, random: &mut Random) {
        let may = self.chamfered > 0.0 && on.additive && on.kind == Kind::Cuboid;
        if !may || !random.chance(self.chamfered) {
            return;
        }
        let axis = random.below(3);
        let sides: &[i8] = [&[1, -1][..], &[1], &[-1]][random.below(3)];
        let ends: &[i8] = if random.chance(0.75) { &[1, -1] } else { &[1] };
        let mut size = [(); 2].map(|()| if random.chance(0.5) { 0.5 } else { random.between(self.chamfer) });
        let all_four = sides.len() == 2 && ends.len() == 2;
        if all_four && self.regular > 0.0 && random.chance(self.regular) {
            size = BARS[random.below(BARS.len())];
        }
        for (&u, &v) in ends.iter().flat_map(|u| sides.iter().map(move |v| (u, v))) {
            let edge = edge_of(on, axis, [u, v], size);
            if !shape.contains(&edge) {
                push_symmetric(shape, edge);
            }
        }
    }

    fn primitive(&self, half: [f64; 2], additive: bool, random: &mut Random) -> Primitive {
        let mut half = DVec3::from([(); 3].map(|()| random.between(half)));
        let mut kind = Kind::Cuboid;
        let share = random.unit();
        if share < self.cylinders {
            let axis = random.below(3);
            kind = Kind::Cylinder { axis };
            half[(axis + 1) % 3] = half[(axis + 2) % 3];
        } else if share < self.cylinders + self.wedges {
            let axis = random.below(3);
            kind = Kind::Wedge { axis, corner: [(); 2].map(|()| if random.chance(0.5) { 1 } else { -1 }) };
        }
        let center = DVec3::ZERO;
        Primitive { kind, additive, center, half }
    }

    /// Puts a primitive on a random face of another, displaced along it, in touch with it.
    fn place(&self, new: &mut Primitive, on: &Primitive, random: &mut Random) {
        let axis = random.below(3);
        let sign = if random.chance(0.5) { 1.0 } else { -1.0 };
        new.center = on.center;
        let fits = self.fitted > 0.0 && !matches!(new.kind, Kind::Cylinder { .. });
        for along in [(axis + 1) % 3, (axis + 2) % 3] {
            if fits && random.chance(self.fitted) {
                new.half[along] = on.half[along];
            } else if random.chance(self.displaced) {
                new.center[along] += random.around(self.displacement) * on.half[along];
            }
        }
        let outwards = if new.additive {
            new.half[axis] - random.unit() * self.overlap * new.half[axis].min(on.half[axis])
        } else {
            random.around(self.sink) * new.half[axis]
        };
        new.center[axis] += sign * (on.half[axis] + outwards);
    }
}

/// Whether it is a share.
fn is_share(share: f64) -> bool {
    (0.0..=1.0).contains(&share)
}

/// Whether it is a range of sizes: from more than 0, its ends in order.
fn is_range([from, to]: [f64; 2]) -> bool {
    from > 0.0 && from <= to && to.is_finite()
}

/// Whether it is a range of sizes within something of size 1.
fn is_inner(range: [f64; 2]) -> bool {
    is_range(range) && range[1] < 1.0
}

/// How much of each side goes where four cut edges leave a hexagon, standing on an edge or on a corner, or an octagon.
const BARS: [[f64; 2]; 3] = [[0.5, 0.25], [0.25, 0.5], [1.0 - SQRT_HALF; 2]];
const SQRT_HALF: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Adds a primitive, and its mirror image where that is another one.
///
/// A wedge in the plane of symmetry that slopes across it becomes two of half its size, back to back: a gable or a
/// valley.
fn push_symmetric(shape: &mut Vec<Primitive>, mut new: Primitive) {
    if new.center.z == 0.0 && new.mirrored() != new {
        new.half.z *= 0.5;
        new.center.z = new.half.z;
    }
    shape.push(new);
    if new.mirrored() != new {
        shape.push(new.mirrored());
    }
}

/// What to take from a cuboid to cut off the edge along an axis at a corner of its cross-section; `size` is how much of
/// each side goes. Of a wedge, at its right angle, it is the wedge shrunk towards it.
fn edge_of(primitive: Primitive, axis: usize, corner: [i8; 2], size: [f64; 2]) -> Primitive {
    let mut edge = Primitive { kind: Kind::Wedge { axis, corner }, additive: false, ..primitive };
    let (u, v) = cross_axes(axis);
    for (a, sign, size) in [(u, corner[0], size[0]), (v, corner[1], size[1])] {
        edge.half[a] *= size;
        edge.center[a] += f64::from(sign) * (primitive.half[a] - edge.half[a]);
    }
    edge
}

/// What to take from a wedge so that a slab along its slanted face is left.
fn beyond_slab(wedge: Primitive, thickness: f64) -> Primitive {
    let Kind::Wedge { axis, corner } = wedge.kind else { return wedge };
    edge_of(wedge, axis, corner, [1.0 - thickness; 2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::voxel::CELLS;

    #[test]
    fn shapes_are_symmetric_connected_and_scaled() {
        let paper = GrammarConfig::default();
        let wedges = GrammarConfig {
            wedges: 0.3,
            slabs: 0.5,
            fitted: 0.4,
            chamfered: 0.5,
            regular: 0.5,
            bores: BoreConfig { share: 0.3, ..BoreConfig::default() },
            bars: BarConfig { share: 0.3, ..BarConfig::default() },
            ..paper.clone()
        };
        for (config, sample) in (0..200).flat_map(|i| [(&paper, i), (&wedges, i)]) {
            let (shape, grid) = config.draw(&mut Random::new(7, sample, 0)).unwrap();
            assert!(grid.is_connected());
            let bounds = grid.bounds().unwrap();
            let largest = bounds.iter().map(|b| b.1 + 1 - b.0).max().unwrap();
            assert!((50..=56).contains(&largest), "sample {sample}: {largest} of 64 voxels");
            let mut bytes = vec![0; CELLS];
            grid.write_bytes(&mut bytes);
            assert!(bytes.chunks(SIDE).all(|column| column.iter().eq(column.iter().rev())));
            assert_eq!(config.draw(&mut Random::new(7, sample, 0)).unwrap().0, shape);
        }
    }

    #[test]
    fn impossible_wishes_are_refused() {
        let with = |change: fn(&mut GrammarConfig)| {
            let mut config = GrammarConfig::default();
            change(&mut config);
            config.check().unwrap_err().to_string()
        };
        assert!(with(|c| c.steps = [3, 2]).contains("steps"));
        assert!(with(|c| c.half = [0.0, 1.0]).contains("half"));
        assert!(with(|c| c.cylinders = 1.5).contains("between 0 and 1"));
        assert!(with(|c| c.wedges = -0.1).contains("between 0 and 1"));
        assert!(with(|c| c.wedges = 0.7).contains("at most 1 together"));
        assert!(with(|c| c.fitted = 1.1).contains("between 0 and 1"));
        assert!(with(|c| c.slabs = 2.0).contains("between 0 and 1"));
        assert!(with(|c| c.chamfer = [0.1, 0.6]).contains("at most 0.5"));
        assert!(with(|c| c.slab_thickness = [0.5, 1.0]).contains("slab_thickness"));
        assert!(with(|c| c.regular = 1.5).contains("regular"));
        assert!(with(|c| c.bores.share = 2.0).contains("bores.share"));
        assert!(with(|c| c.cover = f64::NAN).contains("cover"));
        let hopeless = GrammarConfig { min_occupancy: 0.9, attempts: 5, ..GrammarConfig::default() };
        let error = hopeless.draw(&mut Random::new(0, 0, 0)).unwrap_err();
        assert_eq!(error, CoreError::NoShape { attempts: 5 });
    }

    #[test]
    fn wedges_across_the_plane_of_symmetry_are_gables_and_valleys() {
        let half = DVec3::new(0.1, 0.2, 0.3);
        let wedge = |kind, z| Primitive { kind, additive: true, center: DVec3::new(0.0, 0.0, z), half };
        let pushed = |primitive| {
            let mut shape = Vec::new();
            push_symmetric(&mut shape, primitive);
            shape
        };
        let (up, across) =
            (Kind::Wedge { axis: 2, corner: [1, -1] }, Kind::Wedge { axis: 0, corner: [-1, -1] });
        assert_eq!(pushed(wedge(up, 0.0)), [wedge(up, 0.0)]);
        assert_eq!(pushed(wedge(across, 0.2)), [wedge(across, 0.2), wedge(across, 0.2).mirrored()]);
        let pair = pushed(wedge(across, 0.0));
        assert_eq!((pair[0].center.z, pair[0].half.z), (0.15, 0.15));
        assert_eq!(pair[1..], [pair[0].mirrored()]);
        let gable = Shape::new(pair).unwrap();
        assert!(gable.contains(DVec3::new(0.0, 0.19, 0.0)) && gable.contains(DVec3::new(0.0, -0.19, 0.28)));
        assert!(!gable.contains(DVec3::new(0.0, 0.19, 0.28)));
    }

    #[test]
    fn edges_that_are_cut_off_leave_a_gable_or_a_nut() {
        let half = DVec3::new(0.4, 0.2, 0.3);
        let cuboid = Primitive { kind: Kind::Cuboid, additive: true, center: DVec3::ZERO, half };
        let without = |corners: &[[i8; 2]], size| {
            let cuts = corners.iter().map(|&corner| edge_of(cuboid, 0, corner, size));
            Shape::new(std::iter::once(cuboid).chain(cuts).collect()).unwrap()
        };
        let (u, v) = cross_axes(0);
        let at = |y: f64, z: f64| DVec3::new(0.39, 0.2 * y, 0.3 * z);
        let up = |sign: i8| if u == 1 { [1, sign] } else { [sign, 1] };
        assert!([u, v].contains(&1) && [u, v].contains(&2));
        let gable = without(&[up(1), up(-1)], [0.5; 2]);
        assert!(
            gable.contains(at(0.98, 0.0))
                && gable.contains(at(-0.1, 0.98))
                && gable.contains(at(-0.98, 0.98))
        );
        assert!(!gable.contains(at(0.52, 0.52)) && gable.contains(at(0.48, 0.48)));
        let nut = without(&[[1, 1], [1, -1], [-1, 1], [-1, -1]], [0.5; 2]);
        assert!(nut.contains(at(0.98, 0.0)) && nut.contains(at(0.0, -0.98)));
        assert!(!nut.contains(at(-0.52, -0.52)) && nut.contains(at(-0.48, 0.48)));
    }

    #[test]
    fn a_slab_keeps_to_its_slanted_face() {
        let half = DVec3::new(0.1, 0.2, 0.3);
        let kind = Kind::Wedge { axis: 2, corner: [1, -1] };
        let wedge = Primitive { kind, additive: true, center: DVec3::ZERO, half };
        let slab = Shape::new(vec![wedge, beyond_slab(wedge, 0.25)]).unwrap();
        // From the slanted face through the origin towards the right angle at (0.1, -0.2).
        let towards = |share: f64| DVec3::new(0.1 * share, -0.2 * share, 0.0);
        assert!(slab.contains(towards(0.0)) && slab.contains(towards(0.24)));
        assert!(
            !slab.contains(towards(-0.01)) && !slab.contains(towards(0.26)) && !slab.contains(towards(0.99))
        );
        // Its ends reach as far as the wedge's.
        assert!(
            slab.contains(DVec3::new(0.099, 0.195, 0.0)) && slab.contains(DVec3::new(-0.095, -0.199, 0.0))
        );
    }
}
