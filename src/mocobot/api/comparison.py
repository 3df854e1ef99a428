"""Compare two results: which numbers differ by more than their standard errors.

Keys of the JSON:

format, version     "mocobot-comparison", 1
kind                "estimate", "estimate of two bodies", "calibration", "joint calibration" or "diagnosis"
a, b                names of the compared files or folders
changed             whether anything differs by more than its standard errors
groups              list of {name, unit, chi2, dof, p, changed, together, quantities}: p is the p-value of the
                    chi-square test with correlations; together lists {entries [2], correlation} of strongly
                    correlated errors; chi2 is null if a difference has no error
quantities          list of {name, a, a_se, b, b_se, difference, se, ratio}: difference is b - a; ratio is difference
                    over se, null if a difference has no error
level               probability of a false alarm in any group; least_p is its share for each group
changes             sentences: findings that only one of the results has
notes               sentences
"""

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from discrepancy.result.read import FORMAT as DIAGNOSIS
from discrepancy.result.read import NAME as DIAGNOSIS_NAME
from discrepancy.result.read import parse_diagnosis
from estimator.calibrate.json import FORMAT as CALIBRATION
from estimator.calibrate.json import calibration_from_dict
from estimator.errors import InputError
from estimator.estimate.result import FORMAT as ESTIMATE
from estimator.estimate.result import PayloadEstimate
from estimator.extras import draws_plots
from estimator.files import write_json, write_text
from estimator.statistics import measured
from estimator.strict import read_json
from estimator.two_bodies.result import FORMAT as TWO_BODIES
from estimator.two_bodies.result import TwoBodies
from mocobot.api import comparison_groups as groups_of
from mocobot.api.comparison_groups import LEVEL, TOGETHER, Group
from mocobot.checks import CALIBRATION as CALIBRATION_NAME
from mocobot.results import Folder

