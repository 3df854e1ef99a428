"""Pictures of Tables II-V: our errors beside the published ones, on logarithmic axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from estimator.files import whole_file
from mocobot_sim.paper.published import published_errors

COLOURS = {"paper": "#6b7280", "ideal": "#2a9d8f", "nominal": "#2f6fd0", "uncalibrated": "#e07b39"}
MARKERS = {"paper": "D", "ideal": "v", "nominal": "o", "uncalibrated": "s"}
PAIRS = ("12", "23", "31")
Scores = Mapping[str, Any]


def save_plots(scores: Mapping[str, Mapping[str, Scores]], folder: Path) -> list[Path]:
    """Draw one picture per table group and return their paths.

    Args:
        scores: by preset, then payload, as in ``paper.json``.
        folder: existing folder for ``grasps.png``, ``mass_com.png`` and ``inertia.png``.
    """
    payloads = list(next(iter(scores.values())))
    series = {"paper": {p: published_errors(p) for p in payloads}, **scores}
    grasps = [(f"({p}) {pair}", p, pair) for p in payloads for pair in PAIRS]
    moments = [(f"({p}) {name}", p, name) for p in payloads for name in ("Ixx", "Iyy", "Izz")]
    paths = []

    figure = Figure(figsize=(11, 7.5), layout="constrained")  # without pyplot: no display, no global state
    axes = figure.subplots(2, 1)
    labels = [label for label, _, _ in grasps]
    _dots(
        axes[0], labels, {n: [s[p][f"R{pair}_deg"]["mean"] for _, p, pair in grasps] for n, s in series.items()},
        {n: [s[p][f"R{pair}_deg"]["std"] for _, p, pair in grasps] for n, s in series.items()},
        "Table II: rotation error [deg]",
    )  # fmt: skip
    _dots(
        axes[1], labels, {n: [s[p][f"p{pair}_percent"]["mean"] for _, p, pair in grasps] for n, s in series.items()},
        {n: [s[p][f"p{pair}_percent"]["std"] for _, p, pair in grasps] for n, s in series.items()},
        "Table III: position error [% of |p|]",
    )  # fmt: skip
    paths.append(_save(figure, axes[0], folder / "grasps.png"))

    figure = Figure(figsize=(11, 4.2), layout="constrained")
    axes = figure.subplots(1, 2)
    labels = [f"({p})" for p in payloads]
    for axis, key, title in (
        (axes[0], "m_percent", "Table IV: mass error [%]"),
        (axes[1], "p1c_percent", "Table IV: centre-of-mass error [% of |p1c|]"),
    ):
        _dots(axis, labels, {n: [s[p][key] for p in payloads] for n, s in series.items()}, {}, title)
    paths.append(_save(figure, axes[0], folder / "mass_com.png"))

    figure = Figure(figsize=(11, 4.4), layout="constrained")
    axis = figure.subplots()
    _dots(
        axis, [label for label, _, _ in moments],
        {n: [s[p]["all"][m]["percent"] for _, p, m in moments] for n, s in series.items()},
        {n: [s[p]["all"][m]["std_percent"] for _, p, m in moments] for n, s in series.items()},
        "Table V: |mean error| of the principal moments [%] (whisker: mean + standard deviation of the estimates)",
    )  # fmt: skip
    paths.append(_save(figure, axis, folder / "inertia.png"))
    return paths


def _dots(
    axis: Axes,
    labels: Sequence[str],
    values: Mapping[str, Sequence[float | None]],
    spreads: Mapping[str, Sequence[float | None]],
    title: str,
) -> None:
    """One dot per column and row; whiskers reach up by one standard deviation (down has no meaning on a log axis)."""
    for k, (name, heights) in enumerate(values.items()):
        x = [i + 0.13 * (k - (len(values) - 1) / 2) for i in range(len(labels))]
        shown = [float("nan") if h is None else h for h in heights]
        up = [0.0 if s is None else s for s in spreads.get(name, [None] * len(labels))]
        axis.errorbar(
            x, shown, yerr=[[0.0] * len(up), up], label=name, color=COLOURS.get(name),
            fmt=MARKERS.get(name, "o"), markersize=6, elinewidth=1.2, capsize=2,
        )  # fmt: skip
    axis.set_yscale("log")
    axis.set_xlim(-0.5, len(labels) - 0.5)
    axis.set_xticks(range(len(labels)), labels)
    axis.set_xticks([i + 0.5 for i in range(len(labels) - 1)], minor=True)
    axis.tick_params(axis="x", which="both", length=0)
    axis.grid(axis="y", alpha=0.3)
    axis.grid(axis="x", which="minor", alpha=0.3)
    axis.set_title(title, loc="left", fontsize=10)


def _save(figure: Figure, legend_of: Axes, path: Path) -> Path:
    handles, labels = legend_of.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=len(labels), frameon=False, fontsize=9)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=130, format="png")
    return path
