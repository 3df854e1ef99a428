"""The text of a replay: verdict, estimate against truth, residuals, notes, and a key to the colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from discrepancy.result.read import VERDICTS, WrittenDiagnosis
from estimator.statistics import rms, rms_length
from mocobot_view import colours
from mocobot_view.colours import Colour
from mocobot_view.replay.replay_trial import ReplayTrial
from mocobot_view.sizes import FORCE_M_PER_N

Array = NDArray[np.float64]


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
    lines = [f"**Diagnosis: {VERDICTS[diagnosis.verdict]}.**"]
    lines += [f"- **{_plain(cause.name)}**: {_plain(cause.sentence)}" for cause in diagnosis.causes]
    if not diagnosis.causes:
        lines.append("No cause is named.")
    return lines[0] + "\n\n" + "\n".join(lines[1:])


def _estimate(trial: ReplayTrial) -> str:
    estimate, truth = trial.estimate, trial.truth
    if estimate is None and truth is None:
        return ""
    rows: list[tuple[str, str, str]] = []
    known = "not determined"
    facts = trial.facts
    mass = estimate.mass if estimate else None
    rows.append(
        (
            "mass [kg]",
            known if mass is None else f"{mass.mass:.4f} ± {mass.se:.4f}",
            "" if truth is None else f"{truth.mass_kg:.4f}",
        )
    )
    com = facts.p_1c if facts else None
    com_se = estimate.p_1c_se_m if estimate else None
    rows.append(
        (
            "centre of mass in {1} [mm]",
            known if com is None else _with_errors(1e3 * com, None if com_se is None else 1e3 * com_se, 2),
            "" if truth is None or truth.p_1c is None else _vector(1e3 * truth.p_1c, 2),
        )
    )
    inertia = estimate.inertia if estimate else None
    rows.append(
        (
            "principal moments [kg m²]",
            known
            if inertia is None
            else _with_errors(inertia.principal.moments, inertia.principal.moments_se, 4),
            "" if truth is None or truth.principal_kgm2 is None else _vector(truth.principal_kgm2, 4),
        )
    )
    for i in range(1, trial.robots):
        grasps = facts.grasps if facts else None
        true = truth.grasps if truth else None
        rows.append(
            (
                f"grasp {i + 1} in {{1}} [mm]; [deg]",
                known if grasps is None else _pose(grasps.p_1i[i], grasps.R_1i[i]),
                "" if true is None else _pose(true.p_1i[i], true.R_1i[i]),
            )
        )
    columns = 2 + (truth is not None)
    head = ["", "estimate", "truth"][:columns]
    table = ["| " + " | ".join(head) + " |", "|" + "---|" * columns]
    table += ["| " + " | ".join(row[:columns]) + " |" for row in rows]
    title = "**Payload: estimate ± standard error" + (", and truth**" if truth else "**")
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
            f"- {_name(colours.ESTIMATE)}: estimated centre of mass, principal axes, and the solid ellipsoid of that "
            "mass and inertia"
        )
    if trial.truth is not None and trial.motion is not None:
        lines.append(f"- {_name(colours.TRUTH)}, thin: the same in truth; true grasp frames are longer")
    if trial.diagnosis is not None and trial.diagnosis.causes:
        lines.append(f"- {_name(colours.FAULT)} ball: a cause that the diagnosis names sits there")
    commanded = f"; {_name(colours.COMMAND)}: the command" if trial.recording.ref is not None else ""
    lines.append(f"- line at a wrist: its path, in the robot's colour{commanded}")
    lines.append(
        "- series: the robot's colour; dark, plain, light for its joints 1, 2, 3 or axes x, y, z (theta: z, y, x)"
    )
    return "**Key**\n\n" + "\n".join(lines)


def _name(colour: Colour) -> str:
    return {
        colours.ESTIMATE: "magenta",
        colours.TRUTH: "green",
        colours.COMMAND: "white",
        colours.FAULT: "red",
    }[colour]


def _pose(p: Array, R: Array) -> str:
    return f"{_vector(1e3 * p, 2)}; {_vector(Rotation.from_matrix(R).as_rotvec(degrees=True), 3)}"


def _with_errors(values: Array, errors: Array | None, digits: int) -> str:
    if errors is None:
        return _vector(values, digits)
    return ", ".join(f"{_fixed(v, digits)} ± {e:.{digits}f}" for v, e in zip(values, errors, strict=True))


def _vector(values: Array, digits: int) -> str:
    return ", ".join(_fixed(value, digits) for value in values)


def _fixed(value: float, digits: int) -> str:
    """Fixed digits, and no minus before a zero."""
    return f"{round(float(value), digits) + 0.0:.{digits}f}"


def _plain(text: str | None) -> str:
    """Text without what Markdown or a viewer would take for markup or a control character."""
    kept = "".join(c if c.isprintable() else " " for c in str(text))
    return "".join("\\" + c if c in "\\`*_[]<>|#" else c for c in kept)
