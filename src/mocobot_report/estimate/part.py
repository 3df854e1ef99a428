"""The part of the page on one estimate: payload and grasps with standard errors, and what the data say of them."""

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
from scipy.signal import welch

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.estimate.frames import frames_said
from estimator.estimate.identifiability import FACTOR
from estimator.estimate.result import PayloadEstimate
from estimator.leftover.contradiction import CONTRADICTS
from estimator.statistics import rms_length
from mocobot_report.blocks.book import Book, section, tabs
from mocobot_report.blocks.charts import axis, chart, dots, figure, line, log_axis, row_axis
from mocobot_report.blocks.html import Node, el
from mocobot_report.blocks.legend import Key
from mocobot_report.blocks.numbers import NONE, percent, plain, with_error
from mocobot_report.blocks.pictures import ASPECT
from mocobot_report.blocks.prose import bullets, folded, paragraph, tidy, tiles, verdict
from mocobot_report.blocks.series import Line, Panel, stacked_chart, thinned
from mocobot_report.blocks.tables import (
    Entry,
    Num,
    component,
    distance,
    mass,
    measurement,
    moment,
    place,
    quantity,
    table,
    value,
)
from mocobot_report.folder import Estimated
from mocobot_report.sources import Source, sources
from mocobot_sim.paper.scoring import rotation_error_deg
from mocobot_view.payload import BodyFacts, read_truth
from mocobot_view.pictures import estimate_shot
from mocobot_view.replay_trial import ReplayTrial, replay_trial


def errors_table(e: PayloadEstimate, truth: BodyFacts) -> Node:
    """Truth, error, error in percent and in standard errors, for every number that both have."""
    rows: list[list[Entry]] = []

    def row(
        name: str,
        unit: str,
        true: float,
        found: float | None,
        se: float | None,
        scale: float = 1.0,
        of: float = 0.0,
    ) -> None:
        of = of or true
        known: list[float | None] = [None, None, None]
        if found is not None:
            error = found - true
            known = [
                scale * error,
                100.0 * abs(error / of) if of else None,
                abs(error) / se if se else None,
            ]
        rows.append([quantity(name), unit, value(scale * true, 5), *(value(v, 2) for v in known)])

    if truth.mass_kg is not None:
        row("mass", "kg", truth.mass_kg, e.mass and e.mass.mass, e.mass and e.mass.se)
    if truth.p_1c is not None:
        p, errors = e.p_1c, e.p_1c_se_m
        for k, name in enumerate("xyz"):
            found, se = (None, None) if p is None or errors is None else (float(p[k]), float(errors[k]))
            row(f"p_1c {name}", "mm", float(truth.p_1c[k]), found, se, 1e3, float(np.linalg.norm(truth.p_1c)))
    if truth.principal_kgm2 is not None:
        for k, true in enumerate(np.sort(truth.principal_kgm2)):
            p = None if e.inertia is None else e.inertia.principal
            found, se = (None, None) if p is None else (float(p.moments[k]), float(p.moments_se[k]))
            row(f"principal moment {k + 1}", "kg m²", float(true), found, se)
    if truth.grasps is not None:
        for j in range(2, len(truth.grasps.p_1i) + 1):
            true = truth.grasps.p_1i[j - 1]
            pair = None if e.grasps is None else e.grasps.pair(1, j)
            for k, name in enumerate("xyz"):
                found, se = (None, None) if pair is None else (float(pair.p_ij[k]), float(pair.p_se_m[k]))
                row(f"p_1{j} {name}", "mm", float(true[k]), found, se, 1e3, float(np.linalg.norm(true)))
            if e.grasps is not None:
                angle = rotation_error_deg(truth.grasps.R_1i[j - 1], e.grasps.R_1i[j - 1])
                rows.append([quantity(f"R_1{j}"), "deg", Num(NONE), value(angle, 2), Num(NONE), Num(NONE)])
    head = ["", "unit", "truth", "error", "error [%]", "in standard errors"]
    note = "error of a rotation: its angle; error [%] of a component: share of the vector's length"
    return table("Estimate against truth", head, rows, note=note)


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


LINES = (Key("x", "x", "c1"), Key("y", "y", "c2"), Key("z", "z", "c3"))
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
        out.append(Left("force", "N", LINES, trial.data.time, trial.balance.force))
        if trial.balance.moment is not None:
            out.append(Left("moment", "N m", LINES, trial.data.time, trial.balance.moment))
    return out


def _plots(book: Book, name: str, left: list[Left], notes: list[str]) -> list[Node]:
    gaps, balance = [one for one in left if one.keys is not LINES], [one for one in left if one.keys is LINES]
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


ORDER = ((0, 0, "xx"), (0, 1, "xy"), (0, 2, "xz"), (1, 1, "yy"), (1, 2, "yz"), (2, 2, "zz"))
DEG = 180.0 / np.pi


def title(estimated: Estimated) -> str:
    """What it is of."""
    label = estimated.estimate.payload
    return f"Payload ({label})" if label is not None else "Payload"


