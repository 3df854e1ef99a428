"""What the recordings leave of one rigid payload: gaps at the grasps, balance of forces and moments, their spectra."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import welch

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.estimate.result import PayloadEstimate
from estimator.statistics import rms_length
from mocobot_report.blocks.book import Book, tabs
from mocobot_report.blocks.charts import chart, figure, line, log_axis
from mocobot_report.blocks.html import Node, el
from mocobot_report.blocks.legend import Key
from mocobot_report.blocks.prose import bullets, paragraph, verdict
from mocobot_report.blocks.series import Line, Panel, stacked_chart, thinned
from mocobot_report.blocks.tables import Entry, table, value
from mocobot_report.sources import Source
from mocobot_view.replay.replay_trial import ReplayTrial, replay_trial

AXES = (Key("x", "x", "c1"), Key("y", "y", "c2"), Key("z", "z", "c3"))
SEGMENT_S = 10.0


@dataclass(frozen=True)
class Left:
    """One quantity that is zero if all is well.

    Attributes:
        name: of it.
        unit: of its values.
        keys: one per column.
        time: [s], shape (n,).
        values: shape (n, C).
    """

    name: str
    unit: str
    keys: tuple[Key, ...]
    time: Array
    values: Array


def signal_sections(book: Book, found: list[Source], e: PayloadEstimate) -> list[Node]:
    """Plots of every recording that is still there, and what is missing."""
    if not found:
        said = "The file does not say which recordings it was made from; estimate again with this version of mocobot."
        return [verdict("warn", "No plots over time", said)]
    panels: list[tuple[str, list[Node]]] = []
    rows: list[list[Entry]] = []
    missing: list[str] = []
    head: list[str] = []
    for source in found:
        book.say(f"signals of {source.name}")
        try:
            trial = replay_trial(source.recording(), source.name, e)
        except InputError as error:
            missing.append(f"{error}.")
            continue
        left = _left(trial)
        if not left:
            missing.append(f"{source.name}: nothing can be said without grasps and a centre of mass.")
            continue
        head = ["recording", *(f"{one.name} [{one.unit}]" for one in left)]
        rows.append([source.name, *(value(rms_length(one.values), 2) for one in left)])
        panels.append((source.name, _plots(book, source.name, left, list(trial.notes))))
    out: list[Node] = []
    if panels:
        said = (
            "With the estimated grasps, flanges and grasps must stay together, and the robots' forces and moments must "
            "add up to what the payload's motion needs. What is left over is noise if the estimate is right and the "
            "robots are as designed; a pattern in it is something that the model does not have."
        )
        out.append(paragraph(said, kind="note"))
        if len({len(row) for row in rows}) == 1:
            out.append(table("Left over, rms", head, rows))
        out += tabs(book, "Recording", panels)
    if missing:
        out.append(verdict("warn", "Not all recordings could be shown", bullets(missing)))
    return out


def _left(trial: ReplayTrial) -> list[Left]:
    out = []
    if trial.motion is not None and trial.robots > 1:
        keys = tuple(Key(f"r{k + 1}", f"robot {k + 1}", f"r{k % 6 + 1}") for k in range(trial.robots))
        out.append(Left("gap", "mm", keys, trial.time, 1e3 * trial.motion.gap_position_m))
        out.append(Left("gap angle", "mrad", keys, trial.time, 1e3 * trial.motion.gap_rotation_rad))
    if trial.balance is not None and trial.data is not None:
        out.append(Left("force", "N", AXES, trial.data.time, trial.balance.force))
        if trial.balance.moment is not None:
            out.append(Left("moment", "N m", AXES, trial.data.time, trial.balance.moment))
    return out


def _plots(book: Book, name: str, left: list[Left], notes: list[str]) -> list[Node]:
    gaps, balance = [one for one in left if one.keys is not AXES], [one for one in left if one.keys is AXES]
    out: list[Node] = []
    if gaps:
        out.append(_robot_by_robot(book, "Flanges and grasps apart", gaps, name))
    if balance:
        out.append(_over_time(book, "Wrenches minus what the motion needs, in {1}", balance, name))
        out.append(el("div", *(_spectrum(book, one) for one in balance), class_="pair"))
    return [*out, *([bullets(notes)] if notes else [])]


def _over_time(book: Book, title: str, left: list[Left], name: str) -> Node:
    panels = []
    for one in left:
        time, values = thinned(one.time, one.values)
        panels.append(
            Panel(one.name, one.unit, [Line(key, time, values[:, k]) for k, key in enumerate(one.keys)])
        )
    label = f"{title}, over time, {name}; rms values are in the table."
    return stacked_chart(book, title, panels, keys=left[0].keys, label=label)


def _robot_by_robot(book: Book, title: str, left: list[Left], name: str) -> Node:
    """One plot per robot, on one scale per quantity: on top of each other the last would hide the others."""
    panels = []
    for one in left:
        time, values = thinned(one.time, one.values)
        limits = (min(0.0, 1.05 * float(np.nanmin(values))), 1.05 * float(np.nanmax(values)) or 1.0)
        panels += [
            Panel(f"{key.label}: {one.name}", one.unit, [Line(key, time, values[:, k])], limits)
            for k, key in enumerate(one.keys)
        ]
    label = f"{title}, over time, robot by robot, {name}; rms values are in the table."
    return stacked_chart(book, title, panels, keys=[], label=label, note="the same scale for every robot")


def _spectrum(book: Book, one: Left) -> Node:
    """Amplitude density of each component."""
    step = float(np.median(np.diff(one.time)))
    segment = min(len(one.time), round(SEGMENT_S / step))
    frequency, power = welch(one.values, 1.0 / step, nperseg=segment, axis=0)
    frequency, density = frequency[1:], np.maximum(np.sqrt(power[1:]), 1e-12)
    shown = figure(
        [
            line(
                frequency,
                density[:, k],
                key,
                f"{key.label}, %{{x:.2f}} Hz: %{{y:.2g}} {one.unit}/√Hz",
                width=1.4,
            )
            for k, key in enumerate(one.keys)
        ],
        xaxis=log_axis("frequency [Hz]", [float(frequency[0]), float(frequency[-1])]),
        yaxis=log_axis(f"{one.unit}/√Hz", [float(np.percentile(density, 2)), float(density.max())]),
        margin_l=64,
    )
    return chart(
        book, f"Spectrum of the {one.name} left over", shown, height=260, keys=one.keys,
        label=f"Amplitude spectral density of the {one.name} that is left over.", note="filtered at 5 Hz",
    )  # fmt: skip
