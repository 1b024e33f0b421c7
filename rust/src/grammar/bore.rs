//! A bore: a hole along an axis of a primitive, through it or into it, such as a nut's, a pipe's or a cup's.

use super::{is_inner, is_share};
use crate::csg::{Kind, Primitive, cross_axes};
use crate::error::CoreError;
use crate::random::Random;
use serde::{Deserialize, Serialize};

/// How often and how wide primitives are bored.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct BoreConfig {
    /// Share of the added cuboids and cylinders that are bored.
    pub share: f64,
    /// Width of the bore, as a share of what it is in.
    pub width: [f64; 2],
    /// Share of the bores that end within: a cup.
    pub blind: f64,
    /// How deep those go, as a share of the length.
    pub depth: [f64; 2],
    /// Share of the bores in cuboids that are as angular as these: a box, a frame.
    pub angular: f64,
}

impl Default for BoreConfig {
    fn default() -> Self {
        Self { share: 0.0, width: [0.35, 0.85], blind: 0.5, depth: [0.5, 0.9], angular: 0.4 }
    }
}

impl BoreConfig {
    /// Says which entry nothing could be bored with.
    pub fn check(&self) -> Result<(), CoreError> {
        let bad = |message: &str| Err(CoreError::Config(format!("grammar.bores.{message}")));
        match self {
            c if !is_share(c.share) => bad("share must lie between 0 and 1"),
            c if !(is_share(c.blind) && is_share(c.angular)) => {
                bad("blind and angular are shares between 0 and 1")
            }
            c if !(is_inner(c.width) && is_inner(c.depth)) => {
                bad("width and depth must be [least, most], between 0 and 1")
            }
            _ => Ok(()),
        }
    }

    /// What to take from a primitive that was added; of wedges, and by lot of others, nothing.
    ///
    /// A cylinder is bored along its axis and concentrically; a cuboid along any, its bore round or rectangular.
    pub fn draw(&self, on: Primitive, random: &mut Random) -> Option<Primitive> {
        let may = self.share > 0.0 && on.additive && !matches!(on.kind, Kind::Wedge { .. });
        if !may || !random.chance(self.share) {
            return None;
        }
        let mut bore = Primitive { additive: false, ..on };
        let axis = if let Kind::Cylinder { axis } = on.kind { axis } else { random.below(3) };
        let (u, v) = cross_axes(axis);
        let width = random.between(self.width);
        bore.half[u] *= width;
        bore.half[v] *= width;
        if on.kind == Kind::Cuboid && !random.chance(self.angular) {
            bore.kind = Kind::Cylinder { axis };
            let radius = bore.half[u].min(bore.half[v]);
            (bore.half[u], bore.half[v]) = (radius, radius);
        }
        if random.chance(self.blind) {
            let end = if random.chance(0.5) { 1.0 } else { -1.0 };
            bore.half[axis] *= random.between(self.depth);
            bore.center[axis] += end * (on.half[axis] - bore.half[axis]);
        }
        Some(bore)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::csg::Shape;
    use glam::DVec3;

    #[test]
    fn walls_and_floors_stay_and_the_middle_goes() {
        let half = DVec3::new(0.3, 0.2, 0.1);
        let always = BoreConfig { share: 1.0, ..BoreConfig::default() };
        let mut seen = [0; 4];
        for sample in 0..400 {
            let mut random = Random::new(8, sample, 0);
            let kind = [Kind::Cuboid, Kind::Cylinder { axis: 0 }][sample as usize % 2];
            let on = Primitive { kind, additive: true, center: DVec3::new(0.1, 0.0, 0.0), half };
            let bore = always.draw(on, &mut random).unwrap();
            let shape = Shape::new(vec![on, bore]).unwrap();
            assert!(!shape.contains(bore.center));
            let blind = bore.center != on.center;
            let open = (0..3).filter(|&a| bore.half[a] == half[a] || bore.center[a] != on.center[a]);
            let [axis] = open.collect::<Vec<_>>()[..] else { panic!("one axis is bored along") };
            assert!(kind == Kind::Cuboid || axis == 0);
            let along = |towards: f64| {
                let mut at = on.center;
                at[axis] += towards * 0.99 * half[axis];
                shape.contains(at)
            };
            assert_eq!([1.0, -1.0].map(along).iter().filter(|&&solid| solid).count(), usize::from(blind));
            for side in [cross_axes(axis).0, cross_axes(axis).1] {
                let mut at = on.center;
                at[side] += 0.99 * half[side];
                assert!(shape.contains(at), "sample {sample} has no wall");
            }
            seen[2 * usize::from(blind) + usize::from(bore.kind == Kind::Cuboid)] += 1;
        }
        assert!(seen.iter().all(|&n| n > 20), "{seen:?}");
        assert!(
            always
                .draw(
                    Primitive { kind: Kind::Wedge { axis: 0, corner: [1, 1] }, ..block() },
                    &mut Random::new(8, 0, 0)
                )
                .is_none()
        );
        assert!(BoreConfig::default().draw(block(), &mut Random::new(8, 0, 0)).is_none());
    }

    fn block() -> Primitive {
        Primitive { kind: Kind::Cuboid, additive: true, center: DVec3::ZERO, half: DVec3::splat(0.1) }
    }
}
