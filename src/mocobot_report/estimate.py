"""Report of an estimate: payload and grasps with standard errors, doubts, and residuals of the rigid-body model."""

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import welch

from estimator.arm.unit import frames_said
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.estimate.leftover import CONTRADICTS
from estimator.estimate.result import PayloadEstimate
from estimator.estimate.uncertainty import FACTOR
from estimator.statistics import rms_length
from mocobot_report.charts import (
    Chart,
    Key,
    Line,
    Panel,
    Trace,
    axis,
    dots,
    line,
    log_axis,
    points_of_each,
    row_layout,
    stacked_chart,
    thinned,
)
from mocobot_report.folder import Result, Source, sources
from mocobot_report.numbers import NONE, counted, kinds_of, percent, plain, with_error
from mocobot_report.tables import Entry, Num, component, distance, mass, measurement, quantity, value, vector
from mocobot_sim.paper.scoring import rotation_error_deg
from mocobot_view.payload import BodyFacts, read_truth
from mocobot_view.pictures import estimate_shot
from mocobot_view.replay_trial import ReplayTrial, replay_trial

METHODS = {
    "fit": "in one fit of closed loops and balance of wrenches",
    "staged": "in stages as in the paper",
    "joint": "by one joint least squares",
    "calibrated": "in one least squares with the robots' own calibration",
}
ORDER = ((0, 0, "xx"), (0, 1, "xy"), (0, 2, "xz"), (1, 1, "yy"), (1, 2, "yz"), (2, 2, "zz"))
DEG = 180.0 / np.pi
Rows = list[list[Entry]]


def context(result: Result, say: Callable[[str], object]) -> dict[str, Any]:
    """Return the data of ``assets/estimate.html``."""
    e: PayloadEstimate = result.found
    say(f"estimate {result.path.name}")
    found = sources(result)
    truth, truth_name = _truth(found, e)
    name = "Payload" if e.payload is None else f"Payload ({e.payload})"
    how = METHODS.get(e.method, e.method)
    if e.units is not None and e.method != "calibrated":
        how += ", on robots as a calibration has them"
    steps = [s for s in e.steps if s.singular_values]
    return {
        "title": f"{name}, estimated from {counted(len(e.recordings), 'recording')}",
        "e": e,
        "kinds": kinds_of([r.trial for r in e.recordings]),
        "seconds": f"{sum(r.duration_s for r in e.recordings):.0f}",
        "how": how,
        "frames": frames_said(e.zero_sd_rad) if e.zero_sd_rad else "",
        "tiles": _tiles(e),
        "missing": _missing(e),
        "payload": _payload(e),
        "grasps": _grasps(e) if e.grasps is not None else None,
        "grasp_charts": _grasp_charts(e),
        "moment_chart": _moment_chart(e, truth),
        "recordings": _recordings(e),
        "contradicts": f"{CONTRADICTS:g}",
        "truth_name": truth_name,
        "errors": None if truth is None else _errors(e, truth),
        "weak": [[quantity(w.step), w.direction, w.reason] for w in e.undetermined],
        "steps": _steps(e),
        "excitation_chart": _excitation_chart(e) if steps else None,
        "signals": _signals(found, e, say),
        "pictures": _pictures(found, e, truth),
    }


def _tiles(e: PayloadEstimate) -> list[tuple[str, str, str]]:
    """Return name, value and error of every tile; undetermined quantities have no error."""
    found: dict[str, tuple[str, str]] = {}
    if e.mass:
        share = f"standard error {percent(e.mass.se / e.mass.mass)}" if e.mass.mass else ""
        found["mass"] = with_error(e.mass.mass, e.mass.se, "kg"), share
    if e.p_1c is not None and e.p_1c_se_m is not None:
        at, most = _each(1e3 * e.p_1c), _most(1e3 * e.p_1c_se_m)
        found["centre of mass in {1}"] = f"({at}) mm", f"± {most} mm at most"
    if e.inertia is not None:
        principal = e.inertia.principal
        most = _most(principal.moments_se)
        found["principal moments of inertia"] = f"{_each(principal.moments)} kg m²", f"± {most} kg m² at most"
    if e.grasps is not None and e.robots > 1:
        pairs = [e.grasps.pair(1, j) for j in range(2, e.robots + 1)]
        each = _each([1e3 * float(np.linalg.norm(p.p_ij)) for p in pairs])
        most = _most([1e3 * p.distance_se_m for p in pairs])
        found["distance of the grasps from the first"] = f"{each} mm", f"± {most} mm at most"
    names = ["mass", "centre of mass in {1}", "principal moments of inertia"]
    if e.robots > 1:
        names.append("grasps" if e.grasps is None else "distance of the grasps from the first")
    return [(name, *found.get(name, ("not determined", ""))) for name in names]


