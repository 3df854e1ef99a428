"""Compliant bases and grasps with a lag, creeping bases, and loose grasps."""

from __future__ import annotations

import math
from typing import ClassVar, cast

import numpy as np
from scipy.ndimage import binary_dilation
from scipy.signal import cont2discrete, lfilter

from discrepancy.team.causes.base import Cause, Shape, stack
from discrepancy.team.causes.friction import in_parts, pieces_while
from discrepancy.team.linear.rest import PLAY_FORCE_N
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arm.dynamics import rate_matrix
from estimator.arm.motion import THETA
from estimator.arrays import Array

RELAXATIONS_S = (0.02, 0.005, 0.06, 0.2)
"""Time constants tried first [s]. Chosen: a factor of about four apart, which Gauss-Newton steps bridge."""

RELAXATION_RANGE_S = (0.001, 0.5)
"""Range of time constants [s]. Derived: shorter ones shift a 1 Hz motion by less than 0.6 %; longer ones are creep."""

RELAXATION_FINER = (0.5, 0.7, 0.85, 1.2, 1.4, 2.0)
"""Factors of a time constant tried next. Chosen."""


class Yielding(Cause):
    """A displacement proportional to force with a first-order lag; the time constant is compliance times damping.

    A moving mass makes the lag second-order: the shape then has ``inertia_s2``, compliance times that mass.
    """

    family = "compliance"
    parameters = ("compliance_m_per_N",)
    tolerances = (1e-7,)
    positive = ("compliance_m_per_N",)
    shapes = tuple({"relaxation_s": time_s} for time_s in RELAXATIONS_S)
    determined: ClassVar = {"relaxation_s": 0.1}
    refined: ClassVar = {"relaxation_s": (RELAXATION_FINER, RELAXATION_RANGE_S)}

    def physical(self, values, context):
        return {"compliance_m_per_N": float(values[0]), **context.shape}


def lagging(force: Array, rate_hz: float, shape: Shape) -> Array:
    """Apply the lag to a force (Q, 3), which is linear between samples and constant before them."""
    below = [shape["relaxation_s"], 1.0]
    if inertia_s2 := shape.get("inertia_s2"):
        below.insert(0, inertia_s2)
    filtered = cast("tuple[Array, Array, float]", cont2discrete(([1.0], below), 1.0 / rate_hz, method="foh"))
    start = force[:1]
    return np.asarray(start + lfilter(np.ravel(filtered[0]), filtered[1], force - start, axis=0), dtype=float)


BASE_INERTIA_SHARES, BASE_INERTIA_FINER = (0.06, 0.25, 1.0), (0.5, 0.7, 1.4, 2.0)
"""Compliance times moving mass over squared time constant, tried first (1/4: critical damping); finer factors."""


class BaseCompliance(Yielding):
    """The base yields to the horizontal reaction force of arm and payload.

    With a large compliance the robot's own mass matters: on 14 um/N, 70 kg oscillate at 5 Hz.
    """

    title = "compliance of {base}"
    at = "robot"
    determined: ClassVar = {**Yielding.determined, "inertia_s2": 0.1}
    refined: ClassVar = {**Yielding.refined, "inertia_s2": (BASE_INERTIA_FINER, (0.0, math.inf))}
    separate = (
        "Vertical forces (lifting against each other) separate a base, which yields sideways, from a grasp."
    )

    def sentence(self, n):
        along = f", {n('mass_kg', 'kg')} moving along" if n.values.get("mass_kg") else ""
        return (
            f"the base gives way horizontally, by {n('compliance_m_per_N', 'um/N', 1e6)}, and follows the force within "
            f"{n('relaxation_s', 'ms', 1e3)}{along}"
        )

    def further(self, shape):
        """Add the robot's mass to the spring; slow forces have the same lag."""
        if "inertia_s2" in shape:
            return []
        shares = BASE_INERTIA_SHARES
        return [{**shape, "inertia_s2": share * shape["relaxation_s"] ** 2} for share in shares]

    def physical(self, values, context):
        given = super().physical(values, context)
        inertia_s2 = given.pop("inertia_s2", 0.0)
        return {**given, "mass_kg": inertia_s2 / (given["compliance_m_per_N"] or np.inf)}

    def columns(self, trial, robot, joint, shape):
        mass_kg = trial.design.wrist_mass_kg + 1.5 * trial.design.rod_mass_kg
        force = np.einsum("qij,qj->qi", trial.data.R_bi[:, robot], trial.data.wrench[:, robot, 3:])
        force = force + mass_kg * trial.wrist_accelerations[:, robot]
        horizontal = lagging(-force * np.array([1.0, 1.0, 0.0]), trial.signals.rate_hz, shape)
        return stack([trial.of_pose(robot, None, horizontal @ trial.bases.R[robot].T)])


CREEP_STARTS = 100
"""Number of distinguishable start times. Derived: three bases, each a minute in steps of 2 s."""

