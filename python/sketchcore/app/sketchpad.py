"""The workspace as a NiceGUI element: what its ES modules need to know from Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from nicegui.element import Element


class Sketchpad(Element, component="sketchpad.js", esm={"sketchcore-app": "web"}):
    """Canvas and 3D viewer at once, with toolbar, panel and dialogs; it talks to the routes of `server` by itself."""

    def __init__(
        self,
        actions: Mapping[str, Mapping[str, Any]],
        viewpoints: Mapping[str, Sequence[float]],
        labels: Mapping[str, str],
        quarters: Sequence[str],
        scenes: Sequence[Mapping[str, str]],
        example: str,
    ) -> None:
        """Puts the workspace on the page.

        Args:
            actions: name -> {"name", "label", "icon", "keys"}, in the order of the help.
            viewpoints: name -> packed camera, 15 numbers.
            labels: viewpoint -> what people call it.
            quarters: the viewpoints of a first drawing.
            scenes: {"name", "label"} of the example sessions.
            example: address of the drawings that the first-run example plays.
        """
        super().__init__()
        self._props["actions"] = {name: dict(action) for name, action in actions.items()}
        self._props["viewpoints"] = {name: list(row) for name, row in viewpoints.items()}
        self._props["labels"] = dict(labels)
        self._props["quarters"] = list(quarters)
        self._props["scenes"] = [dict(scene) for scene in scenes]
        self._props["example"] = example