def _each(values: Any) -> str:
    return ", ".join(plain(float(v), 4) for v in values)


def _most(errors: Any) -> str:
    return plain(float(np.max(errors)), 2)


def _missing(e: PayloadEstimate) -> list[str]:
    known = {"mass": e.mass, "centre of mass": e.p_1c, "inertia": e.inertia}
    known |= {"grasps": e.grasps} if e.robots > 1 else {}
    return [name for name, found in known.items() if found is None]


def _payload(e: PayloadEstimate) -> Rows:
    rows: Rows = [["mass", "kg", mass(e)]]
    rows += vector("p_1c", "mm", [(e.p_1c, e.p_1c_se_m)], 1e3)
    if e.inertia is None:
        return [*rows, ["inertia", "kg m²", Num(NONE)]]
    se, p = np.sqrt(np.diag(e.inertia.covariance)), e.inertia.principal
    for k, (a, b, name) in enumerate(ORDER):
        rows.append([quantity(f"I_{name}"), "kg m²", measurement(float(e.inertia.inertia[a, b]), se[k])])
    rows += vector("principal moment", "kg m²", [(p.moments, p.moments_se)], parts="123")
    return rows + vector("R_1c", "deg", [(p.axis_angle_rad, p.axis_angle_se_rad)], DEG)


def _grasps(e: PayloadEstimate) -> tuple[Rows, Rows]:
    """Tabulate position and rotation of every pair of grasp frames."""
    positions: Rows = []
    rotations: Rows = []
    assert e.grasps is not None
    for i, j in combinations(range(1, e.robots + 1), 2):
        pair = e.grasps.pair(i, j)
        places = [component(pair.p_ij, pair.p_se_m, k, 1e3) for k in range(3)]
        positions.append([quantity(f"p_{i}{j}"), *places, distance(e, i, j)])
        angles = [component(pair.axis_angle_rad, pair.axis_angle_se_rad, k, DEG) for k in range(3)]
        rotations.append([quantity(f"R_{i}{j}"), *angles])
    return positions, rotations


def _recordings(e: PayloadEstimate) -> Rows:
    return [
        [
            Path(r.name).name, r.trial, Num(f"{r.duration_s:.1f}"), Num(str(r.holds)),
            value(None if r.force_residual is None else 100.0 * r.force_residual, 2),
            value(None if r.moment_residual_m is None else 1e3 * r.moment_residual_m, 2),
            value(max((one.ratio for one in r.leftovers), default=None), 2),
        ]
        for r in e.recordings
    ]  # fmt: skip


def _steps(e: PayloadEstimate) -> Rows:
    return [
        [
            quantity(s.step), Num(str(s.rank)), Num(str(len(s.singular_values))), value(s.condition, 3),
            value(s.singular_values[-1], 2), value(s.noise, 2), s.unit,
        ]
        for s in e.steps
    ]  # fmt: skip


def _pictures(found: Sequence[Source], e: PayloadEstimate, truth: BodyFacts | None) -> list[Any]:
    """Request a picture of the team in the first recording that still exists."""
    for source in found:
        with contextlib.suppress(InputError):
            return [("The team as estimated", partial(estimate_shot, source.recording(), e, truth))]
    return []


def _truth(found: Sequence[Source], e: PayloadEstimate) -> tuple[BodyFacts | None, str]:
    """Read the truth beside the first recording that has one; also return the recording's name."""
    for source in found:
        if source.path is not None:
            with contextlib.suppress(InputError):
                return read_truth(source.path, e.robots, e), source.name
    return None, ""


def _errors(e: PayloadEstimate, truth: BodyFacts) -> Rows:
    """Tabulate truth, error, error in percent and in standard errors, for every quantity of the truth."""
    rows: Rows = []

    def row(name: str, unit: str, true: float, found: tuple, scale: float = 1.0, of: float = 0.0) -> None:
        values, errors, k = found
        shown = [Num(NONE), Num(NONE), Num(NONE)]
        if values is not None and errors is not None:
            error, se, of = float(np.ravel(values)[k]) - true, float(np.ravel(errors)[k]), of or true
            in_percent, in_se = 100.0 * abs(error / of) if of else None, abs(error) / se if se else None
            shown = [value(scale * error, 2), value(in_percent, 2), value(in_se, 2)]
        rows.append([quantity(name), unit, value(scale * true, 5), *shown])

    if truth.mass_kg is not None:
        row("mass", "kg", truth.mass_kg, (e.mass and e.mass.mass, e.mass and e.mass.se, 0))
    if truth.p_1c is not None:
        length = float(np.linalg.norm(truth.p_1c))
        for k, name in enumerate("xyz"):
            row(f"p_1c {name}", "mm", float(truth.p_1c[k]), (e.p_1c, e.p_1c_se_m, k), 1e3, length)
    if truth.principal_kgm2 is not None:
        p = None if e.inertia is None else e.inertia.principal
        for k, true in enumerate(np.sort(truth.principal_kgm2)):
            row(f"principal moment {k + 1}", "kg m²", float(true), (p and p.moments, p and p.moments_se, k))
    for j in range(2, 1 if truth.grasps is None else len(truth.grasps.p_1i) + 1):
        assert truth.grasps is not None
        true, pair = truth.grasps.p_1i[j - 1], None if e.grasps is None else e.grasps.pair(1, j)
        length = float(np.linalg.norm(true))
        places = (None, None) if pair is None else (pair.p_ij, pair.p_se_m)
        for k, name in enumerate("xyz"):
            row(f"p_1{j} {name}", "mm", float(true[k]), (*places, k), 1e3, length)
        if e.grasps is not None:
            angle = rotation_error_deg(truth.grasps.R_1i[j - 1], e.grasps.R_1i[j - 1])
            rows.append([quantity(f"R_1{j}"), "deg", Num(NONE), value(angle, 2), Num(NONE), Num(NONE)])
    return rows


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


