"""Plots of one estimate: every recording's own values beside the pooled ones, and the excitation of every step."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go

from estimator.estimate.identifiability import FACTOR
from estimator.estimate.result import PayloadEstimate
from mocobot_report.blocks.book import Book
from mocobot_report.blocks.charts import axis, chart, dots, figure, log_axis, row_axis
from mocobot_report.blocks.html import Node, el
from mocobot_report.blocks.legend import Key
from mocobot_report.blocks.numbers import with_error
from mocobot_view.facts.body_facts import BodyFacts

MOMENTS = (
    Key("m1", "moment 1", "c1", "circle"),
    Key("m2", "moment 2", "c2", "square"),
    Key("m3", "moment 3", "c3", "diamond"),
)
AXES = (Key("x", "x", "c1", "circle"), Key("y", "y", "c2", "square"), Key("z", "z", "c3", "diamond"))
TRUTH = Key("truth", "truth", "text", "x")
SIGNAL = Key("signal", "a direction of the parameters", "nominal", "circle")
WEAK = Key("", "too weak below", "text", "dash")
APART = 0.17
Measured = tuple[float, float]
"""A value and its standard error."""


def moment_chart(book: Book, e: PayloadEstimate, truth: BodyFacts | None) -> Node:
    """Principal moments of every recording, relative to the pooled ones, with standard errors."""
    if e.inertia is None:
        return el("p", "The inertia is not determined.")
    pooled = e.inertia.principal
    found = [(Path(r.name).name, r.inertia.principal) for r in e.recordings if r.inertia is not None]
    rows = [("pooled", pooled), *found]

    def read(p: Any, k: int) -> Measured:
        return float(p.moments[k]), float(p.moments_se[k])

    traces = _against_pooled(rows, MOMENTS, read, "kg m²", lambda k: 100.0 / float(pooled.moments[k]))
    legend = list(MOMENTS)
    if truth is not None and truth.principal_kgm2 is not None:
        shares = [float(s) for s in 100.0 * (np.sort(truth.principal_kgm2) / pooled.moments - 1.0)]
        text = [f"truth, moment {k + 1}" for k in range(len(shares))]
        traces.append(dots(shares, [APART * (k - 1) for k in range(len(shares))], TRUTH, text, size=8))
        legend.append(TRUTH)
    return _pooled_chart(
        book, "Principal moments of inertia against the pooled estimate", traces, [name for name, _ in rows], legend,
        "difference [%]",
        "Each recording's own principal moments of inertia relative to the pooled ones, with standard errors.",
    )  # fmt: skip


def grasp_charts(book: Book, e: PayloadEstimate) -> Node | None:
    """Positions of the grasps from every recording alone, relative to the pooled ones, with standard errors."""
    found = [(Path(r.name).name, r.grasps) for r in e.recordings if r.grasps is not None]
    if e.grasps is None or not found:
        return None

    def read(pair: Any, k: int) -> Measured:
        return 1e3 * float(pair.p_ij[k]), 1e3 * float(pair.p_se_m[k])

    charts = []
    for j in range(2, e.robots + 1):
        rows = [(name, grasps.pair(1, j)) for name, grasps in [("pooled", e.grasps), *found]]
        charts.append(
            _pooled_chart(
                book, f"Position of grasp {j} in {{1}} against the pooled estimate",
                _against_pooled(rows, AXES, read, "mm"), [name for name, _ in rows], AXES, "difference [mm]",
                f"Each recording's own position of grasp {j} relative to the pooled one, with standard errors.",
            )
        )  # fmt: skip
    return el("div", *charts, class_="pair")


def _against_pooled(
    rows: Sequence[tuple[str, Any]], keys: Sequence[Key], read: Callable[[Any, int], Measured], unit: str,
    scale: Callable[[int], float] = lambda k: 1.0,
) -> list[go.Scatter]:  # fmt: skip
    """Differences from the first row, which is the pooled one, with horizontal bars of two standard errors."""
    traces = []
    for k, key in enumerate(keys):
        found = [read(source, k) for _, source in rows]
        differences = [scale(k) * (number - found[0][0]) for number, _ in found]
        text = [
            f"{name}, {key.label}: {with_error(*each, unit)}"
            for (name, _), each in zip(rows, found, strict=True)
        ]
        bars = {"array": [2.0 * scale(k) * se for _, se in found], "thickness": 1.4, "width": 3}
        at = [n + APART * (k - 1) for n in range(len(rows))]
        traces.append(dots(differences, at, key, text, error_x=bars))
    return traces


def _pooled_chart(
    book: Book, title: str, traces: Sequence[go.Scatter], names: Sequence[str], keys: Sequence[Key], across: str,
    label: str,
) -> Node:  # fmt: skip
    shown = figure(
        traces, xaxis=axis(across, zerolinewidth=1.5, nticks=7), yaxis=row_axis(names, 24), margin_l=90
    )
    return chart(
        book, title, shown, height=44 * len(names) + 66, keys=keys, label=label, narrow={"xaxis.nticks": 4},
        note="bars: two standard errors either way",
    )  # fmt: skip


def excitation_chart(book: Book, e: PayloadEstimate) -> Node:
    """Signal over noise of every direction of every step."""
    steps = [s for s in e.steps if s.singular_values]
    if not steps:
        return el("p", "No step had anything to solve for.")
    found = [(k, step, s) for k, step in enumerate(steps) for s in step.singular_values]
    x = [max(s / step.noise if step.noise > 0 else 1e6, 1e-3) for _, step, s in found]
    text = [f"{step.step}: signal {s:.2g} {step.unit}, noise {step.noise:.2g}" for _, step, s in found]
    shown = figure(
        [dots(x, [k for k, _, _ in found], SIGNAL, text, opacity=0.85)],
        xaxis=log_axis("signal over noise (rms)", [1.0, 100.0, *x]),
        yaxis=row_axis([s.step for s in steps], 40), margin_l=150,
    )  # fmt: skip
    shown.add_vline(FACTOR)
    return chart(
        book, "Excitation: signal over noise of every direction", shown, height=34 * len(steps) + 70,
        keys=[SIGNAL, WEAK], narrow={"yaxis.tickfont.size": 10},
        label="Ratio of signal to noise for every direction that each step solves for; the numbers are in the table.",
    )  # fmt: skip
