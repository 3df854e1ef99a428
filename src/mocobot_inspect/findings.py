"""Problems of a log of a team or of joints: one sentence each, with its evidence."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import floor, log10
from typing import Literal

import numpy as np

from estimator.recording.checks import TORQUE_FACTOR
from mocobot_inspect.channels import UNITS, Channel, Stretch
from mocobot_inspect.joint_motion import Follows, pooled
from mocobot_inspect.joint_wiring import SUSPICIOUS as JOINT_SUSPICIOUS
from mocobot_inspect.joint_wiring import Mistake as JointMistake
from mocobot_inspect.joints import JointInspection
from mocobot_inspect.mistakes import listed
from mocobot_inspect.survey import Timing
from mocobot_inspect.team import FASTEST_HZ, MOSTLY, SIGMAS, SLOWEST_HZ, Inspection, differs
from mocobot_inspect.team_wiring import SUSPICIOUS, Found, Misfit
from mocobot_logs.joints.joint_log import JointLog
from mocobot_logs.log import NS, repeated

Topic = Literal["time", "samples", "clocks", "wiring", "estimate"]

JITTERY = 0.2  # smallest rms jitter, relative to the period, that is reported
SAME_RATE = 1e-3
EARLY_S = 1.0  # smallest difference [s] between the robots' first or last stamps that is reported
RECORDER_S = 1.0
"""Smallest spread [s] of the recorder's lead over the stamps that is reported: it means mixed clocks."""
MARGIN = 0.02
"""A joint may leave its range by this share of it plus this many rad or m, since calibration shifts zeros."""
COARSE = 0.005  # largest position step, as a share of a joint's motion, that is not reported as coarse
SATURATED = 0.98  # share of the drive's limit above which a torque counts as saturated
LATE = 1.1
"""Smallest ratio of the torques' unexplained shares, without and with the delay, at which a delay is reported."""
FACTORS = {
    180.0 / np.pi: "degrees, taken for radians", np.pi / 180.0: "radians, taken for degrees",
    1e3: "thousandths, taken for whole units", 1e-3: "whole units, taken for thousandths",
    30.0 / np.pi: "rpm, taken for rad/s", np.pi / 30.0: "rad/s, taken for rpm",
    1.0 / (2.0 * np.pi): "turns, taken for radians", 2.0 * np.pi: "radians, taken for turns",
}  # fmt: skip
"""Gains that wrong units cause."""
CLOSE = 0.05  # relative distance within which a gain counts as equal to a factor, or to 1
_NAMED = 4  # most channels that a sentence names
_TURN = 2 * np.pi
_ONE_TURN = 0.01  # a range within this share of a full turn means an encoder that wraps around
_TIME_UNITS = ((1e-3, "milliseconds"), (1e-6, "microseconds"), (1e-9, "nanoseconds"))
_FOLLOWED = 0.9  # least correlation of a motion with its command for a finding
_NEVER, _NEAR = 1e-3, 0.02  # of the maximum: bounds of the minimum of a torque that lost its sign
_UNEXPLAINED = 0.5  # share of a torque, beyond noise, above which the model hardly explains it


@dataclass(frozen=True)
class Finding:
    topic: Topic  # the subject
    sentence: str  # the problem, with the numbers that show it


def findings(found: Inspection | JointInspection) -> list[Finding]:
    """Return all problems, in the order in which to correct them."""
    if isinstance(found, JointInspection):
        return [Finding(topic, sentence) for topic, source in _OF_JOINTS for sentence in source(found)]
    return [Finding(topic, sentence) for topic, source in _OF_TEAM for sentence in source(found)]


# Stamps and channels of any log


