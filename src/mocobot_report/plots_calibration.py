"""Pictures of calibrations: parameters, misfit and information of each recording; what predictions leave of joints."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from discrepancy.joints.calibrated import Told
from estimator.arm.unit import AT
from estimator.calibrate.calibration import Calibration
from estimator.calibrate.text import SHOWN, shown_groups
from mocobot_report.calibration import COLOURS, FITS, fits_of, kind_names, shares_of
from mocobot_report.charts import Key
from mocobot_report.joint_calibration import keys_of
from mocobot_report.numbers import short_names
from mocobot_report.palette import LIGHT
from mocobot_sim.plots_plain import plain_numbers, plain_words

MARKERS = {"circle": "o", "square": "s", "diamond": "D", "x": "x"}


@plain_words()
def save_plots(calibration: Calibration, folder: Path) -> list[Path]:
    """Draw all pictures into an existing folder and return their paths."""
    figures = {
        folder / "deviations.png": _deviations(calibration),
        folder / "recordings.png": _recordings(calibration),
        folder / "shares.png": _shares(calibration),
    }
    for path, figure in figures.items():
        figure.savefig(path, dpi=110)
    return list(figures)


def _deviations(calibration: Calibration) -> Figure:
    """Draw one panel per kind of deviation, with bars of two standard errors and the prior as a band."""
    groups = shown_groups(calibration)
    columns = 2
    rows = -(-len(groups) // columns)
    figure = Figure(figsize=(max(11.0, 2.0 * calibration.robots), 1.9 * rows + 0.8), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis, group in zip(axes, groups, strict=False):
        shown, at = SHOWN[group.name], AT[group.name]
        prior = shown.scale * float(np.max(calibration.prior_sd[:, at]))
        axis.axhspan(-prior, prior, color=LIGHT["band"], lw=0)
        axis.axhline(0.0, color=LIGHT["line"], lw=1.0)
        count, places, names = len(group.entries), [], []
        for robot in range(calibration.robots):
            x = robot * (count + 1) + np.arange(count)
            known = calibration.sd[robot, at] > 0
            y, se = shown.scale * calibration.units.x[robot, at], shown.scale * calibration.sd[robot, at]
            axis.errorbar(
                x[known], y[known], 2.0 * se[known], fmt="o", ms=4, lw=1.3, capsize=2.5,
                color=LIGHT[COLOURS[robot % len(COLOURS)]],
            )  # fmt: skip
            places += list(x)
            names += list(group.entries)
        axis.set_xticks(places, names, fontsize=8)
        axis.set_title(f"{shown.name} [{shown.unit}]", loc="left", fontsize=10)
        _plain(axis)
    for axis in axes[len(groups) :]:
        axis.set_visible(False)
    handles = [
        axes[0].plot([], [], "o", ms=4, color=LIGHT[COLOURS[k % 6]])[0] for k in range(calibration.robots)
    ]
    names = [f"robot {k + 1}" for k in range(calibration.robots)]
    figure.legend(handles, names, loc="outside lower center", ncols=10, frameon=False, fontsize=9)
    figure.suptitle(
        "Deviations, with two standard errors (grey: assumed beforehand, one standard deviation)", x=0.01, ha="left",
        fontsize=11,
    )  # fmt: skip
    return figure


def _recordings(calibration: Calibration) -> Figure:
    names = short_names([trial.name for trial in calibration.trials])
    figure = Figure(figsize=(11.0, 0.38 * len(names) + 1.5), layout="constrained")
    axes = figure.subplots(1, 2, squeeze=False, sharey=True)[0]
    for kind, (axis, title) in enumerate(zip(axes, ("loops", "balance"), strict=True)):
        _rows(axis, names, "chi²/n", {key: dict(fits_of(calibration, kind, key)) for key in FITS})
        axis.axvline(1.0, color=LIGHT["text"], lw=1.0, ls="--")
        axis.set_title(title, loc="left", fontsize=10)
    handles = axes[0].get_lines()[: len(FITS)]
    figure.legend(handles=handles, loc="outside upper right", ncols=3, frameon=False, fontsize=9)
    figure.suptitle("What recordings leave over; 1 is noise alone", x=0.01, ha="left", fontsize=11)
    return figure


def save_left(told: Told, folder: Path) -> None:
    """Draw what predictions leave of every joint: ``torques.png`` or ``forecasts.png``."""
    torques = told.predicts == "torque"
    figure = Figure(figsize=(9.0, 0.38 * len(told.names) + 1.5), layout="constrained")
    axis = figure.subplots()
    what = "rms torque left" if torques else "rms error of forecasts over 1 s"
    _rows(axis, told.names, what, {key: dict(enumerate(told.rms(key.group))) for key in keys_of(told)})
    figure.legend(loc="outside upper right", ncols=4, frameon=False, fontsize=9)
    figure.savefig(folder / ("torques.png" if torques else "forecasts.png"), dpi=110)


def _shares(calibration: Calibration) -> Figure:
    kinds, series = shares_of(calibration)
    figure = Figure(figsize=(9.0, 0.36 * len(kinds) + 1.6), layout="constrained")
    axis = figure.subplots()
    rows, left = range(len(kinds)), np.zeros(len(kinds))
    for k, (name, shares) in enumerate(series):
        share, colour = 100.0 * np.array(shares), LIGHT[COLOURS[k % len(COLOURS)]]
        label = name if name[0] != "_" else f" {name}"
        axis.barh(rows, share, 0.66, left, color=colour, label=label)
        left += share
    rest = np.maximum(0.0, 100.0 - left)
    axis.barh(rows, rest, 0.66, left, color=LIGHT["band"], label="prior, weights")
    axis.set_yticks(rows, kind_names(kinds), fontsize=9)
    axis.set_ylim(len(kinds) - 0.4, -0.6)
    axis.set_xlim(0.0, 100.0)
    axis.set_xlabel("share [%]")
    _plain(axis)
    figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    figure.suptitle("What each recording contributes to what is known", x=0.01, ha="left", fontsize=11)
    return figure


def _rows(axis: Axes, names: Sequence[str], label: str, series: Mapping[Key, Mapping[int, float]]) -> None:
    """Draw the numbers of each legend entry by row, on a logarithmic axis."""
    for key, of in series.items():
        axis.plot([*of.values()], [*of], MARKERS[key.symbol], color=LIGHT[key.colour], label=key.label, ms=6)
    axis.set_xscale("log")
    plain_numbers(axis.xaxis)
    axis.set_yticks(range(len(names)), names, fontsize=9)
    axis.set_ylim(len(names) - 0.4, -0.6)
    axis.set_xlabel(label)
    _plain(axis)


def _plain(axis: Axes) -> None:
    axis.grid(True, color=LIGHT["grid"], lw=0.6)
    axis.set_axisbelow(True)
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)
