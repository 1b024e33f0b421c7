//! Exact Euclidean distances in a 256^2 image, up to a reach.

use crate::camera::IMAGE;

/// Distances are exact up to this many pixels; beyond, they say just "further".
pub const REACH: u16 = 16;
/// Squared distance that stands for "further than `REACH`".
const FAR: u16 = (REACH + 1) * (REACH + 1);

/// The squared distance, in pixels, from each pixel's centre to the nearest pixel that is set.
pub fn squared_distance(set: &[bool]) -> Vec<u16> {
    // Down and up each column, then along each row over all offsets within reach.
    let mut along = vec![REACH + 1; IMAGE * IMAGE];
    for row in 0..IMAGE {
        for col in 0..IMAGE {
            let i = row * IMAGE + col;
            if set[i] {
                along[i] = 0;
            } else if row > 0 {
                along[i] = (along[i - IMAGE] + 1).min(REACH + 1);
            }
        }
    }
    for i in (0..IMAGE * (IMAGE - 1)).rev() {
        along[i] = along[i].min(along[i + IMAGE] + 1);
    }
    const PAD: usize = REACH as usize;
    let mut squared = vec![FAR; IMAGE * IMAGE];
    let mut padded = [FAR; IMAGE + 2 * PAD];
    for (distances, out) in along.chunks_exact(IMAGE).zip(squared.chunks_exact_mut(IMAGE)) {
        for (p, d) in padded[PAD..].iter_mut().zip(distances) {
            *p = d * d;
        }
        for offset in 0..=2 * PAD {
            let across = offset.abs_diff(PAD) as u16;
            let across = across * across;
            for (o, p) in out.iter_mut().zip(&padded[offset..]) {
                *o = (*o).min(p + across);
            }
        }
    }
    squared
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        #[test]
        fn distances_are_those_to_the_nearest_set_pixel(
            points in prop::collection::vec((0..IMAGE, 0..IMAGE), 1..40)
        ) {
            let mut set = vec![false; IMAGE * IMAGE];
            points.iter().for_each(|&(r, c)| set[r * IMAGE + c] = true);
            let got = squared_distance(&set);
            for row in (0..IMAGE).step_by(7) {
                for col in (0..IMAGE).step_by(5) {
                    let exact = points
                        .iter()
                        .map(|&(r, c)| r.abs_diff(row).pow(2) + c.abs_diff(col).pow(2))
                        .min()
                        .unwrap();
                    let d = usize::from(got[row * IMAGE + col]);
                    if exact <= usize::from(REACH * REACH) {
                        prop_assert_eq!(d, exact);
                    } else {
                        prop_assert!(d > usize::from(REACH * REACH));
                    }
                }
            }
        }
    }
}
