"""Parameters of MuJoCo's constraints for rigid parts, stiction, and exact linear springs and dampers.

A passive spring or damper on a light body is unstable with steps of 1 ms. Integrated implicitly, it is unknown to the
constraint solver and opens the welds. A soft ``equality`` row, in contrast, is part of the constraint problem. MuJoCo
gives a row that keeps a coordinate x at zero the force

    R f = -(B x_dot + K d x + x_ddot),   K = s / d^2,  B = b / d,  R = (1 - d) / d * A

for ``solref = (-s, -b)`` and a constant impedance d = ``solimp[0] = solimp[1]``. A is MuJoCo's inverse inertia of the
coordinate in the zero pose of the model. Thus x has the stiffness s / ((1 - d) A) or, with s = 0, the damping
b / ((1 - d) A).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import mujoco

    from mocobot_sim.scene.pymjcf import mjcf

_RIGID = [0.9999, 0.9999, 0.001, 0.5, 2.0]
STIFF: dict[str, Any] = {"solref": [0.004, 1.0], "solimp": _RIGID}
"""Parameters of constraints that act as rigid: welds and hard limits."""
STICK: dict[str, Any] = {"solreffriction": [-1.0, -1000.0], "solimpfriction": _RIGID}
"""Parameters of ``frictionloss`` for Coulomb friction with stiction.

Below its limit, a friction row lets the coordinate creep at the velocity -R f / B. With the smallest possible R and a
rate B that stops a coordinate within 1 ms, a coordinate with inertia I creeps at 1e-7 f / I [1/s].
"""

# Smallest d and 1 - d [-]: MuJoCo clips d to this range.
_LEAST = 1e-4
# Largest s of springs [1/s^2]. Derived: (4 ms)^-2, the stiffness of the welds; larger if (1 - d) is at its minimum.
_STIFFNESS_PER_S2 = 62500.0
_STIFFEST_PER_S2 = 250000.0
# Rate b of dampers that stops a coordinate within one step of 1 ms [1/s].
_DAMPING_PER_S = 1000.0
# Shortest relaxation time [s]. Below it, the lag of the moving mass would be similar, so damping is critical instead.
_LEAST_RELAXATION_S = 0.005


@dataclass(frozen=True)
class SoftRow:
    """An ``equality`` on one joint or fixed tendon that acts as a spring or as a damper."""

    equality: str  # name of the equality in the scene
    compliance: float | None = None  # compliance of the spring [m/N or rad/(N m)]; None for a damper
    damping: float | None = None  # coefficient of the damper [N s/m or N m s/rad]; None for a spring
    # time constant with which the spring follows its load [s]; below 5 ms the spring is critically damped
    relaxation_s: float = 0.0


def spring_parameters(compliance: float, inverse_inertia: float) -> tuple[list[float], list[float]]:
    """``solref`` and ``solimp`` of a critically damped spring.

    Args:
        compliance: compliance, greater than 0 [m/N or rad/(N m)].
        inverse_inertia: MuJoCo's inverse inertia A of the coordinate [1/kg or 1/(kg m^2)].
    """
    s = min(_STIFFNESS_PER_S2, 0.5 * inverse_inertia / compliance)
    soft = s * compliance / inverse_inertia
    if soft < _LEAST:
        soft, s = _LEAST, min(_LEAST * inverse_inertia / compliance, _STIFFEST_PER_S2)
    return [-s, -2.0 * np.sqrt(s)], _constant_impedance(1.0 - soft)


def viscoelastic_parameters(
    compliance: float, relaxation_s: float, inverse_inertia: float
) -> tuple[list[float], list[float]]:
    """``solref`` and ``solimp`` of a spring and damper in parallel (Kelvin-Voigt), damping = relaxation / compliance.

    The lag due to the inertia of the row is a fortieth of the relaxation time, or as small as steps of 1 ms allow.
    """
    s = min(40.0 / relaxation_s, 1.3 * _DAMPING_PER_S) / relaxation_s
    soft = min(max(s * compliance / inverse_inertia, _LEAST), 1.0 - _LEAST)
    s = soft * inverse_inertia / compliance
    return [-s, -s * relaxation_s], _constant_impedance(1.0 - soft)


def damper_parameters(damping: float, inverse_inertia: float) -> tuple[list[float], list[float]]:
    """``solref`` and ``solimp`` of a linear damper; arguments as in ``spring_parameters``."""
    rate = damping * inverse_inertia
    impedance = max(1.0 - _DAMPING_PER_S / rate, _LEAST)
    return [-1e-12, -(1.0 - impedance) * rate], _constant_impedance(impedance)


def _constant_impedance(d: float) -> list[float]:
    return [float(d), float(d), 0.001, 0.5, 2.0]


def tune(root: mjcf.RootElement, model: mujoco.MjModel, rows: Sequence[SoftRow]) -> None:
    """Set the parameters of soft rows in a PyMJCF tree, for the inertias of its compiled model."""
    import mujoco

    for row in rows:
        equality = model.equality(row.equality).id
        on = model.eq_obj1id[equality]
        if model.eq_type[equality] == mujoco.mjtEq.mjEQ_TENDON:
            inverse_inertia = float(model.tendon_invweight0[on])
        else:
            inverse_inertia = float(model.dof_invweight0[model.jnt_dofadr[on]])
        if row.compliance is not None and row.relaxation_s >= _LEAST_RELAXATION_S:
            solref, solimp = viscoelastic_parameters(row.compliance, row.relaxation_s, inverse_inertia)
        elif row.compliance is not None:
            solref, solimp = spring_parameters(row.compliance, inverse_inertia)
        else:
            assert row.damping is not None
            solref, solimp = damper_parameters(row.damping, inverse_inertia)
        element = root.find("equality", row.equality)
        element.solref, element.solimp = solref, solimp


def row_compliance(model: mujoco.MjModel, joint: int) -> float:
    """Compliance of the spring row of a joint, computed from the compiled model [m/N or rad/(N m)]; 0 if none."""
    import mujoco

    for k in range(model.neq):
        if model.eq_type[k] == mujoco.mjtEq.mjEQ_JOINT and model.eq_obj1id[k] == joint:
            s, soft = -model.eq_solref[k, 0], 1.0 - model.eq_solimp[k, 0]
            return float(soft * model.dof_invweight0[model.jnt_dofadr[joint]] / s)
    return 0.0


def row_relaxation_s(model: mujoco.MjModel, equality: str) -> float:
    """Relaxation time of the spring of a row, computed from the compiled model [s]."""
    stiffness, damping = -model.eq_solref[model.equality(equality).id]
    return float(damping / stiffness)


def row_mass_kg(model: mujoco.MjModel, equality: str) -> float:
    """Inertia that a spring row adds to the bodies on its slide, computed from the compiled model [kg]."""
    row = model.equality(equality).id
    impedance, dof = float(model.eq_solimp[row, 0]), model.jnt_dofadr[model.eq_obj1id[row]]
    return float(impedance / ((1.0 - impedance) * model.dof_invweight0[dof]))