def answer(estimated: Estimated) -> list[Node]:
    """Mass, centre of mass, inertia and grasps, and whether to trust them."""
    e = estimated.estimate
    trials = [r.trial for r in e.recordings]
    kinds = ", ".join(f"{trials.count(kind)} {kind}" for kind in dict.fromkeys(trials))
    how = {
        "fit": "in one fit of closed loops and balance of wrenches",
        "staged": "in stages as in the paper",
        "joint": "by one joint least squares",
        "calibrated": "in one least squares with the robots' own calibration",
    }.get(e.method, e.method)
    if e.units is not None and e.method != "calibrated":
        how += ", on robots as a calibration has them"
    why = [paragraph(tidy(e.why_not_fit))] if e.why_not_fit else []
    said = (
        f"Estimated from {len(trials)} recording{'s' * (len(trials) != 1)} ({kinds}; "
        f"{sum(r.duration_s for r in e.recordings):.0f} s in all) of {e.robots} robot{'s' * (e.robots != 1)} that "
        f"hold{'s' * (e.robots == 1)} the payload together, {how}. Values are given with their standard errors"
        f"{f', in {tidy(frames_said(e.zero_sd_rad), inside=True)}' if e.zero_sd_rad else ''}."
    )
    return [paragraph(said, kind="lede"), tiles(_tiles(e)), *why, _doubts(e)]


def _tiles(e: PayloadEstimate) -> list[tuple[str, str, str]]:
    """Name, value and its error; what is not determined has neither."""
    found: dict[str, tuple[str, str]] = {}
    if e.mass:
        share = f"standard error {percent(e.mass.se / e.mass.mass)}" if e.mass.mass else ""
        found["mass"] = with_error(e.mass.mass, e.mass.se, "kg"), share
    if e.p_1c is not None and e.p_1c_se_m is not None:
        at = ", ".join(plain(1e3 * v, 4) for v in e.p_1c)
        found["centre of mass in {1}"] = (
            f"({at}) mm",
            f"± {plain(1e3 * float(np.max(e.p_1c_se_m)), 2)} mm at most",
        )
    if e.inertia is not None:
        principal = e.inertia.principal
        each = ", ".join(plain(float(v), 4) for v in principal.moments)
        most = plain(float(np.max(principal.moments_se)), 2)
        found["principal moments of inertia"] = f"{each} kg m²", f"± {most} kg m² at most"
    if e.grasps is not None and e.robots > 1:
        pairs = [e.grasps.pair(1, j) for j in range(2, e.robots + 1)]
        each = ", ".join(plain(1e3 * float(np.linalg.norm(p.p_ij)), 4) for p in pairs)
        most = plain(1e3 * max(p.distance_se_m for p in pairs), 2)
        found["distance of the grasps from the first"] = f"{each} mm", f"± {most} mm at most"
    names = ["mass", "centre of mass in {1}", "principal moments of inertia"]
    if e.robots > 1:
        names.append("grasps" if e.grasps is None else "distance of the grasps from the first")
    return [(name, *found.get(name, ("not determined", ""))) for name in names]


def _doubts(e: PayloadEstimate) -> Node:
    known = {"mass": e.mass, "centre of mass": e.p_1c, "inertia": e.inertia}
    known |= {"grasps": e.grasps} if e.robots > 1 else {}
    missing = [name for name, found in known.items() if found is None]
    left_open = [*(["Left open by the robots' calibration:", bullets(list(e.open))] if e.open else [])]
    if not e.undetermined and not e.flags and not missing:
        said = "The recordings determine every one of them and fit one rigid payload."
        return verdict("good", "Nothing speaks against these numbers", said, *left_open)
    return verdict(
        "bad" if e.contradicts else "warn",
        "The robots contradict each other: do not trust the standard errors"
        if e.contradicts
        else "What to know before these numbers are trusted",
        bullets(list(e.flags)) if e.flags else None,
        f"The recordings do not give: {', '.join(missing)}." if missing else None,
        *(
            ["Not determined by these recordings:", bullets(list(map(str, e.undetermined)))]
            if e.undetermined
            else []
        ),
        *left_open,
    )


def sections(book: Book, estimated: Estimated) -> list[Node]:
    """Everything below the answer."""
    e = estimated.estimate
    book.say(f"estimate {estimated.path.name}")
    found = sources(estimated.provenance, estimated.path.parent)
    truth, said = _truth(found, e)
    alone = any(r.inertia is not None for r in e.recordings)
    outline = [
        ("Payload", [_picture(book, found, e, truth), _payload(e)]),
        ("Grasps", [_grasps(e), grasp_charts(book, e)] if e.robots > 1 else None),
        ("Recording by recording", [moment_chart(book, e, truth) if alone else None, _recordings(e)]),
        ("Against the truth", [paragraph(said, kind="note"), errors_table(e, truth)] if truth else None),
        ("What the motion determines", _excitation(book, e)),
        ("What one rigid payload leaves over", signal_sections(book, found, e)),
    ]
    return [section(book, name, blocks) for name, blocks in outline if blocks is not None]


