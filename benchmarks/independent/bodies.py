"""What bodies are: how far every robot is off its design, and payloads with the wrench that their motion takes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from independent.numerics import Array, back_turned, derivative, turned

ROBOTS = 3


@dataclass(frozen=True)
class Quantity:
    """One thing that may be off.

    Attributes:
        tolerance: standard deviation at background x1; 0: never off but where it is hidden.
        places: numbers per robot.
        positive: whether only one sign makes sense.
        uncalibrated: standard deviation of robots that nobody calibrated; None: as at x1.
    """

    tolerance: float
    places: int
    positive: bool = False
    uncalibrated: float | None = None


QUANTITIES: Mapping[str, Quantity] = {
    "phi_zero": Quantity(1e-4, 3, uncalibrated=np.radians(1.0)),  # reading minus truth [rad]
    "theta_zero": Quantity(1e-4, 3, uncalibrated=np.radians(1.0)),
    "proximal": Quantity(2e-5, 3, uncalibrated=1e-3),  # true minus design [m]
    "rod": Quantity(2e-5, 3, uncalibrated=1e-3),
    "base_radius": Quantity(2e-5, 3, uncalibrated=1e-3),
    "base_tilt": Quantity(1e-4, 2),  # rotation vector about x and y of {b} [rad]
    "base_creep": Quantity(2e-8, 2),  # along x and y of {b} [m/s]
    "base_compliance": Quantity(1e-7, 1, positive=True),  # [m/N]
    "sea_scale": Quantity(0.001, 3, uncalibrated=0.02),
    "sea_bias": Quantity(0.003, 3, uncalibrated=0.02),  # reading minus truth [N m]
    "sea_hardening": Quantity(3.0, 3),  # [N m/rad^3]
    "sea_hysteresis": Quantity(0.002, 3, positive=True),  # [N m]
    "joint_coulomb": Quantity(0.002, 3, positive=True),  # [N m]
    "joint_viscous": Quantity(0.002, 3, positive=True),  # [N m s/rad]
    "gimbal_coulomb": Quantity(0.002, 3, positive=True),
    "gimbal_viscous": Quantity(0.002, 3, positive=True),
    "torque_skew": Quantity(1e-4, 1, positive=True),  # [s]
    "torque_lag": Quantity(1e-4, 1, positive=True),  # [s]
    "sensor_lag": Quantity(0.0, 3, positive=True),  # [s], of single torque sensors
    "clock_delay": Quantity(1e-5, 1, positive=True),  # [s]
    "grasp_flex": Quantity(1e-7, 1, positive=True),  # [m/N]
    "grasp_play": Quantity(3e-6, 1, positive=True),  # [m]
}
TIMES = {"none": 0.0, "x1": 1.0, "x3": 3.0, "x10": 10.0, "uncalibrated": 1.0}
"""Backgrounds and how many times the tolerances they are; ``none`` is for tests."""

AsBuilt = dict[str, Array]
"""Values by the names of ``QUANTITIES``, shape (N, places) each."""


def draw_as_built(rng: np.random.Generator, background: str) -> AsBuilt:
    """All robots of a set, normally distributed.

    Args:
        rng: their source.
        background: one of ``TIMES``.
    """
    values: AsBuilt = {}
    for name, quantity in QUANTITIES.items():
        spread = TIMES[background] * quantity.tolerance
        if background == "uncalibrated" and quantity.uncalibrated is not None:
            spread = quantity.uncalibrated
        drawn = rng.normal(0.0, 1.0, (ROBOTS, quantity.places)) * spread
        values[name] = np.abs(drawn) if quantity.positive else drawn
    return values


def limit_factor(quantity: str, background: str) -> float:
    """How much larger the smallest effect that shows is than at x1, for a quantity that is off at random."""
    known = QUANTITIES[quantity]
    if known.tolerance == 0 or background == "none":
        return 1.0
    if background == "uncalibrated" and known.uncalibrated is not None:
        return known.uncalibrated / known.tolerance
    return TIMES[background]


MODELS = Path(__file__).parents[2] / "models"


@dataclass(frozen=True, eq=False)
class Payload:
    """A rigid body with grasps, in its frame {1}.

    Attributes:
        mass_kg: mass [kg].
        p_1c: centre of mass [m], shape (3,).
        inertia: about the centre of mass, axes of {1} [kg m^2], shape (3, 3).
        p_1i: grasps [m], shape (N, 3).
        R_1i: their axes, shape (N, 3, 3).
    """

    mass_kg: float
    p_1c: Array
    inertia: Array
    p_1i: Array
    R_1i: Array


@cache
def load_payload(name: str) -> Payload:
    """Payload a, b, c or d. MuJoCo only reads the numbers out of the file."""
    file = MODELS / f"payload_{name}" / "payload.xml"
    model = mujoco.MjModel.from_xml_path(str(file))  # pyright: ignore[reportAttributeAccessIssue]
    body = model.body("payload")
    axes = _matrix(body.iquat)
    grasps = [model.site(f"grasp{i}") for i in (1, 2, 3)]
    return Payload(
        mass_kg=float(body.mass[0]),
        p_1c=np.array(body.ipos),
        inertia=axes @ np.diag(body.inertia) @ axes.T,
        p_1i=np.array([site.pos for site in grasps]),
        R_1i=np.array([_matrix(site.quat) for site in grasps]),
    )


def needed_wrench(
    payload: Payload, R_W1: Array, omega: Array, acceleration: Array, gravity: Array
) -> tuple[Array, Array]:
    """What has to act on the payload besides its weight, by Newton and Euler.

    Args:
        payload: the body.
        R_W1: its orientation, shape (Q, 3, 3).
        omega: its angular velocity in W [rad/s], shape (Q, 3).
        acceleration: of its centre of mass in W [m/s^2], shape (Q, 3).
        gravity: in W [m/s^2], shape (3,).

    Returns:
        Force [N] and moment about the centre of mass [N m], in W, shape (Q, 3) each.
    """
    momentum = turned(R_W1, back_turned(R_W1, omega) @ payload.inertia)
    return payload.mass_kg * (acceleration - gravity), derivative(momentum)


def _matrix(quaternion: Array) -> Array:
    return Rotation.from_quat(np.asarray(quaternion), scalar_first=True).as_matrix()
