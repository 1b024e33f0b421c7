//! How wide the layers of a network are: `CompactConfig` in Python.

use super::attention::HEADS;
use crate::error::CoreError;

/// Channels of any layer.
pub const MAX_WIDTH: usize = 4096;

/// Widths (channels) of `CompactNetwork`.
#[derive(Clone, Debug)]
pub struct Widths {
    /// Of the encoder at 64^2.
    pub stem: usize,
    /// Of the encoder at 32^2, 16^2 and 8^2.
    pub image: [usize; 3],
    /// Of each pixel and depth of a drawing.
    pub features: usize,
    /// Of what a cell reads from one drawing.
    pub fused: usize,
    /// Of the decoder with 32, 16 and 8 cells along x and y.
    pub world: [usize; 3],
    /// Groups of each normalisation.
    pub groups: usize,
}

impl Widths {
    /// # Errors
    /// For a width that no layer can have.
    pub fn check(&self) -> Result<(), CoreError> {
        let Self { stem, image, features, fused, world, groups } = *self;
        let single = [("stem", stem), ("features", features), ("fused", fused), ("groups", groups)];
        let several = [("image", image), ("world", world)];
        let all = several.iter().flat_map(|(what, widths)| widths.map(|width| (*what, width)));
        for (what, width) in single.into_iter().chain(all) {
            if !(1..=MAX_WIDTH).contains(&width) {
                return Err(CoreError::Width { what, width });
            }
        }
        let normalised = image.iter().chain(&world).map(|&width| (width, groups, "groups"));
        let attending = [image[2], world[2]].map(|width| (width, HEADS, "attention heads"));
        for (width, among, what) in normalised.chain(attending) {
            if !width.is_multiple_of(among) {
                return Err(CoreError::CannotShare { width, among, what });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_that_no_layer_can_have_are_refused() {
        let good = Widths {
            stem: 64,
            image: [96, 192, 256],
            features: 16,
            fused: 32,
            world: [32, 96, 192],
            groups: 8,
        };
        assert!(good.check().is_ok());
        let fault = |widths: Widths| widths.check().unwrap_err().to_string();
        let of = |stem| Widths { stem, ..good.clone() };
        assert_eq!(fault(of(0)), "stem must be whole, 1 to 4096, got 0");
        assert_eq!(fault(of(usize::MAX)), format!("stem must be whole, 1 to 4096, got {}", usize::MAX));
        let uneven = Widths { image: [96, 100, 256], ..good.clone() };
        assert_eq!(fault(uneven), "a width of 100 cannot be shared by 8 groups");
        let headless = Widths { world: [32, 96, 36], groups: 4, ..good.clone() };
        assert_eq!(fault(headless), "a width of 36 cannot be shared by 8 attention heads");
    }
}
