"""How a drawing lies on its sheet: what novices get wrong before anything is reconstructed (paper, section 6.2).

Two of the paper's six novices drew the object too small for its details or too large for the sheet, and the networks
know objects at one distance only. What is usual was measured on drawings of the generator, which are made of objects
that fill 1/1.2 of the cube: `generate(7, 300, views=3)`, exact lines, 642 three-quarter drawings and 258 from a side or
the top. In percentiles 1 to 99:

    longest side of the ink's box, share of the sheet   0.38 to 0.76 three-quarter, 0.21 to 0.65 front and sides,
                                                        0.32 to 0.63 top
    its centre from the sheet's, to either side          0.10 three-quarter, 0.05 others
    from the box to the nearest border                   more than 18 pixels

Whether an outline is open was measured on `generate(7, 300, views=2)`: at half and a quarter of the resolution, where
wider gaps close, the inside of whole drawings grows by up to 8.5 % and 27 %, and it fills 58 % of their convex hull or
more. With a gap of 40 to 70 pixels in the outline, more than half of those that are left open by it lie beyond that.
"""

# mypy: disable-error-code="no-untyped-call"
# (scikit-image says that it is typed, and is not.)

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sketchcore.camera import QUARTER_VIEWS, check_viewpoint
from sketchcore.drawing import INK, Composition
from sketchcore.drawing import composition as measure
from sketchcore.grids import IMAGE, as_drawings, silhouette

_LONGEST = {True: (0.38, 0.76), False: (0.21, 0.65)}
"""Of three-quarter drawings, and of others."""
_OFFSET = {True: 0.10, False: 0.06}
_BORDER = 3
"""Pixels from the border within which ink is taken to go on beyond it."""
_COARSER = {2: 1.12, 4: 1.30}
"""How much larger the inside of a closed outline may be at so many times less resolution."""
_HULL = 0.55
"""How much of its convex hull the inside of a closed outline fills at least."""


def composition(drawing: NDArray[np.uint8], viewpoint: str) -> list[str]:
    """What would make a drawing easier to reconstruct; nothing if it lies as drawings usually do.

    Args:
        drawing: uint8 [256, 256], ink 255 on 0.
        viewpoint: where it was drawn from.

    Returns:
        sentences to show to the person who draws, the most important first.

    Raises:
        ValueError: for another shape or an unknown viewpoint.
        TypeError: for another dtype.
    """
    quarter = check_viewpoint(viewpoint) in QUARTER_VIEWS
    mask = as_drawings(drawing)[0] >= INK
    if not mask.any():
        return ["Nothing is drawn here yet: draw the object's outline and the edges that you would see."]
    lies = measure(drawing)
    hints = []
    if _touches_border(mask):
        hints.append("The drawing runs over the border of the sheet, and what is beyond is lost: draw it smaller.")
    elif lies.longest > _LONGEST[quarter][1]:
        hints.append(
            f"The object is drawn too large: it spans {lies.longest:.0%} of the sheet, and up to "
            f"{_LONGEST[quarter][1]:.0%} is understood well. Let it fit into the wireframe cube."
        )
    elif lies.longest < _LONGEST[quarter][0]:
        hints.append(
            f"The object is drawn too small: it spans {lies.longest:.0%} of the sheet, and its details get lost below "
            f"{_LONGEST[quarter][0]:.0%}. Let it nearly fill the wireframe cube."
        )
    if max(map(abs, lies.offset)) > _OFFSET[quarter]:
        hints.append(
            f"The object is off centre, too far {_where(lies, _OFFSET[quarter])}: draw it in the middle of the cube."
        )
    if _open(drawing, mask):
        hints.append("The outline seems to be open somewhere: close it, so that inside and outside can be told apart.")
    return hints


def _touches_border(mask: NDArray[np.bool_]) -> bool:
    inner = mask[_BORDER:-_BORDER, _BORDER:-_BORDER]
    return bool(mask.sum() > inner.sum())


def _where(lies: Composition, most: float) -> str:
    right, down = lies.offset
    words = []
    if abs(down) > most:
        words.append("down" if down > 0 else "up")
    if abs(right) > most:
        words.append("to the right" if right > 0 else "to the left")
    return " and ".join(words)


def _open(drawing: NDArray[np.uint8], mask: NDArray[np.bool_]) -> bool:
    """Whether the background gets inside: the flood that fills it reaches further than through a coarser sieve."""
    from skimage.morphology import convex_hull_image

    inside = int(silhouette(drawing).sum())
    if inside < _HULL * int(convex_hull_image(mask).sum()):
        return True
    return any(_coarse_inside(drawing, times) > most * inside for times, most in _COARSER.items())


def _coarse_inside(drawing: NDArray[np.uint8], times: int) -> int:
    """Pixels inside the outline, told at so many times less resolution: gaps count as that much narrower."""
    side = IMAGE // times
    first = (IMAGE - side) // 2
    sheet = np.zeros_like(drawing)
    sheet[first : first + side, first : first + side] = drawing.reshape(side, times, side, times).max(axis=(1, 3))
    return int(silhouette(sheet).sum()) * times**2
