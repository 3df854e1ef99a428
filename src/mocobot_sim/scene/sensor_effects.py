"""Faults in the timing of a robot's sensors; they change readings, not mechanics."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class SensorEffects:
    """Timing faults, one entry per robot; empty tuples mean none.

    Attributes:
        torque_delay_s: the logged torque is that much older than the angles beside it [s], N entries.
        torque_lag_s: time constant of a first-order lag in the torque sensor, before log and controller [s].
        clock_delay_s: everything the robot logs was sampled that much too early [s]; the controller is unaffected.
    """

    torque_delay_s: tuple[float, ...] = ()
    torque_lag_s: tuple[float, ...] = ()
    clock_delay_s: tuple[float, ...] = ()

    def of(self, name: str, robots: int) -> tuple[float, ...]:
        """One attribute's values, N entries, zeros where there is no fault [s]."""
        return getattr(self, name) or (0.0,) * robots

    def added(self, name: str, robot: int, value_s: float, robots: int) -> SensorEffects:
        """A copy in which one robot's (1-based) value is larger by ``value_s`` [s]."""
        values = list(self.of(name, robots))
        values[robot - 1] += value_s
        return replace(self, **{name: tuple(values)})
