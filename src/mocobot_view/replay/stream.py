"""A replay as one Rerun recording."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import rerun as rr
from scipy.spatial.transform import Rotation

from discrepancy.result.read import VERDICTS, WrittenDiagnosis
from estimator.arm.unit import frames_said
from estimator.arrays import Array
from estimator.statistics import rms, rms_length
from mocobot_view import colours
from mocobot_view.colours import FORCE_M_PER_N, FRAME_M, Colour
from mocobot_view.facts.body_facts import BodyFacts
from mocobot_view.facts.placement import Grasps
from mocobot_view.replay.blueprint import blueprint, log_keys
from mocobot_view.replay.log_robots import log_causes, log_label, log_robots, log_shape
from mocobot_view.replay.log_time import send, send_poses
from mocobot_view.replay.replay_trial import ReplayTrial


def log_payload(stream: rr.RecordingStream, trial: ReplayTrial) -> None:
    """Log the payload below the trial's root, in frame {1}; nothing where its grasps are not known."""
    if trial.motion is None:
        return
    payload = f"{trial.name}/payload"
    send_poses(stream, payload, trial.time, trial.motion.p_W1, trial.motion.quaternion)
    if trial.shape is not None:
        log_shape(stream, f"{payload}/shape", trial.shape)
    if trial.facts is not None:
        _log_facts(stream, f"{payload}/estimate", trial.facts, "", colours.ESTIMATE, thick=1.0)
    if trial.truth is not None:
        # Longer and thinner, so that both show where they agree.
        _log_facts(stream, f"{payload}/truth", trial.truth, " true", colours.TRUTH, thick=0.5)


def _log_facts(
    stream: rr.RecordingStream, path: str, facts: BodyFacts, suffix: str, colour: Colour, thick: float
) -> None:
    """Grasp frames, centre of mass, principal axes and inertia ellipsoid in {1}."""
    longer = FRAME_M * (1.0 if thick == 1.0 else 1.5)
    if facts.grasps is not None:
        for i, (p, R) in enumerate(zip(facts.grasps.p_1i, facts.grasps.R_1i, strict=True), start=1):
            _log_axes(stream, f"{path}/grasp{i}", p, longer * R, colours.AXES, 0.006 * thick)
            log_label(stream, f"{path}/grasp{i}/name", p, f"{{{i}}}{suffix}", colour, show=not suffix)
    if facts.p_1c is None:
        return
    com = rr.Points3D([facts.p_1c], colors=[colour], radii=0.022 * thick)
    stream.log(f"{path}/com", com, static=True)
    log_label(stream, f"{path}/com/name", facts.p_1c, f"CoM{suffix}", colour, show=not suffix)
    semi_axes = facts.semi_axes_m()
    if semi_axes is None or facts.R_1c is None:
        return
    inertia = rr.Ellipsoids3D(
        half_sizes=[semi_axes],
        centers=[facts.p_1c],
        quaternions=[Rotation.from_matrix(facts.R_1c).as_quat()],
        colors=[colour],
        line_radii=0.002 * thick,
        fill_mode=rr.components.FillMode.MajorWireframe,
    )
    stream.log(f"{path}/inertia", inertia, static=True)
    if facts.axes_known:
        _log_axes(stream, f"{path}/axes", facts.p_1c, facts.R_1c * semi_axes, [colour] * 3, 0.005 * thick)


def _log_axes(
    stream: rr.RecordingStream, path: str, at: Array, axes: Array, tones: Sequence[Colour], radius_m: float
) -> None:
    """Three arrows from a point (3,), the columns of ``axes`` (3, 3), in {1} [m]."""
    arrows = rr.Arrows3D(origins=np.tile(at, (3, 1)), vectors=axes.T, colors=tones, radii=radius_m)
    stream.log(path, arrows, static=True)


XYZ = ("x", "y", "z")


def log_series(stream: rr.RecordingStream, trial: ReplayTrial) -> None:
    """Log all series below ``series`` in the trial's root, one entity per quantity and robot."""
    recording, data, motion, balance = trial.recording, trial.data, trial.motion, trial.balance
    _log_wrists(stream, trial)
    series: list[tuple[str, Array, Array, tuple[str, ...]]] = [
        ("phi", trial.time, recording.phi, ("1", "2", "3")),
        ("theta", trial.time, recording.theta, ("z", "y", "x")),
        ("tau", trial.time, recording.tau, ("1", "2", "3")),
    ]
    if data is not None:
        series += [
            ("omega", data.time, data.twist[..., :3], XYZ),
            ("velocity", data.time, data.twist[..., 3:], XYZ),
            ("moment", data.time, data.wrench[..., :3], XYZ),
            ("force", data.time, data.wrench[..., 3:], XYZ),
        ]
    if motion is not None:
        series += [
            ("grasp_position_mm", trial.time, 1e3 * motion.gap_position_m[..., None], ("",)),
            ("grasp_rotation_mrad", trial.time, 1e3 * motion.gap_rotation_rad[..., None], ("",)),
        ]
    for quantity, time, values, parts in series:
        _per_robot(stream, trial, quantity, time, values, parts)
    if data is not None and balance is not None:
        for quantity, values in (("balance_force", balance.force), ("balance_moment", balance.moment)):
            if values is not None:
                path = f"{trial.name}/series/{quantity}"
                _lines(stream, path, data.time, values, list(XYZ), list(colours.AXES))


