"""Two results compared.

format, version     "mocobot-comparison", 1
kind                "estimate", "calibration" or "diagnosis"
a, b                what was compared: names of files or folders
changed             whether anything differs by more than its errors
groups              list of {name, unit, chi2, dof, p, changed, together, quantities}: p of so large a difference by
                    chance, correlations heeded; together is a list of {entries [2], correlation} of errors that move
                    together; chi2 is null if there is a difference and no error
    quantities      list of {name, a, a_se, b, b_se, difference, se, ratio}; the difference is b - a; ratio is null as
                    chi2
level               probability of a false alarm anywhere, and least_p, what it leaves to each group
changes             sentences: what only one of them has
notes               sentences
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from mocobot.comparison import rules
from mocobot.comparison.difference import Group

FORMAT, VERSION = "mocobot-comparison", 1


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two results of one kind.

    Attributes:
        kind: ``"estimate"``, ``"calibration"`` or ``"diagnosis"``.
        a, b: what they are called.
        groups: what both give, with the differences.
        changes: what only one of them has, or says otherwise, one sentence each.
        notes: what to know before trusting the differences, one sentence each.
    """

    kind: str
    a: str
    b: str
    groups: tuple[Group, ...]
    changes: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def least_p(self) -> float:
        """Probability below which a group has changed."""
        return rules.LEVEL / max(1, len(self.groups))

    @property
    def changed_groups(self) -> tuple[Group, ...]:
        """Those that differ by more than their errors, the clearest first."""
        found = [group for group in self.groups if group.p < self.least_p]
        return tuple(sorted(found, key=lambda group: -group.chi2 / max(1, group.dof)))

    @property
    def changed(self) -> bool:
        """Whether anything did."""
        return bool(self.changed_groups or self.changes)

    def to_dict(self) -> dict[str, Any]:
        """Strict JSON as documented at the head of this module."""
        return {
            "format": FORMAT,
            "version": VERSION,
            "kind": self.kind,
            "a": self.a,
            "b": self.b,
            "changed": self.changed,
            "groups": [_group(group, group.p < self.least_p) for group in self.groups],
            "level": rules.LEVEL,
            "least_p": self.least_p,
            "changes": list(self.changes),
            "notes": list(self.notes),
        }


def _group(group: Group, changed: bool) -> dict[str, Any]:
    errors = [np.sqrt(np.maximum(np.diag(c), 0.0)) for c in (group.a_covariance, group.b_covariance)]
    columns = (group.a, errors[0], group.b, errors[1], group.difference, group.se, group.ratio)
    keys = ("a", "a_se", "b", "b_se", "difference", "se", "ratio")
    return {
        "name": group.name,
        "unit": group.unit,
        "chi2": _finite(group.chi2),
        "dof": group.dof,
        "p": group.p,
        "changed": changed,
        "together": [{"entries": [i, j], "correlation": float(r)} for i, j, r in group.together],
        "quantities": [
            {"name": entry} | {key: _finite(column[k]) for key, column in zip(keys, columns, strict=True)}
            for k, entry in enumerate(group.entries)
        ],
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
