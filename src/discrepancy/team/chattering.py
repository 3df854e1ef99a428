"""What recordings say of loops that chatter."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from discrepancy.team import constants
from discrepancy.team.linear.chatter import Fast
from discrepancy.team.linear.signals import Signals


def chattering(trials: Sequence[Signals]) -> tuple[str, ...]:
    """A sentence where a torque oscillates faster than a team moves, by so much that it is let through; for the notes.

    Args:
        trials: signals of every trial, with their cut-offs (``Noise.known_to``).
    """
    loud = [Fast.of(trial).lines[2] for trial in trials if trial.chatters]
    if not loud:
        return ()
    lines = np.max(loud, axis=0)
    robot, joint = np.unravel_index(int(np.argmax(lines)), lines.shape)
    return (
        f"The torque of driven joint {joint + 1} of robot {robot + 1} oscillates faster than "
        f"{constants.NOISE_ABOVE_HZ:g} Hz, with {lines[robot, joint]:.2g} N m rms, as if its loop were unstable "
        "(mocobot inspect says at what frequency). The mean of what that does to torques and friction is in the model, "
        "as far as the samples tell it; what it does to readings that are not linear is in no cause.",
    )
