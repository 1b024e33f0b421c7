"""The pages of the guide: their Python runs, their command lines are understood, and the reference is whole."""

import asyncio
import os
import re
import shlex
import shutil
from pathlib import Path

import httpx
import numpy as np
import pytest
import torch
import typer
from sybil import Sybil
from sybil.parsers.markdown import PythonCodeBlockParser

import sketchcore as sk
from sketchcore.cli import app
from sketchcore.serve.api import build_app

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), ROOT / "weights" / "README.md"]
CODE = [page for page in PAGES if "```python" in page.read_text()]
COMMANDS = sorted(
    {
        match.group(1)
        for page in PAGES
        for match in re.finditer(r"^\s*(?:\$ )?(sketchcore [a-z].*?)(?:  +#.*)?$", page.read_text(), re.MULTILINE)
    }
)


def _namespace():
    """What pages take for granted."""
    shape = sk.Shape([sk.Cuboid((0, 0, 0), (0.3, 0.2, 0.2))])
    cameras = [sk.VIEWPOINTS["front"], sk.VIEWPOINTS["top"]]
    drawings = np.stack([sk.draw(shape, camera) for camera in cameras])
    volume = sk.voxelize(shape).astype(np.float32)
    return {
        "sk": sk,
        "torch": torch,
        "shape": shape,
        "camera": cameras[0],
        "cameras": cameras,
        "drawing": drawings[0],
        "drawings": drawings,
        "volume": volume,
        "a": volume,
        "b": volume,
    }


def _post(url, **request):
    """A request to the server that a page takes for granted: to one in this process."""
    assert url.startswith("http://127.0.0.1:8021/")
    app = build_app(sk.load_model())

    async def asked():
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app)) as client:
            return await client.post(url, **request)

    try:
        return asyncio.run(asked())
    finally:
        app.state.service.close()


@pytest.mark.parametrize("page", CODE, ids=lambda page: str(page.relative_to(ROOT)))
def test_the_python_of_a_page_runs(page, tmp_path, monkeypatch):
    for folder in ("examples", "weights"):
        os.symlink(ROOT / folder, tmp_path / folder)
    shutil.copy(ROOT / "examples" / "chair.png", tmp_path / "drawing.png")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("httpx.post", _post)
    examples = Sybil(parsers=[PythonCodeBlockParser()]).parse(page)
    examples.namespace.update(_namespace())
    count = 0
    for example in examples:
        example.evaluate()
        count += 1
    assert count == page.read_text().count("```python")


@pytest.mark.parametrize("line", COMMANDS)
def test_the_command_lines_of_the_pages_are_understood(line):
    words = shlex.split(line, comments=True)
    typer.main.get_command(app).make_context(words[0], words[1:])  # reads the command's name alone
    command = typer.main.get_command(app).commands[words[1]]
    command.make_context(words[1], words[2:])  # and its options; it does not run


def test_pages_show_every_command():
    assert {line.split()[1] for line in COMMANDS} == set(typer.main.get_command(app).commands)


def test_the_reference_has_every_public_name():
    reference = (ROOT / "docs" / "api.md").read_text()
    shown = set(re.findall(r"^\.\. (?:auto\w+|py:data):: (?:sketchcore\.)?(\w+)", reference, re.MULTILINE))
    assert set(sk.__all__) - {"datasets"} <= shown