def _stamps(t: Timing) -> Iterator[str]:
    """Yield the problems of one stream's stamps."""
    if t.repeats:
        yield repeated(t.repeats)
    if t.rate_hz is None:
        yield f"{t.samples} samples are too few"
        return
    if not SLOWEST_HZ <= t.rate_hz <= FASTEST_HZ:
        yield f"samples come at {t.rate_hz:.3g} Hz{_time_unit(t.rate_hz)}"
    if t.gaps:
        share = 100 * t.missing / (t.samples + t.missing)
        yield (
            f"{t.missing} samples ({share:.2g} %) are missing in {counted(t.gaps, 'gap')}, the longest of "
            f"{t.longest_gap_s:.3g} s from {t.longest_gap_at_s:.2f} s on"
        )
    if t.duplicates:
        yield f"a stamp is repeated {counted(t.duplicates, 'time')}"
    if t.backwards:
        most = ", at most" * (t.backwards > 1)
        yield (
            f"time runs backwards {counted(t.backwards, 'time')}{most} by {t.farthest_back_s:.3g} s after "
            f"{t.farthest_back_at_s:.2f} s"
        )
    if t.jitter_rms_s * t.rate_hz > JITTERY:
        yield (
            f"samples come unevenly: intervals are {1e3 * t.jitter_rms_s:.3g} ms rms from their period of "
            f"{1e3 / t.rate_hz:.3g} ms, at most {1e3 * t.jitter_max_s:.3g} ms"
        )
    if t.recorder_s is not None and t.recorder_s[1] - t.recorder_s[0] > RECORDER_S:
        yield (
            f"the recorder's time leads the stamps by {t.recorder_s[0]:.3g} to {t.recorder_s[1]:.3g} s: the stamps "
            "come from several clocks, or messages were held up"
        )


def counted(number: int, what: str) -> str:
    """Return a number with its noun, such as ``1 gap`` or ``2 gaps``."""
    return f"{number} {what}{'s' * (number != 1)}"


def _time_unit(rate_hz: float) -> str:
    for factor, unit in _TIME_UNITS:
        if SLOWEST_HZ <= rate_hz / factor <= FASTEST_HZ / 4:
            return f": is its time in {unit}, taken for seconds?"
        if SLOWEST_HZ <= rate_hz * factor <= FASTEST_HZ / 4:
            return f": is its time in seconds, taken for {unit}?"
    return ", which is no robot's rate"


def _readings(who: str, c: Channel, t: Timing) -> Iterator[str]:
    """Yield the problems of a channel: samples that are no readings, stuck and clipped stretches."""
    counts = ((c.nans, "NaN"), (c.infinities, "infinite"), (c.wild, "absurd"))
    parts = [f"{number} {what}" for number, what in counts if number]
    if parts:
        extremes = f" (it reaches {c.lowest:.4g} to {c.highest:.4g})" if c.wild else ""
        yield f"{who}: {' and '.join(parts)} of {t.samples} samples{extremes}"
    stuck_s = sum(s.duration_s for s in c.stuck)
    if c.stuck and stuck_s > MOSTLY * t.duration_s:
        yield (
            f"{who} stands at {c.stuck[0].value:.6g} for {stuck_s:.3g} of {t.duration_s:.3g} s while others move: stuck"
        )
    elif c.stuck:
        yield f"{who} is stuck {_times(c.stuck, c.stuck_count)} while others move"
    if c.clipped:
        yield f"{who} is cut off at {c.clipped[0].value:.6g}: it stays there {_times(c.clipped, c.clipped_count)}"


def _times(stretches: tuple[Stretch, ...], count: int) -> str:
    longest = max(stretches, key=lambda s: s.duration_s)
    at = f"from {longest.start_s:.2f} s for {longest.duration_s:.2f} s"
    return at if count == 1 else f"{count} times, longest {at}"


# A team


def _team_time(found: Inspection) -> Iterator[str]:
    timing = found.survey.timing
    # Robots of one table share its stamps and therefore their problems.
    robots: dict[str, list[str]] = {}
    for robot, t in enumerate(timing):
        for what in _stamps(t):
            robots.setdefault(what, []).append(str(robot + 1))
    for what, of in robots.items():
        yield f"robot{'s' * (len(of) > 1)} {listed(of)}: {what}"
    known = [t.rate_hz for t in timing if t.rate_hz is not None]
    if known and max(known) - min(known) > SAME_RATE * max(known):
        yield "the robots are sampled at different rates: " + ", ".join(f"{r:.6g}" for r in known) + " Hz"
    for verb, which, ends_ns in (
        ("begins", "after the first", [None if t.first_ns is None else -t.first_ns for t in timing]),
        ("ends", "before the last", [t.last_ns for t in timing]),
    ):
        latest_ns = max((end for end in ends_ns if end is not None), default=0)
        for robot, end_ns in enumerate(ends_ns):
            if end_ns is not None and (latest_ns - end_ns) * NS > EARLY_S:
                yield f"robot {robot + 1} {verb} {(latest_ns - end_ns) * NS:.3g} s {which} of the others"


