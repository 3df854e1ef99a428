"""What else acts in a trial, besides the robots' arms: bases that drive, a person's hand."""

from dataclasses import dataclass
from typing import Protocol

import mujoco

from mocobot_sim.control.control import TeamController
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
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    index: TeamIndex
    controller: TeamController
    rate_hz: float
    ticks: int
    duration: int


class Actor(Protocol):
    """Somebody or something that acts at the control rate.

    Every tick, before the arms' controller, ``qpos`` and ``qvel`` are those of this instant; whatever MuJoCo derives
    from them (poses of bodies and sites, contacts, forces) is of the instant one time step before.
    """

    def start(self, stage: Stage) -> None:
        """Get ready; called once."""
        ...

    def act(self, tick: int) -> None:
        """Write ``ctrl`` of what it drives, add to ``xfrc_applied`` of the payload (zero before), or both."""
        ...
