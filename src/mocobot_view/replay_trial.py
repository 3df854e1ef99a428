"""Data of the replay of one recording: poses, signals, estimate, truth and diagnosis."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from discrepancy.result.read import WrittenDiagnosis
from estimator.arm.dynamics import rotation
from estimator.arm.unit import levelled, true_joints
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.estimate.payload import estimate_payload
from estimator.estimate.result import PayloadEstimate
from estimator.recording.metadata import FREE
from estimator.recording.model import Recording
from estimator.rigid_team import fuse
from estimator.signals import GraspData, process_recording
from estimator.statistics import rms
from estimator.two_bodies.result import TwoBodies
from mocobot_view.payload import (
    Bases,
    BodyFacts,
    Grasps,
    PayloadMotion,
    as_estimated,
    bars,
    cad_shape,
    check_robots,
    drawn_payload,
    facts_of,
    held,
    placed,
)
from mocobot_view.robot import BodyMotion, body_motion, robot_shapes
from mocobot_view.shapes import Shape
from mocobot_view.two_bodies import TwoBodyMotion, two_body_motion

CUTOFF_HZ, FILTERED_HZ = 5.0, 50.0
"""Cut-off frequency of the low-pass filter, and rate of its stored output [Hz]. Chosen."""


@dataclass(frozen=True)
class Balance:
    """Residuals of the Newton-Euler equations of the payload, in {1}."""

    force: Array  # sum of the forces minus m (a_c + g) [N], shape (P, 3)
    # sum of the moments about the centre of mass minus I alpha + omega x I omega [N m], shape (P, 3), or None without
    # an inertia
    moment: Array | None


def filtered(recording: Recording, notes: list[str]) -> GraspData | None:
    """Compute twists and wrenches as the estimator does, with times from the first sample of the recording.

    The result is decimated to ``FILTERED_HZ``; the filter reduces frequencies that would alias to 1e-4. None if the
    recording is too short; ``notes`` then states the reason.
    """
    try:
        data = process_recording(recording, CUTOFF_HZ)
    except InputError as error:
        notes.append(f"No twists and no wrenches: {error}.")
        return None
    step = max(1, int(data.rate_hz / FILTERED_HZ))
    arrays = {name: getattr(data, name)[::step] for name in ("R_bi", "p_bi", "twist", "twist_dot", "wrench")}
    return replace(data, time=data.time[::step] - recording.time[0], rate_hz=data.rate_hz / step, **arrays)


def balance(data: GraspData, estimate: PayloadEstimate) -> Balance | None:
    """Compute the Newton-Euler residuals; None if grasps, mass or centre of mass are unknown."""
    grasps, mass, p_1c = estimate.grasps, estimate.mass, estimate.p_1c
    if grasps is None or mass is None or p_1c is None:
        return None
    motion = fuse(data, grasps)
    lever = np.cross(motion.alpha, p_1c) + np.cross(motion.omega, np.cross(motion.omega, p_1c))
    weight = data.gravity_mps2 * motion.up
    force = motion.force - mass.mass * (motion.acceleration + lever + weight)
    if estimate.inertia is None:
        return Balance(force, None)
    inertia = estimate.inertia.inertia
    spin = motion.omega @ inertia
    euler = motion.alpha @ inertia + np.cross(motion.omega, spin)
    return Balance(force, motion.moment - np.cross(p_1c, motion.force) - euler)


MISFIT_M, MISFIT_RAD = 0.01, 0.03
"""Rms gaps between flanges and grasps above which the grasps do not fit [m], [rad]. Chosen: uncalibrated robots have
6 mm and 10 mrad."""
BETTER = 3.0
"""Ratio of the gaps, one rigid body over two bodies, above which two are drawn. Chosen, as for the diagnosis."""


@dataclass(frozen=True, eq=False)
class ReplayTrial:
    """Data of the replay of one recording."""

    name: str  # root of its entities, unique among the replays shown together
    recording: Recording
    time: Array  # times since the first sample [s], shape (Q,)
    bodies: BodyMotion  # motion of the robots' bodies
    bases: Bases  # poses of the bases
    motion: PayloadMotion | None  # motion of the payload; None if the grasps are unknown
    shape: Shape | None  # shape of the payload in {1}, or None
    data: GraspData | None  # filtered twists and wrenches, or None
    balance: Balance | None  # Newton-Euler residuals, or None
    estimate: PayloadEstimate | None  # estimate of the payload, or None
    facts: BodyFacts | None  # quantities of the estimate to draw, or None
    truth: BodyFacts | None  # true quantities of the payload to draw, or None
    diagnosis: WrittenDiagnosis | None  # diagnosis of the team, or None
    two: TwoBodyMotion | None  # the payload's two bodies if it is not rigid, or None
    notes: tuple[str, ...]  # sentences for the viewer

    @property
    def robots(self) -> int:
        return self.recording.metadata.robots


def replay_trial(
    recording: Recording,
    name: str,
    estimate: PayloadEstimate | TwoBodies | None = None,
    truth: BodyFacts | None = None,
    diagnosis: WrittenDiagnosis | None = None,
    payload: str | Path | None = None,
) -> ReplayTrial:
    """Compute the data of the replay of a recording.

    Args:
        recording, name: one trial, and the name of its replay.
        estimate: estimate of the payload, of one body or two; None to estimate from this recording, as far as possible.
        truth, diagnosis: true payload, and diagnosis of these robots.
        payload: name or MJCF of the geometry of one rigid payload; None for that of the recording's label.
    """
    given = estimate if isinstance(estimate, TwoBodies) else None
    estimate = None if isinstance(estimate, TwoBodies) else estimate
    recording = as_estimated(recording, estimate)
    meta = recording.metadata
    notes: list[str] = []
    if given is not None:
        check_robots(given, recording)
    if meta.trial == FREE:
        notes.append(
            "The robots hold nothing: they are drawn in a row, without a payload, an estimate or forces on one."
        )
        estimate = truth = None
    else:
        estimate = _given(estimate, recording, notes) if estimate else _estimated(recording, notes, given)
    if diagnosis is not None:
        _check_diagnosis(diagnosis, recording, notes)
    phi, theta, _ = true_joints(meta.arms, recording.phi, recording.theta, recording.tau)
    bodies = body_motion(phi, theta, meta.arms)
    R_bi, wrist = levelled(meta.arms, rotation(theta), bodies.wrist)
    height = robot_shapes(meta.design).base_height_m
    facts = None if estimate is None else facts_of(estimate)
    grasps = held(facts, meta.robots)
    bases, motion = placed(R_bi, wrist, grasps, height, meta.arms)
    two = None
    if meta.trial != FREE and payload is None and given is None and (motion is None or _misfits(motion)):
        two = two_body_motion(recording, R_bi, wrist, height)
    if given is not None and meta.trial != FREE:
        two = two_body_motion(recording, R_bi, wrist, height, given)
    elif two is not None and _misfits(two.first):
        two = None
    if two is not None and motion is not None and given is None:
        gap, left = rms(motion.gap_position_m), rms(two.first.gap_position_m)
        two = two if left < gap / BETTER else None
    if two is not None:
        bases, motion, notes = two.bases, two.first, [two.sentence]
        estimate, facts = None, None  # of one rigid body
    if motion is None and meta.trial != FREE:
        notes.append(
            "The grasps are not known, so neither is where the robots stand: they are drawn in a row, without a "
            "payload. Give an estimate from recordings with motion (--estimate)."
        )
    elif motion is not None and _misfits(motion):
        gap, turn = rms(motion.gap_position_m), rms(motion.gap_rotation_rad)
        notes.append(
            f"The grasps do not fit this recording: flanges and grasps are {1e3 * gap:.0f} mm and "
            f"{1e3 * turn:.0f} mrad apart (rms)."
        )
    data = None if meta.trial == FREE else filtered(recording, notes)
    return ReplayTrial(
        name=name,
        recording=recording,
        time=recording.time - recording.time[0],
        bodies=bodies,
        bases=bases,
        motion=motion,
        shape=_shape(recording, payload, facts, grasps, notes) if two is None else two.shapes[0],
        data=data,
        balance=None if data is None or estimate is None else balance(data, estimate),
        estimate=estimate,
        facts=facts,
        truth=truth,
        diagnosis=diagnosis,
        two=two,
        notes=tuple(notes),
    )


def _misfits(motion: PayloadMotion) -> bool:
    return rms(motion.gap_position_m) > MISFIT_M or rms(motion.gap_rotation_rad) > MISFIT_RAD


def distinct_names(recordings: Sequence[Path]) -> list[str]:
    """Make unique names from file names without suffix, for use in entity paths.

    Every character except letters, digits, dots and hyphens becomes an underscore; equal names get a number.
    """
    names: list[str] = []
    for path in recordings:
        stem = re.sub(r"[^A-Za-z0-9.-]", "_", path.stem)
        stem = re.sub(r"^_+(?=_)", "", stem)  # Rerun reserves names with two leading underscores
        name, k = stem, 1
        while name in names:
            k += 1
            name = f"{stem}-{k}"
        names.append(name)
    return names


def _given(estimate: PayloadEstimate, recording: Recording, notes: list[str]) -> PayloadEstimate:
    label = recording.metadata.payload
    check_robots(estimate, recording)
    if None not in (estimate.payload, label) and estimate.payload != label:
        notes.append(f"The estimate is of payload {estimate.payload!r}; this recording is of {label!r}.")
    return estimate


def _estimated(recording: Recording, notes: list[str], given: TwoBodies | None) -> PayloadEstimate | None:
    if given is not None:
        return None
    try:
        return estimate_payload([recording])
    except InputError as error:
        notes.append(f"Nothing could be estimated from this recording: {error}.")
        return None


def _check_diagnosis(diagnosis: WrittenDiagnosis, recording: Recording, notes: list[str]) -> None:
    if diagnosis.of_joints:
        raise InputError(f"the diagnosis is of one robot's joints; {recording.name} is of a team")
    if diagnosis.robots() > recording.metadata.robots:
        raise InputError(
            f"the diagnosis names robot {diagnosis.robots()}; {recording.name} is of "
            f"{recording.metadata.robots} robots"
        )
    if not diagnosis.is_of(recording.name):
        notes.append(
            f"The diagnosis was made from other recordings ({', '.join(diagnosis.recordings)}), not from this one."
        )


def _shape(
    recording: Recording,
    payload: str | Path | None,
    facts: BodyFacts | None,
    grasps: Grasps | None,
    notes: list[str],
) -> Shape | None:
    """Choose the geometry of the payload: its CAD if that fits the grasps, else bars."""
    meta = recording.metadata
    if grasps is None:
        if payload is not None:
            cad_shape(payload, meta.robots)  # raises InputError if the payload does not fit
        return None
    drawn = drawn_payload(payload, meta.payload, grasps, notes)
    if drawn is not None:
        return cad_shape(drawn, meta.robots)[0]
    return bars(facts or BodyFacts(grasps, None, None, None, None))
