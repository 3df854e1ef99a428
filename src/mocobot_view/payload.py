"""Grasps, placement, inertial parameters, files and geometry of a payload and its team, for drawing.

No sensor measures the pose of a base, so grasps and joint angles determine the poses of robots and payload. The
origin of the world W lies on the floor under robot 1, with the axes of {b1}. All bases are taken as level, except for
tilts from a calibration.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from estimator import so3
from estimator.arm.unit import Arms, ArmUnit, seen_by_encoders
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.estimate.grasps import single_robot
from estimator.estimate.result import PayloadEstimate
from estimator.recording.model import Recording
from estimator.strict import Fields, read_json
from estimator.two_bodies.result import FORMAT as TWO_BODIES
from estimator.two_bodies.result import TwoBodies
from mocobot_sim.scene.as_built import read_units, theta_x_zeros
from mocobot_sim.scene.models import payload_names
from mocobot_sim.scene.payload import grasp_frames, load_payload
from mocobot_sim.scene.pymjcf import compiled
from mocobot_sim.trial.truth import truth_path
from mocobot_view.shapes import Shape, body_shape, capsule, join

SPACING_M = 1.2
"""Distance between robots that are drawn in a row, because their poses are unknown [m]. Chosen."""


@dataclass(frozen=True)
class Grasps:
    """Grasp frames in {1}, estimated or true."""

    R_1i: Array  # orientations, shape (N, 3, 3)
    p_1i: Array  # positions [m], shape (N, 3)


@dataclass(frozen=True)
class Bases:
    """Base frames {b} in the world."""

    R_Wb: Array  # orientations, rotated only about z unless a tilt is known, shape (N, 3, 3)
    p_Wb: Array  # positions [m], shape (N, 3)


@dataclass(frozen=True)
class PayloadMotion:
    """Motion of the payload's frame {1} in the world, and the gap between each robot's flange and its grasp."""

    R_W1: Array  # orientations, shape (Q, 3, 3)
    p_W1: Array  # positions [m], shape (Q, 3)
    gap_rotation_rad: Array  # angle between flange and grasp frame, shape (Q, N)
    gap_position_m: Array  # distance between them, shape (Q, N)

    @property
    def quaternion(self) -> Array:
        """Orientations as quaternions (x, y, z, w), shape (Q, 4)."""
        return Rotation.from_matrix(self.R_W1).as_quat()


def place_bases(R_bi: Array, p_bi: Array, grasps: Grasps, height_m: float) -> Bases:
    """Compute the poses of the bases from the grasps and the joint angles, averaged over the samples.

    Flanges have orientations (Q, N, 3, 3) and wrists positions (Q, N, 3) [m] in their {b}; {b1} is ``height_m`` high.
    """
    R_b1b, p_b1b = [np.eye(3)], [np.zeros(3)]
    for i in range(1, R_bi.shape[1]):
        turn = so3.chordal_mean(R_bi[:, 0] @ grasps.R_1i[i] @ np.swapaxes(R_bi[:, i], -1, -2))
        yaw = np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])
        R = Rotation.from_rotvec([0.0, 0.0, yaw]).as_matrix()
        R_b1b.append(R)
        p_b1b.append(np.mean(p_bi[:, 0] + R_bi[:, 0] @ grasps.p_1i[i] - p_bi[:, i] @ R.T, axis=0))
    return Bases(np.array(R_b1b), np.array(p_b1b) + np.array([0.0, 0.0, height_m]))


def placed(
    R_bi: Array, p_bi: Array, grasps: Grasps | None, height_m: float, arms: Arms, at: slice = slice(None)
) -> tuple[Bases, PayloadMotion | None]:
    """Compute the poses of the bases as ``place_bases``, and the motion of the payload at the samples ``at``.

    Without grasps, the robots stand in a row and the motion is None. A calibration may state the tilts of the bases.
    """
    motion = None
    if grasps is None:
        places = np.zeros((R_bi.shape[1], 3))
        places[:, 0], places[:, 2] = SPACING_M * np.arange(len(places)), height_m
        bases = Bases(np.tile(np.eye(3), (len(places), 1, 1)), places)
    else:
        bases = place_bases(R_bi, p_bi, grasps, height_m)
        motion = payload_motion(R_bi[at], p_bi[at], grasps, bases)
    if isinstance(arms, ArmUnit) and np.any(arms.of("tilt")):
        bases = Bases(np.asarray(bases.R_Wb @ arms.R_ba), bases.p_Wb)
    return bases, motion


def payload_motion(R_bi: Array, p_bi: Array, grasps: Grasps, bases: Bases) -> PayloadMotion:
    """Compute the pose of the payload as the mean over the poses that each robot implies.

    ``R_bi`` and ``p_bi`` have the shapes that ``place_bases`` expects.
    """
    R_Wi = bases.R_Wb @ R_bi
    p_Wi = np.einsum("nij,qnj->qni", bases.R_Wb, p_bi) + bases.p_Wb
    R_W1 = so3.chordal_mean(np.swapaxes(R_Wi @ np.swapaxes(grasps.R_1i, -1, -2), 0, 1))
    p_W1 = np.mean(p_Wi - np.einsum("qij,nj->qni", R_W1, grasps.p_1i), axis=1)
    held = p_W1[:, None] + np.einsum("qij,nj->qni", R_W1, grasps.p_1i)
    # |R1 - R2|_F = 2 sqrt(2) sin(angle / 2) is accurate for small angles, unlike the arccos formula.
    chord = np.linalg.norm(R_Wi - R_W1[:, None] @ grasps.R_1i, axis=(-2, -1)) / np.sqrt(8.0)
    return PayloadMotion(
        R_W1, p_W1, 2.0 * np.arcsin(np.clip(chord, 0.0, 1.0)), np.linalg.norm(p_Wi - held, axis=-1)
    )


def as_estimated(recording: Recording, estimate: PayloadEstimate | None) -> Recording:
    """Give a recording the robot parameters of its estimate, if it has none itself and they fit."""
    metadata, units = recording.metadata, None if estimate is None else estimate.units
    if units is None or metadata.units is not None:
        return recording
    if units.design != metadata.design or len(units.x) != metadata.robots:
        return recording
    return replace(recording, metadata=replace(metadata, units=units))


THINNEST = 0.02
"""Smallest semi-axis of a drawn inertia ellipsoid relative to the largest, for impossible inertias. Chosen."""


@dataclass(frozen=True)
class BodyFacts:
    """Grasps and inertial parameters of a payload; None marks unknown quantities."""

    grasps: Grasps | None  # grasp frames in {1}
    mass_kg: float | None  # mass
    p_1c: Array | None  # centre of mass in {1} [m], shape (3,)
    R_1c: Array | None  # principal axes in {1}, shape (3, 3)
    principal_kgm2: Array | None  # principal moments, in the order of the axes, shape (3,)
    axes_known: bool = True  # False if two moments are too similar to determine the principal axes

    def semi_axes_m(self) -> Array | None:
        """Return the semi-axes of the uniform solid ellipsoid with this mass and inertia [m], shape (3,), or None.

        I_x = m (b^2 + c^2) / 5, so a^2 = 5 (I_y + I_z - I_x) / (2 m). Moments that violate the triangle inequality
        give a flat ellipsoid.
        """
        if self.mass_kg is None or self.principal_kgm2 is None or not self.mass_kg > 0:
            return None
        squares = 2.5 * (np.sum(self.principal_kgm2) - 2.0 * self.principal_kgm2) / self.mass_kg
        axes = np.sqrt(np.maximum(squares, 0.0))
        return np.maximum(axes, THINNEST * axes.max()) if axes.max() > 0 else None


def held(facts: BodyFacts | None, robots: int) -> Grasps | None:
    """Return the known grasps, or None; a single robot always holds the payload at {1}."""
    if facts is not None and facts.grasps is not None:
        return facts.grasps
    return Grasps(single_robot().R_1i, single_robot().p_1i) if robots == 1 else None


def check_robots(estimate: PayloadEstimate | TwoBodies, recording: Recording) -> None:
    """Refuse an estimate and a recording with different numbers of robots."""
    robots = recording.metadata.robots
    if estimate.robots != robots:
        raise InputError(
            f"the estimate is of {estimate.robots} robots; {recording.name} is of {robots} robots"
        )


def facts_of(estimate: PayloadEstimate) -> BodyFacts:
    """Extract the quantities of an estimate that pictures show."""
    grasps, inertia = estimate.grasps, estimate.inertia
    R_1c = None if inertia is None else inertia.principal.R_1c
    known = R_1c is not None
    if inertia is not None and R_1c is None:
        R_1c = np.linalg.eigh(inertia.inertia)[1]
        R_1c = R_1c * np.sign(np.linalg.det(R_1c))
    return BodyFacts(
        grasps=None if grasps is None else Grasps(grasps.R_1i, grasps.p_1i),
        mass_kg=None if estimate.mass is None else estimate.mass.mass,
        p_1c=estimate.p_1c,
        R_1c=R_1c,
        principal_kgm2=None if inertia is None else inertia.principal.moments,
        axes_known=known,
    )


TRUTH = ("grasps", "mass_kg", "p_1c_m", "R_1c_rotvec_deg", "principal_inertia_kgm2")
"""Keys of the truth that pictures show."""


def read_truth(
    recording: Path, robots: int, estimate: PayloadEstimate | TwoBodies | None = None
) -> BodyFacts:
    """Read the truth beside a simulated recording, in the frames of the estimate if one is given."""
    path = truth_path(recording)
    values = read_json(path, "the truth beside a simulated recording")
    truth = Fields(values, TRUTH, str(path), optional=("as_built", "bodies", "joint", "effects", "control"))
    grasps = values["grasps"]
    if not isinstance(grasps, list) or len(grasps) != robots:
        count = len(grasps) if isinstance(grasps, list) else "no"
        raise InputError(f"{path}: has {count} grasps; {recording} is of {robots} robots")
    each = [
        Fields(entry, ("p_1i_m", "R_1i_rotvec_deg"), f"{path}: grasps[{k}]") for k, entry in enumerate(grasps)
    ]
    R_1c, *R_1i = (
        Rotation.from_rotvec(read.array(key, (3,)), degrees=True).as_matrix()
        for read, key in ((truth, "R_1c_rotvec_deg"), *((entry, "R_1i_rotvec_deg") for entry in each))
    )
    p_1i = np.array([entry.array("p_1i_m", (3,)) for entry in each])
    parts = [np.array(R_1i), p_1i, truth.array("p_1c_m", (3,)), R_1c]
    if isinstance(estimate, PayloadEstimate) and estimate.zero_sd_rad and "as_built" in truth:
        parts = seen_by_encoders(theta_x_zeros(read_units(path), robots), *parts)
    R, p, p_1c, R_1c = parts
    moments = truth.array("principal_inertia_kgm2", (3,))
    return BodyFacts(Grasps(R, p), truth.number("mass_kg"), p_1c, R_1c, moments)


def read_any_estimate(path: Path) -> PayloadEstimate | TwoBodies:
    """Read an estimate of one body or two that ``mocobot estimate --out`` wrote."""
    values = read_json(path, "an estimate")
    if values.get("format") != TWO_BODIES:
        return read_estimate(path)
    try:
        return TwoBodies.from_dict(values)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def read_estimate(path: Path) -> PayloadEstimate:
    """Read an estimate of one body that ``mocobot estimate --out`` wrote."""
    values = read_json(path, "an estimate")
    try:
        estimate = PayloadEstimate.from_dict(values)
        _check(estimate)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    except (IndexError, OverflowError) as error:  # pairs of missing robots, or infinite numbers
        raise InputError(f"{path}: not a complete estimate ({type(error).__name__}: {error})") from error
    return estimate


def _check(estimate: PayloadEstimate) -> None:
    """Check shapes and finiteness of the drawn quantities, which ``PayloadEstimate.from_dict`` does not check."""
    if type(estimate.robots) is not int or estimate.robots < 1:
        raise InputError(f"robots is {estimate.robots!r:.40}; it must be a whole number of at least 1")
    N, grasps, mass, inertia = estimate.robots, estimate.grasps, estimate.mass, estimate.inertia
    principal = inertia and inertia.principal
    facts: tuple[tuple[str, Any, tuple[int, ...]], ...] = (
        ("com.p_1c_m", estimate.p_1c, (3,)),
        ("com.covariance_m2", estimate.p_1c_covariance, (3, 3)),
        ("grasps.R_axis_angle_deg", grasps and grasps.R_1i, (N, 3, 3)),
        ("grasps.p_m", grasps and grasps.p_1i, (N, 3)),
        ("grasps.covariance", grasps and grasps.covariance, (6 * (N - 1),) * 2),
        ("grasps.angular_residual_radps", grasps and grasps.angular_residual_rms, (N, N)),
        ("grasps.linear_residual_mps", grasps and grasps.linear_residual_rms, (N, N)),
        ("mass.m_kg", mass and mass.mass, ()),
        ("mass.m_se_kg", mass and mass.se, ()),
        ("inertia.I_b_kgm2", inertia and inertia.inertia, (3, 3)),
        ("inertia.principal_kgm2", principal and principal.moments, (3,)),
        ("inertia.principal_se_kgm2", principal and principal.moments_se, (3,)),
        ("inertia.R_1c_axis_angle_deg", principal and principal.R_1c, (3, 3)),
    )
    for key, value, shape in facts:
        if value is not None and not _is(value, shape):
            size = " x ".join(map(str, shape)) + " finite numbers" if shape else "a finite number"
            raise InputError(f"{key} must hold {size}")


def _is(value: Any, shape: tuple[int, ...]) -> bool:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        return False
    return array.shape == shape and bool(np.isfinite(array).all())


BAR_M, BAR_RGBA = 0.012, (0.55, 0.60, 0.70, 1.0)
FAR_M, FAR_RAD = 0.1, np.deg2rad(15.0)
"""Largest distance [m] and angle [rad] between estimated grasps and those of a payload's CAD. Chosen."""


