"""What is wrong with a log, one sentence each with its evidence."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from estimator.recording.checks import TORQUE_FACTOR
from mocobot_inspect.inspection import FASTEST_HZ, MOSTLY, SLOWEST_HZ, Inspection, differs
from mocobot_inspect.stream.channels import UNITS, Channel, Stretch
from mocobot_inspect.stream.timing import Timing
from mocobot_inspect.wiring.check import Found
from mocobot_inspect.wiring.misfit import SUSPICIOUS, Misfit
from mocobot_inspect.wiring.mistakes.base import listed
from mocobot_logs.log import NS, repeated

Topic = Literal["time", "samples", "clocks", "wiring", "estimate"]

JITTERY = 0.2
"""Jitter over the period (rms) from which on it is worth a word."""
SAME_RATE = 1e-3
EARLY_S = 1.0
"""Ends that are farther apart than this are worth a word."""
RECORDER_S = 1.0
"""Spread of the recorder's lead over the stamps from which on two clocks are mixed."""
_NAMED = 4  # channels of a sentence
_TURN = 2 * np.pi
_ONE_TURN = 0.01  # angles that cover a full turn to this share of it are an encoder's that starts again there
_TIME_UNITS = ((1e-3, "milliseconds"), (1e-6, "microseconds"), (1e-9, "nanoseconds"))


@dataclass(frozen=True)
class Finding:
    """Something wrong.

    Attributes:
        topic: what it concerns.
        sentence: what it is, with the numbers that say so.
    """

    topic: Topic
    sentence: str


def findings(found: Inspection) -> list[Finding]:
    """All that is wrong, in the order in which it should be mended."""
    sources: tuple[tuple[Topic, Callable[[Inspection], Iterator[str]]], ...] = (
        ("time", _of_time),
        ("samples", _of_samples),
        ("clocks", _of_clocks),
        ("wiring", _of_wiring),
        ("estimate", _of_estimate),
    )
    return [Finding(topic, sentence) for topic, source in sources for sentence in source(found)]


def _of_time(found: Inspection) -> Iterator[str]:
    timing = found.survey.timing
    # Robots of a table share its stamps and what is wrong with them.
    robots: dict[str, list[int]] = {}
    for robot, t in enumerate(timing):
        for what in of_stream(t):
            robots.setdefault(what, []).append(robot + 1)
    for what, of in robots.items():
        yield f"robot{'s' * (len(of) > 1)} {listed([str(robot) for robot in of])}: {what}"
    known = [t.rate_hz for t in timing if t.rate_hz is not None]
    if known and max(known) - min(known) > SAME_RATE * max(known):
        yield "the robots are sampled at different rates: " + ", ".join(f"{r:.6g}" for r in known) + " Hz"
    yield from _ends(timing)


def of_stream(t: Timing) -> Iterator[str]:
    """What is wrong with the stamps of one stream."""
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
            f"{t.missing} samples ({share:.2g} %) are missing in {_count(t.gaps, 'gap')}, the longest of "
            f"{t.longest_gap_s:.3g} s from {t.longest_gap_at_s:.2f} s on"
        )
    if t.duplicates:
        yield f"a stamp is repeated {_count(t.duplicates, 'time')}"
    if t.backwards:
        most = ", at most" * (t.backwards > 1)
        yield (
            f"time runs backwards {_count(t.backwards, 'time')}{most} by {t.farthest_back_s:.3g} s after "
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


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number != 1)}"


def _ends(timing: tuple[Timing, ...]) -> Iterator[str]:
    told = [(robot, t) for robot, t in enumerate(timing) if t.first_ns is not None and t.last_ns is not None]
    for words, ends in (
        ("begins", [(-(t.first_ns or 0), robot) for robot, t in told]),
        ("ends", [((t.last_ns or 0), robot) for robot, t in told]),
    ):
        if len(ends) < 2:
            continue
        latest = max(ends)[0]
        for value, robot in ends:
            if (latest - value) * NS > EARLY_S:
                when = "after the first" if words == "begins" else "before the last"
                yield f"robot {robot + 1} {words} {(latest - value) * NS:.3g} s {when} of the others"