def _team_samples(found: Inspection) -> Iterator[str]:
    every = [
        (robot, f"omnid{robot + 1}.{c.name}", c)
        for robot, channels in enumerate(found.survey.channels)
        for c in channels
    ]
    for robot, who, c in every:
        yield from _readings(who, c, found.survey.timing[robot])
    d, torque = found.design, TORQUE_FACTOR * found.design.torque_limit_Nm
    known = found.wiring.found if found.wiring is not None else ()
    blamed = {(robot, name) for f in known for robot in f.mistake.robots for name in f.mistake.channels}
    for kind, low, high in (
        ("phi", d.phi_min_rad, d.phi_max_rad),
        ("theta", -d.gimbal_limit_rad, d.gimbal_limit_rad),
        ("tau", -torque, torque),
    ):
        # A wiring mistake already explains these ranges.
        beyond = {
            who: (c.lowest, c.highest)
            for robot, who, c in every
            if c.name.startswith(kind) and not c.wild and c.lowest is not None and c.highest is not None
            if (c.lowest < low or c.highest > high) and (robot, c.name) not in blamed
        }
        if beyond:
            yield _beyond_range(beyond, low, high, UNITS[kind[:3]])
    yield from _oscillating([(who, UNITS[c.name[:3]], c) for _, who, c in every])


def _beyond_range(beyond: dict[str, tuple[float, float]], low: float, high: float, unit: str) -> str:
    """Describe the channels of one kind that leave their range."""
    spans = [reached[1] - reached[0] for reached in beyond.values()]
    turn = ""
    if unit == "rad" and any(abs(span / _TURN - 1.0) < _ONE_TURN for span in spans):
        turn = ": do they jump by a full turn, which has to be taken out before (numpy.unwrap)?"
    names = list(beyond)
    many = f"{', '.join(names[:_NAMED])} and {len(names) - _NAMED} more"
    who = many if len(names) > _NAMED else listed(names)
    lowest, highest = min(min(x) for x in beyond.values()), max(max(x) for x in beyond.values())
    return (
        f"{who} reach{'es' * (len(names) == 1)} {lowest:.4g} to {highest:.4g} {unit}, beyond the range of {low:.4g} "
        f"to {high:.4g}{turn}"
    )


def _oscillating(channels: Sequence[tuple[str, str, Channel]]) -> Iterator[str]:
    """Describe the effort that oscillates most, or else the angle, and name the other oscillating channels."""
    lines = [(who, unit, c.oscillation) for who, unit, c in channels if c.oscillation is not None]
    if not lines:
        return
    lines.sort(key=lambda line: (line[1] in ("N m", "N"), line[2].amplitude), reverse=True)
    (who, unit, most), *others = lines
    names = [other for other, _, _ in others]
    along = listed(names) if len(names) <= _NAMED else f"{len(names)} other channels"
    yield (
        f"{who} oscillates at {most.frequency_hz:.3g} Hz, or what folds to that, by up to +-{most.amplitude:.3g} "
        f"{unit} for {most.duration_s:.3g} s{f', and {along} with it' if names else ''}: is a control loop unstable?"
    )


def _team_clocks(found: Inspection) -> Iterator[str]:
    clocks = found.clocks
    for robot in range(1, found.robots) if clocks is not None else ():
        if clocks is not None and differs(clocks, robot):
            offset, error = clocks.offset_s[robot], clocks.offset_se_s[robot]
            drift, drift_se = clocks.drift[robot], clocks.drift_se[robot]
            drifts = ""
            if np.isfinite(drift_se) and abs(drift) >= SIGMAS * drift_se:
                drifts = f" and drifts by {1e6 * drift:+.3g} +- {1e6 * drift_se:.2g} ppm"
            yield (
                f"the clock of robot {robot + 1} is {1e3 * abs(offset):.3g} +- {1e3 * error:.2g} ms "
                f"{'ahead of' if offset > 0 else 'behind'} that of robot 1{drifts}: convert with --clock correct"
            )


