"""What acts in a trial besides MuJoCo and the arms' controllers, tick by tick."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco

from estimator.arrays import Array
from mocobot_sim.scene.applied import Pushing
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.trial.actors import Acting, Actor, Reader, Stage


@dataclass(frozen=True)
class Others:
    """Actors, sensors that misread, and pushes of one trial.

    Attributes:
        actors, readers, pushes: each in the order in which it acts.
        carries: whether there is a payload to act on.
        R_Wb1: axes of robot 1's {b} in the world, shape (3, 3).
    """

    actors: tuple[Actor, ...]
    readers: tuple[Reader, ...]
    pushes: tuple[Pushing, ...]
    carries: bool
    R_Wb1: Array

    @classmethod
    def of(cls, scene: TeamScene, trial_number: int | None, actors: Sequence[Actor]) -> Others:
        """``actors``, and after them what the scene's effects bring to a trial."""
        acting = [effect for effect in scene.effects if isinstance(effect, Acting)]
        return cls(
            (*actors, *(actor for effect in acting for actor in effect.actors(trial_number))),
            tuple(reader for effect in acting for reader in effect.readers(trial_number)),
            tuple(push for push in scene.pushes if trial_number in (None, push.trial)),
            scene.carries,
            scene.mounts.rotation[0].as_matrix(),
        )

    def __bool__(self) -> bool:
        """Whether there are any."""
        return bool(self.actors or self.readers or self.pushes)

    def start(self, stage: Stage) -> None:
        """Get ready."""
        for part in (*self.actors, *self.readers):
            part.start(stage)

    def before_control(self, stage: Stage, tick: int, seen: Array) -> None:
        """Act, from no force applied on, and change what the sensors see, shape (nq,), in place."""
        data = stage.data
        if self.carries and (self.pushes or self.actors):
            data.xfrc_applied[stage.index.payload_body] = 0.0
        if self.actors:
            data.qfrc_applied[:] = 0.0
        for actor in self.actors:
            actor.act(tick)
        if self.readers:
            seen[:] = data.qpos
            for reader in self.readers:
                reader.read(tick, seen)

    def after_control(self, stage: Stage) -> None:
        """Push."""
        for push in self.pushes:
            if push.acts(stage.data.time):
                mujoco.mj_kinematics(stage.model, stage.data)
                push.act(stage.data, stage.index.payload_body, self.R_Wb1)
