"""python -m sketchcore.cli."""

from sketchcore.cli import app

app()