def _moment_chart(e: PayloadEstimate, truth: BodyFacts | None) -> Chart | None:
    """Plot principal moments from every recording relative to the pooled estimate, with standard errors."""
    found = {Path(r.name).name: r.inertia.principal for r in e.recordings if r.inertia is not None}
    if e.inertia is None or not found:
        return None
    pooled, extra = e.inertia.principal, []
    if truth is not None and truth.principal_kgm2 is not None:
        shares = 100.0 * (np.sort(truth.principal_kgm2) / pooled.moments - 1.0)
        text = [f"truth, moment {k + 1}" for k in range(len(shares))]
        at = [APART * (k - 1) for k in range(len(shares))]
        extra.append((TRUTH, dots([float(share) for share in shares], at, TRUTH, text, size=8)))
    rows = [(name, p.moments, p.moments_se) for name, p in ({"pooled": pooled} | found).items()]
    title = "Principal moments of inertia against the pooled estimate"
    label = (
        "Each recording's own principal moments of inertia relative to the pooled ones, with their errors."
    )
    return _pooled_chart((title, label, "kg m²"), rows, MOMENTS, 100.0 / pooled.moments, extra)


def _grasp_charts(e: PayloadEstimate) -> list[Chart]:
    """Plot grasp positions from every recording relative to the pooled estimate, with standard errors."""
    found = {Path(r.name).name: r.grasps for r in e.recordings if r.grasps is not None}
    if e.grasps is None or not found:
        return []
    charts = []
    for j in range(2, e.robots + 1):
        pairs = {name: grasps.pair(1, j) for name, grasps in ({"pooled": e.grasps} | found).items()}
        rows = [(name, 1e3 * pair.p_ij, 1e3 * pair.p_se_m) for name, pair in pairs.items()]
        title = f"Position of grasp {j} in {{1}} against the pooled estimate"
        label = f"Each recording's own position of grasp {j} relative to the pooled one, with its errors."
        charts.append(_pooled_chart((title, label, "mm"), rows, AXES, np.ones(3)))
    return charts


def _pooled_chart(
    words: tuple[str, str, str], rows: Sequence[tuple[str, Array, Array]], keys: Sequence[Key], scales: Array,
    extra: Sequence[tuple[Key, Trace]] = (),
) -> Chart:  # fmt: skip
    """Plot differences from the first row, the pooled estimate, with horizontal bars of two standard errors.

    ``words`` are title, label and unit; rows have a name, values and standard errors (3,), which ``scales`` (3,)
    multiply.
    """
    title, label, unit = words
    data = []
    for k, (key, scale) in enumerate(zip(keys, map(float, scales), strict=True)):
        found = [(name, float(values[k]), float(errors[k])) for name, values, errors in rows]
        text = [f"{name}, {key.label}: {with_error(number, se, unit)}" for name, number, se in found]
        bars = {"array": [2.0 * scale * se for _, _, se in found], "thickness": 1.4, "width": 3}
        differences = [scale * (number - found[0][1]) for _, number, _ in found]
        at = [n + APART * (k - 1) for n in range(len(rows))]
        data.append(dots(differences, at, key, text, error_x=bars))
    across = axis(f"difference [{'%' if keys is MOMENTS else unit}]", zerolinewidth=1.5, nticks=6)
    layout = row_layout([name for name, _, _ in rows], across, row_px=44, left_px=90, most=24, font_px=11)
    return Chart(
        title, label, data + [one for _, one in extra], keys=[*keys, *(key for key, _ in extra)],
        note="bars: two standard errors either way", **layout,
    )  # fmt: skip


