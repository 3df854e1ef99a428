"""What else acts in a trial, besides the robots' arms: bases that drive, a person's hand, effects that MJCF lacks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from estimator.arrays import Array
from mocobot_sim.control.control import TeamController

if TYPE_CHECKING:
    import mujoco

    from mocobot_sim.scene.team_index import TeamIndex


@dataclass(frozen=True)
class Stage:
    """A trial that is about to begin, at rest.

    Attributes:
        model, data: the trial's.
        index: addresses in the model.
        controller: of the arms.
        rate_hz: control rate [Hz].
        ticks: control ticks per logged sample.
        duration: control ticks of the whole trial.
        shared: by name, what several actors keep of the trial together.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    index: TeamIndex
    controller: TeamController
    rate_hz: float
    ticks: int
    duration: int
    shared: dict[str, object] = field(default_factory=dict)


class Actor(Protocol):
    """Somebody or something that acts at the control rate.

    Every tick, before the arms' controller, ``qpos`` and ``qvel`` are those of this instant; whatever MuJoCo derives
    from them (poses of bodies and sites, contacts, forces) is of the instant one time step before.
    """

    def start(self, stage: Stage) -> None:
        """Get ready; called once."""
        ...

    def act(self, tick: int) -> None:
        """Write ``ctrl`` of what it drives; add to ``xfrc_applied`` of the payload or ``qfrc_applied`` (both zero)."""
        ...


class Reader(Protocol):
    """A sensor that misreads: it changes what the robots' controllers and logs see."""

    def start(self, stage: Stage) -> None:
        """Get ready; called once."""
        ...

    def read(self, tick: int, seen: Array) -> None:
        """Change, in place, the positions that the sensors see.

        Args:
            tick: of the control.
            seen: ``qpos`` of this instant, and what readers before this one made of it, shape (nq,). The driven angle
                is motor plus spring, the torque minus the design stiffness times the spring.
        """
        ...


@runtime_checkable
class Loading(Protocol):
    """An effect that changes the payload of some trials, which begin at rest with it."""

    def load(self, model: mujoco.MjModel, index: TeamIndex, trial_number: int | None) -> None:
        """Change a trial's model (trials count from 1; None is any), before the team is assembled."""
        ...


@runtime_checkable
class Acting(Protocol):
    """An effect that MJCF cannot express: somebody acts, or a sensor misreads, while a trial runs."""

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        """Who acts in a trial, new ones for each (trials count from 1; None is any)."""
        ...

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        """Sensors that misread in it."""
        ...
