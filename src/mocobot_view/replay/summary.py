"""The text of a replay: verdict, estimate against truth, residuals, notes, and a key to the colours."""

from pathlib import Path

from scipy.spatial.transform import Rotation

from discrepancy.result.read import VERDICTS, WrittenDiagnosis
from estimator.arrays import Array
from estimator.statistics import rms, rms_length
from mocobot_view.facts.placement import Grasps
from mocobot_view.replay.replay_trial import ReplayTrial
from mocobot_view.sizes import FORCE_M_PER_N


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
    facts, known = trial.facts, "not determined"
    mass, inertia, com_se = None, None, None
    if estimate is not None:
        mass, inertia, com_se = estimate.mass, estimate.inertia, estimate.p_1c_se_m
    com = facts.p_1c if facts else None
    rows = [
        (
            "mass [kg]",
            known if mass is None else f"{mass.mass:.4f} ± {mass.se:.4f}",
            "" if truth is None else f"{truth.mass_kg:.4f}",
        ),
        (
            "centre of mass in {1} [mm]",
            known if com is None else _with_errors(1e3 * com, None if com_se is None else 1e3 * com_se, 2),
            "" if truth is None or truth.p_1c is None else _vector(1e3 * truth.p_1c, 2),
        ),
        (
            "principal moments [kg m²]",
            known
            if inertia is None
            else _with_errors(inertia.principal.moments, inertia.principal.moments_se, 4),
            "" if truth is None or truth.principal_kgm2 is None else _vector(truth.principal_kgm2, 4),
        ),
    ]
    grasps, true = (of.grasps if of else None for of in (facts, truth))
    rows += [
        (
            f"grasp {i + 1} in {{1}} [mm]; [deg]",
            known if grasps is None else _pose(grasps, i),
            "" if true is None else _pose(true, i),
        )
        for i in range(1, trial.robots)
    ]
    columns = 2 + (truth is not None)
    head, *lines = ["| " + " | ".join(row[:columns]) + " |" for row in [("", "estimate", "truth"), *rows]]
    table = [head, "|" + "---|" * columns, *lines]
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


def _pose(grasps: Grasps, i: int) -> str:
    turn = Rotation.from_matrix(grasps.R_1i[i]).as_rotvec(degrees=True)
    return f"{_vector(1e3 * grasps.p_1i[i], 2)}; {_vector(turn, 3)}"


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
