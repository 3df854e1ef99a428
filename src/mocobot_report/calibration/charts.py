"""Plots of a calibration: deviations against what was assumed, how well they are known, fits, shares of recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import plotly.graph_objects as go

from estimator.arm.unit import AT, Group
from estimator.calibrate.calibration import GRASPS, INERTIAL, Calibration
from estimator.calibrate.text import SHOWN, shown_groups
from mocobot_report.blocks.book import Book
from mocobot_report.blocks.charts import axis, chart, dots, figure, literal, log_axis, row_axis
from mocobot_report.blocks.html import Node, el
from mocobot_report.blocks.legend import Key
from mocobot_report.blocks.numbers import percent, plain, with_error
from mocobot_report.blocks.units import short_names

FITS = (
    Key("before", "as designed", "before", "circle"),
    Key("after", "calibrated", "after", "square"),
    Key("held_out", "left out", "c1", "diamond"),
)
NOISE = Key("", "noise alone", "text", "dash")
ASSUMED = Key("", "as assumed beforehand", "text", "dash")
COLOURS = ("r1", "r2", "r3", "r4", "r5", "r6")
NAMES = {GRASPS: "grasps", INERTIAL: "mass, centre of mass, inertia"}
APART = 0.2


def robot_keys(robots: int) -> list[Key]:
    """One for each robot."""
    return [Key(f"r{k + 1}", f"robot {k + 1}", COLOURS[k % len(COLOURS)], "circle") for k in range(robots)]


def kind_names(kinds: list[str]) -> list[str]:
    """Of deviations, grasps and inertial parameters."""
    return [NAMES.get(kind) or SHOWN[kind].name for kind in kinds]


def deviation_chart(book: Book, calibration: Calibration) -> Node:
    """Every deviation in prior standard deviations, with bars of two standard errors."""
    groups, keys = shown_groups(calibration), robot_keys(calibration.robots)
    traces, most = [], 2.0
    for robot, key in enumerate(keys):
        x, y, bars, text = [], [], [], []
        for row, group in enumerate(groups):
            shown = SHOWN[group.name]
            for entry, value, se, prior in _of_group(calibration, robot, group):
                x.append(value / prior)
                y.append(row + APART * (robot - 0.5 * (len(keys) - 1)) * min(1.0, 3.0 / len(keys)))
                bars.append(2.0 * se / prior)
                measured = with_error(shown.scale * value, shown.scale * se, shown.unit)
                text.append(f"{key.label}, {shown.name} {entry}: {measured}")
        most = max([most, *np.abs(x)])
        traces.append(dots(x, y, key, text, size=7, error_x={"array": bars, "thickness": 1.3, "width": 3}))
    shown = figure(
        traces,
        xaxis=axis("deviation over prior sd", range=[-1.08 * most, 1.08 * most], zerolinewidth=1.5),
        yaxis=row_axis(kind_names([group.name for group in groups]), 30), margin_l=178,
    )  # fmt: skip
    for rule in (-1.0, 1.0):
        shown.add_vline(rule)
    return chart(
        book, "How far the robots are off", shown, height=52 * len(groups) + 76, keys=[*keys, ASSUMED],
        label="Every deviation of every robot in prior standard deviations, grouped by kind; values are in the tables.",
        note="bars: two standard errors either way", narrow={"margin.l": 120, "yaxis.tickfont.size": 10},
    )  # fmt: skip


def certainty_chart(book: Book, calibration: Calibration) -> Node:
    """Standard errors over prior standard deviations."""
    groups, keys = shown_groups(calibration), robot_keys(calibration.robots)
    traces, seen = [], [1.0]
    for robot, key in enumerate(keys):
        x, y, text = [], [], []
        for row, group in enumerate(groups):
            shown = SHOWN[group.name]
            for entry, _, se, prior in _of_group(calibration, robot, group):
                x.append(se / prior)
                y.append(row + APART * (robot - 0.5 * (len(keys) - 1)) * min(1.0, 3.0 / len(keys)))
                known = f"{plain(shown.scale * prior, 2)} to {plain(shown.scale * se, 2)} {shown.unit}"
                text.append(f"{key.label}, {shown.name} {entry}: from {known}")
        seen += x
        traces.append(dots(x, y, key, text, size=7))
    shown = figure(
        traces, xaxis=log_axis("standard error over prior sd", seen),
        yaxis=row_axis(kind_names([group.name for group in groups]), 30), margin_l=178,
    )  # fmt: skip
    shown.add_vline(1.0)
    return chart(
        book, "How much better they are known than before", shown, height=46 * len(groups) + 76, keys=[*keys, ASSUMED],
        label="Standard error of every deviation over its prior standard deviation; at 1 the data said nothing.",
        note="at 1 the recordings said nothing", narrow={"margin.l": 120, "yaxis.tickfont.size": 10},
    )  # fmt: skip


def _of_group(calibration: Calibration, robot: int, group: Group) -> list[tuple[str, float, float, float]]:
    """Entry, value, standard error and prior standard deviation of what is not held."""
    at = AT[group.name]
    values = zip(
        group.entries, calibration.units.x[robot, at], calibration.sd[robot, at], calibration.prior_sd[robot, at],
        strict=True,
    )  # fmt: skip
    # A zero of theta_x has no prior in the fit itself; parallel flanges take that of the other encoders.
    return [
        (entry, float(value), float(se), float(prior) or calibration.prior.encoder_zero_rad)
        for entry, value, se, prior in values
        if se > 0
    ]


def fit_charts(book: Book, calibration: Calibration) -> Node:
    """chi²/n of every recording: loops, balance."""
    names = short_names([Path(trial.name).name for trial in calibration.trials])
    charts = []
    for kind, title in enumerate(
        ("Loops: where robots have each other's grasps", "Balance: wrenches and motion")
    ):
        at = [k for k, trial in enumerate(calibration.trials) if trial.count[kind]]
        traces, seen = [], [1.0]
        for key in FITS:
            pairs = [getattr(calibration.trials[k], key.group) for k in at]
            found = [(row, pair[kind]) for row, pair in enumerate(pairs) if pair is not None]
            seen += [number for _, number in found]
            text = [f"{names[at[row]]}, {key.label}: {plain(number)}" for row, number in found]
            traces.append(dots([number for _, number in found], [row for row, _ in found], key, text))
        shown = figure(
            traces, xaxis=log_axis("chi²/n", seen), yaxis=row_axis([names[k] for k in at], 20), margin_l=120
        )
        shown.add_vline(1.0)
        charts.append(
            chart(book, title, shown, height=34 * len(at) + 76, keys=[*FITS, NOISE],
                  label=f"{title}: chi-square per number of every recording as designed, calibrated and left out.",
                  narrow={"margin.l": 100})
        )  # fmt: skip
    return el("div", *charts, class_="pair")


def share_chart(book: Book, calibration: Calibration) -> Node | None:
    """What every recording contributes to what is known of each kind of parameter."""
    trials = [trial for trial in calibration.trials if trial.shares]
    if not trials:
        return None
    kinds = [kind for kind in trials[0].shares if kind not in hidden_kinds(calibration)]
    names = short_names([Path(trial.name).name for trial in trials])
    series = [
        (name, COLOURS[k % len(COLOURS)], [trial.shares.get(kind, 0.0) for kind in kinds])
        for k, (name, trial) in enumerate(zip(names, trials, strict=True))
    ]
    left = [max(0.0, 1.0 - sum(shares)) for shares in zip(*(values for _, _, values in series), strict=True)]
    series.append(("prior and weights", "band", left))
    keys = [Key(f"s{k}", name, colour, "band") for k, (name, colour, _) in enumerate(series)]
    bars = [
        go.Bar(
            x=[100.0 * share for share in values], y=list(range(len(kinds))), orientation="h", width=0.66,
            meta=colour, name=literal(name), legendgroup=key.group,
            text=[literal(f"{name}: {percent(share)}") for share in values], textposition="none",
            hovertemplate="%{text}<extra></extra>",
        )
        for key, (name, colour, values) in zip(keys, series, strict=True)
    ]  # fmt: skip
    shown = figure(
        bars, xaxis=axis("share [%]", range=[0, 100], nticks=6), yaxis=row_axis(kind_names(kinds), 32), margin_l=190,
        barmode="stack",
    )  # fmt: skip
    return chart(
        book, "What each recording contributes", shown, height=34 * len(kinds) + 76, keys=keys,
        label="Share of every recording in what is known of each kind of parameter; the rest is the prior's.",
        note="share of the information, averaged over the parameters of a kind",
        narrow={"margin.l": 120, "yaxis.tickfont.size": 10},
    )  # fmt: skip


def hidden_kinds(calibration: Calibration) -> set[str]:
    """Kinds that stand for nothing of their own: masses where all arms are alike, but for one of them."""
    shown = {group.name for group in shown_groups(calibration)}
    return {"proximal_mass_ratio", "rod_mass_ratio", "wrist_mass_ratio", "tilt"} - shown