def _team_wiring(found: Inspection) -> Iterator[str]:
    wiring = found.wiring
    if wiring is None:
        return
    for mistake in wiring.found:
        yield _mistake(mistake)
    misfit = wiring.undone
    if misfit.suspicious:
        # Velocities agree and only forces disagree.
        moving = [value for name, value in misfit.scaled.items() if name not in ("force", "moment")]
        together = misfit.determined and not misfit.faults and max(moving, default=0.0) ** 2 < SUSPICIOUS
        hint = ": they move together, so does the log lack a robot, or does something else carry or push?"
        apart = "; if the payload has two bodies on a joint, `mocobot estimate` finds it"
        yield (
            f"{'even then the' if wiring.found else 'the'} channels do not fit robots that carry one rigid payload "
            f"({evidence(misfit)}), and no {'other ' if wiring.found else ''}mistake that is looked for explains it"
            f"{hint if together else apart}"
        )


def _mistake(found: Found) -> str:
    """Describe a mistake, the alternatives that fit equally well, and its evidence."""
    others = ""
    if found.alternatives:
        some = "; ".join(m.sentence for m in found.alternatives[:3])
        more = len(found.alternatives) - 3
        others = f" (these data cannot tell it from: {some}{f'; and {more} more' if more > 0 else ''})"
    return (
        f"{found.mistake.sentence}{others}: undoing it brings the misfit from {found.before:.3g} to "
        f"{found.after:.2g}; with it {evidence(found.misfit)}"
    )


def evidence(misfit: Misfit) -> str:
    """Describe the largest disagreements."""
    if misfit.faults:
        return "; ".join(fault.reason for fault in misfit.faults[:2])
    worst = sorted(misfit.scaled, key=lambda name: -misfit.scaled[name])[:2]
    return " and ".join(_disagreement(name, misfit.relative[name]) for name in worst)


def _disagreement(name: str, value: float) -> str:
    percent = f"{100 * value:.2g} %"
    return {
        "rotation": f"angular velocities of the robots differ by {percent} of their rms",
        "velocity": f"velocities of the robots differ by {percent} of their rms",
        "tilt": f"directions of gravity differ by {np.rad2deg(value):.2g} deg",
        "force": f"{percent} of the forces do not add up",
        "moment": f"moments do not add up by {percent} of the forces' levers",
        "angular speed": f"angular speeds of the robots differ by {percent} of their rms",
        "lift": f"vertical forces do not add up to one weight by {percent}",
    }[name]


def _team_estimate(found: Inspection) -> Iterator[str]:
    ready = found.ready_undone or found.ready
    yield from ready.flags if ready is not None else ()


# Joints


def percent(share: float) -> str:
    """Format a share in percent with two digits, without an exponent."""
    value = 100.0 * share
    return f"{value:.2g}" if value < 99.5 else f"{value:.0f}"


def milliseconds(delay_s: float, se_s: float) -> str:
    """Format a delay's size and its standard error with two digits."""
    digits = max(0, 1 - floor(log10(max(1e3 * se_s, 1e-3))))
    return f"{1e3 * abs(delay_s):.{digits}f} +- {1e3 * se_s:.{digits}f} ms"


def _unit_of(gain: float) -> str | None:
    """Return the unit error that explains a gain between two channels that should be equal, or None."""
    return next((words for factor, words in FACTORS.items() if abs(abs(gain) / factor - 1.0) < CLOSE), None)


def _joint_time(found: JointInspection) -> Iterator[str]:
    whole = len(found.logs) == 1 and found.logs[0].usable.all()
    # A change of the rate makes no gaps.
    yield from _stamps(replace(found.timing, gaps=0, missing=0) if whole else found.timing)


def is_left_out(c: Channel, t: Timing) -> bool:
    """Return whether no sample has the channel, so that the log is read without it, as its notes say."""
    return c.nans == t.samples


def _joint_samples(found: JointInspection) -> Iterator[str]:
    for c in found.channels:
        if not (found.logs and is_left_out(c, found.timing)):
            yield from _readings(c.name, c, found.timing)
    yield from found.signs_lost
    for log in found.logs[:1]:
        for j, joint in enumerate(log.joints):
            span, step = float(np.ptp(log.q[:, j])), float(log.position_step[j])
            if found.moves[j] and step > COARSE * span:
                yield (
                    f"q of {joint} comes in steps of {step:.3g}, {percent(step / span)} % of all that it moves: what "
                    "is slower or smaller is lost in rounding"
                )
    mistakes = () if found.wiring is None else found.wiring.found
    known = any(one.mistake.kind.startswith("position") for one in mistakes)
    for log in found.logs:
        for j in range(len(log.joints)) if not known else ():
            yield from _joint_range(found, log, j)
        yield from _saturated(found, log)


