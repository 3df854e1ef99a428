"""Named causes with the values that the other blocks give them, put into the model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from discrepancy.candidate import Transient
from discrepancy.engine.explanation import Explanation, Found
from discrepancy.least_squares.fit import Fit
from discrepancy.rules import rollouts as rules
from discrepancy.serial.model import load_spec
from discrepancy.serial.rig import SerialRig
from discrepancy.serial.rolled.readings import KNOWN, Readings
from estimator.arrays import Array
from mocobot_sim.serial.built import Built, build
from mocobot_sim.serial.effects import RobotEffect


@dataclass(frozen=True, eq=False)
class Fitted:
    """The extended model for one block.

    Attributes:
        built: the robot.
        readings: what torques are really, by what the log says.
        left_out: labels of causes that are in neither.
        events: when events act in this block; they are not simulated.
    """

    built: Built
    readings: Readings
    left_out: tuple[str, ...] = ()
    events: tuple[Transient, ...] = ()


def steps_per(period_s: float) -> int:
    """Steps of the integration in a sampling period."""
    return max(1, math.ceil(period_s / rules.LONGEST_STEP_S * (1.0 - 1e-9)))


def nominal(rig: SerialRig, step_s: float) -> Fitted:
    """The model as it was given."""
    return extended(rig, [], step_s)


def extended(rig: SerialRig, found: Sequence[Found], step_s: float) -> Fitted:
    """The model with causes in it.

    Args:
        rig: the logs.
        found: causes with the values to use.
        step_s: of the integration [s].

    Raises:
        InputError: MuJoCo refuses the model with the causes in it.
    """
    pairs = [(item, effect) for item in found for effect in rig.effects(item)]
    read = [e for _, e in pairs if isinstance(e, RobotEffect) and e.cause in KNOWN]
    acting = [(item, e) for item, e in pairs if not (isinstance(e, RobotEffect) and e.cause in KNOWN)]
    built = build(load_spec(rig.model.path), [e for _, e in acting], step_s)
    left = dict.fromkeys(acting[k][0].candidate.label for k in built.left_out)
    return Fitted(built, Readings.of(read, len(rig.model.joints)), tuple(left))


def by_the_others(rig: SerialRig, explanation: Explanation, trial: int, step_s: float) -> Fitted:
    """The extended model with everything fitted to the other blocks; to the block itself where there is no other.

    Args:
        rig: the logs.
        explanation: what was found.
        trial: the block, from 0.
        step_s: of the integration [s].

    Raises:
        InputError: MuJoCo refuses the model with the causes in it.
    """
    problem = explanation.problem
    others = [t for t in problem.trials if t != trial] or [trial]
    lasting = [item for item in explanation.found if item.candidate.transient is None]
    own = [item.candidate.transient for item in explanation.found if item.candidate.transient is not None]
    # Events of the other blocks are there when those are fitted.
    used = [
        i.index for i in explanation.found if i.candidate.transient is None or not i.candidate.acts_in(trial)
    ]
    fit = Fit.of(problem, used, others)
    told = [replace(item, values=_values(fit, item)) for item in lasting]
    done = extended(rig, told, step_s)
    events = tuple(event for event in own if event.trial == trial)
    names = dict.fromkeys(
        [*done.left_out, *(i.candidate.label for i in explanation.found if i.candidate.transient)]
    )
    return replace(done, left_out=tuple(names), events=events)


def _values(fit: Fit, item: Found) -> Array:
    return np.asarray(fit.part(item.index)[0] * item.candidate.units)