def _time_unit(rate_hz: float) -> str:
    for factor, unit in _TIME_UNITS:
        if SLOWEST_HZ <= rate_hz / factor <= FASTEST_HZ / 4:
            return f": is its time in {unit}, taken for seconds?"
        if SLOWEST_HZ <= rate_hz * factor <= FASTEST_HZ / 4:
            return f": is its time in seconds, taken for {unit}?"
    return ", which is no robot's rate"


def _of_samples(found: Inspection) -> Iterator[str]:
    for robot, channels in enumerate(found.survey.channels):
        duration = found.survey.timing[robot].duration_s
        for c in channels:
            who = f"omnid{robot + 1}.{c.name}"
            yield from no_readings(who, c, found.survey.timing[robot].samples)
            yield from stands(who, c, duration)
    for kind in ("phi", "theta", "tau"):
        yield from _limits(kind, found)
    yield from _oscillating(found)


def no_readings(who: str, c: Channel, samples: int) -> Iterator[str]:
    """How many samples of a channel are no numbers, or none that a sensor reads."""
    counts = ((c.nans, "NaN"), (c.infinities, "infinite"), (c.wild, "absurd"))
    parts = [f"{number} {what}" for number, what in counts if number]
    if parts:
        extremes = f" (it reaches {c.lowest:.4g} to {c.highest:.4g})" if c.wild else ""
        yield f"{who}: {' and '.join(parts)} of {samples} samples{extremes}"


def stands(who: str, c: Channel, duration_s: float) -> Iterator[str]:
    """How a channel is stuck or clipped, in a stream of some length [s]."""
    stuck_s = sum(s.duration_s for s in c.stuck)
    if c.stuck and stuck_s > MOSTLY * duration_s:
        yield f"{who} stands at {c.stuck[0].value:.6g} for {stuck_s:.3g} of {duration_s:.3g} s while others move: stuck"
    elif c.stuck:
        yield f"{who} is stuck {_times(c.stuck, c.stuck_count)} while others move"
    if c.clipped:
        yield f"{who} is cut off at {c.clipped[0].value:.6g}: it stays there {_times(c.clipped, c.clipped_count)}"


def _oscillating(found: Inspection) -> Iterator[str]:
    """The effort that oscillates most, or else the angle, and what shakes with it."""
    lines = [
        (f"omnid{robot + 1}.{c.name}", UNITS[c.name[:3]], c.oscillation)
        for robot, channels in enumerate(found.survey.channels)
        for c in channels
        if c.oscillation is not None
    ]
    if not lines:
        return
    lines.sort(key=lambda line: (line[1] in ("N m", "N"), line[2].amplitude), reverse=True)
    (who, unit, most), *others = lines
    with_it = [other for other, _, _ in others]
    names = listed(with_it) if len(with_it) <= _NAMED else f"{len(with_it)} other channels"
    yield (
        f"{who} oscillates at {most.frequency_hz:.3g} Hz, or what folds to that, by up to +-{most.amplitude:.3g} "
        f"{unit} for {most.duration_s:.3g} s{f', and {names} with it' if with_it else ''}: is a control loop unstable?"
    )


def _times(stretches: tuple[Stretch, ...], count: int) -> str:
    longest = max(stretches, key=lambda s: s.duration_s)
    at = f"from {longest.start_s:.2f} s for {longest.duration_s:.2f} s"
    return at if count == 1 else f"{count} times, longest {at}"


