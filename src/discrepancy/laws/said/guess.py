"""What a law may be physically, and what would tell: guesses, said as such."""

from __future__ import annotations

import math
from collections.abc import Mapping

from discrepancy.laws.candidate import LawCandidate

_BY_FORM: dict[tuple[str, str, str], str] = {
    ("tau reading", "linear", "other torque"): "cross-talk between torque sensors",
    ("tau reading", "warming", "time"): "a zero that drifts while the electronics warm up",
    ("tau reading", "linear", "time"): "a zero that drifts",
    ("tau reading", "warming", "time and own torque"): "a scale that drifts while the electronics warm up",
    ("tau reading", "linear", "time and own torque"): "a scale that drifts",
    ("tau reading", "square", "own torque"): "a bridge that is not linear",
    ("tau reading", "cube", "own torque"): "a bridge that is not linear",
    ("tau reading", "beyond", "own torque"): "an amplifier near its end",
    ("tau reading", "above", "own torque"): "an amplifier near its end",
    ("tau reading", "below", "own torque"): "an amplifier near its end",
    ("tau reading", "play", "own torque"): "a loose gauge, or a spring whose material has a hysteresis",
    ("tau reading", "sine", "own angle"): "poles of the motor, or a cable that pulls at the sensor",
    ("driven torque", "sine", "own angle"): "cogging: poles of the motor",
    ("tau reading", "hum", "time"): "a hum from the mains or a machine nearby",
    ("phi reading", "sine", "own angle"): "an eccentric disc (once a turn), or the encoder's poles",
    ("theta reading", "sine", "own angle"): "an eccentric disc (once a turn), or the encoder's poles",
    ("phi reading", "play", "own angle"): "an encoder behind a gear with play",
    ("theta reading", "play", "own angle"): "an encoder behind a gear with play",
    ("phi reading", "linear", "own torque"): "an encoder's mount that gives way to the torque",
    ("phi reading", "linear", "time"): "a zero that slips",
    ("theta reading", "linear", "time"): "a zero that slips",
    ("gimbal torque", "linear", "own angle"): "a bundle of cables that acts as a spring",
    ("gimbal torque", "cube", "own angle"): "a bundle of cables that stiffens",
    ("gimbal torque", "play", "own angle"): "a bearing that gives way before it slides (presliding)",
    (
        "driven torque",
        "play",
        "own angle",
    ): "a gear, or a bearing, that gives way before it slides (presliding)",
    ("driven torque", "above", "own rate"): "a brake in one direction",
    ("driven torque", "below", "own rate"): "a brake in one direction",
    ("base position", "linear", "time"): "a base that creeps",
    ("base position", "warming", "time"): "a base that settles, fast at first",
    ("payload spin", "constant", "time"): "something that spins inside the payload",
    ("payload mass", "linear", "time"): "a payload that loses or takes up mass",
    ("payload centre", "linear", "time"): "a load that shifts in the payload",
    ("payload centre", "second_order", "payload"): "a load on a spring in the payload",
    ("force on payload", "hum", "time"): "something unbalanced that turns on the payload",
    ("force on payload", "linear", "time"): "a push that grows",
    ("force on payload", "linear", "payload"): "a spring, or a drag, on the payload",
    ("joint torque", "sine", "own angle"): "cogging: poles of the motor, or teeth of the gear",
    ("joint torque", "sine", "own travel"): "cogging: poles of the motor, or the pitch of a screw",
    ("joint torque", "linear", "other torque"): "cross-talk between the drives' readings",
    (
        "joint torque",
        "linear",
        "other direction",
    ): "drives that share a gear, or cables that rub on each other",
    ("joint torque", "linear", "other rate"): "drives that share a gear",
    ("joint torque", "linear", "other angle"): "cables that pull across joints",
    ("joint torque", "linear", "own angle"): "a spring, or a bundle of cables",
    ("joint torque", "cube", "own angle"): "a bundle of cables that stiffens",
    ("joint torque", "above", "own angle"): "cables, or a cover, that come into play on one side",
    ("joint torque", "below", "own angle"): "cables, or a cover, that come into play on one side",
    ("joint torque", "play", "own angle"): "gears or seals that give way before they slide (presliding)",
    ("joint torque", "signed_square", "own rate"): "drag of air, or of grease that is stirred",
    ("joint torque", "hum", "time"): "a hum from the mains or a machine nearby",
    ("joint torque", "linear", "time"): "a zero that drifts",
    ("joint torque", "warming", "time"): "a zero that drifts while the electronics warm up",
    ("joint torque", "warming", "time and own direction"): "grease that warms up",
    ("joint torque", "linear", "time and own direction"): "grease that warms up, or a joint that runs in",
    ("joint torque", "warming", "time and own torque"): "a scale that drifts while the electronics warm up",
    ("joint torque", "sine", "own angle and own direction"): "a bearing or a gear out of round",
    (
        "joint torque",
        "spline",
        "own angle and own direction",
    ): "a bearing, or a seal, that is tighter in some places",
    (
        "joint torque",
        "linear",
        "own angle and own direction",
    ): "a bearing, or a seal, that is tighter on one side",
    (
        "joint position",
        "sine",
        "own angle",
    ): "an eccentric disc (once a turn), the encoder's poles, or a gear behind it",
    ("joint position", "linear", "own torque"): "an encoder on the far side of something that gives way",
    ("joint position", "linear", "time"): "a zero that slips",
}
_TELLS = {
    "tau reading": "Exchange this torque sensor with another robot's, and repeat: does it go along?",
    "driven torque": "Drive the joint alone, the payload put down: is it still there?",
    "phi reading": "Exchange this encoder, or compare it with an outside measurement of the angle.",
    "theta reading": "Exchange this encoder, or compare it with an outside measurement of the angle.",
    "gimbal torque": "Turn the gimbal by hand, the payload put down.",
    "joint torque": (
        "Without power, turn the joint by hand: an error of the reading stays, a torque in the joint is felt instead."
    ),
    "joint position": "Compare this encoder with an outside measurement of the angle.",
    "base position": "Watch the base with a dial gauge during a trial.",
    "grasp position": "Watch flange and payload with a dial gauge during a trial.",
}


def guess(candidate: LawCandidate, values: Mapping[str, float]) -> str:
    """A physical reading of a law, or nothing where none is known.

    Args:
        candidate: the law.
        values: of ``numbers.report``.
    """
    term = candidate.term
    known = _BY_FORM.get((candidate.at.name, term.function, _relation(candidate)), "")
    if (candidate.at.name, term.function) == ("payload centre", "second_order") and term.of.parts:
        # Under one m/s^2 a mass on a spring shifts by 1 / omega^2.
        known += f", of {values['amplitude'] * (2.0 * math.pi * term.numbers['frequency_hz']) ** 2:.2g} kg"
    return known


def experiment(place: str) -> str:
    """What would tell the law at a place from its look-alikes."""
    return _TELLS.get(place, "Repeat with another payload: what is in the payload stays behind.")


def _relation(candidate: LawCandidate) -> str:
    """What the signals are to the place."""
    term, own = candidate.term, {variable.name for variable in candidate.at.own}
    words = []
    for variable in (term.of, term.times):
        if variable is None:
            continue
        if variable.kind == "time":
            words.append("time")
        elif variable.name.startswith("payload"):
            words.append("payload")
        else:
            words.append(f"{'own' if variable.name in own else 'other'} {variable.kind}")
    return " and ".join(words)
