"""The widths of the compact network."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

MAX_WIDTH = 4096
"""Channels of any layer."""
HEADS = 8
"""Of the attention at the coarsest level of the encoder and of the decoder."""


@dataclass(frozen=True)
class CompactConfig:
    """Widths (channels) of `CompactNet`.

    Attributes:
        stem: of the encoder at 64^2.
        image: of the encoder at 32^2, 16^2 and 8^2.
        features: of each pixel and depth of a drawing.
        fused: of what a cell reads from one drawing.
        world: of the decoder with 32, 16 and 8 cells along x and y.
        groups: groups of each group normalisation.

    Raises:
        ValueError: for a width that is no whole number from 1 to 4096, or that groups or attention heads cannot share.
    """

    stem: int = 64
    image: tuple[int, int, int] = (96, 192, 256)
    features: int = 16
    fused: int = 32
    world: tuple[int, int, int] = (32, 96, 192)
    groups: int = 8

    def __post_init__(self) -> None:
        for field in fields(self):
            value, several = getattr(self, field.name), isinstance(field.default, tuple)
            each = value if several and isinstance(value, tuple) else (value,)
            if several and len(each) != 3:
                raise ValueError(f"{field.name} must be 3 widths, got {value!r:.80}")
            if not all(type(width) is int and 1 <= width <= MAX_WIDTH for width in each):
                raise ValueError(f"{field.name} must be whole, 1 to {MAX_WIDTH}, got {value!r:.80}")
        for name, widths in (("image", self.image), ("world", self.world)):
            if odd := [width for width in widths if width % self.groups]:
                raise ValueError(f"{name} must be widths that {self.groups} groups can share, got {odd[0]}")
            if widths[-1] % HEADS:
                raise ValueError(f"{name} must end in a width that {HEADS} attention heads can share, got {widths[-1]}")

    @classmethod
    def of_options(cls, options: Mapping[str, Any]) -> CompactConfig:
        """The configuration of options by name; where they come out of JSON, tuples are lists.

        Raises:
            TypeError: for an option that there is not.
        """
        tuples: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in options.items()}
        return cls(**tuples)
