"""A calibration as strict JSON: plain types, no NaN, units in the keys; null is what is not known.

format, version            "mocobot-calibration", 1
robots                     N
design                     what the robots are off from: keys of models/omnid/design.toml
deviations                 list of N objects, one a robot, with the keys phi_zero_rad [3: legs], theta_zero_rad [3: z,
                           y, x], radius_m [3: legs], proximal_length_m [3], rod_length_m [3], stiffness_ratio [3],
                           tau_zero_Nm [3], tilt_rad [2: x, y], proximal_mass_ratio [3], rod_mass_ratio [3],
                           wrist_mass_ratio [1]; each {value, se, prior_se, by_scale}, lists of that length. Zeros are
                           reading minus truth, all others as built minus design; a radius is the base's minus the
                           platform's. ``se`` includes the uncertainty of a held spring scale; prior_se 0 marks what
                           was held; by_scale is the derivative by the common spring scale
covariance                 {names, matrix}: of the deviations that are not exactly known, the spring scale held; SI
scale_sd                   standard deviation of the common spring scale [-]; 0 where a known weight decided it
prior                      {encoder_zero_rad, geometry_m, stiffness_ratio, tau_zero_Nm, tilt_rad, arm_mass_ratio,
                           arm_weight_ratio}: standard deviations assumed of robots beforehand
payloads                   list of
    label                  or null
    grasps                 list of {i, R_axis_angle_deg [3], R_se_deg [3], p_m [3], p_se_m [3]} for i = 2..N: {i} in {1}
    m_kg, m_se_kg, p_1c_m [3], p_1c_se_m [3], I_b_kgm2 [3 x 3], I_b_se_kgm2 [3 x 3], principal_kgm2 [3],
    principal_se_kgm2 [3]  mass, centre of mass in {1}, inertia about it in the axes of {1}, and its principal moments
    parameters             {m_kg, mp_1c_kgm [3], J_1_kgm2 [6]: xx, xy, xz, yy, yz, zz about the origin of {1}}
    covariance             of (d_2, e_2, ...) as in ``GraspEstimate`` and the parameters, 6 (N - 1) + 10 square
    by_scale               derivative of the same by the common spring scale
trials                     list of
    name, kind             the recording's; "random", "periodic", "static" or "free" (with nothing in the hands)
    payload                index into payloads from 0; null for a free one
    duration_s             evaluated length
    count                  {loops, balance}: numbers compared
    chi2_per_n             {before, after, held_out}: with the robots as designed, with the calibration, with one from
                           all other recordings; each {loops, balance}, or null where it cannot be had
    bases                  list of {i, yaw_deg, p_m [3]} for i = 2..N: bases in {b1}; null for a free one
    shares                 {kind: its share in what is known of it}, by the names of the deviations without unit,
                           "grasps" and "inertial_parameters"; the rest up to 1 is the prior's and that of known weights
known_mass                 labels of payloads whose weight was known
steps                      Gauss-Newton steps
findings                   sentences: what to know before trusting the numbers
open                       sentences: what these recordings do not decide, and what would

frames                     {defined_by, theta_x_zero_sd_deg}: "encoders", each {i} turned about its x axis by the zero
                           of that theta_x, of which a standard deviation is assumed; or "drawing", and 0

Files add ``provenance`` (``mocobot.results``); readers ignore it, ``frames`` and any other key at the top.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arm.design import OmnidDesign
from estimator.arm.unit import AT, COUNT, GROUPS, ArmUnit
from estimator.arm.units_json import key_of
from estimator.arrays import Array
from estimator.calibrate.calibration import CalibratedPayload, CalibratedTrial, Calibration
from estimator.calibrate.outcome.carried import carried, grasps_of
from estimator.calibrate.prior import Prior
from estimator.errors import InputError
from estimator.estimate.grasp_estimate import GraspEstimate
from estimator.rigid_team.residual import Bases
from estimator.strict import Fields


def by_robot(
    read: Fields, key: str, N: int, keys: tuple[str, ...], more: tuple[str, ...] = ()
) -> list[Fields]:
    """Entries for robots 2 to N, in order.

    Args:
        read: the object with the list.
        key: of the list.
        N: number of robots.
        keys: of an entry, ``i`` among them.
        more: keys that it may have besides.

    Raises:
        InputError: there are not so many, or one is of another robot.
    """
    out = []
    for k, entry in enumerate(read.list(key, N - 1), 1):
        one = Fields(entry, keys, f"{read.where}: {key}[{k}]", more)
        if one.values["i"] != k + 1:
            one.refuse("i", f"{k + 1}")
        out.append(one)
    return out


PAYLOAD_KEYS = ("label", "grasps", "parameters", "covariance", "by_scale")
DERIVED = (
    "m_kg", "m_se_kg", "p_1c_m", "p_1c_se_m", "I_b_kgm2", "I_b_se_kgm2", "principal_kgm2", "principal_se_kgm2",
)  # fmt: skip
GRASP, PARAMETERS = ("i", "R_axis_angle_deg", "p_m"), ("m_kg", "mp_1c_kgm", "J_1_kgm2")


def payload_to_dict(payload: CalibratedPayload, scale_sd: float) -> dict[str, Any]:
    """Plain values of a payload; standard errors include that of a held spring scale."""
    grasps, whole, about = grasps_of(payload, scale_sd), carried(payload, scale_sd), payload.parameters
    pairs = [grasps.pair(1, j) for j in range(2, grasps.robots + 1)]
    return {
        "label": payload.label,
        "grasps": [
            {
                "i": pair.j,
                "R_axis_angle_deg": np.rad2deg(pair.axis_angle_rad).tolist(),
                "R_se_deg": np.rad2deg(pair.axis_angle_se_rad).tolist(),
                "p_m": pair.p_ij.tolist(),
                "p_se_m": pair.p_se_m.tolist(),
            }
            for pair in pairs
        ],
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


def payload_from_dict(entry: Any, N: int, where: str) -> CalibratedPayload:
    """Inverse of ``payload_to_dict``, for N robots; ``where`` is how messages call it.

    Raises:
        InputError: something is missing or not allowed.
    """
    read = Fields(entry, PAYLOAD_KEYS, where, DERIVED)
    label = None if read.values["label"] is None else read.words("label")
    R, p, count = np.tile(np.eye(3), (N, 1, 1)), np.zeros((N, 3)), 6 * (N - 1)
    for i, one in enumerate(by_robot(read, "grasps", N, GRASP, ("R_se_deg", "p_se_m")), 1):
        R[i] = Rotation.from_rotvec(one.array("R_axis_angle_deg", (3,)), degrees=True).as_matrix()
        p[i] = one.array("p_m", (3,))
    inner = read.within("parameters", PARAMETERS)
    parameters = np.concatenate(
        [[inner.number("m_kg", above=0.0)], inner.array("mp_1c_kgm", (3,)), inner.array("J_1_kgm2", (6,))]
    )
    covariance = read.array("covariance", (count + 10, count + 10))
    pairs, each = np.full((N, N), np.nan), np.full(N, np.nan)  # a calibration has no residuals of twists
    grasps = GraspEstimate(R, p, covariance[:count, :count], pairs, pairs, each, each)
    return CalibratedPayload(label, grasps, parameters, covariance, read.array("by_scale", (count + 10,)))


TRIAL_KEYS = ("name", "kind", "payload", "duration_s", "count", "chi2_per_n", "bases")
BASE, FITS, PAIR = ("i", "yaw_deg", "p_m"), ("before", "after", "held_out"), ("loops", "balance")
SHARED = (*(group.name for group in GROUPS), "grasps", "inertial_parameters")
KINDS = ("random", "periodic", "static", "free")


def trial_to_dict(trial: CalibratedTrial) -> dict[str, Any]:
    """Plain values of a trial."""
    bases = trial.bases
    return {
        "name": trial.name,
        "kind": trial.kind,
        "payload": trial.payload,
        "duration_s": float(trial.duration_s),
        "count": dict(zip(PAIR, trial.count, strict=True)),
        "chi2_per_n": {
            "before": _fit(trial.before, trial.count),
            "after": _fit(trial.after, trial.count),
            "held_out": _fit(trial.held_out, trial.count),
        },
        "bases": bases
        and [
            {"i": i + 1, "yaw_deg": float(np.rad2deg(np.arctan2(R[1, 0], R[0, 0]))), "p_m": p.tolist()}
            for i, (R, p) in enumerate(zip(bases.R, bases.p, strict=True))
            if i
        ],
        "shares": {name: float(share) for name, share in trial.shares.items()},
    }


def _fit(pair: tuple[float, float] | None, count: tuple[int, int]) -> dict[str, float | None] | None:
    if pair is None:
        return None
    return {name: float(v) if n else None for name, v, n in zip(PAIR, pair, count, strict=True)}


def trial_from_dict(entry: Any, N: int, payloads: int, where: str) -> CalibratedTrial:
    """Inverse of ``trial_to_dict``, for N robots and so many payloads; ``where`` is how messages call it.

    Raises:
        InputError: something is missing or not allowed.
    """
    read = Fields(entry, TRIAL_KEYS, where, ("shares",))
    payload = None if read.values["payload"] is None else read.whole("payload", 0)
    if payload is not None and payload >= payloads:
        read.refuse("payload", f"the index, from 0, of one of {payloads} payloads")
    count = read.within("count", PAIR)
    fits = read.within("chi2_per_n", FITS)
    after = _read_fit(fits, "after")
    if after is None:
        fits.refuse("after", "an object")
    return CalibratedTrial(
        name=read.words("name"),
        kind=read.one_of("kind", KINDS),
        payload=payload,
        duration_s=read.number("duration_s", 0.0),
        count=(count.whole("loops", 0), count.whole("balance", 0)),
        before=_read_fit(fits, "before"),
        after=after,
        held_out=_read_fit(fits, "held_out"),
        bases=None if read.values["bases"] is None else _read_bases(read, N),
        shares=_read_shares(read),
    )


def _read_fit(fits: Fields, key: str) -> tuple[float, float] | None:
    if fits.values[key] is None:
        return None
    inner = fits.within(key, PAIR)
    loops, balance = (None if inner.values[name] is None else inner.number(name, 0.0) for name in PAIR)
    return loops or 0.0, balance or 0.0


def _read_shares(read: Fields) -> dict[str, float]:
    if "shares" not in read:
        return {}
    inner = Fields(read.object("shares"), (), f"{read.where}: shares", SHARED)
    return {name: inner.number(name, 0.0) for name in inner.values}


def _read_bases(read: Fields, N: int) -> Bases:
    R, p = np.tile(np.eye(3), (N, 1, 1)), np.zeros((N, 3))
    for i, one in enumerate(by_robot(read, "bases", N, BASE), 1):
        R[i] = Rotation.from_euler("z", one.number("yaw_deg"), degrees=True).as_matrix()
        p[i] = one.array("p_m", (3,))
    return Bases(R, p)


FORMAT, VERSION = "mocobot-calibration", 1
KEYS = (
    "format", "version", "robots", "design", "deviations", "covariance", "scale_sd", "prior", "payloads", "trials",
    "known_mass", "steps", "findings", "open",
)  # fmt: skip


def deviation_names(robots: int) -> list[str]:
    """``omnid1.phi_zero1`` and so on: a name for every entry of ``ArmUnit.x``, robot by robot."""
    return [
        f"omnid{robot}.{group.name}{entry}"
        for robot in range(1, robots + 1)
        for group in GROUPS
        for entry in group.entries
    ]


def calibration_to_dict(calibration: Calibration) -> dict[str, Any]:
    """A calibration as documented at the head of this module."""
    names = deviation_names(calibration.robots)
    free = np.flatnonzero(np.diag(calibration.covariance) > 0)
    return {
        "format": FORMAT,
        "version": VERSION,
        "robots": calibration.robots,
        "design": calibration.design.to_dict(),
        "deviations": [_deviations(calibration, robot) for robot in range(calibration.robots)],
        "covariance": {
            "names": [names[k] for k in free],
            "matrix": calibration.covariance[np.ix_(free, free)].tolist(),
        },
        "scale_sd": float(calibration.scale_sd),
        "prior": {name: float(value) for name, value in asdict(calibration.prior).items()},
        "payloads": [payload_to_dict(payload, calibration.scale_sd) for payload in calibration.payloads],
        "trials": [trial_to_dict(trial) for trial in calibration.trials],
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
    """Inverse of ``calibration_to_dict``.

    Args:
        values: the object; keys besides the documented ones are ignored at its top.
        where: how messages call it, such as the file's name.

    Raises:
        InputError: it is not a calibration, of another version, or not whole; the sentence names the key.
    """
    given = values if isinstance(values, Mapping) else {}
    if given.get("format") != FORMAT or type(given.get("version")) is not int or given["version"] != VERSION:
        raise InputError(
            f"{where}: not a calibration: it must have format {FORMAT!r} and version {VERSION}, as "
            "mocobot calibrate writes it"
        )
    read = Fields({key: value for key, value in values.items() if key in KEYS}, KEYS, where)
    N = read.whole("robots")
    design = OmnidDesign.from_dict(read.object("design"), f"{where}: design")
    x, by_scale = _read_deviations(read, N)
    prior_names = tuple(field.name for field in fields(Prior))
    prior = read.within("prior", prior_names)
    payloads = tuple(
        payload_from_dict(entry, N, f"{where}: payloads[{k}]")
        for k, entry in enumerate(read.list("payloads"), 1)
    )
    trials = tuple(
        trial_from_dict(entry, N, len(payloads), f"{where}: trials[{k}]")
        for k, entry in enumerate(read.list("trials"), 1)
    )
    return Calibration(
        units=ArmUnit(design, x),
        covariance=_read_covariance(read, N),
        by_scale=by_scale,
        scale_sd=read.number("scale_sd", 0.0),
        prior=Prior(**{name: prior.number(name, 0.0) for name in prior_names}),
        payloads=payloads,
        trials=trials,
        known_mass=_texts(read, "known_mass"),
        steps=read.whole("steps", 0),
        findings=_texts(read, "findings"),
        open=_texts(read, "open"),
    )


def _deviations(calibration: Calibration, robot: int) -> dict[str, dict[str, list[float]]]:
    parts = {
        "value": calibration.units.x[robot],
        "se": calibration.sd[robot],
        "prior_se": calibration.prior_sd[robot],
        "by_scale": calibration.by_scale[robot],
    }
    return {
        key_of(group): {name: part[AT[group.name]].tolist() for name, part in parts.items()}
        for group in GROUPS
    }


def _read_deviations(read: Fields, N: int) -> tuple[Array, Array]:
    x, by_scale = np.zeros((N, COUNT)), np.zeros((N, COUNT))
    for robot, entry in enumerate(read.list("deviations", N)):
        unit = Fields(entry, [key_of(group) for group in GROUPS], f"{read.where}: deviations[{robot + 1}]")
        for group in GROUPS:
            part = unit.within(key_of(group), ("value", "se", "prior_se", "by_scale"))
            shape = (len(group.entries),)
            x[robot, AT[group.name]] = part.array("value", shape)
            by_scale[robot, AT[group.name]] = part.array("by_scale", shape)
    return x, by_scale


def _read_covariance(read: Fields, N: int) -> Array:
    inner, known = read.within("covariance", ("names", "matrix")), deviation_names(N)
    names = inner.list("names")
    if len(set(map(str, names))) != len(names) or not set(map(str, names)) <= set(known):
        inner.refuse("names", f"deviations, each once, such as {known[0]!r}")
    at = [known.index(name) for name in names]
    out = np.zeros((N * COUNT, N * COUNT))
    out[np.ix_(at, at)] = inner.array("matrix", (len(at), len(at)))
    return out


def _texts(read: Fields, key: str) -> tuple[str, ...]:
    values = read.list(key)
    if not all(isinstance(value, str) for value in values):
        read.refuse(key, "a list of texts")
    return tuple(values)
