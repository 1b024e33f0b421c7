"""Training: presets, samples straight from the generator, and a loop that can be killed at any moment."""

from sketchcore.train.loop import Run, train
from sketchcore.train.presets import ALTERNATIVES, PRESETS, Preset

__all__ = ["ALTERNATIVES", "PRESETS", "Preset", "Run", "train"]
