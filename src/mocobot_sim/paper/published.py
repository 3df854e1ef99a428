"""The paper's tables as data: ground truth of the four payloads (Table I) and published errors (II-V)."""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arm.unit import seen_by_encoders
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.strict import Fields, read_toml


@dataclass(frozen=True)
class PayloadTruth:
    """What is true of a payload; frames as in ``PayloadEstimate``.

    Attributes:
        name: label of the payload.
        R_1i: rotations of the grasp frames in {1}, shape (N, 3, 3).
        p_1i: their origins in {1} [m], shape (N, 3).
        mass: mass [kg].
        p_1c: centre of mass in {1} [m], shape (3,).
        R_1c: principal axes in {1}, as columns, shape (3, 3).
        principal_moments: about the axes of {c}, ascending [kg m^2], shape (3,).
    """

    name: str
    R_1i: Array
    p_1i: Array
    mass: float
    p_1c: Array
    R_1c: Array
    principal_moments: Array

    @property
    def inertia(self) -> Array:
        """Inertia matrix in {b}: about the centre of mass, axes of {1} [kg m^2], shape (3, 3)."""
        return self.R_1c @ np.diag(self.principal_moments) @ self.R_1c.T

    def seen_by_encoders(self, theta_x_zero: Array) -> "PayloadTruth":
        """The same in the frames that the encoders define: each {i} turned about its x axis by that theta_x's zero.

        Args:
            theta_x_zero: reading minus true theta_x of every robot [rad], shape (N,).
        """
        R, p, p_1c, R_1c = seen_by_encoders(theta_x_zero, self.R_1i, self.p_1i, self.p_1c, self.R_1c)
        return replace(self, R_1i=R, p_1i=p, p_1c=p_1c, R_1c=R_1c)

    def T(self, i: int, j: int) -> Array:
        """Homogeneous transform T_ij, shape (4, 4); robots counted from 1."""
        T = np.eye(4)
        T[:3, :3] = self.R_1i[i - 1].T @ self.R_1i[j - 1]
        T[:3, 3] = self.R_1i[i - 1].T @ (self.p_1i[j - 1] - self.p_1i[i - 1])
        return T


PAYLOADS = ("a", "b", "c", "d")
_FILE = Path(__file__).with_name("published.toml")
_TRUTH = (
    "R_12_deg", "R_23_deg", "R_31_deg", "p_12_m", "p_23_m", "p_31_m", "mass_kg", "p_1c_m", "R_1c_deg", "principal_kgm2"
)  # fmt: skip


def payload_truth(name: str) -> PayloadTruth:
    """Table I for payload ``"a"``, ``"b"``, ``"c"`` or ``"d"``.

    T_12 and T_31 are taken as printed; T_13 is the inverse of T_31, and T_23 follows.

    Raises:
        InputError: there is no such payload.
    """
    row = Fields(printed_truth(name), _TRUTH, f"{_FILE.name}: {name}.truth")
    R_12, R_31, R_1c = (
        Rotation.from_rotvec(row.array(key, (3,)), degrees=True).as_matrix()
        for key in ("R_12_deg", "R_31_deg", "R_1c_deg")
    )
    return PayloadTruth(
        name=name,
        R_1i=np.stack([np.eye(3), R_12, R_31.T]),
        p_1i=np.stack([np.zeros(3), row.array("p_12_m", (3,)), -R_31.T @ row.array("p_31_m", (3,))]),
        mass=row.number("mass_kg", above=0.0),
        p_1c=row.array("p_1c_m", (3,)),
        R_1c=R_1c,
        principal_moments=row.array("principal_kgm2", (3,)),
    )


def published_errors(name: str) -> dict[str, Any]:
    """Tables II-V for a payload, keys as of ``mocobot_sim.paper.scoring.score``; inertia under ``"all"`` only.

    Raises:
        InputError: there is no such payload.
    """
    return _payload(name)["errors"]


def printed_truth(name: str) -> dict[str, Any]:
    """The row of Table I exactly as printed (degrees, metres), T_23 included.

    Raises:
        InputError: there is no such payload.
    """
    return _payload(name)["truth"]


def _payload(name: str) -> dict[str, Any]:
    tables = _tables()
    if name not in tables:
        raise InputError(f"there is no payload {name!r} in the paper; it has {', '.join(sorted(tables))}")
    return tables[name]


@cache
def _tables() -> dict[str, Any]:
    return read_toml(_FILE, "file of the paper's tables")