FORMAT, VERSION = "mocobot-comparison", 1
NAME, REPORT, PICTURE = "comparison.json", "report.txt", "comparison.png"
TWO = "estimate of two bodies"
KINDS = {ESTIMATE: "estimate", TWO_BODIES: TWO, CALIBRATION: "calibration", DIAGNOSIS: "diagnosis"}
KINDS["mocobot-joint-calibration"] = "joint calibration"  # discrepancy.joints.calibrated loads mujoco
SOUGHT = "an estimate of `mocobot estimate`, or a calibration or diagnosis of `mocobot calibrate` or `diagnose --out`"
WIDTH = 110


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Folder):
    """Differences between two results of one kind; prints as text and writes a folder.

    Attributes:
        kind: ``"estimate"``, ``"estimate of two bodies"``, ``"calibration"``, ``"joint calibration"`` or
            ``"diagnosis"``.
        a, b: names of the results.
        groups: quantities that both results contain, with their differences.
        changes: findings that only one result has or that differ, one sentence each.
        notes: caveats about the differences, one sentence each.
    """

    kind: str
    a: str
    b: str
    groups: tuple[Group, ...]
    changes: tuple[str, ...]
    notes: tuple[str, ...]
    result = "comparison"

    @property
    def least_p(self) -> float:
        """Threshold of the p-value below which a group counts as changed (Bonferroni)."""
        return LEVEL / max(1, len(self.groups))

    @property
    def changed_groups(self) -> tuple[Group, ...]:
        """Groups that differ by more than their standard errors, the clearest first."""
        found = [group for group in self.groups if group.p < self.least_p]
        return tuple(sorted(found, key=lambda group: -group.chi2 / max(1, group.dof)))

    @property
    def changed(self) -> bool:
        """Whether any group or finding changed."""
        return bool(self.changed_groups or self.changes)

    @property
    def what_changed(self) -> str:
        """Names of the changed groups with their largest difference, the clearest first."""
        return "; ".join(f"{group.name} ({_clearest(group)})" for group in self.changed_groups)

    def __repr__(self) -> str:
        """Return a one-line summary."""
        groups = f"{len(self.changed_groups)} of {len(self.groups)} groups changed"
        return f"<Comparison of two results, {self.kind}: {groups}>"

    def __str__(self) -> str:
        """Return the text report."""
        plural = {"diagnosis": "diagnoses", TWO: "estimates of two bodies"}.get(self.kind, f"{self.kind}s")
        lines = [f"Two {plural}: A is {self.a}", f"{'':{len(plural) + 6}}B is {self.b}", ""]
        lines += _fill(self.verdict)
        lines += [line for sentence in self.changes for line in _fill(sentence, "- ")]
        names = [_label(group, entry) for group in self.groups for entry in group.entries]
        width = min(WIDTH // 2, max(map(len, names), default=0))
        if self.groups:
            lines += ["", f"{'':{width}}{'A':>24}{'B':>24}{'B - A':>24}{'over its error':>16}"]
        changed = self.changed_groups
        for group in self.groups:
            lines += [
                f"{_beside(_label(group, entry), width)}{row}{' *' * (group in changed)}"
                for entry, row in zip(group.entries, _rows(group), strict=True)
            ]
        if close := [group.name for group in self.groups if group.together]:
            said = f"Errors within a group move together (correlation above {TOGETHER}), which the test heeds"
            lines += ["", *_fill(f"{said}: {'; '.join(close)}.", "- ")]
        lines += [line for note in self.notes for line in _fill(note, "- ")]
        return "\n".join(lines).rstrip()

    @property
    def verdict(self) -> str:
        """State in one sentence what changed."""
        tests = f"{len(self.groups)} groups of numbers are tested together, one false alarm in a hundred comparisons"
        if not self.groups and not self.changes:
            return "NOTHING TO COMPARE: they have no number in common."
        if not self.changed:
            return f"NOTHING CHANGED beyond its errors ({tests})."
        if not self.changed_groups:
            return "CHANGED; what both give agrees within its errors." if self.groups else "CHANGED."
        return f"CHANGED beyond its errors, marked with a star ({tests}): {self.what_changed}."

    def to_dict(self) -> dict[str, Any]:
        """Return strict JSON values; the docstring of this module documents the keys."""
        return {
            "format": FORMAT,
            "version": VERSION,
            "kind": self.kind,
            "a": self.a,
            "b": self.b,
            "changed": self.changed,
            "groups": [_values(group, group.p < self.least_p) for group in self.groups],
            "level": LEVEL,
            "least_p": self.least_p,
            "changes": list(self.changes),
            "notes": list(self.notes),
        }

    def write_into(self, folder: Path, *, pictures: bool = True, **more: Any) -> None:
        """Write JSON, text and a picture into an existing folder.

        Args:
            folder: existing folder.
            pictures: whether to draw the picture.
            more: further keys of the JSON.

        Raises:
            InputError: a file cannot be written.
        """
        write_json(folder / NAME, self.to_dict() | more)
        write_text(folder / REPORT, f"{self}\n")
        if pictures and self.groups and draws_plots():
            from mocobot.plots import save_comparison  # matplotlib

            save_comparison(self, folder / PICTURE)


def compare(a: Any, b: Any) -> Comparison:
    """Compare two estimates, calibrations or diagnoses: which numbers changed by more than their standard errors.

    Args:
        a, b: results of ``estimate``, ``calibrate`` or ``diagnose``, both of one kind; or their files or folders.

    Raises:
        InputError: a result cannot be read, or the two differ in kind or in their number of robots.
    """
    one, other = _read(a), _read(b)
    if one.kind != other.kind:
        raise InputError(
            f"{one.name} is {_a(one.kind)} and {other.name} {_a(other.kind)}; both must be of one kind"
        )
    x, y, changes = one.value, other.value, []
    if one.kind == "estimate":
        groups, notes = groups_of.estimate_groups(x, y), groups_of.estimate_notes(x, y)
    elif one.kind == TWO:
        groups, notes = groups_of.two_body_groups(x, y), groups_of.two_body_notes(x, y)
        changes = groups_of.two_body_changes(x, y)
    elif one.kind == "calibration":
        groups, notes = groups_of.calibration_groups(x, y), groups_of.calibration_notes(x, y)
    elif one.kind == "joint calibration":
        groups, notes = groups_of.joint_groups(x, y), groups_of.joint_notes(x, y)
    else:
        if {x.get("machine"), y.get("machine")} >= {"team", "joints"}:
            raise InputError(
                f"{one.name} and {other.name} are diagnoses of a team and of one robot's joints; both must be of one "
                "kind"
            )
        groups, notes = groups_of.diagnosis_groups(x, y), groups_of.diagnosis_notes(x, y)
        changes = groups_of.diagnosis_changes(x, y)
    if shared := sorted({name for digest, name in one.files.items() if digest in other.files}):
        first = (
            f"Both were made from {', '.join(shared)}: errors that come from there are in both, and differences are "
            "better known than is said."
        )
        notes = [first, *notes]
    return Comparison(one.kind, one.name, other.name, tuple(groups), tuple(changes), tuple(notes))


@dataclass(frozen=True)
class _Result:
    """A result that was read; ``files`` maps the SHA-256 of each of its input files to the file's name."""

    name: str
    kind: str
    value: Any
    files: Mapping[str, str]


def _read(given: Any) -> _Result:
    if not isinstance(given, Path | str):
        return _result(f"{given!r}", f"{given!r}", given.to_dict())
    file = _file(Path(given))
    return _result(str(given), str(file), read_json(file, SOUGHT))


def _file(path: Path) -> Path:
    """Return the JSON file of a result: the path itself, or the only result in a folder."""
    if not path.is_dir():
        return path
    found = [path / name for name in (CALIBRATION_NAME, DIAGNOSIS_NAME) if (path / name).is_file()]
    found = found or sorted(one for one in path.glob("*.json") if not one.name.endswith(".truth.json"))
    if len(found) != 1:
        what = "holds no result" if not found else f"holds {len(found)} JSON files"
        raise InputError(f"{path}: {what}; name the file of {SOUGHT}")
    return found[0]


def _result(name: str, where: str, values: dict[str, Any]) -> _Result:
    kind, value = KINDS.get(str(values.get("format"))), values
    if kind in ("estimate", TWO):
        try:
            value: Any = (PayloadEstimate if kind == "estimate" else TwoBodies).from_dict(values)
        except InputError as error:
            raise InputError(f"{where}: {error}") from error
    elif kind == "calibration":
        value = calibration_from_dict(values, where)
    elif kind == "joint calibration":
        from discrepancy.joints.calibrated import from_dict

        value = from_dict(values, where)
    elif kind == "diagnosis":
        parse_diagnosis(values, Path(where))
    else:
        raise InputError(f"{where}: format is {values.get('format')!r:.40}; it must be {SOUGHT}")
    made = values.get("provenance")
    listed = made.get("files", []) if isinstance(made, dict) else []
    files = {str(f.get("sha256")): str(f.get("name")) for f in listed if isinstance(f, dict)}
    return _Result(name, kind, value, files)


def _a(kind: str) -> str:
    return f"{'an' if kind.startswith('estimate') else 'a'} {kind}"


def _values(group: Group, changed: bool) -> dict[str, Any]:
    columns = (group.a, group.a_se, group.b, group.b_se, group.difference, group.se, group.ratio)
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


def _clearest(group: Group) -> str:
    """Describe the largest difference of a group in terms of its standard error."""
    k = int(np.argmax(np.abs(group.ratio)))
    entry = f"{group.entries[k]} by " if group.entries[k] else "by "
    return f"{entry}{_with_error(group.difference[k], group.se[k])} {group.unit}".rstrip()


def _rows(group: Group) -> list[str]:
    columns = ((group.a, group.a_se), (group.b, group.b_se), (group.difference, group.se))
    return [
        "".join(f"{_with_error(values[k], se[k]):>24}" for values, se in columns) + f"{group.ratio[k]:16.1f}"
        for k in range(len(group.entries))
    ]


def _with_error(value: float, se: float) -> str:
    return " +- ".join(measured(value, se)) if se > 0 else f"{value:.6g}"


def _label(group: Group, entry: str) -> str:
    unit = f" [{group.unit}]" if group.unit else ""
    return f"{group.name}{' ' * bool(entry)}{entry}{unit}"


def _beside(name: str, width: int) -> str:
    return name.ljust(width) if len(name) <= width else f"{name}\n{'':{width}}"


def _fill(text: str, mark: str = "") -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent=mark, subsequent_indent=" " * len(mark))
