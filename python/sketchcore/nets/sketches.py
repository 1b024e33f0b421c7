"""The drawings of one object with their cameras, and what the kernels make of them for the networks."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sketchcore import _core

BORDER = 128
"""The signed distance of an outline, in `Sketches.fields` and `Sketches.evidence`."""
PIXEL = 8
"""What that distance grows by in one pixel, inwards."""


@dataclass(frozen=True)
class Sketches:
    """The drawings of one object.

    Attributes:
        drawings: uint8 [n, 256, 256], ink 255 on 0.
        cameras: float64 [n, 15], packed.
        kept: what a network has made of them already, by the network: they are looked at more than once.
    """

    drawings: NDArray[np.uint8]
    cameras: NDArray[np.float64]
    kept: dict[Any, Any] = field(default_factory=dict, repr=False, compare=False)

    def __len__(self) -> int:
        return len(self.drawings)

    @cached_property
    def fields(self) -> NDArray[np.uint8]:
        """uint8 [n, 256, 256, 2]: silhouette and nearness to ink (`rust/src/evidence.rs`)."""
        return _core.evidence_fields(self.drawings)

    @cached_property
    def depths(self) -> NDArray[np.float32]:
        """How far inside each drawing's outline a cell of a camera grid is: pixels, float32 [n, 64, 64] (row, col)."""
        silhouettes = self.fields[..., 0].reshape(-1, 64, 4, 64, 4)
        pixels: NDArray[np.float32] = (silhouettes.mean(axis=(2, 4), dtype=np.float32) - BORDER) / np.float32(PIXEL)
        return pixels

    @cached_property
    def evidence(self) -> NDArray[np.uint8]:
        """uint8 [3, 64, 64, 32]: what all drawings say about each voxel of the half grid z > 0."""
        return _core.evidence(self.fields, self.cameras)

    def seen_by(self, cameras: NDArray[np.float64]) -> Sketches:
        """The same drawings, made by other cameras, float64 [n, 15]."""
        return _known(self.drawings, cameras, self.fields)

    def mirrored(self, axis: int) -> Sketches:
        """The object mirrored along a world axis (0 or 2 for x or z), as mirrored cameras see it."""
        drawings, fields = (np.ascontiguousarray(images[:, :, ::-1]) for images in (self.drawings, self.fields))
        mirrored = _known(drawings, mirror_cameras(self.cameras, axis), fields)
        if "evidence" in self.__dict__:  # about z = 0 it is the same
            evidence = np.ascontiguousarray(self.evidence[:, ::-1]) if axis == 0 else self.evidence
            mirrored.__dict__["evidence"] = evidence
        return mirrored


def _known(drawings: NDArray[np.uint8], cameras: NDArray[np.float64], fields: NDArray[np.uint8]) -> Sketches:
    """Drawings whose fields are known already."""
    sketches = Sketches(drawings, cameras)
    sketches.__dict__["fields"] = fields  # where `cached_property` looks
    return sketches


def mirror_cameras(cameras: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    """Packed cameras, float64 [n, 15], mirrored along a world axis; their images are flipped left to right."""
    mirrored = cameras.copy()
    mirrored[:, axis] *= -1
    rows = mirrored[:, 3:12].reshape(-1, 3, 3)
    rows[:, :, axis] *= -1
    rows[:, 0] *= -1
    return mirrored
