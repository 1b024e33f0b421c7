"""Solids as files to save."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from urllib.parse import quote

from fastapi import Response

MEDIA_TYPES = {
    ".glb": "model/gltf-binary",
    ".obj": "model/obj",
    ".stl": "model/stl",
    ".sketchcore": "application/zip",
}
"""Of files, by their suffix; of others, `OTHER`."""
OTHER = "application/octet-stream"


def attachment(content: bytes, name: str, suffix: str, headers: Mapping[str, str] | None = None) -> Response:
    """A file to save.

    Args:
        content: what is in it.
        name: what people call it, in any script.
        suffix: with the dot.
        headers: more headers of the answer.
    """
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    plain = re.sub(r"[^A-Za-z0-9 _-]+", "", plain).strip() or "sketch"
    names = f"filename=\"{plain}{suffix}\"; filename*=UTF-8''{quote(name, safe='')}{suffix}"
    disposition = {"Content-Disposition": f"attachment; {names}"}
    return Response(content, media_type=MEDIA_TYPES.get(suffix, OTHER), headers={**disposition, **(headers or {})})