def _picture(book: Book, found: list[Source], e: PayloadEstimate, truth: BodyFacts | None) -> Node | None:
    """The team at one instant of the first recording that is still there."""
    for source in found:
        with contextlib.suppress(InputError):
            shot = partial(estimate_shot, source.recording(), e, truth, aspect=ASPECT)
            return book.gallery.ask([("The team as estimated", shot)])
    return None


def _truth(found: list[Source], e: PayloadEstimate) -> tuple[BodyFacts | None, str]:
    for source in found:
        if source.path is None:
            continue
        with contextlib.suppress(InputError):
            frames = ", in the frames that the encoders define" if e.zero_sd_rad else ""
            return read_truth(source.path, e.robots, e), (
                f"The truth is that beside {source.name}{frames}: these recordings are simulated. Error is estimate "
                "minus truth; errors beyond two or three standard errors come from what standard errors do not cover, "
                "such as calibration."
            )
    return None, ""


def _payload(e: PayloadEstimate) -> Node:
    rows: list[list[Entry]] = [["mass", "kg", mass(e)]]
    rows += [[quantity(f"p_1c {name}"), "mm", place(e, k)] for k, name in enumerate("xyz")]
    if e.inertia is None:
        rows.append(["inertia", "kg m²", Num(NONE)])
    else:
        se, p = np.sqrt(np.diag(e.inertia.covariance)), e.inertia.principal
        for k, (a, b, name) in enumerate(ORDER):
            rows.append([quantity(f"I_{name}"), "kg m²", measurement(float(e.inertia.inertia[a, b]), se[k])])
        rows += [[f"principal moment {k + 1}", "kg m²", moment(e, k)] for k in range(3)]
        for k, name in enumerate("xyz"):
            rows.append(
                [quantity(f"R_1c {name}"), "deg", component(p.axis_angle_rad, p.axis_angle_se_rad, k, DEG)]
            )
    note = "centre of mass in {1}; inertia about it, in the axes of {1}; R: rotation vector of the principal axes"
    return table("Mass, centre of mass and inertia", ["", "unit", "value ± standard error"], rows, note=note)


def _grasps(e: PayloadEstimate) -> list[Node]:
    if e.grasps is None:
        return [paragraph("The recordings do not determine the grasps.")]
    positions: list[list[Entry]] = []
    rotations: list[list[Entry]] = []
    for i, j in combinations(range(1, e.robots + 1), 2):
        pair = e.grasps.pair(i, j)
        places = [component(pair.p_ij, pair.p_se_m, k, 1e3) for k in range(3)]
        positions.append([quantity(f"p_{i}{j}"), *places, distance(e, i, j)])
        angles = [component(pair.axis_angle_rad, pair.axis_angle_se_rad, k, DEG) for k in range(3)]
        rotations.append([quantity(f"R_{i}{j}"), *angles])
    return [
        table("Grasp frames from each other: position", ["", "x [mm]", "y [mm]", "z [mm]", "distance [mm]"], positions,
              note="of frame {j} in frame {i}, ± standard error"),
        table("Grasp frames from each other: rotation", ["", "x [deg]", "y [deg]", "z [deg]"], rotations,
              note="rotation vector of frame {j} in frame {i}, ± standard error"),
    ]  # fmt: skip


def _recordings(e: PayloadEstimate) -> Node:
    head = [
        "recording",
        "trial",
        "length [s]",
        "holds",
        "force left over [% of weight]",
        "moment left over [mm]",
        "most left over [times noise]",
    ]
    rows = [
        [
            Path(r.name).name, r.trial, Num(f"{r.duration_s:.1f}"), Num(str(r.holds)),
            value(None if r.force_residual is None else 100.0 * r.force_residual, 2),
            value(None if r.moment_residual_m is None else 1e3 * r.moment_residual_m, 2),
            value(max((one.ratio for one in r.leftovers), default=None), 2),
        ]
        for r in e.recordings
    ]  # fmt: skip
    note = (
        "moment left over: the error of the centre of mass that would explain it; times noise: gaps at the flanges, "
        f"forces and moments that no rigid payload explains; beyond {CONTRADICTS:g} the robots contradict each other"
    )
    return table("Recordings", head, rows, note=note)


def _excitation(book: Book, e: PayloadEstimate) -> list[Node | None]:
    note = (
        "Every step solves for some parameters; a direction in which the motion's signal does not rise above the noise "
        "is not determined."
    )
    weak = [[quantity(w.step), w.direction, w.reason] for w in e.undetermined]
    head = ["step", "rank", "of", "condition", "weakest signal", "noise", "unit"]
    rows = [
        [
            quantity(s.step), Num(str(s.rank)), Num(str(len(s.singular_values))), value(s.condition, 3),
            value(s.singular_values[-1], 2), value(s.noise, 2), s.unit,
        ]
        for s in e.steps
    ]  # fmt: skip
    return [
        paragraph(note, kind="note"),
        excitation_chart(book, e),
        table("Directions that the data do not determine", ["step", "direction", "reason"], weak, stack=True)
        if weak
        else None,
        folded("As a table", table("Excitation of every step", head, rows)),
    ]