def _limits(kind: str, found: Inspection) -> Iterator[str]:
    """Channels of one kind that leave their range, unless a mistake in their wiring is found anyway."""
    d = found.design
    low, high, unit = {
        "phi": (d.phi_min_rad, d.phi_max_rad, "rad"),
        "theta": (-d.gimbal_limit_rad, d.gimbal_limit_rad, "rad"),
        "tau": (-TORQUE_FACTOR * d.torque_limit_Nm, TORQUE_FACTOR * d.torque_limit_Nm, "N m"),
    }[kind]
    known = found.wiring.found if found.wiring is not None else ()
    blamed = {(robot, name) for f in known for robot in f.mistake.robots for name in f.mistake.channels}
    beyond, extremes, spans = [], [], []
    for robot, channels in enumerate(found.survey.channels):
        for c in channels:
            if not c.name.startswith(kind) or c.wild or c.lowest is None or c.highest is None:
                continue
            if (c.lowest < low or c.highest > high) and (robot, c.name) not in blamed:
                beyond.append(f"omnid{robot + 1}.{c.name}")
                extremes += [c.lowest, c.highest]
                spans.append(c.highest - c.lowest)
    if beyond:
        wraps = kind != "tau" and any(abs(span / _TURN - 1.0) < _ONE_TURN for span in spans)
        turn = (
            ": do they jump by a full turn, which has to be taken out before (numpy.unwrap)?" if wraps else ""
        )
        names = (
            listed(beyond)
            if len(beyond) <= _NAMED
            else ", ".join(beyond[:_NAMED]) + f" and {len(beyond) - _NAMED} more"
        )
        yield (
            f"{names} reach{'es' * (len(beyond) == 1)} {min(extremes):.4g} to {max(extremes):.4g} {unit}, beyond the "
            f"range of {low:.4g} to {high:.4g}" + turn
        )


def _of_clocks(found: Inspection) -> Iterator[str]:
    if found.clocks is None:
        return
    for robot in range(1, found.robots):
        if differs(found.clocks, robot):
            offset, error = found.clocks.offset_s[robot], found.clocks.offset_se_s[robot]
            way = "ahead of" if offset > 0 else "behind"
            yield (
                f"the clock of robot {robot + 1} is {1e3 * abs(offset):.3g} +- {1e3 * error:.2g} ms {way} that of "
                f"robot 1{_drift(found, robot)}: convert with --clock correct"
            )


def _drift(found: Inspection, robot: int) -> str:
    assert found.clocks is not None
    drift, error = found.clocks.drift[robot], found.clocks.drift_se[robot]
    if not np.isfinite(error) or abs(drift) < 5 * error:
        return ""
    return f" and drifts by {1e6 * drift:+.3g} +- {1e6 * error:.2g} ppm"


def _of_wiring(found: Inspection) -> Iterator[str]:
    wiring = found.wiring
    if wiring is None:
        return
    for mistake in wiring.found:
        yield wiring_sentence(mistake)
    if wiring.undone.suspicious:
        what = "even then the" if wiring.found else "the"
        yield (
            f"{what} channels do not fit robots that carry one rigid payload ({evidence(wiring.undone)}), and no "
            f"{'other ' if wiring.found else ''}mistake that is looked for explains it{_missing(wiring.undone)}"
        )


def _missing(misfit: Misfit) -> str:
    """A hint where the robots move together and only their forces do not fit."""
    moving = [value for name, value in misfit.scaled.items() if name not in ("force", "moment")]
    if misfit.determined and not misfit.faults and max(moving, default=0.0) ** 2 < SUSPICIOUS:
        return ": they move together, so does the log lack a robot, or does something else carry or push?"
    return ""


def wiring_sentence(found: Found) -> str:
    """A mistake, what it cannot be told from, and its evidence."""
    others = ""
    if found.alternatives:
        listed = "; ".join(m.sentence() for m in found.alternatives[:3])
        more = len(found.alternatives) - 3
        others = f" (these data cannot tell it from: {listed}{f'; and {more} more' if more > 0 else ''})"
    return (
        f"{found.mistake.sentence()}{others}: undoing it brings the misfit from {found.before:.3g} to "
        f"{found.after:.2g}; with it {evidence(found.misfit)}"
    )


def evidence(misfit: Misfit) -> str:
    """The largest disagreements in words."""
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


def _of_estimate(found: Inspection) -> Iterator[str]:
    ready = found.ready_undone or found.ready
    if ready is not None:
        yield from ready.flags
