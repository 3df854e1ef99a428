"""An inspection as text."""

import numpy as np

from mocobot_inspect.findings import evidence, findings
from mocobot_inspect.inspection import Inspection
from mocobot_inspect.readiness import AXES, Readiness
from mocobot_inspect.stream.channels import UNITS, Channel
from mocobot_inspect.stream.timing import Timing
from mocobot_inspect.wiring.mistakes import Mistake
from mocobot_inspect.wiring.mistakes.base import listed
from mocobot_logs.resample import MAX_GAP_S, MOST_MISSING

_HIDDEN = 6
_AS_IT_IS = "nothing as it is; with "


def format_inspection(found: Inspection) -> str:
    """Readable report; the last line says what the log is ready for."""
    robots = f"{found.robots} robot{'s' * (found.robots > 1)}"
    channels = f"{len(found.channel_names)} channels each"
    lines = [f"[[Log {found.name}]]  {robots}, {found.level} level, {channels}"]
    if found.assumed_design:
        lines.append("    the log does not say what the robots' numbers are: those of the Omnid are assumed")
    if found.units is not None:
        lines.append("    the robots are taken as a calibration has them, not as designed")
    lines += _streams(found) + _channels(found)
    lines += _checked(found)
    wrong = findings(found)
    lines += (
        ["[[Wrong]]"] + [f"    - {finding.sentence}" for finding in wrong]
        if wrong
        else ["[[Wrong]]  nothing found"]
    )
    lines.append(ready_line(found))
    return "\n".join(lines)


def _streams(found: Inspection) -> list[str]:
    lines = [
        "[[Streams]]",
        "    robot  samples    from [s]      to [s]    rate [Hz]  jitter rms, max [ms]    gaps",
    ]
    for robot, t in enumerate(found.survey.timing):
        if t.first_ns is None or t.last_ns is None:
            lines.append(f"    {robot + 1:>5}        0")
            continue
        start = (t.first_ns - found.survey.origin_ns) * 1e-9
        rate = "-" if t.rate_hz is None else f"{t.rate_hz:.6g}"
        jitter = f"{1e3 * t.jitter_rms_s:.3g}, {1e3 * t.jitter_max_s:.3g}"
        lines.append(
            f"    {robot + 1:>5} {t.samples:>8} {start:>11.3f} {start + t.duration_s:>11.3f} {rate:>12} {jitter:>21} "
            f"{t.gaps:>7}"
        )
    return lines


def _channels(found: Inspection) -> list[str]:
    """Extremes over the robots, coarsest step and largest noise."""
    lines = [
        "[[Channels, over all robots]]",
        "    channel         lowest    highest       step      noise   [unit]",
    ]
    for k, name in enumerate(found.channel_names):
        every = [of_robot[k] for of_robot in found.survey.channels]
        told = [c for c in every if c.lowest is not None and c.highest is not None]
        if not told:
            lines.append(f"    {name:<9} no finite samples")
            continue
        low, high = min(c.lowest or 0.0 for c in told), max(c.highest or 0.0 for c in told)
        lines.append(
            f"    {name:<9} {low:>12.4g} {high:>10.4g} {_step(told):>10} {_noise(told):>10}   {UNITS[name[:3]]}"
        )
    return lines


def _step(channels: list[Channel]) -> str:
    steps = [c.step for c in channels if c.step is not None]
    return f"{max(steps):.3g}" if steps else "none"


def _noise(channels: list[Channel]) -> str:
    noise = max(c.noise for c in channels)
    return f"{noise:.2g}" if noise > 0 else "< step" if any(c.step for c in channels) else "0"


def _checked(found: Inspection) -> list[str]:
    if found.unchecked is not None:
        return [f"[[Motion and forces]]  not looked at: {found.unchecked}"]
    total = sum(duration for _, duration in found.checked)
    part = ""
    if found.survey.excerpt_s is not None:
        start, stop = found.survey.excerpt_s
        part = f", the liveliest part of a long log ({start:.0f} to {stop:.0f} s)"
    pieces = f" in {len(found.checked)} stretches without gaps" if len(found.checked) > 1 else ""
    lines = [f"[[Motion and forces]]  {total:.1f} s{pieces}{part}"]
    if found.segments is not None:
        s = found.segments
        rests = f", {len(s.rests)} rests of 6 s and more" if s.rests else ""
        lines.append(f"    still {s.still_s:.1f} s, moving {s.moving_s:.1f} s{rests}")
    if found.free:
        lines.append(
            "    the robots hold nothing: clocks, wiring and excitation, which need a payload that all of them move, "
            "are left out"
        )
    lines += _clocks(found)
    if found.wiring is not None:
        lines += _wiring(found)
    ready = found.ready_undone or found.ready
    if ready is not None and ready.steps:
        undone = ", with all mistakes found undone" if found.ready_undone is not None else ""
        lines.append(f"[[Excitation{undone}]]  {ready.holds} static holds")
        if ready.axes is not None:
            axes = zip(AXES, ready.axes, strict=True)
            lines.append(
                "    turning [rad/s rms]: " + "; ".join(f"{value:.2g} {name}" for name, value in axes)
            )
        for step in ready.steps:
            lines.append(
                f"    {step.step}: rank {step.rank} of {len(step.singular_values)}, condition {step.condition:.3g}, "
                f"weakest signal {step.singular_values[-1]:.2g} {step.unit}, noise {step.noise:.2g}"
            )
            lines += [f"        weak {weak.direction}: {weak.reason}" for weak in step.weak]
    return lines


