"""Small payloads to carry in tests: a point-symmetric block on N grasps, written as MJCF."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation


@dataclass(frozen=True)
class Grasp:
    """One grasp: position [m] in {1} and orientation R = Rz(yaw) Ry(pitch) Rx(roll) [deg]."""

    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    zyx_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def pose(self) -> RigidTransform:
        return RigidTransform.from_components(
            self.position, Rotation.from_euler("ZYX", self.zyx_deg, degrees=True)
        )


@dataclass(frozen=True)
class Payload:
    """A rigid payload; the first grasp is {1}."""

    grasps: tuple[Grasp, ...]
    mass_kg: float
    com_m: tuple[float, float, float]
    inertia_kgm2: tuple[float, float, float] = (0.05, 0.06, 0.08)
    compiler: str = '<compiler angle="radian" autolimits="true"/>'
    extra: str = field(default="")

    def xml(self) -> str:
        sites = ""
        for i, grasp in enumerate(self.grasps, start=1):
            # The quaternion is half-angle products, not scipy's: the scene must reproduce it from the MJCF.
            q = _quaternion(np.deg2rad(grasp.zyx_deg))
            sites += f'<site name="grasp{i}" pos="{_text(grasp.position)}" quat="{_text(q)}"/>\n'
        return (
            f'<mujoco model="test_payload">{self.compiler}<worldbody><body name="payload">\n'
            f'<inertial pos="{_text(self.com_m)}" mass="{self.mass_kg!r}" diaginertia="{_text(self.inertia_kgm2)}"/>\n'
            f"{sites}{self.extra}</body></worldbody></mujoco>\n"
        )

    def write(self, folder: Path) -> Path:
        path = folder / "payload_under_test.xml"
        path.write_text(self.xml(), encoding="utf-8")
        return path


def _text(numbers) -> str:
    return " ".join(repr(float(number)) for number in numbers)


def _quaternion(zyx) -> np.ndarray:
    """(w, x, y, z) of Rz Ry Rx from half angles."""
    (cz, cy, cx), (sz, sy, sx) = np.cos(np.asarray(zyx) / 2), np.sin(np.asarray(zyx) / 2)
    return np.array(
        [
            cz * cy * cx + sz * sy * sx,
            cz * cy * sx - sz * sy * cx,
            cz * sy * cx + sz * cy * sx,
            sz * cy * cx - cz * sy * sx,
        ]
    )


# One and two grasps leave the payload free to swing: its centre of mass hangs below the grasps.
ONE = Payload((Grasp(),), mass_kg=3.0, com_m=(0.0, 0.0, -0.15))
TWO = Payload(
    (Grasp(), Grasp((0.9, 0.3, 0.02), (70.0, 0.0, 0.0))),
    mass_kg=6.0,
    com_m=(0.45, 0.15, -0.20),
    inertia_kgm2=(0.10, 0.50, 0.55),
)
# Five grasps, three of them tilted, at different heights and yaws; centre of mass above the grasps.
FIVE = Payload(
    (
        Grasp(),
        Grasp((0.9, -0.2, 0.015), (40.0, 0.0, 0.0)),
        Grasp((1.3, 0.7, -0.020), (-110.0, 8.0, -5.0)),
        Grasp((0.5, 1.3, 0.010), (160.0, -6.0, 9.0)),
        Grasp((-0.4, 0.8, 0.0), (-60.0, 0.0, 12.0)),
    ),
    mass_kg=16.0,
    com_m=(0.46, 0.52, 0.06),
    inertia_kgm2=(3.0, 4.0, 6.5),
)
TEAMS = {1: ONE, 2: TWO, 5: FIVE}
