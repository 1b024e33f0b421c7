"""How good the network is right now, on shapes that training never sees."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sketchcore.datagen.generate import generate
from sketchcore.datagen.prepared import Prepared
from sketchcore.nets.model import Model
from sketchcore.nets.sketches import Sketches
from sketchcore.volume import iou

SEED = 2**63
"""Training seeds lie below; held-out shapes have this one."""


def heldout_iou(
    model: Model,
    views: Sequence[int],
    rounds: int = 1,
    shapes: int = 16,
    grammar: str | None = None,
    data: Prepared | None = None,
) -> list[float]:
    """Mean IoU in the world grid after some rounds over exact drawings, for each number of views.

    Of shapes of a grammar, or of as many from the validation split of a data set.
    """
    if data is None:
        batch = generate(SEED, shapes, views=max(views), grammar=grammar)
    else:
        batch = data.batch("val", SEED, shapes := min(shapes, data.count("val")), views=max(views))
    scores = []
    for count in views:
        each = []
        for i in range(shapes):
            sketches = Sketches(batch.drawings[i, :count], batch.packed_cameras[i, :count])
            *_, volume = model.rounds(sketches, rounds)
            each.append(iou(volume, batch.world[i]))
        scores.append(float(np.mean(each)))
    return scores
