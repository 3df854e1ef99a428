"""Control laws of drives as actuators of MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass

# mujoco's compiled modules come without types.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np

Array = np.ndarray


@dataclass(frozen=True)
class ControlLaw:
    """A control law: within ``limit``, kp (command - q) - kd dq of a command that is late.

    Attributes:
        kp, kd, limit: [N m/rad], [N m s/rad], [N m], shape (J,) each.
        delay_s: [s], one or one a joint.
        apart: whether the limit leaves the velocity's part alone, as a limited duty does a motor's back-EMF.
    """

    kp: Array
    kd: Array
    limit: Array
    delay_s: float | Array = 0.0
    apart: bool = False


def actuate(spec: mujoco.MjSpec, joints: tuple[str, ...], law: ControlLaw, *, firmware: bool = False) -> None:
    """Put a control law into a model: position loops, and after them what the limit leaves alone.

    With ``firmware`` the loops are motors, whose torques somebody else gives.
    """
    for j, name in enumerate(joints):
        drive = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.forcerange = [-law.limit[j], law.limit[j]]
        drive.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        if not firmware:
            drive.biastype = mujoco.mjtBias.mjBIAS_AFFINE
            drive.gainprm[0], drive.biasprm[1] = law.kp[j], -law.kp[j]
            drive.biasprm[2] = 0.0 if law.apart else -law.kd[j]
    for j, name in enumerate(joints if law.apart else ()):
        emf = spec.add_actuator(name=f"{name}_emf", target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        emf.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        emf.gainprm[0], emf.biasprm[2] = 0.0, -law.kd[j]
