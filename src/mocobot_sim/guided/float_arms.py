"""Arms that carry a payload's weight and are otherwise as soft as their gains say: an actor of a trial."""

from collections.abc import Sequence

import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_sim.control.control import ControlGains
from mocobot_sim.guided.weight import Payload, up_in_payload, weight_shares
from mocobot_sim.scene.as_built import AsBuilt, units_of
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.trial.actors import Stage
from mocobot_sim.trial.trajectories import minimum_jerk

# No stiffness. The SEA torque loop lags behind the changing lever arms, which takes about 1.4 N s/m of damping away
# per arm (measured with payload (a)); a little more than that brings a payload that nobody holds to rest.
FLOAT_GAINS = ControlGains(stiffness_N_per_m=0.0, damping_Ns_per_m=2.0)


class FloatArms:
    """Sets every arm's feed-forward force to its share of the weight, at the payload's present tilt.

    A trial starts at rest with the payload held. From ``start_s`` on, within ``fade_s``, the forces that hold it then
    give way to those that ``payload`` asks for; the gains do not change (``FLOAT_GAINS``, or softer arms' own).

    Args:
        payload: whose weight the robots believe they carry, or None for the forces that they start with, for ever.
        as_built: sensor zeros of every unit; empty for robots as designed.
        start_s, fade_s: when and how fast [s].
    """

    def __init__(
        self,
        payload: Payload | None,
        as_built: Sequence[AsBuilt] = (),
        start_s: float = 0.2,
        fade_s: float = 1.5,
    ) -> None:
        if not start_s > 0 or not fade_s > 0:
            raise InputError(f"start_s is {start_s} and fade_s {fade_s}; both must be greater than 0")
        self._payload, self._as_built = payload, as_built
        self._start_s, self._fade_s = start_s, fade_s

    def start(self, stage: Stage) -> None:
        """Get ready.

        Raises:
            InputError: the payload has another number of grasps than there are robots.
        """
        robots = stage.index.robots
        if self._payload is not None and len(self._payload.p_1i) != robots:
            raise InputError(
                f"the payload has {len(self._payload.p_1i)} grasps; the team has {robots} robots"
            )
        self._stage = stage
        self._theta_zero = np.array([unit.theta_zero_rad for unit in units_of(self._as_built, robots)])
        self._gravity = omnid_design().gravity_mps2
        self._held = np.zeros((robots, 3))

    def act(self, tick: int) -> None:
        """Every sample, set the forces; the payload turns slowly."""
        stage = self._stage
        if tick == 1:
            self._held = stage.controller.feed_forward  # measured by the arms in their first tick
            stage.controller.feed_forward = self._held
        if tick and tick % stage.ticks == 0 and self._payload is not None:
            share = minimum_jerk(np.array((tick / stage.rate_hz - self._start_s) / self._fade_s))
            stage.controller.feed_forward = (1.0 - share) * self._held + share * self.forces()

    def forces(self) -> Array:
        """What the payload asks for now: force of every wrist in its {b} [N], shape (N, 3)."""
        payload, force = self._payload, np.zeros_like(self._held)
        if payload is not None and payload.mass_kg > 0:
            theta = self._stage.data.qpos[self._stage.index.gimbal_qpos] + self._theta_zero
            for i, up in enumerate(up_in_payload(theta, payload.R_1i)):
                # Every robot sees the tilt by its own gimbal, and takes its own share.
                force[i, 2] = weight_shares(payload, up, self._gravity)[i]
        return force
