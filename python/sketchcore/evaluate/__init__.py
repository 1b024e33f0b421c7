"""What a network is worth: accuracy, convergence, robustness and cost on the fixed test set, and people's drawings."""

from sketchcore.evaluate.accuracy import Accuracy, measure_accuracy
from sketchcore.evaluate.convergence import Convergence, measure_convergence
from sketchcore.evaluate.drawings import Drawings, measure_drawings
from sketchcore.evaluate.robustness import Robustness, measure_robustness

__all__ = [
    "Accuracy",
    "Convergence",
    "Drawings",
    "Robustness",
    "measure_accuracy",
    "measure_convergence",
    "measure_drawings",
    "measure_robustness",
]