CREEP_STEP_S = 0.5
"""Step of finite differences by the start time [s]. Chosen: half a second changes the path little."""

CREEP_FINER_S = (-2.0, -1.0, -0.5, -0.25, 0.25, 0.5, 1.0, 2.0)
"""Changes of a start time tried next [s]. Chosen."""

CREEP_STARTS_S = tuple(3.0 * k for k in range(1, 31))
"""Start times of creep within a trial, tried first [s]. Chosen: trials last less than a minute and a half."""


class BaseCreep(Cause):
    """The base moves at constant velocity (x, y in its own axes) during a trial; with ``start_s`` only from then on."""

    title = "creep of {base}"
    family = "base_creep"
    parameters = ("x_mps", "y_mps")
    tolerances = (2e-8, 2e-8)
    at = "robot"
    determined: ClassVar = {"start_s": CREEP_STEP_S}
    absolute = ("start_s",)
    separate = "A longer recording at rest."

    def sentence(self, n):
        start = f" from {n('start_s', 's')} into a trial" if n.values.get("start_s") else ""
        return (
            f"the base creeps over the floor{start}, by {n('x_mps', 'um/min', 6e7, signed=True)} along its x axis and "
            f"{n('y_mps', 'um/min', 6e7, signed=True)} along its y axis"
        )

    def further(self, shape):
        return [] if shape else [{"start_s": start_s} for start_s in CREEP_STARTS_S]

    def finer(self, shape):
        starts_s = [shape["start_s"] + x for x in CREEP_FINER_S] if shape else []
        return [{"start_s": start_s} for start_s in starts_s if start_s > 0.0]

    def alike(self, shape):
        return CREEP_STARTS if shape else self.among

    def physical(self, values, context):
        return super().physical(values, context) | {"start_s": context.shape.get("start_s", 0.0)}

    def columns(self, trial, robot, joint, shape):
        # Count from the start of the recording, even in a later part. The base poses absorb a constant.
        since = shape.get("start_s", trial.signals.time[0])
        time = np.maximum(0.0, trial.signals.time - since)
        axes = trial.bases.R[robot].T[:2]
        return stack([trial.of_pose(robot, None, np.outer(time, axis)) for axis in axes])


GRASP_TURNS_FINER, GRASP_TURNS_RANGE_M = (0.5, 0.7, 1.4, 2.0), (0.01, 0.3)
"""Factors of that offset tried next, and its range [m]. Derived: the rotation about a nearer pivot is negligible."""

GRASP_TURNS_M = (0.05, -0.05)
"""Positions of the pivot along the grasp's axis from the gimbal's centre, tried first [m]. Chosen."""


class GraspFlex(Yielding):
    """The payload's grasp yields against the flange under the force on the payload.

    It may also rotate, about a pivot on the grasp's axis at ``offset_m`` from the gimbal's centre (along z of {i}). The
    gimbal transmits no moment, so the moment about the pivot is its distance times the transverse force.
    ``turning_rad_per_N`` is rotational compliance times distance. Without ``offset_m`` the grasp does not rotate.
    """

    title = "compliance of {grasp}"
    parameters = ("compliance_m_per_N", "turning_rad_per_N")
    tolerances = (1e-7, 1e-6)  # second: bolts 7 cm apart with the same compliance, 5 cm from the gimbal
    positive = ("compliance_m_per_N", "turning_rad_per_N")
    clipped = ("turning_rad_per_N",)
    at = "grasp"
    shapes = (
        *({"relaxation_s": time_s} for time_s in sorted(RELAXATIONS_S)),  # no large mass moves along
        *({"relaxation_s": min(RELAXATIONS_S), "offset_m": offset_m} for offset_m in GRASP_TURNS_M),
    )
    determined: ClassVar = {**Yielding.determined, "offset_m": 0.1}
    refined: ClassVar = {**Yielding.refined, "offset_m": (GRASP_TURNS_FINER, GRASP_TURNS_RANGE_M)}
    separate = (
        "Vertical forces (lifting against each other) separate a grasp from a base, which yields sideways."
    )

    def sentence(self, n):
        turns = ""
        if n.values.get("offset_m"):
            turns = f", turns by {n('turning_rad_per_N', 'mrad/N', 1e3)} of force across it about a point "
            turns += f"{n('offset_m', 'mm', 1e3, signed=True)} along its axis from the gimbal's centre"
        gives = f"gives way by {n('compliance_m_per_N', 'um/N', 1e6)}{turns}"
        return (
            f"the grasp is flexible: it {gives}, and follows the force within {n('relaxation_s', 'ms', 1e3)}"
        )

    def columns(self, trial, robot, joint, shape):
        R_bi, to_b1 = trial.data.R_bi[:, robot], trial.bases.R[robot]
        # The springs turn with the payload, and so does their lag.
        force = lagging(trial.data.wrench[:, robot, 3:], trial.signals.rate_hz, shape)
        gives = _moved(trial, robot, to_b1 @ R_bi, -force)
        turns = np.zeros_like(gives)
        if "offset_m" in shape:
            offset_m = shape["offset_m"]
            across = force * [1.0, 1.0, 0.0]
            turned = np.sign(offset_m) * np.cross([0.0, 0.0, 1.0], force)  # of the payload
            # The gimbal reads its own side of the grasp, which has not turned.
            angles = np.linalg.solve(rate_matrix(trial.s[:, robot, THETA]), turned[..., None])[..., 0]
            turns = _moved(trial, robot, to_b1 @ R_bi, -abs(offset_m) * across)
            turns += trial.of_signals(robot, theta=-angles)
        return stack([gives, turns])

    def physical(self, values, context):
        offset_m = context.shape.get("offset_m", 0.0)
        turning = float(values[1]) if offset_m else 0.0
        return super().physical(values, context) | {"turning_rad_per_N": turning, "offset_m": offset_m}


