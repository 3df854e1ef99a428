"""What a hidden effect can act on, and the effects that are no more than one number of a robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from independent.as_built import AsBuilt
from independent.numerics import Array
from independent.payload import Payload
from independent.rotations import turned


@dataclass(frozen=True, eq=False)
class Scene:
    """One trial as the effects see it; W axes, on the fine grid.

    Attributes:
        trial: number, from 1.
        time: 0 where the recording starts [s], shape (Q,).
        payload: the rigid body.
        R_W1, p_W1: its pose, shapes (Q, 3, 3) and (Q, 3).
        velocity, acceleration: of its centre of mass, shape (Q, 3).
        omega, alpha: its angular velocity and acceleration, shape (Q, 3).
        R_Wb, p_Wb: level frames {b} of the robots, shapes (N, 3, 3) and (N, 3).
        gravity: shape (3,).
    """

    trial: int
    time: Array
    payload: Payload
    R_W1: Array
    p_W1: Array
    velocity: Array
    acceleration: Array
    omega: Array
    alpha: Array
    R_Wb: Array
    p_Wb: Array
    gravity: Array

    def place(self, point: Array) -> Array:
        """A point of {1} in W [m], shape (Q, 3)."""
        return self.p_W1 + turned(self.R_W1, point)

    def motion(self, point: Array) -> tuple[Array, Array]:
        """Velocity and acceleration of a point of {1} in W, shape (Q, 3) each."""
        arm = turned(self.R_W1, point - self.payload.p_1c)
        turning = np.cross(self.omega, arm)
        return self.velocity + turning, (
            self.acceleration + np.cross(self.alpha, arm) + np.cross(self.omega, turning)
        )

    def at(self, point: Array, force: Array) -> tuple[Array, Array]:
        """A force at a point of {1} as force and moment about the centre of mass, W axes."""
        return force, np.cross(turned(self.R_W1, point - self.payload.p_1c), force)


class Effect:
    """Something hidden. Subclasses override what they act on; nothing else happens."""

    def build(self, robots: AsBuilt) -> None:
        """Change numbers of the robots in place."""

    def wrench(self, scene: Scene) -> tuple[Array, Array] | None:
        """Force and moment about the centre of mass that act on the payload, W axes [N, N m], shape (Q, 3) each."""
        return None

    def driven_torque(self, phi: Array) -> tuple[int, int, Array] | None:
        """Robot, joint (from 0) and torque that resists there [N m], shape (Q,), of phi (Q, N, 3)."""
        return None

    def gimbal_torque(self, theta: Array) -> tuple[int, int, Array] | None:
        """The same about a gimbal axis, of theta (Q, N, 3)."""
        return None

    def grasp_shift(self, robot: int, force: Array) -> Array | float:
        """How far the wrist of a robot (from 0) is from its grasp, axes of {i} [m], of its force there (Q, 3)."""
        return 0.0

    def spring(self, torque: Array, stiffness: float) -> tuple[int, int, Array] | None:
        """Robot, joint and what the spring's reading is for torques (Q, N, 3) [N m], shape (Q,)."""
        return None

    def sensed(self, torque: Array) -> tuple[int, Array] | None:
        """Robot and its torque readings (Q, 3) behind a sensor's dynamics, of readings (Q, N, 3)."""
        return None


@dataclass(frozen=True)
class Hidden:
    """An effect and how it is told.

    Attributes:
        name: as asked for.
        cause: of the catalogue.
        other_form: whether its law is not the catalogue's.
        effect: what acts.
        robot, joint: place, from 1, or None.
        known: true values of the cause's parameters.
        parameters: everything else that was drawn.
    """

    name: str
    cause: str
    other_form: bool
    effect: Effect
    robot: int | None
    joint: int | None
    known: dict[str, Any]
    parameters: dict[str, Any]

    def to_dict(self, size: float) -> dict[str, Any]:
        """As the truth of a set tells it."""
        answer = {"cause": self.cause, "robot": self.robot, "joint": self.joint, "known": self.known}
        return {
            "cause": self.name, "form": self.other_form, "answer": answer, "law": None,
            "parameters": self.known | self.parameters, "size": size,
        }  # fmt: skip


@dataclass(frozen=True)
class Numbers(Effect):
    """Numbers of ``AsBuilt`` that are set: what is drawn at random at that place is replaced, so the truth is exact.

    Attributes:
        values: by quantity, robot and place (from 0).
    """

    values: dict[tuple[str, int, int], float]

    def build(self, robots: AsBuilt) -> None:
        """Set them."""
        for (quantity, robot, place), value in self.values.items():
            robots[quantity][robot, place] = value
