"""The command line: thin callers of the package's functions, a file for each kind of work."""

# In the order in which the help lists them.
# isort: off
from sketchcore.cli import solids, data, training, measuring, serving
from sketchcore.cli.application import app
# isort: on

__all__ = ["app", "data", "measuring", "serving", "solids", "training"]
