"""Grammars for classes of shapes, in Python: `chair`, `vase`, and those that anybody writes (docs/grammars.md).

The abstract one, which is the default everywhere, is the paper's and lives in Rust (rust/src/grammar.rs).
"""

from __future__ import annotations

import inspect
import runpy
from collections.abc import Mapping
from pathlib import Path

from sketchcore.datagen.grammars.chair import Chair
from sketchcore.datagen.grammars.grammar import Grammar
from sketchcore.datagen.grammars.parts import Dice, Parts, Range
from sketchcore.datagen.grammars.vase import Vase

__all__ = ["GRAMMARS", "Chair", "Dice", "Grammar", "Parts", "Range", "Vase", "find_grammar"]

GRAMMARS: Mapping[str, Grammar] = {grammar.name(): grammar for grammar in (Chair(), Vase())}
"""The grammars that come with the package, by name."""


def find_grammar(grammar: str | Grammar) -> Grammar:
    """A grammar by its name, or the one that a Python file defines; or the one that is given.

    Args:
        grammar: "chair", "vase", the path of a file that ends in .py, or a grammar. The file is run.

    Raises:
        ValueError: for an unknown name, or a file with no grammar or several.
        FileNotFoundError: if there is no such file.
        TypeError: for anything else.
    """
    if isinstance(grammar, Grammar):
        return grammar
    if not isinstance(grammar, str):
        raise TypeError(f"a grammar is a name, a path or a sketchcore.Grammar, got {type(grammar).__name__}")
    if grammar in GRAMMARS:
        return GRAMMARS[grammar]
    if not grammar.endswith(".py"):
        known = ", ".join(GRAMMARS)
        raise ValueError(f"unknown grammar {grammar!r}; it is one of {known}, or a Python file that defines one")
    if not Path(grammar).is_file():
        raise FileNotFoundError(f"no grammar file {grammar}")
    found = [
        value
        for value in runpy.run_path(grammar, run_name="grammar").values()
        if inspect.isclass(value) and issubclass(value, Grammar) and value.__module__ == "grammar"
    ]
    if len(found) != 1:
        names = ", ".join(kind.__name__ for kind in found) or "none"
        raise ValueError(f"{grammar} must define one subclass of sketchcore.Grammar, it has {names}")
    made: Grammar = found[0]()
    return made
