"""Data without storage: sample i of a data set is a function of (config, seed, i)."""

from sketchcore.datagen.generate import Batch, default_config, generate

__all__ = ["Batch", "default_config", "generate"]
