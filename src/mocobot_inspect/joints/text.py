"""The inspection of a joint log for the terminal."""

from __future__ import annotations

import numpy as np

from mocobot_inspect.joints.findings import joint_findings, wrong_scales
from mocobot_inspect.joints.inspection import JointInspection
from mocobot_inspect.joints.lags import pooled
from mocobot_inspect.joints.numbers import later, percent
from mocobot_inspect.stream.channels import Channel
from mocobot_inspect.wiring.mistakes.base import listed
from mocobot_logs.joints.joint_map import COMMANDS, QUANTITIES

_UNITS = {
    "position": ("rad", "m"),
    "velocity": ("rad/s", "m/s"),
    "effort": ("N m", "N"),
    "current": ("A", "A"),
    "duty": ("1", "1"),
    "voltage": ("V", "V"),
    "flag": ("", ""),
}
_COMMAND_KINDS = {"position": "position", "velocity": "velocity", "torque": "effort"}


def format_joint_inspection(found: JointInspection) -> str:
    """The text report."""
    count = len(found.robot.joints)
    lines = [
        f"[[Log {found.name}]]  {count} joint{'s' * (count > 1)}, {len(found.channels)} columns by map "
        f"{found.log_map.name}",
        *_stream(found),
        *_channels(found),
        *_motion(found),
    ]
    wrong = joint_findings(found)
    if wrong:
        lines += ["[[Wrong]]", *(f"    - {finding.sentence}" for finding in wrong)]
    return "\n".join([*lines, joint_ready_line(found)])


def _stream(found: JointInspection) -> list[str]:
    t = found.timing
    rate = "-" if t.rate_hz is None else f"{t.rate_hz:.6g}"
    lines = [
        "[[Stamps]]",
        f"    {t.samples} samples, {t.duration_s:.3f} s, {rate} Hz; jitter {1e3 * t.jitter_rms_s:.3g} ms rms, "
        f"{1e3 * t.jitter_max_s:.3g} ms at most; {t.gaps} gap{'s' * (t.gaps != 1)}",
    ]
    for log in found.logs:
        part = "" if len(found.logs) == 1 else f"from {log.start_s:.3f} s on, {log.time[-1]:.3f} s: "
        how = "interpolated" if log.resampled else "as they are"
        lines.append(f"    {part}{len(log.time)} samples at {log.rate_hz:.6g} Hz, {how}")
        lines += [f"        {note}" for note in log.notes]
    return lines


def _channels(found: JointInspection) -> list[str]:
    keys = list(found.log_map.channels)
    names = [c.name for c in found.channels]
    width = max(len("channel"), *(len(name) for name in names))
    lines = [
        "[[Channels]]",
        f"    {'channel':<{width}}     lowest    highest       step      noise   [unit]",
    ]
    for (quantity, joint), c in zip(keys, found.channels, strict=True):
        if c.lowest is None or c.highest is None:
            lines.append(f"    {c.name:<{width}} no finite samples")
            continue
        step = "none" if c.step is None else f"{c.step:.3g}"
        lines.append(
            f"    {c.name:<{width}} {c.lowest:>10.4g} {c.highest:>10.4g} {step:>10} {_noise(c):>10}   "
            f"{_unit(found, quantity, joint)}".rstrip()
        )
    return lines


def _noise(c: Channel) -> str:
    return f"{c.noise:.2g}" if c.noise > 0 else "< step" if c.step else "0"


def _unit(found: JointInspection, quantity: str, joint: str) -> str:
    kind = QUANTITIES[quantity].kind
    if quantity in COMMANDS:
        kind = _COMMAND_KINDS.get(found.log_map.control.command, kind)
    robot = found.robot
    slides = bool(joint) and bool(robot.slides[robot.joints.index(joint)]) and not QUANTITIES[quantity].motor
    return _UNITS[kind][slides]


def _motion(found: JointInspection) -> list[str]:
    if found.unchecked is not None:
        return [f"[[Motion and torques]]  not looked at: {found.unchecked}"]
    joints = found.robot.joints
    still = [joints[j] for j in np.flatnonzero(~found.moves)]
    lines = [f"[[Motion and torques]]  {sum(log.time[-1] for log in found.logs):.1f} s"]
    if still:
        lines.append(f"    {listed(still)} {'does' if len(still) == 1 else 'do'} not move")
    w = found.wiring
    if w is None or not found.moves.any():
        lines.append(
            "    no torque or duty of a joint that moves: signs and order are not compared with the model"
        )
    else:
        told = [f"{joints[j]} {percent(w.misfit[j])} %" for j in np.flatnonzero(np.isfinite(w.misfit))]
        lines.append("    neither model nor friction explains, of each torque or duty: " + ", ".join(told))
        if w.payload is not None:
            lines.append("    the robot seems to carry something at its last link that the model lacks")
        lines.append(f"    mistakes of signs, order and units that were tried: {w.tried}")
    for what, all_of in (("dq follows q", found.velocities), ("q follows its command", found.commands)):
        for one in all_of:
            lines.append(
                f"    {joints[one.joint]}: {what} with gain {one.gain:.4g} +- {one.gain_se:.2g}, "
                f"{later(one.delay_s, one.delay_se_s)}, correlation {one.correlation:.4g}"
            )
        shared = pooled(all_of)
        if shared is not None:
            lines.append(f"    {what} alike at all joints, {later(*shared)}")
    if found.delay is not None:
        lines.append(f"    torques follow the motion {later(found.delay.delay_s, found.delay.delay_se_s)}")
    return lines


def joint_ready_line(found: JointInspection) -> str:
    """What the log can be used for, one line."""
    if found.unchecked is not None:
        return f"ready for: nothing ({found.unchecked})"
    log = found.logs[0]
    torque = np.zeros(len(found.robot.joints), dtype=bool)
    if log.torque is not None:
        torque = np.isfinite(log.torque).any(axis=0) & found.moves
    commanded = log.command is not None or log.drive.duty is not None
    good = []
    if torque.any():
        good.append(f"a diagnosis from torques of {int(torque.sum())} joint{'s' * (int(torque.sum()) > 1)}")
    if commanded and found.moves.any():
        what = "commands" if log.command is not None else "duties"
        good.append(f"one from {what}" if good else f"a diagnosis from {what}")
    if not good:
        return "ready for: nothing (no joint that moves has a torque, a command or a duty)"
    wrong = 0 if found.wiring is None else len(found.wiring.found)
    wrong += bool(found.signs_lost or found.crossed or wrong_scales(found))
    undone = [f"the mistake{'s' * (wrong > 1)} above undone in the map"] if wrong else []
    if any(c.wild or c.infinities for c in found.channels):
        undone.append("the absurd values left out of the log")
    lacking = "; rows that lack a value are left out" if any(c.nans for c in found.channels) else ""
    if undone:
        return f"ready for: nothing as it is; with {' and '.join(undone)}: {' and '.join(good)}{lacking}"
    return f"ready for: {' and '.join(good)}{lacking}"