def _log_wrists(stream: rr.RecordingStream, trial: ReplayTrial) -> None:
    """Measured and commanded wrist positions, robot by robot, so that each pair shares a plot."""
    for i in range(trial.robots):
        path = f"{trial.name}/series/wrist/omnid{i + 1}"
        measured = trial.bodies.wrist[:, i]
        _lines(stream, f"{path}/measured", trial.time, measured, list(XYZ), colours.shades(i + 1))
        if trial.recording.ref is not None:
            names = [f"{axis} commanded" for axis in XYZ]
            pale = colours.shades(i + 1, saturation=0.15)
            _lines(stream, f"{path}/commanded", trial.time, trial.recording.ref[:, i], names, pale, width=3.0)


def _per_robot(
    stream: rr.RecordingStream,
    trial: ReplayTrial,
    quantity: str,
    time: Array,
    values: Array,
    parts: tuple[str, ...],
) -> None:
    """One entity for a quantity of all robots, shape (Q, N, k): a row costs as much as three numbers."""
    names, shades = [], []
    for robot in range(1, trial.robots + 1):
        names += [f"omnid{robot} {part}".strip() for part in parts]
        shades += colours.shades(robot) if len(parts) == 3 else [colours.of_robot(robot)]
    _lines(stream, f"{trial.name}/series/{quantity}", time, values.reshape(len(values), -1), names, shades)


def _lines(
    stream: rr.RecordingStream,
    path: str,
    time: Array,
    values: Array,
    names: list[str],
    shades: list[Colour],
    width: float = 1.2,
) -> None:
    """k lines of one entity at times [s], shape (Q, k)."""
    stream.log(path, rr.SeriesLines(names=names, colors=shades, widths=width), static=True)
    counts = np.full(len(values), values.shape[1])
    send(stream, path, time, rr.Scalars.columns(scalars=values.ravel()).partition(counts))


NOT_KNOWN = "not determined"


