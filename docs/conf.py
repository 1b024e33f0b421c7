"""How `make docs` builds the guide and the API reference: every page from where it lies in the repository."""

import re
from typing import Any

from sphinx.application import Sphinx

from sketchcore import __version__

project = "sketchcore"
version = release = __version__
copyright = "sketchcore's authors; MIT licence"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
html_theme = "furo"
html_title = f"sketchcore {__version__}"
html_show_sphinx = False

# The source folder is the repository, so that links between pages are the same here as on a forge.
root_doc = "docs/index"
include_patterns = [
    "*.md",
    "docs/*.md",
    "docs/results/README.md",
    "weights/README.md",
    "python/sketchcore/pretrained/MODEL_CARD.md",
]
exclude_patterns = ["docs/_*"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_default_options = {"members": True}
napoleon_use_ivar = True
napoleon_use_rtype = False


def _readable(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, signature: str | None, returned: str | None
) -> Any:
    """Signatures as they are written: arrays by their dtype, no private arguments."""

    def shorten(text: str | None) -> str | None:
        if text is None:
            return None
        text = re.sub(r"~numpy\.ndarray\[tuple\[~typing\.Any, \.\.\.\], ~numpy\.dtype\[(.*?)\]\]", r"NDArray[\1]", text)
        return re.sub(r", _\w+: [^,)]*", "", text).replace("<factory>", "...")

    return shorten(signature), shorten(returned)


def setup(app: Sphinx) -> None:
    """What Sphinx calls."""
    app.connect("autodoc-process-signature", _readable)
