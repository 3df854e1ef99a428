"""Files that say something of a payload: estimates, and the truth beside simulated recordings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from estimator.errors import InputError
from estimator.estimate.result import PayloadEstimate
from mocobot_sim.trial.truth import truth_path
from mocobot_view.facts.body_facts import BodyFacts
from mocobot_view.facts.placement import Grasps

Array = NDArray[np.float64]


def read_truth(recording: Path, robots: int) -> BodyFacts:
    """The truth beside a simulated recording.

    Raises:
        InputError: there is none, or it is not one of as many robots.
    """
    path = truth_path(recording)
    values = read_json(path, "the truth beside a simulated recording")
    numbers = _Numbers(path, values)
    grasps = values.get("grasps")
    if not isinstance(grasps, list) or len(grasps) != robots:
        count = len(grasps) if isinstance(grasps, list) else "no"
        raise InputError(f"{path}: has {count} grasps; {recording} is of {robots} robots")
    each = [_Numbers(path, entry, f"grasps[{k}].") for k, entry in enumerate(grasps)]
    return BodyFacts(
        grasps=Grasps(
            Rotation.from_rotvec(
                [entry("R_1i_rotvec_deg", (3,)) for entry in each], degrees=True
            ).as_matrix(),
            np.array([entry("p_1i_m", (3,)) for entry in each]),
        ),
        mass_kg=float(numbers("mass_kg", ())),
        p_1c=numbers("p_1c_m", (3,)),
        R_1c=Rotation.from_rotvec(numbers("R_1c_rotvec_deg", (3,)), degrees=True).as_matrix(),
        principal_kgm2=numbers("principal_inertia_kgm2", (3,)),
    )


def read_estimate(path: Path) -> PayloadEstimate:
    """Read what ``mocobot estimate --out`` wrote.

    Raises:
        InputError: it cannot be read, or is not a whole estimate.
    """
    values = read_json(path, "an estimate")
    try:
        estimate = PayloadEstimate.from_dict(values)
        _check(estimate)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    except (
        IndexError,
        OverflowError,
    ) as error:  # pairs of robots that are not there, numbers beyond all bounds
        raise InputError(f"{path}: not a complete estimate ({type(error).__name__}: {error})") from error
    return estimate


def read_json(path: Path, what: str) -> dict[str, Any]:
    """A JSON object from a file.

    Raises:
        InputError: there is no such file, or it holds something else.
    """
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such file; it would be {what}") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not valid JSON ({error}); it must be {what}") from error
    if not isinstance(values, dict):
        raise InputError(f"{path}: must be a JSON object, not {values!r:.40}; it must be {what}")
    return values


class _Numbers:
    """Finite numbers of a JSON object by key."""

    def __init__(self, path: Path, values: Any, where: str = "") -> None:
        self.path, self.values, self.where = path, values if isinstance(values, dict) else {}, where

    def __call__(self, key: str, shape: tuple[int, ...]) -> Array:
        try:
            array = np.array(self.values[key], dtype=float)
        except KeyError as error:
            raise InputError(f"{self.path}: missing key {self.where + key!r}") from error
        except (TypeError, ValueError) as error:
            raise InputError(f"{self.path}: {self.where}{key} does not hold numbers") from error
        if array.shape != shape or not np.isfinite(array).all():
            size = "one finite number" if shape == () else f"{shape[0]} finite numbers"
            raise InputError(f"{self.path}: {self.where}{key} is {self.values[key]!r:.60}; it must be {size}")
        return array


def _check(estimate: PayloadEstimate) -> None:
    """Shapes and finite numbers of what is drawn, which the estimate's own reader takes as they are."""
    facts: list[tuple[str, Any, tuple[int, ...]]] = [("com.p_1c_m", estimate.p_1c, (3,))]
    if type(estimate.robots) is not int or estimate.robots < 1:
        raise InputError(f"robots is {estimate.robots!r:.40}; it must be a whole number of at least 1")
    if estimate.p_1c is not None:
        facts.append(("com.covariance_m2", estimate.p_1c_covariance, (3, 3)))
    if (grasps := estimate.grasps) is not None:
        N = estimate.robots
        facts += [("grasps.R_axis_angle_deg", grasps.R_1i, (N, 3, 3)), ("grasps.p_m", grasps.p_1i, (N, 3))]
        facts += [("grasps.covariance", grasps.covariance, (6 * (N - 1),) * 2)]
        facts += [
            (f"grasps.{kind}", getattr(grasps, field), (N, N))
            for kind, field in (
                ("angular_residual_radps", "angular_residual_rms"),
                ("linear_residual_mps", "linear_residual_rms"),
            )
        ]
    if (mass := estimate.mass) is not None:
        facts += [("mass.m_kg", mass.mass, ()), ("mass.m_se_kg", mass.se, ())]
    if (inertia := estimate.inertia) is not None:
        facts += [
            ("inertia.I_b_kgm2", inertia.inertia, (3, 3)),
            ("inertia.principal_kgm2", inertia.principal.moments, (3,)),
            ("inertia.principal_se_kgm2", inertia.principal.moments_se, (3,)),
        ]
        facts += [("inertia.R_1c_axis_angle_deg", inertia.principal.R_1c, (3, 3))]
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
