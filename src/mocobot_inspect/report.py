"""Format an inspection as text and as strict JSON: SI units, robots count from 1, null for NaN and unknown values.

JSON of a team::

    format "mocobot-inspection", version 1
    log           name, level, robots, channels, assumed_design, calibrated (whether a calibration describes the
                  robots), free (whether the robots hold nothing)
    streams       per robot: samples, start_s and duration_s (after the log's first stamp), rate_hz, jitter_rms_s,
                  jitter_max_s, gaps, missing, longest_gap_s, longest_gap_at_s, duplicates, repeats, backwards,
                  farthest_back_s, farthest_back_at_s, recorder_s
                  (smallest and largest lead of the recorder's time over the stamps)
    channels      per robot and channel: lowest, highest, nans, infinities, wild (samples beyond any sensor's range),
                  step, noise, stuck_count, clipped_count, stuck and clipped (start_s after the robot's first stamp,
                  duration_s, value, jumps), oscillation (frequency_hz, amplitude, duration_s of a fast spectral line
                  above the noise; or null)
    excerpt       part_s (checked part of a long log, else null), stretches (start_s, duration_s), unchecked (why
                  nothing was checked)
    segments      still_s, moving_s, rests (start_s, duration_s); or null
    clocks        per robot: offset_s, offset_se_s, drift, drift_se, differs, why_not; or null
    wiring        misfit and misfit_undone (total, relative, scaled, faults, determined, mass_kg, span_m), found (per
                  mistake: kind, robots, channels, sentence, alternatives, misfit_before, misfit_after, and its size),
                  tried, hidden (mistakes that these data cannot show); or null
    excitation    as_it_is, and undone (with the mistakes undone, or null): holds, axes_radps, steps (step,
                  parameters, unit, rank, condition, singular_values, noise, weak), reasons (null: can be estimated),
                  flags
    findings      topic and sentence of each problem
    ready         last line of the text

JSON of joints::

    format "mocobot-joint-inspection", version 1
    log           name, map, joints, columns
    stamps        as one robot of ``streams``, without start_s
    channels      by column ("q of joint1"): as in an inspection of a team's log
    parts         start_s, duration_s, samples, rate_hz, resampled, notes
    unchecked     why motion and torques were not checked, or null
    joints        by joint: moves, misfit and misfit_undone (share of the torque that neither model nor friction
                  explains), gain (of the model's torque), position_step
    velocity, command     by joint: gain, gain_se, delay_s (null if noise hides it), delay_se_s, correlation,
                  possible (largest correlation that the noise allows)
    torque_delay  delay_s, delay_se_s, before, after; or null
    payload       whether the torques show a payload that the model lacks
    mistakes      kind, joints, sentence, alternatives, misfit_before, misfit_after
    findings, ready     as above
"""

from collections.abc import Iterator, Sequence
from dataclasses import fields
from typing import Any

import msgspec
import numpy as np

from estimator.clocks import ClockEstimate
from mocobot_inspect.channels import UNITS, Channel
from mocobot_inspect.findings import (
    counted,
    evidence,
    findings,
    is_left_out,
    milliseconds,
    mistake_words,
    percent,
    wrong_scales,
)
from mocobot_inspect.joint_motion import Follows, pooled
from mocobot_inspect.joints import JointInspection
from mocobot_inspect.mistakes import Mistake, listed
from mocobot_inspect.survey import Timing
from mocobot_inspect.team import AXES, Inspection, Readiness, differs
from mocobot_inspect.team_wiring import Misfit, Wiring
from mocobot_logs.joints.joint_map import COMMAND_KINDS, COMMANDS, QUANTITIES
from mocobot_logs.resample import MAX_GAP_S, MOST_MISSING

_HIDDEN = 6
_AS_IT_IS = "nothing as it is; with "
_JOINT_UNITS = {
    "position": ("rad", "m"), "velocity": ("rad/s", "m/s"), "effort": ("N m", "N"), "current": ("A", "A"),
    "duty": ("1", "1"), "voltage": ("V", "V"), "flag": ("", ""),
}  # fmt: skip
"""Units of a turning and of a sliding joint, by the quantity's kind."""


# Text


