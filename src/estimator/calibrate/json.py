"""Read and write a calibration as strict JSON: plain types, no NaN, units in the keys; null is unknown.

format, version            "mocobot-calibration", 1
robots                     N
design                     reference of the deviations: keys of models/omnid/design.toml
deviations                 list of N objects, one per robot, with the keys phi_zero_rad [3: legs], theta_zero_rad [3: z,
                           y, x], radius_m [3: legs], proximal_length_m [3], rod_length_m [3], stiffness_ratio [3],
                           tau_zero_Nm [3], tilt_rad [2: x, y], proximal_mass_ratio [3], rod_mass_ratio [3],
                           wrist_mass_ratio [1]; each {value, se, prior_se, by_scale}, lists of that length. Zeros are
                           reading minus truth, all others as built minus design; a radius is the base's minus the
                           platform's. ``se`` includes the uncertainty of a held spring scale; prior_se 0 marks a held
                           deviation; by_scale is the derivative by the common spring scale
covariance                 {names, matrix}: of the deviations that are not held, with the spring scale held; SI
scale_sd                   standard deviation of the common spring scale [-]; 0 if a known weight determined it
prior                      {encoder_zero_rad, geometry_m, stiffness_ratio, tau_zero_Nm, tilt_rad, arm_mass_ratio,
                           arm_weight_ratio}: prior standard deviations of the robots
payloads                   list of
    label                  or null
    grasps                 list of {i, R_axis_angle_deg [3], R_se_deg [3], p_m [3], p_se_m [3]} for i = 2..N: {i} in {1}
    m_kg, m_se_kg, p_1c_m [3], p_1c_se_m [3], I_b_kgm2 [3 x 3], I_b_se_kgm2 [3 x 3], principal_kgm2 [3],
    principal_se_kgm2 [3]  mass, centre of mass in {1}, inertia about it in the axes of {1}, and its principal moments
    parameters             {m_kg, mp_1c_kgm [3], J_1_kgm2 [6]: xx, xy, xz, yy, yz, zz about the origin of {1}}
    covariance             of (d_2, e_2, ...) as in ``GraspEstimate`` and the parameters, 6 (N - 1) + 10 square
    by_scale               derivative of these unknowns by the common spring scale
trials                     list of
    name, kind             name of the recording; "random", "periodic", "static" or "free" (unloaded)
    payload                index into payloads from 0; null for a free one
    duration_s             evaluated length
    count                  {loops, balance}: number of residuals
    chi2_per_n             {before, after, held_out}: with the robots as designed, with the calibration, with one from
                           all other recordings; each {loops, balance}, or null if not available
    bases                  list of {i, yaw_deg, p_m [3]} for i = 2..N: bases in {b1}; null for a free one
    shares                 {kind: share of the recording in the information on it}, by the names of the deviations
                           without unit, "grasps" and "inertial_parameters"; the rest up to 1 belongs to the prior and
                           to known weights
known_mass                 labels of payloads with known weight
steps                      Gauss-Newton steps
findings                   sentences: caveats on the numbers
open                       sentences: what these recordings do not determine, and what would

frames                     {defined_by, theta_x_zero_sd_deg}: "encoders" if each {i} is turned about its x axis by the
                           zero of that theta_x, with its assumed standard deviation; or "drawing", and 0

Files add ``provenance`` (``mocobot.results``); readers ignore it, ``frames`` and any other top-level key.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, fields
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arm.design import OmnidDesign
from estimator.arm.unit import AT, COUNT, GROUPS, ArmUnit
from estimator.arrays import Array
from estimator.calibrate.calibration import (
    GRASPS,
    INERTIAL,
    CalibratedPayload,
    CalibratedTrial,
    Calibration,
    carried,
    deviation_names,
    grasps_of,
)
from estimator.calibrate.prior import Prior
from estimator.errors import InputError
from estimator.estimate.grasps import GraspEstimate
from estimator.rigid_team import Bases
from estimator.strict import Fields

FORMAT, VERSION = "mocobot-calibration", 1
_KEYS = (
    "format", "version", "robots", "design", "deviations", "covariance", "scale_sd", "prior", "payloads", "trials",
    "known_mass", "steps", "findings", "open",
)  # fmt: skip
_PAYLOAD = ("label", "grasps", "parameters", "covariance", "by_scale")
_DERIVED = (
    "m_kg", "m_se_kg", "p_1c_m", "p_1c_se_m", "I_b_kgm2", "I_b_se_kgm2", "principal_kgm2", "principal_se_kgm2",
)  # fmt: skip
_TRIAL = ("name", "kind", "payload", "duration_s", "count", "chi2_per_n", "bases")
_FITS, _PAIR = ("before", "after", "held_out"), ("loops", "balance")
_SHARED = (*(group.name for group in GROUPS), GRASPS, INERTIAL)
_KINDS = ("random", "periodic", "static", "free")


def calibration_to_dict(calibration: Calibration) -> dict[str, Any]:
    """Convert a calibration to the format documented in this module."""
    names = deviation_names(calibration.robots)
    free = np.flatnonzero(np.diag(calibration.covariance) > 0)
    parts = {
        "value": calibration.units.x,
        "se": calibration.sd,
        "prior_se": calibration.prior_sd,
        "by_scale": calibration.by_scale,
    }
    return {
        "format": FORMAT,
        "version": VERSION,
        "robots": calibration.robots,
        "design": calibration.design.to_dict(),
        "deviations": [
            {
                group.key: {name: part[robot, AT[group.name]].tolist() for name, part in parts.items()}
                for group in GROUPS
            }
            for robot in range(calibration.robots)
        ],
        "covariance": {
            "names": [names[k] for k in free],
            "matrix": calibration.covariance[np.ix_(free, free)].tolist(),
        },
        "scale_sd": float(calibration.scale_sd),
        "prior": {name: float(value) for name, value in asdict(calibration.prior).items()},
        "payloads": [_payload_to_dict(payload, calibration.scale_sd) for payload in calibration.payloads],
        "trials": [_trial_to_dict(trial) for trial in calibration.trials],
        "known_mass": list(calibration.known_mass),
        "steps": int(calibration.steps),
        "findings": list(calibration.findings),
        "open": list(calibration.open),
        "frames": {
            "defined_by": "encoders" if calibration.zero_sd_rad else "drawing",
            "theta_x_zero_sd_deg": float(np.rad2deg(calibration.zero_sd_rad)),
        },
    }


def calibration_from_dict(values: Mapping[str, Any], where: str = "calibration") -> Calibration:
    """Read a calibration: the inverse of ``calibration_to_dict``.

    Args:
        values: the object; other keys at its top level are ignored.
        where: name of the object in messages, such as the file's name.

    Raises:
        InputError: the object is not a calibration, has another version, or is incomplete; the sentence names the key.
    """
    given = values if isinstance(values, Mapping) else {}
    if given.get("format") != FORMAT or type(given.get("version")) is not int or given["version"] != VERSION:
        raise InputError(
            f"{where}: not a calibration: it must have format {FORMAT!r} and version {VERSION}, as "
            "mocobot calibrate writes it"
        )
    read = Fields({key: value for key, value in values.items() if key in _KEYS}, _KEYS, where)
    N = read.whole("robots")
    design = OmnidDesign.from_dict(read.object("design"), f"{where}: design")
    x, by_scale = _deviations(read, N)
    prior_names = tuple(field.name for field in fields(Prior))
    prior = read.within("prior", prior_names)
    payloads = tuple(_payload(one, N) for one in read.objects("payloads", _PAYLOAD, _DERIVED))
    trials = tuple(_trial(one, N, len(payloads)) for one in read.objects("trials", _TRIAL, ("shares",)))
    return Calibration(
        units=ArmUnit(design, x),
        covariance=_covariance(read, N),
        by_scale=by_scale,
        scale_sd=read.number("scale_sd", 0.0),
        prior=Prior(**{name: prior.number(name, 0.0) for name in prior_names}),
        payloads=payloads,
        trials=trials,
        known_mass=read.texts("known_mass"),
        steps=read.whole("steps", 0),
        findings=read.texts("findings"),
        open=read.texts("open"),
    )


def _deviations(read: Fields, N: int) -> tuple[Array, Array]:
    """Read the values and their derivative by the spring scale, shape (N, ``COUNT``) each."""
    x, by_scale = np.zeros((N, COUNT)), np.zeros((N, COUNT))
    for robot, unit in enumerate(read.objects("deviations", [group.key for group in GROUPS], length=N)):
        for group in GROUPS:
            part = unit.within(group.key, ("value", "se", "prior_se", "by_scale"))
            shape = (len(group.entries),)
            x[robot, AT[group.name]] = part.array("value", shape)
            by_scale[robot, AT[group.name]] = part.array("by_scale", shape)
    return x, by_scale


def _covariance(read: Fields, N: int) -> Array:
    inner, known = read.within("covariance", ("names", "matrix")), deviation_names(N)
    names = inner.list("names")
    if len(set(map(str, names))) != len(names) or not set(map(str, names)) <= set(known):
        inner.refuse("names", f"deviations, each once, such as {known[0]!r}")
    at = [known.index(name) for name in names]
    out = np.zeros((N * COUNT, N * COUNT))
    out[np.ix_(at, at)] = inner.array("matrix", (len(at), len(at)))
    return out


def _payload_to_dict(payload: CalibratedPayload, scale_sd: float) -> dict[str, Any]:
    """Convert a payload to plain values; standard errors include that of a held spring scale."""
    grasps, whole, about = grasps_of(payload, scale_sd), carried(payload, scale_sd), payload.parameters
    pairs = [grasps.pair(1, j).to_dict() for j in range(2, grasps.robots + 1)]
    of_pair = ("R_axis_angle_deg", "R_se_deg", "p_m", "p_se_m")
    return {
        "label": payload.label,
        "grasps": [{"i": pair["j"]} | {key: pair[key] for key in of_pair} for pair in pairs],
        "m_kg": whole.mass_kg,
        "m_se_kg": whole.mass_se_kg,
        "p_1c_m": whole.p_1c.tolist(),
        "p_1c_se_m": whole.p_1c_se_m.tolist(),
        "I_b_kgm2": whole.inertia.tolist(),
        "I_b_se_kgm2": whole.inertia_se.tolist(),
        "principal_kgm2": whole.principal.moments.tolist(),
        "principal_se_kgm2": whole.principal.moments_se.tolist(),
        "parameters": {
            "m_kg": float(about[0]),
            "mp_1c_kgm": about[1:4].tolist(),
            "J_1_kgm2": about[4:].tolist(),
        },
        "covariance": payload.covariance.tolist(),
        "by_scale": payload.by_scale.tolist(),
    }


def _payload(read: Fields, N: int) -> CalibratedPayload:
    label = None if read.values["label"] is None else read.words("label")
    R, p, count = np.tile(np.eye(3), (N, 1, 1)), np.zeros((N, 3)), 6 * (N - 1)
    for i, one in _of_robots(read, "grasps", N, ("i", "R_axis_angle_deg", "p_m"), ("R_se_deg", "p_se_m")):
        R[i] = Rotation.from_rotvec(one.array("R_axis_angle_deg", (3,)), degrees=True).as_matrix()
        p[i] = one.array("p_m", (3,))
    inner = read.within("parameters", ("m_kg", "mp_1c_kgm", "J_1_kgm2"))
    parameters = np.concatenate(
        [[inner.number("m_kg", above=0.0)], inner.array("mp_1c_kgm", (3,)), inner.array("J_1_kgm2", (6,))]
    )
    covariance = read.array("covariance", (count + 10, count + 10))
    pairs, each = np.full((N, N), np.nan), np.full(N, np.nan)  # a calibration has no residuals of twists
    grasps = GraspEstimate(R, p, covariance[:count, :count], pairs, pairs, each, each)
    return CalibratedPayload(label, grasps, parameters, covariance, read.array("by_scale", (count + 10,)))


def _trial_to_dict(trial: CalibratedTrial) -> dict[str, Any]:
    bases, count = trial.bases, dict(zip(_PAIR, trial.count, strict=True))
    fits: dict[str, Any] = {}
    for name in _FITS:
        pair = getattr(trial, name)
        fits[name] = pair and {
            key: float(value) if count[key] else None for key, value in zip(_PAIR, pair, strict=True)
        }
    return {
        "name": trial.name,
        "kind": trial.kind,
        "payload": trial.payload,
        "duration_s": float(trial.duration_s),
        "count": count,
        "chi2_per_n": fits,
        "bases": bases
        and [
            {"i": i + 1, "yaw_deg": float(np.rad2deg(np.arctan2(R[1, 0], R[0, 0]))), "p_m": p.tolist()}
            for i, (R, p) in enumerate(zip(bases.R, bases.p, strict=True))
            if i
        ],
        "shares": {name: float(share) for name, share in trial.shares.items()},
    }


def _trial(read: Fields, N: int, payloads: int) -> CalibratedTrial:
    payload = None if read.values["payload"] is None else read.whole("payload", 0)
    if payload is not None and payload >= payloads:
        read.refuse("payload", f"the index, from 0, of one of {payloads} payloads")
    count = read.within("count", _PAIR)
    fits = read.within("chi2_per_n", _FITS)
    before, after, held_out = (_fit(fits, key) for key in _FITS)
    if after is None:
        fits.refuse("after", "an object")
    shares = Fields(read.object("shares"), (), f"{read.where}: shares", _SHARED) if "shares" in read else None
    return CalibratedTrial(
        name=read.words("name"),
        kind=read.one_of("kind", _KINDS),
        payload=payload,
        duration_s=read.number("duration_s", 0.0),
        count=(count.whole("loops", 0), count.whole("balance", 0)),
        before=before,
        after=after,
        held_out=held_out,
        bases=None if read.values["bases"] is None else _bases(read, N),
        shares={name: shares.number(name, 0.0) for name in shares.values} if shares else {},
    )


def _fit(fits: Fields, key: str) -> tuple[float, float] | None:
    if fits.values[key] is None:
        return None
    inner = fits.within(key, _PAIR)
    loops, balance = (None if inner.values[name] is None else inner.number(name, 0.0) for name in _PAIR)
    return loops or 0.0, balance or 0.0


def _bases(read: Fields, N: int) -> Bases:
    R, p = np.tile(np.eye(3), (N, 1, 1)), np.zeros((N, 3))
    for i, one in _of_robots(read, "bases", N, ("i", "yaw_deg", "p_m")):
        R[i] = Rotation.from_euler("z", one.number("yaw_deg"), degrees=True).as_matrix()
        p[i] = one.array("p_m", (3,))
    return Bases(R, p)


def _of_robots(
    read: Fields, key: str, N: int, keys: tuple[str, ...], more: tuple[str, ...] = ()
) -> Iterator[tuple[int, Fields]]:
    """Iterate over list entries for robots 2 to N, with their index from 0; check their key ``i``."""
    for k, one in enumerate(read.objects(key, keys, more, N - 1), 1):
        if one.values["i"] != k + 1:
            one.refuse("i", f"{k + 1}")
        yield k, one