def _joint_range(found: JointInspection, log: JointLog, j: int) -> Iterator[str]:
    """Yield positions outside the range of the model's joint."""
    robot, low, high = found.robot, float(log.q[:, j].min()), float(log.q[:, j].max())
    span = robot.upper[j] - robot.lower[j]
    margin = MARGIN * (1.0 + (span if np.isfinite(span) else 0.0))
    least, most = robot.lower[j] - margin, robot.upper[j] + margin
    if low >= least and high <= most:
        return
    inside = np.radians(low) >= least and np.radians(high) <= most
    degrees = not robot.slides[j] and inside and high - low > 2.0 * span
    yield (
        f"q of {robot.joints[j]} reaches {low:.4g} to {high:.4g} {robot.units[j]}, beyond the model's range of "
        f"{robot.lower[j]:.4g} to {robot.upper[j]:.4g}{'; are they degrees, taken for radians?' if degrees else ''}"
    )


def _saturated(found: JointInspection, log: JointLog) -> Iterator[str]:
    """Yield drives at their limit."""
    robot, duty = found.robot, log.drive.duty
    for j, joint in enumerate(log.joints if log.torque is not None else ()):
        limit = robot.torque_limit[j]
        if log.torque is not None and not np.isnan(log.drive.torque_constant[j]) and np.isfinite(limit):
            share = float(np.mean(np.abs(log.torque[:, j]) > SATURATED * limit))
            if share > 0:
                yield (
                    f"torque of {joint} is at the model's limit of {limit:g} {'N' if robot.slides[j] else 'N m'} in "
                    f"{percent(share)} % of the samples"
                )
    for j, joint in enumerate(log.joints if duty is not None else ()):
        share = float(np.mean(np.abs(duty[:, j]) >= 1.0 - 1e-9)) if duty is not None else 0.0
        if share > 0:
            yield f"duty of {joint} is full in {percent(share)} % of the samples: the loop is saturated there"


def _joint_wiring(found: JointInspection) -> Iterator[str]:
    joints, wiring = found.robot.joints, found.wiring
    for log in found.logs[:1]:
        yield from _velocities(found.velocities, log)
    for one, other in found.crossed:
        yield f"{joints[one]} and {joints[other]} follow each other's command: are the two exchanged?"
    for one in found.commands:
        name, unit = joints[one.joint], _unit_of(one.gain)
        if one.correlation > _FOLLOWED and one.gain < 0:
            yield f"q of {name} runs against its command: one of them has the wrong sign"
        elif one.correlation > _FOLLOWED and unit is not None:
            yield f"q of {name} is {one.gain:.4g} times its command: one of them is {unit}"
    if wiring is None:
        return
    for mistake in wiring.found:
        others = ""
        if mistake.alternatives:
            told = "; ".join(mistake_words(m, joints) for m in mistake.alternatives[:3])
            others = f" (this log cannot tell it from: {told})"
        yield (
            f"{mistake_words(mistake.mistake, joints)}{others}: undoing it leaves {percent(mistake.after)} % of the "
            f"torques concerned unexplained, not {percent(mistake.before)} %"
        )
    for j in np.flatnonzero((wiring.undone > JOINT_SUSPICIOUS) & found.moves):
        torques = [log.torque[:, j] for log in found.logs if log.torque is not None]
        torque = np.concatenate(torques or [np.array([np.nan])])
        if np.isfinite(torque).all() and -_NEVER < torque.min() / max(torque.max(), 1e-300) < _NEAR:
            yield f"torque of {joints[j]} is never negative: has it lost its sign?"
    bad = np.flatnonzero((wiring.undone > _UNEXPLAINED + wiring.noise) & found.moves)
    if len(bad):
        yield (
            f"{'even then torques' if wiring.found else 'torques'} of {listed([joints[j] for j in bad])} hardly follow "
            f"the model: {100 * float(wiring.undone[bad].max()):.0f} % of them is explained by neither model nor "
            "friction, and no mistake that is looked for mends it"
        )
    for j, gain in wrong_scales(found).items():
        unit = _unit_of(gain)
        hint = f"is it in {unit}" if unit else "are its unit, gear and torque constant right"
        if found.robot.slides[j] and unit:
            hint += f", or its position in {_unit_of(1.0 / gain)}"
        yield f"torque of {joints[j]} is {gain:.4g} times what the model asks for; {hint}?"