def format_inspection(found: Inspection | JointInspection) -> str:
    """Return a readable report; its last line says what the log is ready for."""
    joints = isinstance(found, JointInspection)
    wrong = [f"    - {finding.sentence}" for finding in findings(found)]
    lines = [*(_joint_lines(found) if joints else _team_lines(found))]
    if wrong:
        lines += ["[[Wrong]]", *wrong]
    elif not joints:
        lines.append("[[Wrong]]  nothing found")
    return "\n".join([*lines, ready_line(found)])


def _channel_row(name: str, width: int, channels: Sequence[Channel], unit: str) -> str:
    """Format a channel's extremes, coarsest step and largest noise over some robots."""
    low = min((c.lowest for c in channels if c.lowest is not None), default=None)
    high = max((c.highest for c in channels if c.highest is not None), default=None)
    if low is None or high is None:
        return f"    {name:<{width}} no finite samples"
    steps = [c.step for c in channels if c.step is not None]
    noise = max(c.noise for c in channels)
    step = f"{max(steps):.3g}" if steps else "none"
    level = f"{noise:.2g}" if noise > 0 else "< step" if any(steps) else "0"
    return f"    {name:<{width}} {low:>10.4g} {high:>10.4g} {step:>10} {level:>10}   {unit}".rstrip()


def _channel_heading(width: int) -> str:
    return f"    {'channel':<{width}}     lowest    highest       step      noise   [unit]"


def _team_lines(found: Inspection) -> Iterator[str]:
    channels = f"{len(found.channel_names)} channels each"
    yield f"[[Log {found.name}]]  {counted(found.robots, 'robot')}, {found.level} level, {channels}"
    if found.assumed_design:
        yield "    the log does not say what the robots' numbers are: those of the Omnid are assumed"
    if found.units is not None:
        yield "    the robots are taken as a calibration has them, not as designed"
    yield "[[Streams]]"
    yield "    robot  samples    from [s]      to [s]    rate [Hz]  jitter rms, max [ms]    gaps"
    for robot, t in enumerate(found.survey.timing):
        if t.first_ns is None:
            yield f"    {robot + 1:>5}        0"
            continue
        start = (t.first_ns - found.survey.origin_ns) * 1e-9
        rate = "-" if t.rate_hz is None else f"{t.rate_hz:.6g}"
        jitter = f"{1e3 * t.jitter_rms_s:.3g}, {1e3 * t.jitter_max_s:.3g}"
        yield (
            f"    {robot + 1:>5} {t.samples:>8} {start:>11.3f} {start + t.duration_s:>11.3f} {rate:>12} {jitter:>21} "
            f"{t.gaps:>7}"
        )
    yield from ("[[Channels, over all robots]]", _channel_heading(11))
    for k, name in enumerate(found.channel_names):
        every = [of_robot[k] for of_robot in found.survey.channels if of_robot[k].lowest is not None]
        yield _channel_row(name, 11 if every else 9, every, UNITS[name[:3]])
    yield from _team_motion(found)


def _team_motion(found: Inspection) -> Iterator[str]:
    if found.unchecked is not None:
        yield f"[[Motion and forces]]  not looked at: {found.unchecked}"
        return
    part = ""
    if found.survey.excerpt_s is not None:
        start, stop = found.survey.excerpt_s
        part = f", the liveliest part of a long log ({start:.0f} to {stop:.0f} s)"
    pieces = f" in {len(found.checked)} stretches without gaps" if len(found.checked) > 1 else ""
    yield f"[[Motion and forces]]  {sum(duration for _, duration in found.checked):.1f} s{pieces}{part}"
    if found.segments is not None:
        s = found.segments
        rests = f", {len(s.rests)} rests of 6 s and more" if s.rests else ""
        yield f"    still {s.still_s:.1f} s, moving {s.moving_s:.1f} s{rests}"
    if found.free:
        yield (
            "    the robots hold nothing: clocks, wiring and excitation, which need a payload that all of them move, "
            "are left out"
        )
    if found.clocks is not None:
        told = "; ".join(_clock(found, robot) for robot in range(1, found.robots))
        yield f"    clocks against that of robot 1: {told}"
    if found.wiring is not None:
        yield from _wiring_lines(found.wiring)
    ready = found.ready_undone or found.ready
    if ready is not None and ready.steps:
        undone = ", with all mistakes found undone" if found.ready_undone is not None else ""
        yield f"[[Excitation{undone}]]  {ready.holds} static holds"
        if ready.axes is not None:
            axes = (f"{value:.2g} {name}" for name, value in zip(AXES, ready.axes, strict=True))
            yield f"    turning [rad/s rms]: {'; '.join(axes)}"
        for step in ready.steps:
            yield (
                f"    {step.step}: rank {step.rank} of {len(step.singular_values)}, condition {step.condition:.3g}, "
                f"weakest signal {step.singular_values[-1]:.2g} {step.unit}, noise {step.noise:.2g}"
            )
            yield from (f"        weak {weak.direction}: {weak.reason}" for weak in step.weak)


