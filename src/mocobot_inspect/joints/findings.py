"""What is wrong with a joint log, one sentence each with its evidence."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from mocobot_inspect.findings import Finding, Topic, no_readings, of_stream, stands
from mocobot_inspect.joints.inspection import JointInspection
from mocobot_inspect.joints.lags import SIGMAS
from mocobot_inspect.joints.numbers import milliseconds, percent
from mocobot_inspect.joints.samples import beyond_range, coarse, of_velocities, saturated, unit_of
from mocobot_inspect.joints.wiring import SUSPICIOUS, Found, Mistake
from mocobot_inspect.wiring.mistakes.base import listed

LATE = 1.1
"""So much more of the torques must be left without a delay than with it."""
_NEVER, _NEAR = (
    1e-3,
    0.02,
)  # of its largest value may a torque be negative that never is; so near it comes to zero


def joint_findings(found: JointInspection) -> list[Finding]:
    """All that is wrong, in the order in which it should be mended."""
    sources: tuple[tuple[Topic, Callable[[JointInspection], Iterator[str]]], ...] = (
        ("time", _of_stamps),
        ("samples", _of_samples),
        ("wiring", _of_wiring),
        ("time", _of_delays),
    )
    return [Finding(topic, sentence) for topic, source in sources for sentence in source(found)]


def _of_stamps(found: JointInspection) -> Iterator[str]:
    timing = found.timing
    whole = len(found.logs) == 1 and found.logs[0].usable.all()
    # A rate that changes makes no gaps.
    yield from of_stream(replace(timing, gaps=0, missing=0) if whole else timing)


def _of_samples(found: JointInspection) -> Iterator[str]:
    for c in found.channels:
        yield from no_readings(c.name, c, found.timing.samples)
        yield from stands(c.name, c, found.timing.duration_s)
    yield from found.signs_lost
    for log in found.logs[:1]:
        yield from coarse(log, found.moves)
    known = found.wiring is not None and any(
        f.mistake.kind.startswith("position") for f in found.wiring.found
    )
    for log in found.logs:
        if not known:
            yield from beyond_range(log, found.robot)
        yield from saturated(log, found.robot)


def _of_wiring(found: JointInspection) -> Iterator[str]:
    joints = found.robot.joints
    for log in found.logs[:1]:
        yield from of_velocities(found.velocities, log)
    for one, other in found.crossed:
        yield f"{joints[one]} and {joints[other]} follow each other's command: are the two exchanged?"
    for one in found.commands:
        name = joints[one.joint]
        if one.correlation > _FOLLOWED and one.gain < 0:
            yield f"q of {name} runs against its command: one of them has the wrong sign"
        elif one.correlation > _FOLLOWED and (words := unit_of(one.gain)) is not None:
            yield f"q of {name} is {one.gain:.4g} times its command: one of them is {words}"
    wiring = found.wiring
    if wiring is None:
        return
    for mistake in wiring.found:
        yield mistake_sentence(mistake, joints)
    yield from _magnitudes(found)
    bad = np.flatnonzero((wiring.undone > 0.5 + wiring.noise) & found.moves)
    if len(bad):
        names = listed([joints[j] for j in bad])
        even = "even then torques" if wiring.found else "torques"
        yield (
            f"{even} of {names} hardly follow the model: {100 * float(wiring.undone[bad].max()):.0f} % of them is "
            "explained by neither model nor friction, and no mistake that is looked for mends it"
        )
    yield from _scales(found)


_FOLLOWED = 0.9  # correlation of a motion with its command


def _magnitudes(found: JointInspection) -> Iterator[str]:
    """Torques without their signs."""
    for j, name in enumerate(found.robot.joints):
        torques = [log.torque[:, j] for log in found.logs if log.torque is not None]
        if (
            not torques
            or found.wiring is None
            or not (found.wiring.undone[j] > SUSPICIOUS and found.moves[j])
        ):
            continue
        torque = np.concatenate(torques)
        if np.isfinite(torque).all() and -_NEVER < torque.min() / max(torque.max(), 1e-300) < _NEAR:
            yield f"torque of {name} is never negative: has it lost its sign?"


def wrong_scales(found: JointInspection) -> dict[int, float]:
    """Joints whose torque is so many times what the model asks for that no mass explains it."""
    log = found.logs[0] if found.logs else None
    if found.wiring is None or found.wiring.found or log is None or log.torque is None:
        return {}
    known = ~np.isnan(log.drive.torque_constant) & np.isfinite(log.torque).any(axis=0)
    odd = np.flatnonzero(known & found.moves & found.wiring.odd_gains)
    return {int(j): float(found.wiring.gains[j]) for j in odd}


def _scales(found: JointInspection) -> Iterator[str]:
    for j, gain in wrong_scales(found).items():
        words = unit_of(gain)
        hint = f"is it in {words}" if words else "are its unit, gear and torque constant right"
        if found.robot.slides[j] and words:
            hint += f", or its position in {unit_of(1.0 / gain)}"
        yield f"torque of {found.robot.joints[j]} is {gain:.4g} times what the model asks for; {hint}?"


def mistake_sentence(found: Found, joints: tuple[str, ...]) -> str:
    """A mistake, what it cannot be told from, and its evidence."""
    others = ""
    if found.alternatives:
        told = "; ".join(words(m, joints) for m in found.alternatives[:3])
        others = f" (this log cannot tell it from: {told})"
    return (
        f"{words(found.mistake, joints)}{others}: undoing it leaves {percent(found.after)} % of the torques concerned "
        f"unexplained, not {percent(found.before)} %"
    )


def words(mistake: Mistake, joints: tuple[str, ...]) -> str:
    """A mistake in words."""
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


def _of_delays(found: JointInspection) -> Iterator[str]:
    late = found.delay
    if late is None or not found.logs:
        return
    period_s = 1.0 / found.logs[0].rate_hz
    least = max(period_s, SIGMAS * late.delay_se_s)
    if abs(late.delay_s) > least and late.before > LATE * late.after:
        way = "behind" if late.delay_s > 0 else "ahead of"
        yield (
            f"torques run {milliseconds(late.delay_s, late.delay_se_s)} {way} the motion: {percent(late.before)} % of "
            f"them is left unexplained without that delay, {percent(late.after)} % with it"
        )
