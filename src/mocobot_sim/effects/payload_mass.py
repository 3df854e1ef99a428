"""A payload whose mass is not the same at all times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from estimator.arrays import inertia_matrix
from estimator.errors import InputError
from mocobot_sim.effects.base import Effect

if TYPE_CHECKING:
    import mujoco

    from estimator.arrays import Array
    from mocobot_sim.scene.scene import TeamScene
    from mocobot_sim.scene.team_index import TeamIndex
    from mocobot_sim.trial.actors import Actor, Reader, Stage

LEAST_RATIO = 1e-6
"""Least principal moment of what is then carried, over the largest: a body needs some."""


@dataclass(frozen=True)
class PayloadMass(Effect):
    """Something that is put on the payload (taken off, if negative) for some trials, or that leaks out while they last.

    ``mass_kg`` is there from the start of ``trial`` to the end of ``last_trial`` (0: of the last of all); in each of
    these, ``rate_kgps`` comes to it. Its centre is a point of the payload, given in {1} [m]; ``inertia_*_m2`` is its
    inertia about that centre, in the axes of {1}, per kg of it: 0 of a point.

    MJCF has no such thing: the trial writes the payload's mass, centre and inertia. What leaves does so without recoil.
    """

    on_payload = True
    ranges: ClassVar = {"mass_kg": (-100.0, 100.0), "rate_kgps": (-1.0, 1.0)}
    mass_kg: float = 0.0
    rate_kgps: float = 0.0
    trial: int = 1
    last_trial: int = 0
    point_x_m: float = 0.0
    point_y_m: float = 0.0
    point_z_m: float = 0.0
    inertia_xx_m2: float = 0.0
    inertia_xy_m2: float = 0.0
    inertia_xz_m2: float = 0.0
    inertia_yy_m2: float = 0.0
    inertia_yz_m2: float = 0.0
    inertia_zz_m2: float = 0.0

    def _edit(self, scene: TeamScene) -> TeamScene:
        return scene

    def load(self, model: mujoco.MjModel, index: TeamIndex, trial_number: int | None) -> None:
        """Put it on, so that the trial begins at rest with it.

        Raises:
            InputError: more would be taken off than there is.
        """
        if self.mass_kg and self._there(trial_number):
            _Carried(self, model, index.payload_body).change(self.mass_kg)

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        """What leaks out in a trial."""
        return (_Leak(self),) if self.rate_kgps and self._there(trial_number) else ()

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        """No sensor misreads."""
        return ()

    def _there(self, trial_number: int | None) -> bool:
        number = self.trial if trial_number is None else trial_number
        return self.trial <= number and (not self.last_trial or number <= self.last_trial)


class _Leak:
    """Mass that comes or goes while a trial lasts."""

    def __init__(self, effect: PayloadMass) -> None:
        self._effect = effect

    def start(self, stage: Stage) -> None:
        """Find the payload.

        Raises:
            InputError: more would leave than there is.
        """
        self._payload = _Carried(self._effect, stage.model, stage.index.payload_body)
        self._per_tick = self._effect.rate_kgps / stage.rate_hz
        self._payload.check(self._per_tick * stage.duration)

    def act(self, tick: int) -> None:
        """What it weighs now."""
        self._payload.change(self._per_tick * tick)


class _Carried:
    """The payload's body, and what it is with more on it."""

    def __init__(self, effect: PayloadMass, model: mujoco.MjModel, body: int) -> None:
        self._model, self._body = model, body
        self._mass, self._centre = float(model.body_mass[body]), model.body_ipos[body].copy()
        R = _matrix(model.body_iquat[body])
        self._inertia = (R * model.body_inertia[body]) @ R.T
        self._point = np.array([effect.point_x_m, effect.point_y_m, effect.point_z_m])
        self._per_kg = inertia_matrix(np.array([getattr(effect, f"inertia_{ij}_m2") for ij in ENTRIES]))
        # MuJoCo takes a shortcut where the inertia's frame is the body's.
        model.body_sameframe[body] = 0

    def check(self, more_kg: float) -> None:
        """Refuse a payload that weighs nothing.

        Raises:
            InputError: it does.
        """
        if not self._mass + more_kg > 0.0:
            raise InputError(
                f"payload_mass: the payload of {self._mass:.3g} kg would weigh {self._mass + more_kg:.3g} kg; "
                "it must weigh something"
            )

    def change(self, more_kg: float) -> None:
        """Write mass, centre and inertia with so much more than at first.

        Raises:
            InputError: nothing would be left.
        """
        from mocobot_sim.scene.payload_mjcf import nearest_inertia

        self.check(more_kg)
        model, body = self._model, self._body
        mass = self._mass + more_kg
        centre = (self._mass * self._centre + more_kg * self._point) / mass
        inertia = self._inertia + self._mass * _about(self._centre - centre)
        inertia = inertia + more_kg * (self._per_kg + _about(self._point - centre))
        moments, axes = np.linalg.eigh(nearest_inertia(inertia, LEAST_RATIO))
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        model.body_mass[body], model.body_ipos[body] = mass, centre
        model.body_inertia[body], model.body_iquat[body] = moments, _quaternion(axes)


ENTRIES = ("xx", "xy", "xz", "yy", "yz", "zz")
"""Of an inertia, as ``inertia_matrix`` takes them."""


def _about(r: Array) -> Array:
    """Inertia of 1 kg that is at r [m] from where it is taken about, shape (3, 3)."""
    return np.asarray(r @ r * np.eye(3) - np.outer(r, r))


def _matrix(quaternion: Array) -> Array:
    import mujoco

    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, quaternion)
    return R.reshape(3, 3)


def _quaternion(R: Array) -> Array:
    import mujoco

    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, R.ravel())
    return quaternion
