"""What every part of an evaluation hands out."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Report:
    """Figures, as fields of a frozen dataclass."""

    def to_dict(self) -> dict[str, Any]:
        """The report as plain data."""
        return asdict(self)
