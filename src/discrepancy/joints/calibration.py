"""Fit everything that joint logs determine about a robot: inertial parameters, friction, rotors, zeros, gains, delays.

The problem is the linear one of the diagnosis, around the current values. It is solved for all parameters together,
with wide priors around the given model. Rows are torques (``fit``), or positions in the closed loop (``loop_fit``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from discrepancy.joints.closed_loop import commanded
from discrepancy.joints.fit import Combination, Fit, HeldOut, Parameter
from discrepancy.joints.forecast import Forecasts
from discrepancy.joints.loop_fit import LoopFit, with_gains
from discrepancy.joints.mechanics import Tree
from discrepancy.joints.model import SerialModel
from discrepancy.joints.same_kind import Comparison, compared, machines
from discrepancy.joints.trials import at_limits, notes_of, resting, trials_of
from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_logs.joints.joint_log import JointLog

LEAST_TRAVEL = 0.01
"""Least travel of a joint of a robot that is known by its commands [rad or m]. Chosen: ten times play and noise."""
ROUNDS, SETTLED = 8, 0.1
"""Most linearisations, and the largest step [standard errors] at which they end. Chosen."""


@dataclass(frozen=True, eq=False)
class ArmCalibration:
    """What joint logs determine about a robot.

    Attributes:
        model: the given model.
        joints: indices of the joints with torques, from 0.
        parameters: all parameters.
        combinations: determined combinations of inertial parameters.
        tree: kinematic tree with the fitted numbers.
        zero: fitted joint zeros, shape (J,) [rad or m].
        gravity: in the base's frame, shape (3,) [m/s^2].
        links: bodies whose inertial parameters were fitted.
        coupled: Coulomb friction, viscous friction, rotor inertia and ratio of coupled drives, by their second joint.
        held_out: predictions of each part; of the only part from itself.
        validated: whether every part was predicted from others.
        logs: names of the logs.
        notes: sentences on the logs and on what is not fitted.
        predicts: what ``held_out`` predicts: torques from the motion, or positions from commands over one second.
        servos: what MJCF can hold of each joint's position loop, shape (J, 4); None unless positions are predicted:
            position gain, velocity gain with negative damping, torque added to it, and largest torque.
        covariance: posterior covariance of ``parameters``, in their order, shape (P, P).
        forecasts: of the first part; None unless positions are predicted.
        friction: of joints whose friction deviates from its law, where positions are predicted: Coulomb friction and
            damping of first to third degree in the speed, shape (4,).
        same: comparisons of machines of one kind.
    """

    model: SerialModel
    joints: tuple[int, ...]
    parameters: tuple[Parameter, ...]
    combinations: tuple[Combination, ...]
    tree: Tree
    zero: Array
    gravity: Array
    links: tuple[int, ...]
    coupled: Mapping[int, tuple[float, float, float, float]]
    held_out: tuple[HeldOut, ...]
    validated: bool
    logs: tuple[str, ...]
    notes: tuple[str, ...]
    predicts: Literal["torque", "position"] = "torque"
    covariance: Array | None = None
    servos: Array | None = None
    forecasts: Forecasts | None = None
    friction: Mapping[int, Array] = field(default_factory=dict)
    same: tuple[Comparison, ...] = ()


def calibrate_arm(
    model: SerialModel,
    logs: Sequence[JointLog],
    say: Callable[[str], object] = lambda _: None,
    same: Sequence[str] = (),
) -> ArmCalibration:
    """Fit all parameters of a robot to logs of its joints.

    Args:
        model: the robot as described.
        logs: joint logs with torques, currents or duties.
        say: receives a line of text about each step.
        same: LEFT=RIGHT for machines of one kind to compare, see ``same_kind.machines``.

    Raises:
        InputError: a log cannot be used, or ``same`` names no two joints.
    """
    alike = [machines(model.joints, one) for one in same]
    say("smoothing the logs")
    logs = with_gains(model, logs)
    positions = all(map(commanded, logs))
    if positions and max(float(np.ptp(log.q, axis=0).max()) for log in logs) < LEAST_TRAVEL:
        raise InputError(
            f"{logs[0].name}: no joint moves by {1e3 * LEAST_TRAVEL:g} mrad or mm; commands and positions tell nothing "
            "of a robot at rest"
        )
    trials = trials_of(model, logs)
    fit, moved, unsettled = (LoopFit if positions else Fit)(model, trials), np.inf, []
    for k in range(ROUNDS):
        say(f"fitting all parameters, step {k + 1}")
        moved = fit.step()
        if moved < SETTLED:
            break
    else:
        unsettled = [
            f"The fit has not settled: the last of its {ROUNDS} steps still moved a value by {moved:.3g} standard "
            f"errors, where less than {SETTLED:g} is settled."
        ]
    say("predicting each part from the others")
    held = fit.held_out()
    if isinstance(fit, LoopFit):
        fit.widen()
    names = tuple(dict.fromkeys(log.name for log in logs))
    notes = [*model.notes, *notes_of(logs), *at_limits(model, trials.limited), *resting(logs)]
    notes = [*unsettled, *notes, *fit.notes()]
    parameters, covariance = tuple(fit.parameters()), fit.covariances()
    return ArmCalibration(
        model, tuple(map(int, trials.joints)), parameters, tuple(fit.combinations()),
        fit.tree, fit.zero(), fit.gravity(), fit.links, fit.coupled(), held,
        len(trials.parts) > 1, names, tuple(notes), "position" if positions else "torque", covariance,
        fit.servos(), fit.forecasts if isinstance(fit, LoopFit) else None, fit.friction,
        tuple(compared(parameters, covariance, one) for one in alike),
    )  # fmt: skip
