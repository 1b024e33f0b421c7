"""Accuracy on the fixed test set: tables, figures, plots."""

from sketchcore.evaluate.measure import Report, evaluate

__all__ = ["Report", "evaluate"]