def cad_shape(payload: str | Path, robots: int) -> tuple[Shape | None, Grasps]:
    """Load the geometry of a payload (a shipped name or an MJCF) in {1}, and its grasps, one for each robot."""
    root = load_payload(payload)
    frames = grasp_frames(root, str(payload))
    if len(frames) != robots:
        raise InputError(
            f"{payload}: the payload has {len(frames)} grasps; the recording is of {robots} robots"
        )
    model = compiled(root)
    grasps = Grasps(frames.rotation.as_matrix(), frames.translation)
    return body_shape(model, list(range(1, model.nbody))), grasps


def drawn_payload(
    payload: str | Path | None, label: str | None, grasps: Grasps, notes: list[str]
) -> str | Path | None:
    """Choose the payload whose CAD is drawn; None means that bars are drawn. Sentences for the viewer go to ``notes``.

    Without a request (a shipped name or an MJCF), it is the payload of the recording's label, if its grasps fit.
    """
    wanted = payload if payload is not None else label if label in payload_names() else None
    if wanted is None:
        return None
    try:
        elsewhere = held_elsewhere(cad_shape(wanted, len(grasps.p_1i))[1], grasps)
    except InputError as error:
        if payload is not None:
            raise
        elsewhere = str(error)
    if elsewhere is not None:
        how = "not drawn:" if payload is None else "drawn as asked, but"
        notes.append(f"The geometry of payload {str(wanted)!r} is {how} {elsewhere}.")
    return wanted if elsewhere is None or payload is not None else None


