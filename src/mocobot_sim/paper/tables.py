"""Tables II-V as text: the paper's columns, then one column per sensor preset."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from estimator.paper_tables import published_errors

PAIRS = ("12", "23", "31")
MOMENTS = ("Ixx", "Iyy", "Izz")
Scores = Mapping[str, Any]


def format_tables(scores: Mapping[str, Mapping[str, Scores]]) -> str:
    """All four tables.

    Args:
        scores: by preset, then payload, as in ``paper.json``.
    """
    presets = list(scores)
    payloads = list(scores[presets[0]])

    def table(title: str, note: str, rows: Sequence[tuple[str, Callable[[Scores], str]]]) -> str:
        columns = [("paper", {p: published_errors(p) for p in payloads}), *scores.items()]
        cells = [["", "", *(name for name, _ in columns)]]
        for payload in payloads:
            for k, (label, cell) in enumerate(rows):
                head = f"({payload})" if k == 0 else ""
                cells.append([head, label, *(cell(column[payload]) for _, column in columns)])
        return f"{title}\n{note}\n\n{_align(cells)}"

    return "\n\n".join(
        [
            table(
                "Table II. Relative grasp orientation: error angle [deg]",
                "mean +- standard deviation over the random trials",
                [(f"R{pair}", lambda s, key=f"R{pair}_deg": _spread(s[key])) for pair in PAIRS],
            ),
            table(
                "Table III. Relative grasp position: error [m] and error relative to |p| [%]",
                "mean +- standard deviation over the random trials",
                [
                    (f"p{pair} {unit}", lambda s, key=f"p{pair}_{key}": _spread(s[key]))
                    for pair in PAIRS
                    for unit, key in (("[m]", "m"), ("[%]", "percent"))
                ],
            ),
            table(
                "Table IV. Mass and centre of mass: error, and error relative to the truth [%]",
                "one set of six static holds",
                [
                    (label, lambda s, key=key: _number(s[key]))
                    for label, key in (
                        ("m [kg]", "m_kg"),
                        ("m [%]", "m_percent"),
                        ("p1c [m]", "p1c_m"),
                        ("p1c [%]", "p1c_percent"),
                    )
                ],
            ),
            table(
                "Table V. Principal moments of inertia: error [kg m^2] and relative error [%]",
                "|mean error| +- standard deviation of the estimates over random and periodic trials",
                [(f"{name} [kg m^2]", lambda s, n=name: _spread(s["all"][n])) for name in MOMENTS]
                + [
                    (
                        f"{name} [%]",
                        lambda s, n=name: _pair(s["all"][n]["percent"], s["all"][n]["std_percent"]),
                    )
                    for name in MOMENTS
                ],
            ),
        ]
    )


def format_summary(scores: Mapping[str, Mapping[str, Scores]]) -> str:
    """The largest mean error of every kind over payloads (and pairs or moments), the paper's beside ours."""
    payloads = list(next(iter(scores.values())))
    columns = [("paper", {p: published_errors(p) for p in payloads}), *scores.items()]

    def largest(column: Mapping[str, Scores], values: Callable[[Scores], list[float | None]]) -> str:
        found = [value for payload in payloads for value in values(column[payload]) if value is not None]
        return _number(max(found, default=None))

    def moments(kind: str) -> Callable[[Scores], list[float | None]]:
        return lambda s: [s[kind][name]["percent"] for name in MOMENTS] if kind in s else []

    rows: list[tuple[str, Callable[[Scores], list[float | None]]]] = [
        ("grasp rotation [deg]", lambda s: [s[f"R{pair}_deg"]["mean"] for pair in PAIRS]),
        ("grasp position [mm]", lambda s: [1e3 * s[f"p{pair}_m"]["mean"] for pair in PAIRS]),
        ("grasp position [%]", lambda s: [s[f"p{pair}_percent"]["mean"] for pair in PAIRS]),
        ("mass [%]", lambda s: [s["m_percent"]]),
        ("centre of mass [mm]", lambda s: [None if s["p1c_m"] is None else 1e3 * s["p1c_m"]]),
        ("centre of mass [%]", lambda s: [s["p1c_percent"]]),
        ("inertia, all trials [%]", moments("all")),
        ("inertia, periodic trials [%]", moments("periodic")),
        ("inertia, random trials [%]", moments("random")),
    ]
    cells = [["largest error over the payloads", *(name for name, _ in columns)]]
    cells += [[label, *(largest(column, values) for _, column in columns)] for label, values in rows]
    return _align(cells)


def _spread(entry: Mapping[str, float | None]) -> str:
    return _pair(entry["mean"], entry["std"])


def _pair(mean: float | None, std: float | None) -> str:
    return _number(mean) if std is None else f"{_number(mean)} +- {_number(std)}"


def _number(value: float | None) -> str:
    if value is None:
        return "none"
    return f"{value:.2g}" if value >= 1e-4 or value == 0 else f"{value:.1e}"


def _align(cells: Sequence[Sequence[str]]) -> str:
    widths = [max(len(row[k]) for row in cells) for k in range(len(cells[0]))]
    lines = [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in cells
    ]
    return "\n".join([lines[0], "-" * max(map(len, lines)), *lines[1:]])