def _moved(trial: TrialLinear, robot: int, R_b1i: Array, by: Array) -> Array:
    """Residual rows of a grasp displaced along the axes of {i}, shape (Q, 3)."""
    return trial.of_pose(robot, None, np.einsum("qij,qj->qi", R_b1i, by))


PLAY_COLUMNS_AT_A_TIME = 16
"""Columns of the travel within the play that are computed at a time. Chosen: limits memory."""

PLAY_CONTACT_PER_N = 0.02
"""Step of finite differences: share of the play by which its ends yield per newton. Chosen."""

PLAY_OPEN_KNOTS_S = 0.05
"""Time between knots of the travel within the play [s]. Derived: faster travel does not pass the rows' filter."""

PLAY_OPEN_N, PLAY_OPEN_S = 1.0, 0.03
"""Force below which a loose payload may travel [N]; time around that by which filters spread the force [s]. Chosen."""


class GraspPlay(Cause):
    """The force presses the payload against one end of its play on every axis of {i}.

    Below ``force_N`` the payload may be anywhere between the ends. With ``contact_per_N`` in the shape, the ends also
    yield to the force, by that share of the play.
    """

    title = "play in {grasp}"
    family = "compliance"
    parameters = ("play_m",)
    tolerances = (3e-6,)
    at = "grasp"
    shapes = ({"force_N": PLAY_FORCE_N}, {"force_N": PLAY_FORCE_N, "contact_per_N": 0.0})
    determined: ClassVar = {"contact_per_N": PLAY_CONTACT_PER_N}
    absolute = ("contact_per_N",)
    positive = ("play_m",)
    separate = "Internal forces of both signs at rest separate play from flexibility."

    def sentence(self, n):
        behind = ""
        if n.values.get("contact_m_per_N"):
            behind = f", and gives way by {n('contact_m_per_N', 'nm/N', 1e9)} behind"
        return f"the grasp is loose by +-({n('play_m', 'um', 1e6)}) along each axis{behind}"

    def physical(self, values, context):
        play_m = float(values[0])
        return {"play_m": play_m, "contact_m_per_N": play_m * context.shape.get("contact_per_N", 0.0)}

    def columns(self, trial, robot, joint, shape):
        force = trial.data.wrench[:, robot, 3:]
        end = np.clip(force / shape["force_N"], -1.0, 1.0)
        behind = shape.get("contact_per_N", 0.0) * force
        return stack([displaced(trial, robot, -end - behind, force)])

    def unknowns(self, trial, robot, joint, shape):
        force, rate_hz = trial.data.wrench[:, robot, 3:], trial.signals.rate_hz
        around = np.ones(2 * math.ceil(PLAY_OPEN_S * rate_hz) + 1, dtype=bool)
        columns = []
        for axis in range(3):
            small = np.abs(force[:, axis]) < PLAY_OPEN_N
            loose = np.asarray(binary_dilation(small, around), dtype=np.bool_)
            places = in_parts(pieces_while(loose, rate_hz, PLAY_OPEN_KNOTS_S), PLAY_COLUMNS_AT_A_TIME)
            along = trial.data.R_bi[:, robot, :, axis] @ trial.bases.R[robot].T
            columns.append(trial.of_shifts(robot, along, places))
        return columns[0].beside(columns[1:])


def displaced(trial: TrialLinear, robot: int, offset: Array, force: Array) -> Array:
    """Residual rows of an offset of the grasp in {i} under a force in {i} [N], shape (Q, 3) each.

    The force still acts at the gimbal's centre, from which the payload is now offset.
    """
    in_b = np.einsum("qij,qj->qi", trial.data.R_bi[:, robot], offset)
    moment = np.cross(force, offset) @ trial.shared.grasps.R_1i[robot].T
    rows = trial.of_pose(robot, None, in_b @ trial.bases.R[robot].T)
    return np.asarray(rows + trial.of_wrench(np.zeros_like(moment), moment))