def _clock(found: Inspection, robot: int) -> str:
    clocks = found.clocks
    assert clocks is not None
    why = clocks.why_not[robot]
    if why is not None:
        return f"robot {robot + 1} not known ({why})"
    text = (
        f"robot {robot + 1} {1e3 * clocks.offset_s[robot]:+.3g} +- {1e3 * clocks.offset_se_s[robot]:.2g} ms"
    )
    if np.isfinite(clocks.drift_se[robot]):
        text += f", {1e6 * clocks.drift[robot]:+.2g} +- {1e6 * clocks.drift_se[robot]:.2g} ppm"
    return text


def _wiring_lines(wiring: Wiring) -> Iterator[str]:
    yield (
        f"    misfit to robots that carry one rigid payload: {wiring.as_is.total:.2g} "
        "(about 1 for poorly calibrated robots)"
    )
    if wiring.as_is.scaled:
        yield f"        most of it: {evidence(wiring.as_is)}"
    if not wiring.undone.determined:
        yield "        the payload does not turn about two axes: most of the wiring cannot be checked"
    elif not wiring.undone.suspicious:
        hidden = _hidden_words(wiring.hidden)
        text = f"        {wiring.tried} wiring mistakes were looked for"
        if hidden:
            text += f"; {len(wiring.hidden)} of them would not show here: {'; '.join(hidden[:_HIDDEN])}"
            text += f"; and {len(hidden) - _HIDDEN} more" if len(hidden) > _HIDDEN else ""
        yield text


def _hidden_words(mistakes: Sequence[Mistake]) -> list[str]:
    """Group mistakes that these data cannot show by subject, with the robots of each."""
    robots: dict[str, dict[str, None]] = {}
    for mistake in mistakes:
        robots.setdefault(mistake.subject, {})[mistake.who] = None
    return [f"{subject} ({', '.join(who)})" for subject, who in robots.items()]


def _joint_lines(found: JointInspection) -> Iterator[str]:
    t, joints = found.timing, counted(len(found.robot.joints), "joint")
    yield f"[[Log {found.name}]]  {joints}, {len(found.channels)} columns by map {found.log_map.name}"
    yield from (f"    {note}" for note in found.robot.notes)
    yield "[[Stamps]]"
    yield (
        f"    {t.samples} samples, {t.duration_s:.3f} s, {'-' if t.rate_hz is None else f'{t.rate_hz:.6g}'} Hz; jitter "
        f"{1e3 * t.jitter_rms_s:.3g} ms rms, {1e3 * t.jitter_max_s:.3g} ms at most; {counted(t.gaps, 'gap')}"
    )
    for log in found.logs:
        part = "" if len(found.logs) == 1 else f"from {log.start_s:.3f} s on, {log.time[-1]:.3f} s: "
        how = "interpolated" if log.resampled else "as they are"
        yield f"    {part}{len(log.time)} samples at {log.rate_hz:.6g} Hz, {how}"
        yield from (f"        {note}" for note in log.notes)
    width = max(len("channel"), *(len(c.name) for c in found.channels))
    yield from ("[[Channels]]", _channel_heading(width))
    for (quantity, joint), c in zip(found.log_map.channels, found.channels, strict=True):
        yield _channel_row(c.name, width, [c], _joint_unit(found, quantity, joint))
    yield from _joint_motion(found)


