//! Saito-Takahashi lines: an edge detector over depth and normal buffers (paper, section 4.2).
//!
//! Profile edges come from the second difference of *inverse* depth, which is zero on every plane at every
//! slant; creases from the angle between normals. Every line pixel lies on the object, and every object pixel
//! beside the background is a line: so outlines are closed, and the background, flooded over its four-connected
//! neighbours from the border, never gets in.

use crate::buffers::Buffers;
use crate::error::CoreError;
use serde::{Deserialize, Serialize};

/// When a change of depth or normal is a line.
#[derive(Clone, Debug, Serialize, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct LineConfig {
    /// Second difference of inverse depth, 1 / world units. A step of one voxel at depth 2 leaves 0.004.
    pub depth_step: f32,
    /// Least angle between the normals of neighbours, degrees.
    pub crease_degrees: f32,
}

impl Default for LineConfig {
    fn default() -> Self {
        Self { depth_step: 0.006, crease_degrees: 30.0 }
    }
}

impl LineConfig {
    /// Says which threshold makes no sense.
    pub fn check(&self) -> Result<(), CoreError> {
        if !(self.depth_step > 0.0 && self.depth_step.is_finite()) {
            return Err(CoreError::Config("lines.depth_step must be more than 0 and finite".into()));
        }
        if !(0.0..=180.0).contains(&self.crease_degrees) {
            return Err(CoreError::Config("lines.crease_degrees must lie between 0 and 180".into()));
        }
        Ok(())
    }
}

/// Marks the lines: `true` where there is ink, row by row.
pub fn detect(buffers: &Buffers, config: &LineConfig) -> Vec<bool> {
    let size = buffers.size;
    let near: Vec<f32> = buffers.depth.iter().map(|d| 1.0 / d).collect();
    let cos_crease = config.crease_degrees.to_radians().cos();
    let mut ink = vec![false; size * size];
    for row in 0..size {
        for col in 0..size {
            let i = row * size + col;
            let here = near[i];
            if here == 0.0 {
                continue;
            }
            let at = |inside: bool, j: usize| if inside { near[j] } else { 0.0 };
            let left = at(col > 0, i.wrapping_sub(1));
            let right = at(col + 1 < size, i + 1);
            let above = at(row > 0, i.wrapping_sub(size));
            let below = at(row + 1 < size, i + size);
            let outline = left == 0.0 || right == 0.0 || above == 0.0 || below == 0.0;
            let step = (2.0 * here - left - right).max(2.0 * here - above - below);
            if outline || step > config.depth_step {
                ink[i] = true;
            }
            for (other, j) in [(right, i + 1), (below, i + size)] {
                if other == 0.0 || dot(buffers.normal[i], buffers.normal[j]) >= cos_crease {
                    continue;
                }
                // The crease belongs to what is in front; where both are equally far, to the same face all along.
                let ahead = here - other;
                let owns = if ahead.abs() > config.depth_step {
                    ahead > 0.0
                } else {
                    dot(buffers.normal[i], FACE_ORDER) >= dot(buffers.normal[j], FACE_ORDER)
                };
                ink[if owns { i } else { j }] = true;
            }
        }
    }
    ink
}

/// Of two faces that meet in a crease, the one whose normal has more of this carries the line: tops before sides.
const FACE_ORDER: [f32; 3] = [0.32, 1.0, 0.11];

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A size x size image from rows of characters: '.' background, digits distances, with one normal a digit.
    fn picture(rows: &[&str]) -> Buffers {
        let normals = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let cells = || rows.iter().flat_map(|r| r.bytes());
        let digit = |c: u8| usize::from(c - b'0');
        Buffers {
            depth: cells()
                .map(|c| if c == b'.' { f32::INFINITY } else { 2.0 + 0.1 * digit(c) as f32 })
                .collect(),
            normal: cells().map(|c| if c == b'.' { [0.0; 3] } else { normals[digit(c) % 3] }).collect(),
            size: rows.len(),
        }
    }

    fn drawn(buffers: &Buffers, config: &LineConfig) -> Vec<String> {
        detect(buffers, config)
            .chunks(buffers.size)
            .map(|row| row.iter().map(|&b| if b { '#' } else { '.' }).collect())
            .collect()
    }

    #[test]
    fn outlines_lie_on_the_object() {
        let buffers = picture(&["......", ".0000.", ".0000.", ".0000.", ".0000.", "......"]);
        let expected = ["......", ".####.", ".#..#.", ".#..#.", ".####.", "......"];
        assert_eq!(drawn(&buffers, &LineConfig::default()), expected);
    }

    #[test]
    fn a_step_is_drawn_once_on_the_nearer_side() {
        let mut buffers = picture(&["3333333"; 7]);
        for row in 2..5 {
            for col in 2..5 {
                buffers.depth[row * 7 + col] = 2.0;
            }
        }
        let expected = ["#######", "#.....#", "#.###.#", "#.#.#.#", "#.###.#", "#.....#", "#######"];
        assert_eq!(drawn(&buffers, &LineConfig::default()), expected);
    }

    #[test]
    fn a_crease_is_one_pixel_wide() {
        let mut buffers = picture(&["0000000"; 7]);
        for row in 0..7 {
            for col in 4..7 {
                buffers.normal[row * 7 + col] = [0.0, 1.0, 0.0];
            }
        }
        // The face whose normal points up carries it.
        let expected = ["#######", "#...#.#", "#...#.#", "#...#.#", "#...#.#", "#...#.#", "#######"];
        assert_eq!(drawn(&buffers, &LineConfig::default()), expected);
    }

    #[test]
    fn a_slanted_crease_is_one_pixel_wide_either_way() {
        for rising in [false, true] {
            let mut buffers = picture(&["000000000"; 9]);
            for row in 0..9 {
                for col in 0..9 {
                    if (if rising { 8 - row } else { row }) < col {
                        buffers.normal[row * 9 + col] = [0.0, 1.0, 0.0];
                    }
                }
            }
            let ink = detect(&buffers, &LineConfig::default());
            let inner = (1..8).flat_map(|row| (1..8).map(move |col| row * 9 + col));
            // Not counting the outline: along a diagonal of seven inner rows, one pixel a row.
            assert_eq!(inner.filter(|&i| ink[i]).count(), 6, "rising: {rising}");
        }
    }
}
