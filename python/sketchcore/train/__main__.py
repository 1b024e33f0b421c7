"""`python -m sketchcore.train`, which is `sketchcore train`; `torchrun -m sketchcore.train` in several processes."""

import typer

from sketchcore.cli.training import train

if __name__ == "__main__":
    typer.run(train)