def wrong_scales(found: JointInspection) -> dict[int, float]:
    """Return, by joint, gains of measured over modelled torque that no mass explains."""
    log = found.logs[0] if found.logs else None
    if found.wiring is None or found.wiring.found or log is None or log.torque is None:
        return {}
    known = ~np.isnan(log.drive.torque_constant) & np.isfinite(log.torque).any(axis=0)
    odd = np.flatnonzero(known & found.moves & found.wiring.odd_gains)
    return {int(j): float(found.wiring.gains[j]) for j in odd}


def mistake_words(mistake: JointMistake, joints: Sequence[str]) -> str:
    """Describe a mistake in the columns of joints."""
    own = [joints[j] for j in mistake.joints]
    names = "all joints" if len(own) == len(joints) > 2 else listed(own)
    return {
        "torque_sign": f"torque of {names} has the wrong sign",
        "position_sign": f"q of {names} has the wrong sign",
        "both_signs": f"q and torque of {names} have the wrong sign",
        "torque_exchange": f"torques of {names} are exchanged",
        "position_exchange": f"q of {names} are exchanged",
        "both_exchange": f"{names} are exchanged, positions and torques",
        "position_degrees": f"q of {names} are degrees, taken for radians",
        "position_radians": f"q of {names} are radians, taken for degrees",
    }[mistake.kind]


def _velocities(found: Sequence[Follows], log: JointLog) -> Iterator[str]:
    """Yield measured velocities that disagree with the derivative of the positions."""
    for one in found:
        dq, unit = f"dq of {log.joints[one.joint]}", _unit_of(one.gain)
        if one.strays:
            yield (
                f"{dq} does not follow its position (correlation {one.correlation:.2g}): is it another joint's?"
            )
        elif abs(one.gain - 1.0) > CLOSE + SIGMAS * one.gain_se:
            if one.gain < 0:
                yield f"{dq} runs against its position: one of them has the wrong sign"
            else:
                hint = "" if unit is None else f": one of them is {unit}"
                yield f"{dq} is {one.gain:.4g} times the derivative of its position{hint}"
    shared = pooled(found)
    each = [(log.joints[one.joint], one.delay_s, one.delay_se_s) for one in found if not one.strays]
    for joint, delay_s, se_s in each if shared is None else [("every joint", *shared)]:
        if abs(delay_s) > max(log.period_s, SIGMAS * se_s):
            late, what = ("later than", "") if delay_s > 0 else ("ahead of", ", or the position is")
            yield f"dq of {joint} is {milliseconds(delay_s, se_s)} {late} its position: it is filtered{what}"


def _joint_delay(found: JointInspection) -> Iterator[str]:
    late = found.delay
    if late is None or not found.logs:
        return
    least_s = max(1.0 / found.logs[0].rate_hz, SIGMAS * late.delay_se_s)
    if abs(late.delay_s) > least_s and late.before > LATE * late.after:
        yield (
            f"torques run {milliseconds(late.delay_s, late.delay_se_s)} "
            f"{'behind' if late.delay_s > 0 else 'ahead of'} the motion: {percent(late.before)} % of them is left "
            f"unexplained without that delay, {percent(late.after)} % with it"
        )


_OF_TEAM: tuple[tuple[Topic, Callable[[Inspection], Iterator[str]]], ...] = (
    ("time", _team_time),
    ("samples", _team_samples),
    ("clocks", _team_clocks),
    ("wiring", _team_wiring),
    ("estimate", _team_estimate),
)
_OF_JOINTS: tuple[tuple[Topic, Callable[[JointInspection], Iterator[str]]], ...] = (
    ("time", _joint_time),
    ("samples", _joint_samples),
    ("wiring", _joint_wiring),
    ("time", _joint_delay),
)
