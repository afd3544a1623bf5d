"""How many buildings of a run were modelled, how well, and which need attention."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ..log import count_things
from ..status import MOSTLY_OFF, Attention, Status, find_attention


class BuildingOutcome(NamedTuple):
    """A building's codes of status and grade, detail, and share of points within 0.2 m or None."""

    status: str
    quality: str | None
    detail: str
    share: float | None


@dataclass(frozen=True)
class Overview:
    """The result of a run: buildings in all, modelled, and in need of attention.

    It has the share of roof points within 0.2 m of the roof (that of the median building, and that
    which a tenth of the buildings fall below). Buildings that need attention are counted by kind.
    """

    buildings: int
    modelled: int
    median_share: float | None = None
    worst_tenth_share: float | None = None
    attention: Mapping[Attention, int] = field(default_factory=dict)

    @classmethod
    def of(cls, outcomes: Iterable[BuildingOutcome]) -> Overview:
        """Count the outcomes.

        >>> good = BuildingOutcome("modelled", "good", "", 0.98)
        >>> off_the_roof, empty = good._replace(share=0.3), good._replace(status="no_points")
        >>> Overview.of([good, off_the_roof, empty]).modelled
        1
        """
        rows = list(outcomes)
        shares = sorted(row.share for row in rows if row.share is not None)
        kinds = Counter(kind for row in rows for kind in find_attention(*row))
        return cls(
            buildings=len(rows),
            modelled=sum(map(is_modelled, rows)),
            median_share=shares[len(shares) // 2] if shares else None,
            worst_tenth_share=shares[len(shares) // 10] if shares else None,
            attention={kind: kinds[kind] for kind in Attention if kinds[kind]},
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the overview for run.json and `--json`."""
        return {
            "buildings": self.buildings,
            "modelled": self.modelled,
            "share_within_20cm_median": self.median_share,
            "share_within_20cm_worst_tenth": self.worst_tenth_share,
            "needs_attention": {kind.code: count for kind, count in self.attention.items()},
        }

    @classmethod
    def from_dict(cls, record: Mapping[str, Any]) -> Overview:
        """Restore the overview from what `to_dict` returned."""
        counts = record.get("needs_attention") or {}
        return cls(
            record.get("buildings") or 0,
            record.get("modelled") or 0,
            record.get("share_within_20cm_median"),
            record.get("share_within_20cm_worst_tenth"),
            {kind: counts[kind.code] for kind in Attention if counts.get(kind.code)},
        )

    @property
    def headline(self) -> str:
        """Say how many of how many buildings were modelled."""
        return f"{self.modelled:,} of {count_things(self.buildings, 'building')} modelled"

    @property
    def fit(self) -> str:
        """Say how well the models fit their points; empty where nothing is known."""
        if self.median_share is None or self.worst_tenth_share is None:
            return ""
        return (
            f"roof points within 0.2 m of the roof: {100 * self.median_share:.1f} % in the median "
            "building; a tenth of the buildings have less than "
            f"{100 * self.worst_tenth_share:.1f} %"
        )


def is_modelled(outcome: BuildingOutcome) -> bool:
    """Return whether a building has a model that most of its points support."""
    status = Status.__members__.get(outcome.status.upper())
    supports = outcome.share is None or outcome.share >= MOSTLY_OFF
    return status is not None and status.is_model and supports


def show_command(folder: str, kind: Attention) -> str:
    """Return the command that shows the run's buildings that need this attention."""
    return f"hiproof edit {folder} --only {kind.code}"