def summary(trial: ReplayTrial) -> str:
    """Markdown."""
    meta = trial.recording.metadata
    payload = f", payload {_plain(meta.payload)}" if meta.payload is not None else ""
    robots = "1 robot" if trial.robots == 1 else f"{trial.robots} robots"
    parts = [
        f"**{_plain(trial.name)}**: {meta.trial} trial, {robots}{payload}, {trial.time[-1]:.1f} s at "
        f"{meta.rate_hz:g} Hz, from {_plain(Path(trial.recording.name).name)} ({_plain(meta.source)}). Time 0 is "
        f"{trial.recording.time[0]:g} s in the recording.",
        *([_verdict(trial.diagnosis)] if trial.diagnosis else []),
        _estimate(trial),
        _residuals(trial),
        *(["**Notes**\n\n" + "\n".join(f"- {_plain(note)}" for note in trial.notes)] if trial.notes else []),
        _key(trial),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _verdict(diagnosis: WrittenDiagnosis) -> str:
    causes = [f"- **{_plain(cause.name)}**: {_plain(cause.sentence)}" for cause in diagnosis.causes]
    return f"**Diagnosis: {VERDICTS[diagnosis.verdict]}.**\n\n" + "\n".join(causes or ["No cause is named."])


def _estimate(trial: ReplayTrial) -> str:
    estimate, truth = trial.estimate, trial.truth
    if estimate is None and truth is None:
        return ""
    facts = trial.facts
    mass, inertia, com_se = None, None, None
    if estimate is not None:
        mass, inertia, com_se = estimate.mass, estimate.inertia, estimate.p_1c_se_m
    com = facts.p_1c if facts else None
    true_com, true_moments = (truth.p_1c, truth.principal_kgm2) if truth else (None, None)
    moments, moments_se = (
        (inertia.principal.moments, inertia.principal.moments_se) if inertia else (None, None)
    )
    # One number per row: the viewer cuts what is wider than its panel.
    rows = [
        (
            "mass [kg]",
            NOT_KNOWN if mass is None else f"{mass.mass:.4f} ± {mass.se:.4f}",
            "" if truth is None else f"{truth.mass_kg:.4f}",
        ),
        *_rows("CoM {} in {{1}} [mm]", "xyz", (com, com_se, true_com), 1e3, 2),
        *_rows("moment {} [kg m²]", "123", (moments, moments_se, true_moments), 1.0, 4),
    ]
    grasps, true = (of.grasps if of else None for of in (facts, truth))
    for i in range(1, trial.robots):
        places, turns = zip(*(_pose(of, i) for of in (grasps, true)), strict=True)
        rows += _rows(f"grasp {i + 1} {{}} in {{{{1}}}} [mm]", "xyz", (places[0], None, places[1]), 1e3, 2)
        rows += _rows(f"grasp {i + 1} about {{}} [deg]", "xyz", (turns[0], None, turns[1]), 1.0, 3)
    columns = 2 + (truth is not None)
    head, *lines = ["| " + " | ".join(row[:columns]) + " |" for row in [("", "estimate", "truth"), *rows]]
    table = [head, "|" + "---|" * columns, *lines]
    title = "**Payload: estimate ± standard error" + (", and truth**" if truth else "**")
    title += f"\n\nIn {frames_said(estimate.zero_sd_rad)}." if estimate and estimate.zero_sd_rad else ""
    flags = [f"- {_plain(flag)}" for flag in estimate.flags] if estimate else []
    return title + "\n\n" + "\n".join(table) + ("\n\n" + "\n".join(flags) if flags else "")


def _residuals(trial: ReplayTrial) -> str:
    lines = []
    if trial.motion is not None and trial.robots > 1:
        position = 1e3 * rms(trial.motion.gap_position_m)
        rotation = 1e3 * rms(trial.motion.gap_rotation_rad)
        lines.append(f"- flange against grasp frame: {position:.3g} mm, {rotation:.3g} mrad")
    if trial.balance is not None:
        text = f"- wrench balance: {rms_length(trial.balance.force):.3g} N"
        if trial.balance.moment is not None:
            text += f", {rms_length(trial.balance.moment):.3g} N m about the centre of mass"
        lines.append(text)
    return "**What one rigid payload leaves over (rms)**\n\n" + "\n".join(lines) if lines else ""


def _key(trial: ReplayTrial) -> str:
    lines = []
    if trial.data is not None:
        lines.append(
            f"- arrows at the grasps: force of each robot on the payload, 100 N is {100 * FORCE_M_PER_N:g} m"
        )
    if trial.facts is not None and trial.motion is not None:
        lines.append("- red, green, blue arrows: x, y, z of a grasp frame")
        lines.append(
            "- magenta: estimated centre of mass, principal axes, and the solid ellipsoid of that "
            "mass and inertia"
        )
    if trial.truth is not None and trial.motion is not None:
        lines.append("- green, thin: the same in truth; true grasp frames are longer")
    if trial.diagnosis is not None and trial.diagnosis.causes:
        lines.append("- red ball: a cause that the diagnosis names sits there")
    commanded = "; white: the command" if trial.recording.ref is not None else ""
    lines.append(f"- line at a wrist: its path, in the robot's colour{commanded}")
    lines.append(
        "- series: the robot's colour; dark, plain, light for its joints 1, 2, 3 or axes x, y, z (theta: z, y, x)"
    )
    return "**Key**\n\n" + "\n".join(lines)


def _rows(
    name: str,
    parts: str,
    values: tuple[Array | None, Array | None, Array | None],
    scale: float,
    digits: int,
) -> list[tuple[str, str, str]]:
    """Rows of three numbers with the standard errors and the truth, shapes (3,), as far as they are known."""
    estimate, errors, truth = (None if value is None else scale * value for value in values)
    rows = []
    for k, part in enumerate(parts):
        text = NOT_KNOWN if estimate is None else _fixed(estimate[k], digits)
        if estimate is not None and errors is not None:
            text += f" ± {errors[k]:.{digits}f}"
        rows.append((name.format(part), text, "" if truth is None else _fixed(truth[k], digits)))
    return rows


def _pose(grasps: Grasps | None, i: int) -> tuple[Array | None, Array | None]:
    """Position [m] and turn [deg] of a grasp in {1}, shapes (3,)."""
    if grasps is None:
        return None, None
    return grasps.p_1i[i], Rotation.from_matrix(grasps.R_1i[i]).as_rotvec(degrees=True)


def _fixed(value: float, digits: int) -> str:
    """Fixed digits, and no minus before a zero."""
    return f"{round(float(value), digits) + 0.0:.{digits}f}"


def _plain(text: str | None) -> str:
    """Text without what Markdown or a viewer would take for markup or a control character."""
    kept = "".join(c if c.isprintable() else " " for c in str(text))
    return "".join("\\" + c if c in "\\`*_[]<>|#" else c for c in kept)


APPLICATION = "mocobot"


def new_stream() -> rr.RecordingStream:
    """An empty stream; connect a file, a server or a viewer before anything is logged."""
    return rr.RecordingStream(APPLICATION)


def log_replay(
    stream: rr.RecordingStream,
    trials: Sequence[ReplayTrial],
    progress: Callable[[int], object] | None = None,
    tab: str | None = None,
) -> None:
    """Log trials side by side, each below the root of its name, all on one timeline that starts at 0.

    Args:
        stream: where to.
        trials: what is shown.
        progress: called with 1 after each trial.
        tab: tab that is open at first (see ``blueprint``).
    """
    stream.send_blueprint(blueprint(trials, tab), make_active=True, make_default=True)
    stream.send_recording_name(", ".join(trial.name for trial in trials))
    for trial in trials:
        stream.log(f"{trial.name}", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        stream.log(
            f"{trial.name}/summary", rr.TextDocument(summary(trial), media_type="text/markdown"), static=True
        )
        log_robots(stream, trial)
        log_payload(stream, trial)
        log_causes(stream, trial)
        log_series(stream, trial)
        log_keys(stream, trial)
        if progress:
            progress(1)
