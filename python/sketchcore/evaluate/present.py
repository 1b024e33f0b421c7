"""Reports as tables for the terminal."""

from __future__ import annotations

from rich.table import Table

from sketchcore.evaluate.accuracy import ROUNDS, Accuracy
from sketchcore.evaluate.advice import LOTS, Advice
from sketchcore.evaluate.comparison import Comparison
from sketchcore.evaluate.convergence import MANY_ROUNDS, Convergence
from sketchcore.evaluate.distort import STRENGTHS
from sketchcore.evaluate.drawings import Drawings
from sketchcore.evaluate.failures import Failures
from sketchcore.evaluate.robustness import COUNTS, Robustness


def _views(n: int) -> str:
    return f"{n} view{'s' if n > 1 else ''}"


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title)
    table.add_column("")
    for column in columns:
        table.add_column(column, justify="right")
    return table


def accuracy_table(report: Accuracy) -> Table:
    """IoU by row and number of views; 95 % intervals in brackets for all figures."""
    counts = range(1, len(report.carving) + 1)
    table = _table(f"IoU on the first {report.shapes} shapes of {report.source}, world grid", *map(_views, counts))
    for r in range(ROUNDS + 1):
        name = "network, first prediction" if r == 0 else f"network, round {r}"
        table.add_row(name, *(str(by_round[r]) for by_round in report.network))
    table.add_row("gain of the latest drawing", "", *map(str, report.gain))
    table.add_row("concavities left empty", *map(str, report.concavities))
    table.add_row("carving, the same drawings", *map(str, report.carving))
    table.add_row("carving, front / top / right / back", *map(str, report.orthogonal))
    table.caption = (
        f"ceiling of one camera grid {report.ceiling}; viewpoint found (up to the half turn) "
        f"{report.viewpoint}; {report.seconds:.2f} s a shape"
    )
    return table


def convergence_table(report: Convergence) -> Table:
    """Change and IoU after each round, by number of views."""
    counts = range(1, len(report.network) + 1)
    table = _table(f"Rounds, on the first {report.shapes} shapes of the fixed test set", *map(_views, counts))
    for r in range(MANY_ROUNDS + 1):
        table.add_row(f"IoU, round {r}", *(str(by_round[r]) for by_round in report.network))
    for r in range(MANY_ROUNDS):
        table.add_row(f"L2 change, round {r + 1}", *(f"{by_round[r].mean:.2f}" for by_round in report.change))
    table.add_row("best round less last round", *(f"{lost:.4f}" for lost in report.lost))
    table.add_row("IoU's deviation over orders", "", *(f"{spread.mean:.4f}" for spread in report.orders))
    table.caption = f"rounds on a single drawing gain {report.refined}"
    return table


def robustness_table(report: Robustness) -> Table:
    """What each fault costs, by strength and number of views."""
    columns = [f"{_views(count)}, strength {s}" for count in COUNTS for s in (1, 2, 3)]
    table = _table(f"IoU lost to faults, on the first {report.shapes} shapes of the fixed test set", *columns)
    for kind, by_strength in report.drop.items():
        amounts = " / ".join(f"{amount:g}" for amount in STRENGTHS.get(kind, ()))
        cells = [f"{by_strength[s][c].mean:.3f}" for c in range(len(COUNTS)) for s in range(3)]
        table.add_row(f"{kind} {amounts}".strip(), *cells)
    clean = ", ".join(f"{_views(n)} {figure}" for n, figure in zip(COUNTS, report.clean, strict=True))
    table.caption = f"clean drawings: {clean}"
    return table


def drawings_table(report: Drawings) -> Table:
    """How well each solid fills its drawings' outlines."""
    table = _table("People's drawings", "outline IoU", "pieces", "viewpoint")
    for drawn in report.objects:
        overlaps = " ".join(f"{overlap:.2f}" for overlap in drawn.outline)
        table.add_row(drawn.name, overlaps, str(drawn.pieces), " ".join(drawn.views) + " (guessed)" * drawn.guessed)
    return table


def failures_table(report: Failures) -> Table:
    """The shapes with the lowest IoU."""
    table = _table(f"Worst of the first {report.shapes} shapes of the fixed test set, one drawing", "IoU")
    for failure in report.worst:
        table.add_row(f"shape {failure.shape}", f"{failure.iou:.3f}")
    return table


def advice_table(report: Advice) -> Table:
    """IoU with a second drawing from the advised viewpoint and from one drawn by lot."""
    table = _table(f"Second viewpoint, on the first {report.shapes} shapes of the fixed test set", "IoU")
    table.add_row("one drawing", str(report.one))
    table.add_row("and one from the advised viewpoint", str(report.advised))
    table.add_row(f"and one drawn by lot, mean of {LOTS}", str(report.random))
    table.add_row("advised less drawn by lot", str(report.gain))
    table.caption = f"the advised viewpoint is at least as good as {report.better:.0%} of those drawn by lot"
    return table


def comparison_table(report: Comparison) -> Table:
    """IoU of each network, and how far it is from the first one's."""
    counts = range(1, len(next(iter(report.networks.values()))) + 1)
    first = next(iter(report.networks))
    table = _table(f"IoU on {report.shapes} shapes of the fixed test set, world grid", *map(_views, counts))
    for name, figures in report.networks.items():
        table.add_row(name, *map(str, figures))
        if name != first:
            table.add_row(f"  less {first}", *map(str, report.differences[name]))
    return table
