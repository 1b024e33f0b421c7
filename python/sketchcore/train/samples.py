"""Samples to train on: shapes of the preset's grammar, or meshes from the training split of a data set."""

from __future__ import annotations

from sketchcore.datagen.generate import Batch, generate
from sketchcore.datagen.prepared import Prepared
from sketchcore.train.presets import Preset


def training_samples(
    preset: Preset, seed: int, first: int, count: int, views: int, data: Prepared | None, frusta: bool = False
) -> Batch:
    """Samples `first` ... `first + count - 1` of a seed, made on the calling thread.

    Args:
        preset: whose grammar, cameras and lines.
        seed: 0 ... 2^64 - 1.
        first: index of the first.
        count: how many.
        views: drawings a sample.
        data: whose training split; None for the grammar.
        frusta: also measure a mesh's camera grids; those of shapes are always there.
    """
    if data is not None:
        config = preset.generator
        return data.batch("train", seed, count, first=first, views=views, config=config, frusta=frusta)
    return generate(seed, count, first=first, views=views, config=preset.generator, grammar=preset.grammar, threads=1)
