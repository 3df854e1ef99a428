"""What recordings say of loops that chatter."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from discrepancy import rules
from discrepancy.team.linear.noise import chatter
from discrepancy.team.linear.signals import Signals
from estimator.arrays import Array


def chattering(trials: Sequence[Signals], steps: Array) -> tuple[str, ...]:
    """A sentence where a torque oscillates faster than a team moves, by more than ten of its steps; for the notes.

    Args:
        trials: signals of every trial.
        steps: rounding steps, shape (3, N, 3): phi, theta, tau.
    """
    lines = np.max([chatter(trial)[2] for trial in trials], axis=0)
    lines = np.where(lines > rules.CHATTER_STEPS * steps[2], lines, 0.0)
    if not lines.any():
        return ()
    robot, joint = np.unravel_index(int(np.argmax(lines)), lines.shape)
    return (
        f"The torque of driven joint {joint + 1} of robot {robot + 1} oscillates faster than "
        f"{rules.NOISE_ABOVE_HZ:g} Hz, with {lines[robot, joint]:.2g} N m rms, as if its loop were unstable "
        "(mocobot inspect says at what frequency). The mean of what that does to torques and friction is in the model, "
        "as far as the samples tell it; what it does to readings that are not linear is in no cause.",
    )
