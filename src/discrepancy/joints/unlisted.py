"""Unlisted laws: smooth functions of one signal of a joint, for effects in no table of causes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import rankdata

from discrepancy.formulas.formula import Curve, Kind, formula_of
from discrepancy.formulas.law import Law, Of, traces
from discrepancy.joints.causes import JointSignals
from estimator.arrays import Array

TERMS = 7
"""Number of cosines in a function; the shortest period is 2/7 of the signal's range."""


@dataclass(frozen=True)
class Signal:
    """The argument of an unlisted law.

    Attributes:
        of: returns the values from the signals of the joint and of the joint before it.
        turns: whether the function changes sign with the direction of motion.
        name: name in the simulator, without the joint number.
        symbol: symbol in a formula.
        unit: unit for a revolute joint.
    """

    of: Callable[[JointSignals, JointSignals], Array]
    turns: bool
    name: str
    symbol: str
    unit: str


SIGNALS: Mapping[str, Signal] = {
    "position": Signal(lambda s, before: s.q, False, "q", "q", "rad"),
    "position and direction": Signal(lambda s, before: s.q, True, "q", "q", "rad"),
    "speed": Signal(lambda s, before: np.abs(s.v), True, "dq", "|v|", "rad/s"),
    "load": Signal(lambda s, before: s.load, False, "load", "L", "N m"),
    "load and direction": Signal(lambda s, before: s.load, True, "load", "L", "N m"),
    "time": Signal(lambda s, before: s.t, False, "time", "t", "s"),
    "neighbour's torque": Signal(lambda s, before: before.asked, False, "torque", "tau", "N m"),
    "reading": Signal(lambda s, before: s.q, False, "q", "q", "rad"),
}
"""Possible arguments; a function of "reading" is a position error, the others are torques."""
SLIDES = {"rad": "m", "rad/s": "m/s", "N m": "N", "s": "s"}
"""Units for a prismatic joint."""
SIZES = 1.0 / (1.0 + np.arange(TERMS)) / np.sqrt(np.sum(1.0 / (1.0 + np.arange(TERMS)) ** 2))
"""Relative prior standard deviations of the terms, as for a function with a square-integrable derivative."""


def functions(
    signals: Sequence[JointSignals], before: Sequence[JointSignals]
) -> Iterator[tuple[str, list[list[Array]]]]:
    """Basis functions of the unlisted laws of one joint.

    Args:
        signals: signals of the joint, one for each log.
        before: signals of the joint before it.

    Returns:
        For each argument, its name, and for each term its series (W,) by log.
    """
    edges = np.cumsum([len(s.q) for s in signals])[:-1]
    for name, signal in SIGNALS.items():
        turns = np.concatenate([s.direction for s in signals]) if signal.turns else 1.0
        terms = basis(name, every(name, signals, before)).T * turns
        yield name, [np.split(term, edges) for term in terms]


def every(name: str, signals: Sequence[JointSignals], before: Sequence[JointSignals]) -> Array:
    """An argument in all logs, concatenated, shape (Q,)."""
    return np.concatenate([SIGNALS[name].of(s, b) for s, b in zip(signals, before, strict=True)])


def basis(name: str, x: Array) -> Array:
    """Terms of a function at values of its argument, shape (Q,) -> (Q, TERMS)."""
    even = (x - x.min()) / (np.ptp(x) + 1e-9)  # smooth in the reading, because it is differentiated
    place = even if name == "reading" else (rankdata(x) - 0.5) / len(x)
    terms = np.cos(np.pi * np.outer(place, 1.0 + np.arange(TERMS)))
    if name == "neighbour's torque":  # the torque sensor may read part of the neighbour's torque
        terms[:, 0] = x / (np.std(x) + 1e-9)
    return terms


def law_of(
    name: str, joint: int, slides: Sequence[bool], signals: Sequence[JointSignals],
    before: Sequence[JointSignals], fit: tuple[Array, Array, Array],
) -> Law:  # fmt: skip
    """Formula of an unlisted law.

    Args:
        name: its argument.
        joint: index of the joint, from 0.
        slides: whether each joint is prismatic.
        signals, before: signals of the joint and of the joint before it, one for each log.
        fit: mean (k,) and covariance (k, k) of its terms, and their prior variances (k,).
    """
    signal, x = SIGNALS[name], every(name, signals, before)
    other = joint - 1 if name == "neighbour's torque" else joint
    unit = SLIDES[signal.unit] if slides[other] else signal.unit
    way: Kind = "way" if slides[joint] else "angle"
    kind: Kind = "time" if name == "time" else way if signal.unit == "rad" else "other"
    f = basis(name, x)
    formula = formula_of(Curve(x, f, *fit, kind))
    number = "" if name == "time" else f"_{other + 1}"
    words = {"dq": "speed", "q": "position", "torque": f"torque of joint {joint}"}.get(
        signal.name, signal.name
    )
    of = Of(f"{signal.name}{number}", words, signal.symbol, unit)
    times = Of(f"direction_{joint + 1}", "direction of motion", "sign(v)", "1") if signal.turns else None
    w = np.concatenate([s.direction for s in signals]) if signal.turns else np.ones(len(x))
    read, torque = name == "reading", "N" if slides[joint] else "N m"
    place, target = ("joint position", "position") if read else ("joint torque", "torque")
    own = traces(
        [s.t for s in signals], x, w, f @ fit[0], np.sqrt(np.einsum("qk,kl,ql->q", f, fit[1], f)), formula
    )
    error = SLIDES["rad"] if read and slides[joint] else "rad" if read else torque
    return Law(place, None, joint + 1, f"{target}_{joint + 1}", error, of, times, formula, own)
