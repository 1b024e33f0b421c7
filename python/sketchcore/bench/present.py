"""A report as a table for the terminal."""

from __future__ import annotations

from rich.table import Table

from sketchcore.bench.jobs import Report, Row


def as_table(report: Report) -> Table:
    """A row for each peer of each job; what is missing, and how to get it, below."""
    machine = report.machine
    table = Table(title=f"{machine.processor}, {machine.cores} cores; medians of {report.repetitions}")
    for name, justify in (("job, against", "left"), ("time", "right"), ("ratio", "right"), ("bar", "right")):
        table.add_column(name, justify=justify, no_wrap=justify == "right")  # type: ignore[arg-type]
    for row in report.rows:
        table.add_row(f"[bold]{row.job}[/]", f"[bold]{_time(row.seconds)}[/]")
        for peer in row.peers:
            if peer.seconds is None or peer.ratio is None:
                table.add_row(f"  {peer.name}", "", "missing", _bar(row, peer.bar))
            else:
                ratio = f"{peer.ratio:.3g}x" if peer.met else f"[bold red]{peer.ratio:.3g}x[/]"
                table.add_row(f"  {peer.name}", _time(peer.seconds), ratio, _bar(row, peer.bar))
        table.add_row("  floor", _time(row.floor), f"{row.floor / row.seconds:.2g}x", end_section=True)
    missing = {peer.missing: peer.name for row in report.rows for peer in row.peers if peer.missing}
    table.caption = "\n".join(
        [
            f"floor: what has to be moved at {machine.bandwidth / 1e9:.1f} GB/s, or computed at "
            f"{machine.arithmetic / 1e9:.0f} Gflop/s, as measured on one core",
            *(f"missing: {name}: {why}" for why, name in missing.items()),
        ]
    )
    return table


def _bar(row: Row, bar: float) -> str:
    return f"at most {bar:g}x" if row.cost else f"at least {bar:g}x"


def _time(seconds: float) -> str:
    return f"{seconds * 1e6:.1f} µs" if seconds < 1e-3 else f"{seconds * 1e3:.2f} ms"