def _clocks(found: Inspection) -> list[str]:
    clocks = found.clocks
    if clocks is None:
        return []
    told = []
    for robot in range(1, found.robots):
        why = clocks.why_not[robot]
        if why is not None:
            told.append(f"robot {robot + 1} not known ({why})")
            continue
        text = f"robot {robot + 1} {1e3 * clocks.offset_s[robot]:+.3g} +- {1e3 * clocks.offset_se_s[robot]:.2g} ms"
        if np.isfinite(clocks.drift_se[robot]):
            text += f", {1e6 * clocks.drift[robot]:+.2g} +- {1e6 * clocks.drift_se[robot]:.2g} ppm"
        told.append(text)
    return ["    clocks against that of robot 1: " + "; ".join(told)]


def _wiring(found: Inspection) -> list[str]:
    wiring = found.wiring
    assert wiring is not None
    lines = [
        f"    misfit to robots that carry one rigid payload: {wiring.as_is.total:.2g} "
        "(about 1 for poorly calibrated robots)"
    ]
    if wiring.as_is.scaled:
        lines.append(f"        most of it: {evidence(wiring.as_is)}")
    if not wiring.undone.determined:
        lines.append("        the payload does not turn about two axes: most of the wiring cannot be checked")
    elif not wiring.undone.suspicious:
        hidden = hidden_words(wiring.hidden)
        text = f"        {wiring.tried} wiring mistakes were looked for"
        if hidden:
            text += f"; {len(wiring.hidden)} of them would not show here: " + "; ".join(hidden[:_HIDDEN])
            text += f"; and {len(hidden) - _HIDDEN} more" if len(hidden) > _HIDDEN else ""
        lines.append(text)
    return lines


def hidden_words(mistakes: tuple[Mistake, ...]) -> list[str]:
    """Mistakes that would not show, put together: kind and groups, then the robots."""
    groups: dict[str, list[str]] = {}
    for mistake in mistakes:
        groups.setdefault(mistake.subject(), [])
        if mistake.who() not in groups[mistake.subject()]:
            groups[mistake.subject()].append(mistake.who())
    return [f"{subject} ({', '.join(who)})" for subject, who in groups.items()]


def ready_line(found: Inspection) -> str:
    """The verdict; an estimate takes all of a log, so stretches in which a channel stands spoil it."""
    line = _ready(found)
    if line.startswith("ready for: nothing ("):
        return line
    if any(c.infinities or c.wild for of_robot in found.survey.channels for c in of_robot):
        later = line.removeprefix("ready for: ").removeprefix(_AS_IT_IS)
        joint = " and " if _AS_IT_IS in line else ": "
        line = f"ready for: {_AS_IT_IS}absurd values left out (convert --drop){joint}{later}"
    return line + "".join(f"; {what}" for what in _first(found))


def _first(found: Inspection) -> list[str]:
    """What a conversion has to do before, or an estimate refuses the log."""
    survey = found.survey
    return [
        what
        for what, needed in (
            ("time that runs back to be mended", any(t.backwards for t in survey.timing)),
            (
                "missing values to be filled in (convert)",
                any(c.nans for of_robot in survey.channels for c in of_robot),
            ),
            ("the parts between gaps to be taken (convert --split-at-gaps)", any(map(_gap, survey.whole))),
        )
        if needed
    ]


def _gap(t: Timing) -> bool:
    """Whether samples are missing for too long to be filled in."""
    return t.rate_hz is not None and t.longest_gap_s > MAX_GAP_S + 1 / t.rate_hz


def _ready(found: Inspection) -> str:
    if found.unchecked is not None or not (found.free or (found.ready and found.wiring)):
        return f"ready for: nothing ({found.unchecked})"
    clocks = "; clocks to be corrected" if found.skewed else ""
    standing = found.standing
    if any(stands.mostly for stands in standing):
        names = listed([stands.channel for stands in standing if stands.mostly][:_HIDDEN])
        return f"ready for: nothing ({names} stand{'s' * (names.count('omnid') == 1)} still)"
    for robot, t in enumerate(found.survey.whole):
        if t.missing > MOST_MISSING * (t.samples + t.missing) and not _gap(t):
            return (
                f"ready for: nothing (robot {robot + 1} lacks {t.missing} samples, too many to be filled in)"
            )
    out = ""
    if standing:
        worst = max(standing, key=lambda stands: stands.seconds)
        who = f"{worst.channel} stands" if len(standing) == 1 else f"{worst.channel} and others stand"
        out = f"the {worst.seconds:.2g} s left out in which {who} still"
    if found.free or found.ready is None or found.wiring is None:
        good = "mocobot calibrate --free yes, an estimate no (the robots hold nothing)"
        return f"ready for: {_AS_IT_IS}{out}: {good}" if out else f"ready for: {good}"
    if found.ready_undone is not None:
        count = len(found.wiring.found)
        what = "the mistake above" if count == 1 else f"the {count} mistakes above"
        if found.wiring.undone.suspicious:
            return f"ready for: nothing (even with {what} undone, the robots do not carry one rigid payload)"
        undone = f"{what} undone{f' and {out}' if out else ''}"
        return f"ready for: {_AS_IT_IS}{undone}: {verdict(found.ready_undone)}{clocks}"
    if found.wiring.as_is.suspicious:
        return "ready for: nothing (the channels do not fit robots that carry one rigid payload)"
    if out:
        return f"ready for: {_AS_IT_IS}{out}: {verdict(found.ready)}{clocks}"
    return f"ready for: {verdict(found.ready)}{clocks}"


def verdict(ready: Readiness) -> str:
    """Yes or no for every quantity, with the reason."""
    same = set(ready.reasons.values())
    if len(same) == 1 and None not in same:
        return f"nothing ({same.pop()})"
    return ", ".join(
        f"{name} yes" if reason is None else f"{name} no ({reason})" for name, reason in ready.reasons.items()
    )