def _excitation_chart(e: PayloadEstimate) -> Chart:
    """Plot the signal-to-noise ratio of every parameter direction of every step."""
    steps = [s for s in e.steps if s.singular_values]
    found = [(k, step, s) for k, step in enumerate(steps) for s in step.singular_values]
    x = [max(s / step.noise if step.noise > 0 else 1e6, 1e-3) for _, step, s in found]
    text = [f"{step.step}: signal {s:.2g} {step.unit}, noise {step.noise:.2g}" for _, step, s in found]
    across = log_axis("signal over noise (rms)", [1.0, 100.0, *x])
    return Chart(
        "Excitation: signal over noise of every direction",
        "Ratio of signal to noise for every direction that each step solves for; the numbers are in the table.",
        [dots(x, [k for k, _, _ in found], SIGNAL, text, opacity=0.85)], keys=[SIGNAL, WEAK],
        **row_layout([s.step for s in steps], across, rules=[FACTOR], row_px=34, left_px=150, most=40),
    )  # fmt: skip


LINES = (Key("x", "x", "c1"), Key("y", "y", "c2"), Key("z", "z", "c3"))
SEGMENT_S = 10.0


@dataclass(frozen=True)
class Left:
    """A residual, which is zero for a perfect model."""

    name: str
    unit: str
    keys: tuple[Key, ...]  # one per column
    time: Array  # [s], shape (n,)
    values: Array  # shape (n, C)


def _signals(
    found: Sequence[Source], e: PayloadEstimate, say: Callable[[str], object]
) -> dict[str, Any] | None:
    """Make charts of the residuals of every recording that still exists, and list what is missing; None without any."""
    if not found:
        return None
    panels: list[dict[str, Any]] = []
    rows: Rows = []
    missing: list[str] = []
    head: list[str] = []
    for source in found:
        say(f"signals of {source.name}")
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
        panels.append(_panel(source.name, left, points_of_each(len(found))) | {"notes": list(trial.notes)})
    alike = len({len(row) for row in rows}) == 1
    return {"panels": panels, "head": head, "rows": rows if alike else [], "missing": missing}


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


def _panel(name: str, left: Sequence[Left], most: int) -> dict[str, Any]:
    """Make the charts of one recording: gaps by robot, wrench residuals over time and as spectra."""
    gaps, balance = [one for one in left if one.keys is not LINES], [one for one in left if one.keys is LINES]
    over_time = []
    if gaps:
        over_time.append(_robot_by_robot(gaps, name, most))
    if balance:
        title, panels = "Wrenches minus what the motion needs, in {1}", []
        for one in balance:
            time, values = thinned(one.time, one.values, most=most)
            lines = [Line(key, time, values[:, k]) for k, key in enumerate(one.keys)]
            panels.append(Panel(one.name, one.unit, lines))
        label = f"{title}, over time, {name}; rms values are in the table."
        over_time.append(stacked_chart(title, label, panels, keys=LINES))
    return {"name": name, "over_time": over_time, "spectra": [_spectrum(one) for one in balance]}


def _robot_by_robot(left: Sequence[Left], name: str, most: int) -> Chart:
    """Make one plot per robot with a common scale per quantity; in a single plot the curves would hide each other."""
    panels = []
    for one in left:
        time, values = thinned(one.time, one.values, most=most)
        limits = (min(0.0, 1.05 * float(np.nanmin(values))), 1.05 * float(np.nanmax(values)) or 1.0)
        panels += [
            Panel(f"{key.label}: {one.name}", one.unit, [Line(key, time, values[:, k])], limits)
            for k, key in enumerate(one.keys)
        ]
    title = "Flanges and grasps apart"
    label = f"{title}, over time, robot by robot, {name}; rms values are in the table."
    return stacked_chart(title, label, panels, note="the same scale for every robot")


def _spectrum(one: Left) -> Chart:
    """Plot the amplitude spectral density of each component."""
    step = float(np.median(np.diff(one.time)))
    segment = min(len(one.time), round(SEGMENT_S / step))
    frequency, power = welch(one.values, 1.0 / step, nperseg=segment, axis=0)
    frequency, density = frequency[1:], np.maximum(np.sqrt(power[1:]), 1e-12)
    hover = f"%{{x:.2f}} Hz: %{{y:.2g}} {one.unit}/√Hz"
    layout = {
        "xaxis": log_axis("frequency [Hz]", [float(frequency[0]), float(frequency[-1])]),
        "yaxis": log_axis(f"{one.unit}/√Hz", [float(np.percentile(density, 2)), float(density.max())]),
        "margin": {"l": 64},
    }
    return Chart(
        f"Spectrum of the {one.name} left over",
        f"Amplitude spectral density of the {one.name} that is left over.",
        [line(frequency, density[:, k], key, f"{key.label}, {hover}", width=1.4) for k, key in enumerate(one.keys)],
        layout, 260, one.keys, "filtered at 5 Hz",
    )  # fmt: skip
