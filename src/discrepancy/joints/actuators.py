"""Actuators of a calibrated robot for simulators that train policies: ``actuators.json``.

Keys:

format, version   "mocobot-actuators", 1
joints            {joint: {quantity: {mean, standard_error, range, distribution, unit, source}}}; source is ``logs``
                  for what was fitted, ``map`` or ``model`` for what was given and not fitted
covariance        {rows: list of [joint, quantity], matrix} of what was fitted, null if the calibration has none
not_determined    list of {joint, quantity, unit, prior_range}: what the logs do not tell, with the range before them
                  (null: unlimited). Nothing of it is in the other keys
mjlab             {ideal_pd, dc_motor}: keys of IdealPdActuatorCfg and DcMotorActuatorCfg by joint; timestep_s, by
                  which delays are counted
isaaclab          {implicit, dc_motor, names_before_3_0}: keys of ImplicitActuatorCfg and DCMotorCfg by joint, and
                  older names of limits
missing           {joint: list of keys that these configurations need and that are not determined}

Ranges for domain randomisation come from the posterior: 95 % quantiles of a log-normal distribution of that mean and
standard error; from 0 to two standard errors for a value at its bound of 0; a delay within two standard errors. A delay
counts from the stamp of a command that holds until the next one.

Sources: mujocolab.github.io/mjlab (mjlab.actuator), isaac-sim.github.io/IsaacLab/release/3.0.0 (isaaclab.actuators).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from discrepancy.joints.calibration import ArmCalibration, Parameter
from estimator.arrays import Array
from estimator.files import write_json
from mocobot_logs.joints.joint_log import Drive

NAME, FORMAT, VERSION = "actuators.json", "mocobot-actuators", 1
STEMS: Mapping[str, tuple[str, ...]] = {
    "armature": ("armature",),
    "coulomb_friction": ("coulomb",),
    "viscous_damping": ("viscous",),
    "stiffness": ("position_gain", "kp"),
    "damping": ("velocity_gain", "kd"),
    "effort_limit": ("limit", "effort_limit"),
    "saturation_effort": ("stall",),
    "velocity_limit": ("no_load", "velocity_limit"),
    "delay": ("delay", "command_delay"),
}
"""Quantities, each with the first words of the parameters that are one."""
UNITS: Mapping[str, tuple[str, str]] = {
    "armature": ("kg m^2", "kg"),
    **dict.fromkeys(("viscous_damping", "damping"), ("N m s/rad", "N s/m")),
    **dict.fromkeys(("coulomb_friction", "effort_limit", "saturation_effort"), ("N m", "N")),
    "stiffness": ("N m/rad", "N/m"),
    "velocity_limit": ("rad/s", "m/s"),
    "delay": ("s", "s"),
}
"""Units of hinges and of slides."""
_MOTOR = {"saturation_effort": ("saturation_effort",), "velocity_limit": ("velocity_limit",)}
MJLAB = {
    "armature": ("armature",), "coulomb_friction": ("frictionloss",), "viscous_damping": ("viscous_damping",),
    "stiffness": ("stiffness",), "damping": ("damping",), "effort_limit": ("effort_limit",),
}  # fmt: skip
_ISAAC = {
    "armature": ("armature",), "coulomb_friction": ("friction", "dynamic_friction"),
    "viscous_damping": ("viscous_friction",), "stiffness": ("stiffness",), "damping": ("damping",),
}  # fmt: skip
ISAAC_IMPLICIT = {
    **_ISAAC,
    "effort_limit": ("joint_effort_limit",),
    "velocity_limit": ("joint_velocity_limit",),
}
ISAAC_MOTOR = {
    **_ISAAC, "effort_limit": ("actuator_effort_limit",), "velocity_limit": ("actuator_velocity_limit",),
    "saturation_effort": ("saturation_effort",),
}  # fmt: skip
"""Keys of configurations by quantity."""
BEFORE_3_0 = {
    "joint_effort_limit": "effort_limit_sim", "joint_velocity_limit": "velocity_limit_sim",
    "actuator_effort_limit": "effort_limit", "actuator_velocity_limit": "velocity_limit",
}  # fmt: skip
TORQUE_DELAY = "delay_s"
"""Parameter of the log that says how much later than the motion its torques are."""
_OF_MAP = {
    "stiffness": ("position_gain", 0), "damping": ("velocity_gain", 1), "effort_limit": ("limit", None),
    "delay": ("delay_s", None),
}  # fmt: skip
"""Attributes of a drive by quantity, and columns of ``gain_within``."""
NORMAL_95 = 1.959964


def quantity_of(name: str) -> str | None:
    """Return which quantity of an actuator a parameter such as ``coulomb_Nm`` is, None if it is none."""
    of = {stem: quantity for quantity, stems in STEMS.items() for stem in stems}
    return next((of[stem] for stem in sorted(of, key=len, reverse=True) if name.startswith(f"{stem}_")), None)


def range_of(quantity: str, mean: float, se: float) -> tuple[list[float], str]:
    """Return a range for domain randomisation and the distribution that it is of."""
    if quantity == "delay":
        return [max(mean - 2.0 * se, 0.0), max(mean + 2.0 * se, 0.0)], "normal, two standard errors"
    if mean <= 0.0:
        return [0.0, 2.0 * se], "half-normal at 0, two standard errors"
    spread = float(np.sqrt(np.log1p((se / mean) ** 2)))
    middle = np.log(mean) - 0.5 * spread**2
    ends = [float(np.exp(middle + side * NORMAL_95 * spread)) for side in (-1.0, 1.0)]
    return ends, "log-normal, 95 %"


def to_dict(
    found: ArmCalibration, drives: Sequence[Drive] = (), covariance: Array | None = None
) -> dict[str, Any]:
    """Return plain JSON values; the module's docstring lists the keys.

    Args:
        found: the calibration.
        drives: drives of its logs, which say what was given and not fitted; what differs between logs is left out.
        covariance: posterior covariance of ``found.parameters``, in their order; None: that of ``found``, if any.
    """
    covariance = getattr(found, "covariance", None) if covariance is None else covariance
    joints: dict[str, dict[str, Any]] = {}
    lost, fitted = [], []
    own = {(p.place, quantity_of(p.name)): (k, p) for k, p in enumerate(found.parameters)}
    for j in found.joints:
        name = found.model.joints[j]
        joints[name] = {}
        for quantity, units in UNITS.items():
            unit = units[int(found.model.slides[j])]
            k, p = own.get((name, quantity), (-1, None))
            mean, factor, source = _given(found, drives, j, quantity)
            if p is not None and p.determined:
                # Torques that commands ask for come early, by what the drive lags behind the map's delay.
                value = float(np.nan_to_num(mean)) - p.value if p.name == TORQUE_DELAY else p.value
                ends, kind = range_of(quantity, value, p.se)
                joints[name][quantity] = _entry(value, p.se, ends, kind, unit, "logs")
                fitted.append((k, name, quantity))
                continue
            if p is None and np.isfinite(mean) and factor == 1.0:
                joints[name][quantity] = _entry(mean, 0.0, [mean, mean], "given", unit, source)
                continue
            around = [mean / factor, mean * factor] if factor < np.inf else None
            prior = around if p is None else _prior(p)
            lost.append({"joint": name, "quantity": quantity, "unit": unit, "prior_range": prior})
    at = [k for k, *_ in fitted]
    rows = [[name, quantity] for _, name, quantity in fitted]
    matrix = None if covariance is None else {"rows": rows, "matrix": covariance[np.ix_(at, at)].tolist()}
    return {
        "format": FORMAT,
        "version": VERSION,
        "joints": joints,
        "covariance": matrix,
        "not_determined": lost,
        **_configurations(joints, float(found.model.model.opt.timestep)),
    }


def write(found: ArmCalibration, drives: Sequence[Drive], folder: Path) -> None:
    """Write ``actuators.json`` into an existing folder.

    Raises:
        InputError: the file cannot be written.
    """
    write_json(folder / NAME, to_dict(found, drives))


def _entry(
    mean: float, se: float, ends: Sequence[float], kind: str, unit: str, source: str
) -> dict[str, Any]:
    return {
        "mean": float(mean), "standard_error": se, "range": [*map(float, ends)], "distribution": kind, "unit": unit,
        "source": source,
    }  # fmt: skip


def _prior(p: Parameter) -> list[float]:
    """Range of a parameter before the logs: two prior standard deviations, not below 0."""
    return [max(p.model - 2.0 * p.prior, 0.0), p.model + 2.0 * p.prior]


def _given(found: ArmCalibration, drives: Sequence[Drive], j: int, quantity: str) -> tuple[float, float, str]:
    """Return what map or model say of a quantity that was not fitted: value, factor within which it is, and source."""
    key, gain = _OF_MAP.get(quantity, ("", None))
    told = [float(getattr(d, key)[j]) for d in drives if key and (d.gain_of == "torque" or key == "delay_s")]
    if told and len(told) == len(drives) and np.isfinite(told).all():
        factor = 1.0 if gain is None else max(float(d.gain_within[j, gain]) for d in drives)
        return (told[0], factor, "map") if len(set(told)) == 1 else (np.nan, np.inf, "")
    limit = float(found.model.torque_limit[j]) if quantity == "effort_limit" else np.inf
    return (limit, 1.0, "model") if np.isfinite(limit) else (np.nan, np.inf, "")


def _configurations(joints: Mapping[str, Mapping[str, Any]], timestep_s: float) -> dict[str, Any]:
    """Return the blocks of mjlab and Isaac Lab, and what they lack."""
    mjlab: dict[str, Any] = {"timestep_s": timestep_s, "ideal_pd": {}, "dc_motor": {}}
    isaac: dict[str, Any] = {"implicit": {}, "dc_motor": {}, "names_before_3_0": BEFORE_3_0}
    missing = {}
    for name, own in joints.items():
        means = {quantity: entry["mean"] for quantity, entry in own.items()}
        lags = {}
        if "delay" in own:
            least, most = (end / timestep_s for end in own["delay"]["range"])
            lags = {"delay_min_lag": int(np.floor(least + 1e-9)), "delay_max_lag": int(np.ceil(most - 1e-9))}
        plain = {"target_names_expr": [name], **_keys(MJLAB, means), **lags}
        mjlab["ideal_pd"][name] = plain
        isaac["implicit"][name] = {"joint_names_expr": [name], **_keys(ISAAC_IMPLICIT, means)}
        if all(quantity in means for quantity in _MOTOR):
            mjlab["dc_motor"][name] = {**plain, **_keys(_MOTOR, means)}
            isaac["dc_motor"][name] = {"joint_names_expr": [name], **_keys(ISAAC_MOTOR, means)}
        lacks = [quantity for quantity in ("stiffness", "damping", *_MOTOR) if quantity not in means]
        if lacks:
            missing[name] = lacks
    return {"mjlab": mjlab, "isaaclab": isaac, "missing": missing}


def _keys(names: Mapping[str, Sequence[str]], means: Mapping[str, float]) -> dict[str, float]:
    """Return the keys of a configuration with the means that are known."""
    return {key: means[quantity] for quantity, keys in names.items() if quantity in means for key in keys}