def held_elsewhere(cad: Grasps, grasps: Grasps) -> str | None:
    """Describe how the grasps of a CAD contradict the given grasps; None if they agree."""
    X_cad, X = (RigidTransform.from_components(g.p_1i, Rotation.from_matrix(g.R_1i)) for g in (cad, grasps))
    apart = X_cad.inv() * X
    shift, turn = np.linalg.norm(apart.translation, axis=1), apart.rotation.magnitude()
    for i in np.flatnonzero((shift > FAR_M) | (turn > FAR_RAD)):
        return (
            f"grasp {i + 1} is {shift[i]:.2f} m and {np.rad2deg(turn[i]):.0f} deg from where its CAD has it"
        )
    return None


def bars(facts: BodyFacts) -> Shape | None:
    """Make bars from the centre of mass, or else the mean grasp position, to every grasp; None if all coincide."""
    if facts.grasps is None:
        return None
    centre = facts.p_1c if facts.p_1c is not None else facts.grasps.p_1i.mean(axis=0)
    meshes = []
    for p in facts.grasps.p_1i:
        length = float(np.linalg.norm(p - centre))
        if length < BAR_M:
            continue
        turn = Rotation.align_vectors([p - centre], [[0.0, 0.0, 1.0]])[0].as_matrix()
        meshes.append(capsule(BAR_M, 0.5 * length).moved(0.5 * (p + centre), turn))
    return Shape.of(join(meshes), BAR_RGBA) if meshes else None