def _joint_unit(found: JointInspection, quantity: str, joint: str) -> str:
    kind, robot = QUANTITIES[quantity].kind, found.robot
    if quantity in COMMANDS:
        kind = COMMAND_KINDS.get(found.log_map.control.command, kind)
    slides = bool(joint) and bool(robot.slides[robot.joints.index(joint)]) and not QUANTITIES[quantity].motor
    return _JOINT_UNITS[kind][slides]


def _joint_motion(found: JointInspection) -> Iterator[str]:
    if found.unchecked is not None:
        yield f"[[Motion and torques]]  not looked at: {found.unchecked}"
        return
    joints, w = found.robot.joints, found.wiring
    still = [joints[j] for j in np.flatnonzero(~found.moves)]
    yield f"[[Motion and torques]]  {sum(log.time[-1] for log in found.logs):.1f} s"
    if still:
        yield f"    {listed(still)} {'does' if len(still) == 1 else 'do'} not move"
    if w is None or not found.moves.any():
        yield "    no torque or duty of a joint that moves: signs and order are not compared with the model"
    else:
        told = ", ".join(
            f"{joints[j]} {percent(w.misfit[j])} %" for j in np.flatnonzero(np.isfinite(w.misfit))
        )
        yield f"    neither model nor friction explains, of each torque or duty: {told}"
        if w.payload is not None:
            yield "    the robot seems to carry something at its last link that the model lacks"
        yield f"    mistakes of signs, order and units that were tried: {w.tried}"
    for what, all_of in (("dq follows q", found.velocities), ("q follows its command", found.commands)):
        for one in all_of:
            yield (
                f"    {joints[one.joint]}: {what} with gain {one.gain:.4g} +- {one.gain_se:.2g}, "
                f"{later(one.delay_s, one.delay_se_s)}, correlation {one.correlation:.4g}"
            )
        shared = pooled(all_of)
        if shared is not None:
            yield f"    {what} alike at all joints, {later(*shared)}"
    if found.delay is not None:
        yield f"    torques follow the motion {later(found.delay.delay_s, found.delay.delay_se_s)}"


def later(delay_s: float, se_s: float) -> str:
    """Format the delay of one signal behind or ahead of another."""
    if np.isnan(delay_s):
        return "by a delay that noise hides"
    return f"{milliseconds(delay_s, se_s)} {'earlier' if delay_s < 0 else 'later'}"


# What a log is ready for


def ready_line(found: Inspection | JointInspection) -> str:
    """Return the verdict in one line: what the log is ready for, as it is or after corrections."""
    return f"ready for: {_joint_ready(found) if isinstance(found, JointInspection) else _team_ready(found)}"


def _team_ready(found: Inspection) -> str:
    never = _never_ready(found)
    if never is not None:
        return f"nothing ({never})"
    before, ready = [], found.ready_undone or found.ready
    if found.wiring is not None and found.ready_undone is not None:
        before.append(f"{_mistakes_above(found.wiring)} undone")
    if found.standing:
        worst = max(found.standing, key=lambda stands: stands.seconds)
        who = f"{worst.channel} stands" if len(found.standing) == 1 else f"{worst.channel} and others stand"
        before.append(f"the {worst.seconds:.2g} s left out in which {who} still")
    if found.free or ready is None:
        good = "mocobot calibrate --free yes, an estimate no (the robots hold nothing)"
    else:
        good = verdict(ready) + ("; clocks to be corrected" if found.skewed else "")
    if not before and good.startswith("nothing ("):
        return good
    channels = [c for of_robot in found.survey.channels for c in of_robot]
    if any(c.infinities or c.wild for c in channels):
        before.insert(0, "absurd values left out (convert --drop)")
    if before:
        good = f"{_AS_IT_IS}{' and '.join(before)}: {good}"
    # Conversions that must come first: without them an estimate refuses the log.
    if any(t.backwards for t in found.survey.timing):
        good += "; time that runs back to be mended"
    if any(c.nans for c in channels):
        good += "; missing values to be filled in (convert)"
    if any(map(_gap, found.survey.whole)):
        good += "; the parts between gaps to be taken (convert --split-at-gaps)"
    return good


