"""States of a trial at chosen times, for pictures."""

from collections.abc import Sequence

import mujoco

from estimator.arrays import Array
from mocobot_sim.trial.actors import Stage


class Snapshots:
    """Keeps ``qpos`` at given times: an actor of a trial that does nothing.

    Args:
        times_s: when [s]; each is kept at the first control tick from then on.
    """

    def __init__(self, times_s: Sequence[float]) -> None:
        self.times_s = tuple(sorted(times_s))
        self.qpos: list[Array] = []

    def start(self, stage: Stage) -> None:
        """Get ready."""
        self.begin(stage.data, stage.rate_hz)

    def begin(self, data: mujoco.MjData, rate_hz: float) -> None:
        """The same without a trial."""
        self._data, self._rate_hz, self.qpos = data, rate_hz, []

    def act(self, tick: int) -> None:
        """Look, and keep what is due."""
        while (
            len(self.qpos) < len(self.times_s) and tick >= self.times_s[len(self.qpos)] * self._rate_hz - 1e-6
        ):
            self.qpos.append(self._data.qpos.copy())
