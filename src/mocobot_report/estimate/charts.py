"""Plots of one estimate: every recording's own values beside the pooled ones, and the excitation of every step."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from estimator.estimate.identifiability import FACTOR
from estimator.estimate.result import PayloadEstimate
from mocobot_report.blocks.book import Book
from mocobot_report.blocks.charts import Json, Key, axis, chart, dots, layout, literal, log_axis, paint
from mocobot_report.blocks.html import Node, el
from mocobot_report.blocks.numbers import with_error
from mocobot_view.facts.body_facts import BodyFacts

MOMENTS = (
    Key("m1", "moment 1", "c1", "circle"),
    Key("m2", "moment 2", "c2", "square"),
    Key("m3", "moment 3", "c3", "diamond"),
)
AXES = (Key("x", "x", "c1", "circle"), Key("y", "y", "c2", "square"), Key("z", "z", "c3", "diamond"))
TRUTH = Key("truth", "truth", "text", "x")
APART = 0.17


def moment_chart(book: Book, e: PayloadEstimate, truth: BodyFacts | None) -> Node:
    """Principal moments of every recording, relative to the pooled ones, with standard errors."""
    if e.inertia is None:
        return el("p", "The inertia is not determined.")
    pooled = e.inertia.principal
    found = [(Path(r.name).name, r.inertia.principal) for r in e.recordings if r.inertia is not None]
    rows = [("pooled", pooled), *found]
    data: list[Json] = []
    for k, key in enumerate(MOMENTS):
        scale = 100.0 / float(pooled.moments[k])
        values = [scale * float(p.moments[k] - pooled.moments[k]) for _, p in rows]
        errors = [scale * float(p.moments_se[k]) for _, p in rows]
        text = [
            f"{name}, {key.label}: {with_error(float(p.moments[k]), float(p.moments_se[k]), 'kg m²')}"
            for name, p in rows
        ]
        data.append(_sideways(values, errors, key, k, len(rows), text))
    legend = list(MOMENTS)
    if truth is not None and truth.principal_kgm2 is not None:
        true = np.sort(truth.principal_kgm2)
        shares = [100.0 * float(t / p - 1.0) for t, p in zip(true, pooled.moments, strict=True)]
        data.append(_true(shares, len(rows)))
        legend.append(TRUTH)
    names = [name for name, _ in rows]
    return chart(
        book, "Principal moments of inertia against the pooled estimate", _figure(data, names, "difference [%]"),
        height=_height(len(rows)), keys=legend, note="bars: two standard errors either way",
        label="Each recording's own principal moments of inertia relative to the pooled ones, with standard errors.",
    )  # fmt: skip


def grasp_charts(book: Book, e: PayloadEstimate) -> Node | None:
    """Positions of the grasps from every recording alone, relative to the pooled ones, with standard errors."""
    found = [(Path(r.name).name, r.grasps) for r in e.recordings if r.grasps is not None]
    if e.grasps is None or not found:
        return None
    charts = []
    for j in range(2, e.robots + 1):
        pooled = e.grasps.pair(1, j)
        pairs = [("pooled", pooled), *((name, grasps.pair(1, j)) for name, grasps in found)]
        data = []
        for k, key in enumerate(AXES):
            values = [1e3 * float(p.p_ij[k] - pooled.p_ij[k]) for _, p in pairs]
            errors = [1e3 * float(p.p_se_m[k]) for _, p in pairs]
            text = [
                f"{name}, {key.label}: {with_error(1e3 * float(p.p_ij[k]), 1e3 * float(p.p_se_m[k]), 'mm')}"
                for name, p in pairs
            ]
            data.append(_sideways(values, errors, key, k, len(pairs), text))
        charts.append(
            chart(
                book,
                f"Position of grasp {j} in {{1}} against the pooled estimate",
                _figure(data, [name for name, _ in pairs], "difference [mm]"),
                height=_height(len(pairs)),
                keys=AXES,
                note="bars: two standard errors either way",
                label=f"Each recording's own position of grasp {j} relative to the pooled one, with standard errors.",
            )
        )
    return el("div", *charts, class_="pair")


def _sideways(values: list[float], errors: list[float], key: Key, k: int, rows: int, text: list[str]) -> Json:
    """Points with horizontal bars of two standard errors, one row each, from the top."""
    trace = dots([], [], key, text=text)
    at = [rows - 1 - n + APART * (1 - k) for n in range(rows)]
    bars = {
        "type": "data",
        "array": [2.0 * s for s in errors],
        "color": paint(key.colour),
        "thickness": 1.4,
        "width": 3,
    }
    return trace | {"x": values, "y": at, "error_x": bars}


def _true(values: list[float], rows: int) -> Json:
    trace = dots([], [], TRUTH, text=[f"truth, moment {k + 1}" for k in range(len(values))], size=8)
    return trace | {"x": values, "y": [rows - 1 + APART * (1 - k) for k in range(len(values))]}


def _figure(data: list[Json], names: list[str], title: str) -> Json:
    rows = len(names)
    short = [literal(name, 24) for name in names]
    return {
        "data": data,
        "layout": layout(
            xaxis=axis(title, zeroline=True, zerolinewidth=1.5, nticks=7),
            yaxis=axis(
                tickvals=list(range(rows)), ticktext=short[::-1], range=[-0.6, rows - 0.4], zeroline=False,
                fixedrange=True,
            ),
            margin={"l": 90, "r": 14, "t": 6, "b": 44},
        ),
        "narrow": {"xaxis.nticks": 4},
    }  # fmt: skip


def _height(rows: int) -> int:
    return 44 * rows + 66


def excitation_chart(book: Book, e: PayloadEstimate) -> Node:
    """Signal over noise of every direction of every step."""
    steps = [s for s in e.steps if s.singular_values]
    if not steps:
        return el("p", "No step had anything to solve for.")
    key, weak = (
        Key("signal", "a direction of the parameters", "nominal", "circle"),
        Key("", "too weak below", "text", "dash"),
    )
    x: list[float] = []
    y: list[int] = []
    text: list[str] = []
    for k, step in enumerate(steps):
        for s in step.singular_values:
            x.append(max(s / step.noise if step.noise > 0 else 1e6, 1e-3))
            y.append(len(steps) - 1 - k)
            text.append(f"{step.step}: signal {s:.2g} {step.unit}, noise {step.noise:.2g}")
    trace = dots([], [], key, text=text, size=9, opacity=0.85) | {"x": x, "y": y}
    line: dict[str, Any] = {"type": "line", "xref": "x", "yref": "paper", "x0": FACTOR, "x1": FACTOR, "y0": 0, "y1": 1,
                            "line": {"color": paint("text"), "width": 1.2, "dash": "dash"}}  # fmt: skip
    figure: Json = {
        "data": [trace],
        "layout": layout(
            xaxis=log_axis("signal over noise (rms)", min(1.0, *x), max(100.0, *x)),
            yaxis=axis(
                tickvals=list(range(len(steps))), ticktext=[s.step for s in steps][::-1],
                range=[-0.6, len(steps) - 0.4], zeroline=False, fixedrange=True,
            ),
            shapes=[line],
            margin={"l": 150, "r": 14, "t": 6, "b": 44},
        ),
        "narrow": {"yaxis.tickfont.size": 10},
    }  # fmt: skip
    return chart(
        book, "Excitation: signal over noise of every direction", figure, height=34 * len(steps) + 70, keys=[key, weak],
        label="Ratio of signal to noise for every direction that each step solves for; the numbers are in the table.",
    )  # fmt: skip