def _never_ready(found: Inspection) -> str | None:
    """Return why the log is ready for nothing, or None. An estimate uses every channel, so a constant one spoils it."""
    if found.unchecked is not None:
        return found.unchecked
    dead = [stands.channel for stands in found.standing if stands.mostly][:_HIDDEN]
    if dead:
        return f"{listed(dead)} stand{'s' * (len(dead) == 1)} still"
    for robot, t in enumerate(found.survey.whole):
        if t.missing > MOST_MISSING * (t.samples + t.missing) and not _gap(t):
            return f"robot {robot + 1} lacks {t.missing} samples, too many to be filled in"
    wiring = found.wiring
    if wiring is not None and found.ready_undone is not None and wiring.undone.suspicious:
        return f"even with {_mistakes_above(wiring)} undone, the robots do not carry one rigid payload"
    if wiring is not None and found.ready_undone is None and wiring.as_is.suspicious:
        return "the channels do not fit robots that carry one rigid payload"
    return None


def _mistakes_above(wiring: Wiring) -> str:
    return "the mistake above" if len(wiring.found) == 1 else f"the {len(wiring.found)} mistakes above"


def _gap(t: Timing) -> bool:
    """Return whether a gap is too long to be filled."""
    return t.rate_hz is not None and t.longest_gap_s > MAX_GAP_S + 1 / t.rate_hz


def verdict(ready: Readiness) -> str:
    """Format yes or no for each quantity, with the reason."""
    same = set(ready.reasons.values())
    if len(same) == 1 and None not in same:
        return f"nothing ({same.pop()})"
    return ", ".join(
        f"{name} yes" if reason is None else f"{name} no ({reason})" for name, reason in ready.reasons.items()
    )


def _joint_ready(found: JointInspection) -> str:
    if found.unchecked is not None:
        return f"nothing ({found.unchecked})"
    log = found.logs[0]
    count = 0
    if log.torque is not None:
        count = int(np.sum(np.isfinite(log.torque).any(axis=0) & found.moves))
    good = [f"a diagnosis from torques of {counted(count, 'joint')}"] if count else []
    if (log.command is not None or log.drive.duty is not None) and found.moves.any():
        what = "commands" if log.command is not None else "duties"
        good.append(f"one from {what}" if good else f"a diagnosis from {what}")
    if not good:
        return "nothing (no joint that moves has a torque, a command or a duty)"
    wrong = 0 if found.wiring is None else len(found.wiring.found)
    wrong += bool(found.signs_lost or found.crossed or wrong_scales(found))
    before = [f"the mistake{'s' * (wrong > 1)} above undone in the map"] if wrong else []
    if any(c.wild or c.infinities for c in found.channels):
        before.append("the absurd values left out of the log")
    some = any(c.nans and not is_left_out(c, found.timing) for c in found.channels)
    lacking = "; rows that lack a value are left out" if some else ""
    return f"{_AS_IT_IS}{' and '.join(before)}: " * bool(before) + f"{' and '.join(good)}{lacking}"


# JSON


def inspection_dict(found: Inspection | JointInspection) -> dict[str, Any]:
    """Return the inspection as plain JSON values; the module's docstring lists the keys."""
    own = _joint_dict(found) if isinstance(found, JointInspection) else _team_dict(found)
    told = own | {"findings": findings(found), "ready": ready_line(found)}
    return msgspec.json.decode(msgspec.json.encode(told, enc_hook=lambda number: number.item()))


def _without(record: Any, *left_out: str) -> dict[str, Any]:
    """Return the fields of a dataclass by name, without some."""
    return _only(record, *(f.name for f in fields(record) if f.name not in left_out))


def _only(record: Any, *names: str) -> dict[str, Any]:
    """Return some attributes of an object by name."""
    return {name: getattr(record, name) for name in names}


def _timing(t: Timing) -> dict[str, Any]:
    return {"duration_s": t.duration_s} | _without(t, "first_ns", "last_ns")


