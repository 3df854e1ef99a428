"""The text of a replay: verdict, estimate against truth, residuals, notes, and a key to the colours."""

from pathlib import Path

from scipy.spatial.transform import Rotation

from discrepancy.result.read import VERDICTS, WrittenDiagnosis
from estimator.arrays import Array
from estimator.estimate.frames import frames_said
from estimator.statistics import rms, rms_length
from mocobot_view.facts.placement import Grasps
from mocobot_view.replay.replay_trial import ReplayTrial
from mocobot_view.sizes import FORCE_M_PER_N

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
