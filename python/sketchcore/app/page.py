"""The page: what can be done on it, by which button and key, and what it is called."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

from nicegui import ui

from sketchcore.app.examples import SCENES
from sketchcore.app.sketchpad import Sketchpad
from sketchcore.camera import QUARTER_VIEWS, VIEWPOINTS

_STYLE = Path(__file__).parent / "web" / "style.css"
_ICON = Path(__file__).parent / "web" / "icon.svg"


@dataclass(frozen=True)
class Action:
    """Something that can be done by a button or a key.

    Attributes:
        name: what the page's modules call it.
        label: what people read, in tooltips, in the help, and to hear by a screen reader.
        icon: of the Material Symbols that NiceGUI ships.
        keys: combinations, the first one is shown; as `KeyboardEvent.key`, letters small, "Control+", "Shift+" before.
    """

    name: str
    label: str
    icon: str = ""
    keys: tuple[str, ...] = ()


ACTIONS = (
    Action("draw", "Draw", "edit", ("d",)),
    Action("navigate", "Navigate", "3d_rotation", ("n",)),
    Action("switch", "Draw or navigate", "", ("m",)),
    Action("pen", "Pen", "edit", ("p",)),
    Action("construction", "Construction line, not sent", "architecture", ("c",)),
    Action("ellipse", "Ellipse about an axis", "circle", ("e",)),
    Action("eraser", "Eraser", "ink_eraser", ("x",)),
    Action("ruler", "Straight lines", "straighten", ("l",)),
    Action("smaller", "Smaller eraser or ellipse", "", ("[",)),
    Action("larger", "Larger eraser or ellipse", "", ("]",)),
    Action("undo", "Undo", "undo", ("Control+z",)),
    Action("redo", "Redo", "redo", ("Control+y", "Control+Shift+z")),
    Action("clear", "Clear this drawing", "layers_clear"),
    Action("reconstruct", "Reconstruct", "deployed_code", ("Enter",)),
    Action("freeze", "Freeze the shape, begin a new part", "ac_unit", ("f",)),
    Action("doubt", "Show where the shape is unsure", "help_center", ("u",)),
    Action("advised", "Go to the view that would help most", "lightbulb", ("g",)),
    Action("photo", "Import an image or a photo", "add_photo_alternate", ("i",)),
    Action("sessions", "Sessions and files", "menu", ("o",)),
    Action("panel", "Side panel", "right_panel_close", ("s",)),
    Action("theme", "Light or dark", "contrast", ("t",)),
    Action("help", "Help", "help", ("?", "h")),
)

LABELS = {
    "front": "Front",
    "right": "Right",
    "back": "Back",
    "left": "Left",
    "top": "Top",
    "quarter-037": "Three-quarter, front and right",
    "quarter-052": "Three-quarter, right and front",
    "quarter-127": "Three-quarter, right and back",
    "quarter-142": "Three-quarter, back and right",
    "quarter-217": "Three-quarter, back and left",
    "quarter-232": "Three-quarter, left and back",
    "quarter-307": "Three-quarter, left and front",
    "quarter-322": "Three-quarter, front and left",
}
"""Viewpoint -> what people call it; of a three-quarter view the side that is seen more of comes first."""

# The theme is known before anything is painted; NiceGUI's own notices of a lost connection give way to the page's.
_HEAD = """
<meta name="description" content="Draw an object from a few sides, and get a solid shape.">
<script>
  (function () {
    let theme = null;
    try { theme = JSON.parse(localStorage.getItem("sketchcore.theme")); } catch (error) {}
    const dark = matchMedia("(prefers-color-scheme: dark)").matches;
    document.documentElement.dataset.theme = theme || (dark ? "dark" : "light");
    document.documentElement.lang = "en";
  })();
</script>
"""


def build_page() -> None:
    """Registers the page, with NiceGUI, at / and at the address of each session."""
    actions = {action.name: asdict(action) for action in ACTIONS}
    viewpoints = {name: camera.packed.tolist() for name, camera in VIEWPOINTS.items()}
    scenes = [{"name": name, "label": label} for name, label in SCENES.items()]
    style = _STYLE.read_text()

    def workspace() -> None:
        ui.add_head_html(f"{_HEAD}<style>{style}</style>")
        Sketchpad(actions, viewpoints, LABELS, QUARTER_VIEWS, scenes, "/api/examples/tour")

    @ui.page("/", title="sketchcore", favicon=_ICON)
    def root() -> None:
        workspace()

    @ui.page("/s/{id}", title="sketchcore", favicon=_ICON)
    def session(id: str) -> None:
        workspace()