def _team_dict(found: Inspection) -> dict[str, Any]:
    seen, rested = found.survey, found.segments
    first_s = [None if t.first_ns is None else (t.first_ns - seen.origin_ns) * 1e-9 for t in seen.timing]
    return {
        "format": "mocobot-inspection",
        "version": 1,
        "log": _only(found, "name", "level", "robots", "assumed_design", "free")
        | {"channels": found.channel_names, "calibrated": found.units is not None},
        "streams": [{"start_s": s} | _timing(t) for s, t in zip(first_s, seen.timing, strict=True)],
        "channels": [{c.name: _without(c, "name") for c in of_robot} for of_robot in seen.channels],
        "excerpt": {
            "part_s": seen.excerpt_s,
            "stretches": _stretches(found.checked),
            "unchecked": found.unchecked,
        },
        "segments": rested and (_without(rested, "rests") | {"rests": _stretches(rested.rests)}),
        "clocks": None if found.clocks is None else _clocks(found.clocks),
        "wiring": None if found.wiring is None else _wiring(found.wiring),
        "excitation": {"as_it_is": _excitation(found.ready), "undone": _excitation(found.ready_undone)},
    }


def _stretches(told: tuple[tuple[float, float], ...]) -> list[dict[str, float]]:
    return [{"start_s": start, "duration_s": duration} for start, duration in told]


def _clocks(clocks: ClockEstimate) -> list[dict[str, Any]]:
    names = ("offset_s", "offset_se_s", "drift", "drift_se", "why_not")
    every = _only(clocks, *names)
    return [
        {name: every[name][robot] for name in names} | {"differs": differs(clocks, robot)}
        for robot in range(len(clocks.why_not))
    ]


def _wiring(wiring: Wiring) -> dict[str, Any]:
    return {
        "misfit": _misfit(wiring.as_is),
        "misfit_undone": _misfit(wiring.undone),
        "found": [
            f.mistake.to_dict()
            | {"alternatives": [m.to_dict() for m in f.alternatives]}
            | {"misfit_before": f.before, "misfit_after": f.after}
            for f in wiring.found
        ],
        "tried": wiring.tried,
        "hidden": [mistake.to_dict() for mistake in wiring.hidden],
    }


def _misfit(misfit: Misfit) -> dict[str, Any]:
    reasons = [fault.reason for fault in misfit.faults]
    return {"total": misfit.total, "faults": reasons} | _without(misfit, "faults", "parts")


def _excitation(ready: Readiness | None) -> dict[str, Any] | None:
    if ready is None:
        return None
    steps = [_without(step) | {"rank": step.rank, "condition": step.condition} for step in ready.steps]
    return {"axes_radps": ready.axes, "steps": steps} | _without(ready, "axes", "steps")


def _joint_dict(found: JointInspection) -> dict[str, Any]:
    joints, w = found.robot.joints, found.wiring
    first = found.logs[0] if found.logs else None
    return {
        "format": "mocobot-joint-inspection",
        "version": 1,
        "log": {
            "name": found.name,
            "map": found.log_map.name,
            "joints": joints,
            "columns": len(found.channels),
        },
        "stamps": _timing(found.timing),
        "channels": {c.name: _without(c, "name") for c in found.channels},
        "parts": [
            {"duration_s": log.time[-1], "samples": len(log.time)}
            | _only(log, "start_s", "rate_hz", "resampled", "notes")
            for log in found.logs
        ],
        "unchecked": found.unchecked,
        "joints": {
            joint: {
                "moves": found.moves[j],
                "misfit": w and w.misfit[j],
                "misfit_undone": w and w.undone[j],
                "gain": w and w.gains[j],
                "position_step": first and first.position_step[j],
            }
            for j, joint in enumerate(joints)
        },
        "velocity": _follows(found.velocities, joints),
        "command": _follows(found.commands, joints),
        "torque_delay": found.delay,
        "payload": w is not None and w.payload is not None,
        "mistakes": [
            {
                "kind": f.mistake.kind,
                "joints": [joints[j] for j in f.mistake.joints],
                "sentence": mistake_words(f.mistake, joints),
                "alternatives": [mistake_words(m, joints) for m in f.alternatives],
                "misfit_before": f.before,
                "misfit_after": f.after,
            }
            for f in (() if w is None else w.found)
        ],
    }


def _follows(found: Sequence[Follows], joints: Sequence[str]) -> dict[str, Any]:
    return {joints[one.joint]: _without(one, "joint") for one in found}
