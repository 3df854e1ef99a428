"""Teams out of the box that are calibrated, and how near the truth the answers come."""

from __future__ import annotations

import json
import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from joblib import Parallel, delayed, parallel_config
from scipy.spatial.transform import Rotation
from tqdm import tqdm

from estimator.arm.unit import AT, COUNT
from estimator.arrays import Array, inertia_matrix, inertia_parameters
from estimator.calibrate.calibrate import calibrate
from estimator.calibrate.calibration import CalibratedPayload, Calibration
from estimator.calibrate.prior import Prior
from estimator.estimate.grasps import GraspEstimate
from estimator.estimate.payload import estimate_payload
from estimator.estimate.result import PayloadEstimate
from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording, write_recording
from mocobot_sim.effects.geometry import BaseTilt
from mocobot_sim.errors import TrialError
from mocobot_sim.trial.sensors import PRESETS, SensorPreset
from mocobot_sim.trial.simulate import TrialRequest, simulate
from sealed import sets

SPACING_M = 1.0
MASS_PER_ROBOT_KG = 3.5
LARGEST_RADIUS_M = 0.95
"""Largest radius of the circle: a payload that turns by 3.4 deg moves the grasps of a larger one out of reach."""


def write_plate(robots: int, path: Path) -> Path:
    """Grasps on a circle, a metre apart or as near as it takes; the mass off the middle and below the grasps.

    Two grasps alone let the payload swing, so it must hang.
    """
    radius = min(LARGEST_RADIUS_M, SPACING_M / (2.0 * np.sin(np.pi / robots)))
    angles = 2.0 * np.pi * np.arange(robots) / robots
    places = radius * np.column_stack([np.cos(angles) - 1.0, np.sin(angles)])
    sites = "\n".join(
        f'      <site name="grasp{k + 1}" pos="{x} {y} {0.01 * (k % 3)}" euler="0 0 {angle}"/>'
        for k, ((x, y), angle) in enumerate(zip(places, angles, strict=True))
    )
    mass = MASS_PER_ROBOT_KG * robots
    across = mass * max(0.3, radius) ** 2 / 4.0
    path.write_text(
        f"""<mujoco model="plate{robots}">
  <compiler angle="radian"/>
  <worldbody>
    <body name="payload">
      <inertial pos="{-0.9 * radius} {0.05 * radius} -0.15" mass="{mass}"
                diaginertia="{across} {1.3 * across} {2.1 * across}"/>
{sites}
    </body>
  </worldbody>
</mujoco>
""",
        encoding="utf-8",
    )
    return path


TRIALS = ("random", "periodic", "static")
TILT_RAD = float(np.deg2rad(0.2))


@dataclass(frozen=True)
class Team:
    """One team with one payload; equal ones give equal bits, and one seed's teams have the same robots.

    Attributes:
        seed: of robots, motion and noise.
        payload: "a" .. "d", or "plateN" for N robots under a plate.
        preset: sensors and robots.
        arm_mass_ratio: spread of the masses of links, rods and wrists, relative.
        tilted: whether the bases stand askew, by ``TILT_RAD`` about x and y.
    """

    seed: int
    payload: str
    preset: str = "uncalibrated"
    arm_mass_ratio: float = 0.0
    tilted: bool = False

    @property
    def key(self) -> str:
        """Its name."""
        more = ["masses"] if self.arm_mass_ratio else []
        more += ["tilted"] if self.tilted else []
        return "-".join([self.payload, self.preset, *more, str(self.seed)])

    def recordings(self, folder: Path, *, free: bool = False) -> tuple[list[Recording], dict[str, Any]]:
        """The three default trials, or the one of robots that hold nothing, and the truth; simulated if need be."""
        here = folder / self.key
        here.mkdir(parents=True, exist_ok=True)
        paths = []
        for trial in ("free",) if free else TRIALS:
            path = here / f"{trial}.parquet"
            if not path.is_file():
                self._simulate(trial, path)
            paths.append(path)
        truth = json.loads(paths[0].with_suffix(".json").read_text(encoding="utf-8"))
        return [read_recording(path) for path in paths], truth

    def _simulate(self, trial: str, path: Path) -> None:
        payload = self.payload
        if payload.startswith("plate"):
            plate = path.parent / f"{payload}.xml"
            payload = str(write_plate(int(payload.removeprefix("plate")), plate))
        request = TrialRequest(payload, trial, self.seed)
        done = simulate(request, [self._sensors()], effects=self._effects())
        path.with_suffix(".json").write_text(json.dumps(done.truth.to_dict()), encoding="utf-8")
        partial = path.with_suffix(".partial")
        write_recording(done.recordings[self.preset], partial)
        partial.rename(path)  # last: a recording that is there is whole

    def _sensors(self) -> SensorPreset:
        preset = PRESETS[self.preset]
        return replace(preset, spread=replace(preset.spread, arm_mass_ratio=self.arm_mass_ratio))

    def _effects(self) -> list[BaseTilt]:
        if not self.tilted:
            return []
        robots = int(self.payload.removeprefix("plate")) if self.payload.startswith("plate") else 3
        angles = TILT_RAD * np.random.default_rng([self.seed, *b"tilt"]).standard_normal((robots, 2))
        return [BaseTilt(k + 1, *map(float, both)) for k, both in enumerate(angles)]


@dataclass(frozen=True)
class Truth:
    """The truth of one team and payload; {i} here is {i} as built, turned about its x axis by the zero of theta_x.

    Attributes:
        R_1i, p_1i: grasps, shapes (N, 3, 3), (N, 3).
        mass: [kg].
        p_1c: centre of mass [m], shape (3,).
        inertia: about it, axes of {1} [kg m^2], shape (3, 3).
        units: deviations of the robots, shape (N, ``COUNT``), the mean of all spring ratios included.
    """

    R_1i: Array
    p_1i: Array
    mass: float
    p_1c: Array
    inertia: Array
    units: Array

    @property
    def scale(self) -> float:
        """Mean of all spring ratios, which a calibration without a known weight takes to be 0."""
        return float(self.units[:, AT["stiffness_ratio"]].mean())

    @classmethod
    def of(cls, told: dict[str, Any], *, encoder_frames: bool = True) -> Truth:
        """From a recording's truth file; ``encoder_frames`` off leaves the frames as built."""
        rotvecs = [grasp["R_1i_rotvec_deg"] for grasp in told["grasps"]]
        R = Rotation.from_rotvec(rotvecs, degrees=True).as_matrix()
        p = np.array([grasp["p_1i_m"] for grasp in told["grasps"]])
        units = np.array([_unit(one) for one in told["as_built"]])
        for effect in (one for one in told["effects"] if one["cause"] == "base_tilt"):
            units[effect["robot"] - 1, AT["tilt"]] = [
                effect["parameters"][k] for k in ("roll_rad", "pitch_rad")
            ]
        R_1c = Rotation.from_rotvec(told["R_1c_rotvec_deg"], degrees=True).as_matrix()
        inertia = R_1c @ np.diag(told["principal_inertia_kgm2"]) @ R_1c.T
        zeros = [one["theta_zero_rad"][2] if encoder_frames else 0.0 for one in told["as_built"]]
        turn = Rotation.from_rotvec(np.outer(zeros, [1.0, 0.0, 0.0])).as_matrix()
        back = turn[0].T
        return cls(
            back @ R @ turn,
            p @ back.T,
            told["mass_kg"],
            back @ told["p_1c_m"],
            back @ inertia @ back.T,
            units,
        )

    @property
    def parameters(self) -> Array:
        """(m, m p_1c, J about {1}), shape (10,)."""
        c = self.p_1c
        J = self.inertia + self.mass * (c @ c * np.eye(3) - np.outer(c, c))
        return np.concatenate([[self.mass], self.mass * c, inertia_parameters(J)])


def _unit(built: dict[str, Any]) -> Array:
    x = np.zeros(COUNT)
    x[AT["phi_zero"]], x[AT["theta_zero"]] = built["phi_zero_rad"], built["theta_zero_rad"]
    x[AT["theta_zero"].stop - 1] = 0.0
    x[AT["radius"]] = np.subtract(built["base_radius_m"], built["platform_radius_m"])
    x[AT["proximal_length"]], x[AT["rod_length"]] = built["proximal_length_m"], built["rod_length_m"]
    x[AT["stiffness_ratio"]], x[AT["tau_zero"]] = built["stiffness_ratio"], built["tau_zero_Nm"]
    for name in ("proximal_mass_ratio", "rod_mass_ratio", "wrist_mass_ratio"):
        x[AT[name]] = built[name]
    return x


def centred(parameters: Array) -> Array:
    """(m, p_1c, inertia about the centre of mass: xx, xy, xz, yy, yz, zz) from (m, m p_1c, J about {1})."""
    m, c = parameters[0], parameters[1:4] / parameters[0]
    inertia = inertia_matrix(parameters[4:]) - m * (c @ c * np.eye(3) - np.outer(c, c))
    return np.concatenate([[m], c, inertia_parameters(inertia)])


def principal(inertia: Array) -> Array:
    """Principal moments, ascending, from xx, xy, xz, yy, yz, zz."""
    return np.asarray(np.linalg.eigvalsh(inertia_matrix(inertia)), dtype=float)


CENTRED = {"m": slice(0, 1), "com": slice(1, 4), "I": slice(4, 10)}


@dataclass(frozen=True)
class Found:
    """What is scored.

    Attributes:
        grasps: with their covariance.
        centred: (m, p_1c, inertia about the centre of mass), shape (10,).
        covariance: of it, shape (10, 10).
    """

    grasps: GraspEstimate
    centred: Array
    covariance: Array


def of_estimate(estimate: PayloadEstimate) -> Found | None:
    """A staged or joint estimate; its mass, centre of mass and inertia claim no correlation."""
    mass, com, com_covariance, inertia = (
        estimate.mass,
        estimate.p_1c,
        estimate.p_1c_covariance,
        estimate.inertia,
    )
    if estimate.grasps is None or mass is None or com is None or com_covariance is None or inertia is None:
        return None
    covariance = np.zeros((10, 10))
    covariance[0, 0] = mass.se**2
    covariance[1:4, 1:4], covariance[4:, 4:] = com_covariance, inertia.covariance
    return Found(
        estimate.grasps, np.concatenate([[mass.mass], com, inertia_parameters(inertia.inertia)]), covariance
    )


def score(found: Found, truth: Truth, scale: float) -> dict[str, Any]:
    """Largest errors, and normalised ones by group.

    Args:
        found: what came out.
        truth: in the frames that are compared.
        scale: mean spring ratio that the estimate takes to be 0; masses and inertias are compared with the truth over
            1 + scale, too.
    """
    turned, shifted = grasp_errors(found.grasps, truth)
    held = _centred_truth(truth, scale)
    error = found.centred - held
    grasps = np.concatenate([turned, shifted], axis=1).ravel()
    result: dict[str, Any] = {
        "R_deg": float(np.rad2deg(np.linalg.norm(turned, axis=1).max())),
        "p_mm": float(1e3 * np.linalg.norm(shifted, axis=1).max()),
        "com_mm": float(1e3 * np.linalg.norm(error[1:4])),
        "m_percent": 100.0 * abs(error[0]) / held[0],
        "I_percent": _principal_percent(found.centred[4:], held[4:]),
        "m_percent_raw": 100.0 * abs(found.centred[0] / truth.mass - 1.0),
        "I_percent_raw": _principal_percent(found.centred[4:], inertia_parameters(truth.inertia)),
    }
    return result | {
        "claims": {"grasps": claim(grasps, found.grasps.covariance)} | claims(error, found.covariance)
    }


def grasp_errors(grasps: GraspEstimate, truth: Truth) -> tuple[Array, Array]:
    """Rotation vectors [rad] and shifts [m] from the truth to the estimate, both in {1}, shape (N - 1, 3)."""
    turned = Rotation.from_matrix(grasps.R_1i[1:] @ np.swapaxes(truth.R_1i[1:], -1, -2)).as_rotvec()
    return turned, grasps.p_1i[1:] - truth.p_1i[1:]


def claims(error: Array, covariance: Array) -> dict[str, Any]:
    """Claims on mass, centre of mass and inertia apart."""
    return {name: claim(error[at], covariance[at, at]) for name, at in CENTRED.items()}


def claim(error: Array, covariance: Array) -> dict[str, Any]:
    """Errors in claimed standard errors one by one, and all together (NEES)."""
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlation = covariance / np.outer(sd, sd)
    z = error / sd
    return {
        "z": z.tolist(),
        "nees": float(z @ np.linalg.lstsq(correlation, z, rcond=1e-12)[0]),
        "n": len(error),
    }


def score_calibration(calibration: Calibration, payload: int, truth: Truth) -> dict[str, Any]:
    """A calibration's payload and robots against the truth.

    With the scale held both ways count: as it is held (``claims``) and with its uncertainty (``claims_in_all``).
    """
    one = calibration.payloads[payload]
    scale = 0.0 if calibration.scale_sd == 0.0 else truth.scale
    values = score(found_of(one, one.covariance), truth, scale)
    held = one.parameters - truth.parameters
    shift = one.by_scale * scale
    turned, shifted = grasp_errors(one.grasps, truth)
    error = np.concatenate([np.concatenate([turned, shifted], axis=1).ravel(), held])
    values["claims"] |= {"payload": claim(error + shift, one.covariance)}
    in_all = one.covariance + calibration.scale_sd**2 * np.outer(one.by_scale, one.by_scale)
    whole = found_of(one, in_all)
    values["claims_in_all"] = {"payload": claim(error, in_all)}
    values["claims_in_all"] |= claims(whole.centred - _centred_truth(truth, 0.0), whole.covariance)
    return values | {"units": score_units(calibration, truth)}


def score_units(calibration: Calibration, truth: Truth) -> dict[str, Any]:
    """Errors of the robots: normalised in the coordinates of their prior, and by group with what was claimed."""
    known = calibration.scale_sd == 0.0
    error = calibration.units.x - truth.units
    if not known:
        error = error + calibration.by_scale * truth.scale
    factor = calibration.prior.factor(calibration.robots, hold_scale=not known)
    if not factor.size:
        return {}
    back = np.linalg.pinv(factor)
    return claim(back @ error.ravel(), back @ calibration.covariance @ back.T)


def found_of(one: CalibratedPayload, covariance: Array) -> Found:
    """A calibrated payload with its parameters' covariance taken over to mass, centre of mass and inertia."""
    split = len(covariance) - 10
    J = np.zeros((10, 10))
    steps = 1e-6 * np.maximum(np.abs(one.parameters), 1e-2)
    for k, step in enumerate(steps):
        dx = np.zeros(10)
        dx[k] = step
        J[:, k] = (centred(one.parameters + dx) - centred(one.parameters - dx)) / (2.0 * step)
    return Found(one.grasps, centred(one.parameters), J @ covariance[split:, split:] @ J.T)


def _centred_truth(truth: Truth, scale: float) -> Array:
    over = 1.0 + scale
    return np.concatenate([[truth.mass / over], truth.p_1c, inertia_parameters(truth.inertia) / over])


def _principal_percent(found: Array, true: Array) -> float:
    a, b = principal(found), principal(true)
    return float(100.0 * np.max(np.abs(a / b - 1.0)))


HELD = Prior(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
ARM_MASS_RATIO = 0.05
WEIGHED = 1e-4
"""Relative standard error of a known weight."""

PRIORS = {
    "calibrated": Prior(),
    "masses": Prior(arm_mass_ratio=ARM_MASS_RATIO),
    "tilted": Prior(tilt_rad=TILT_RAD),
    "held": HELD,
}


@dataclass(frozen=True)
class Task:
    """One calibration or estimate of one team.

    Attributes:
        method: "staged", "joint", a key of ``PRIORS``, "weighed" (this payload's weight is known, another's is asked
            for), "free" (a recording of unloaded arms decides these masses) or "transfer" (robots from payload (a)).
        team: the team.
    """

    method: str
    team: Team


def tasks(part: str, seeds: Sequence[int], payloads: Sequence[str], robots: Sequence[int]) -> list[Task]:
    """What one part of the campaign consists of.

    Args:
        part: "main", "weighed", "transfer", "masses", "tilt", "robots" or "nominal".
        seeds: of the teams.
        payloads: what they carry.
        robots: sizes of teams in part "robots".
    """
    teams = [Team(seed, payload) for seed in seeds for payload in payloads]
    if part == "robots":
        teams = [Team(seed, f"plate{N}") for seed in seeds for N in robots]
    change: dict[str, Any] = {
        "nominal": {"preset": "nominal"},
        "masses": {"arm_mass_ratio": ARM_MASS_RATIO},
        "tilt": {"tilted": True},
    }.get(part, {})
    methods = {
        "main": ("staged", "joint", "calibrated"),
        "weighed": ("weighed",),
        "transfer": ("transfer",),
        "masses": ("masses", "free"),
        "tilt": ("tilted",),
        "robots": ("staged", "calibrated"),
        "nominal": ("staged", "joint", "held", "calibrated"),
    }[part]
    listed = [Task(method, replace(team, **change)) for team in teams for method in methods]
    return [task for task in listed if task.method != "transfer" or task.team.payload != "a"]


def run_tasks(listed: Sequence[Task], folder: Path, jobs: int) -> None:
    """Run what is not finished yet, and append each result as soon as it is there."""
    path = folder / "results.jsonl"
    folder.mkdir(parents=True, exist_ok=True)
    finished = {(r["part"], r["key"]) for r in sets.read(path) if not r["error"]}
    todo = [task for task in listed if (task.method, task.team.key) not in finished]
    # All of one team in one process: recordings are simulated once.
    by_team: dict[Team, list[Task]] = {}
    for task in todo:
        by_team.setdefault(task.team, []).append(task)
    with parallel_config("loky", inner_max_num_threads=1):
        run = Parallel(jobs, return_as="generator_unordered")
        done: Any = run(delayed(_run_team)(group, folder) for group in by_team.values())
        for results in tqdm(done, total=len(by_team), unit="team", dynamic_ncols=True):
            for result in results:
                sets.append(path, result)


def _run_team(group: Sequence[Task], folder: Path) -> list[dict[str, Any]]:
    return [run_task(task, folder) for task in group]


def run_task(task: Task, folder: Path) -> dict[str, Any]:
    """One result, as a line of ``results.jsonl``."""
    result = {"part": task.method, "key": task.team.key, "error": None}
    try:
        return result | _outcome(task, folder / "sets")
    except TrialError as error:
        return result | {"error": f"not simulated: {error}"}
    except Exception:  # one broken team must not end the campaign
        return result | {"error": traceback.format_exc()}


def _outcome(task: Task, folder: Path) -> dict[str, Any]:
    recordings, told = task.team.recordings(folder)
    truth = Truth.of(told)
    if task.method in ("staged", "joint"):
        start = time.process_time()
        found = of_estimate(estimate_payload(recordings, task.method, withhold=False))
        took = time.process_time() - start
        if found is None:
            return {"error": "not determined"}
        built = score(found, Truth.of(told, encoder_frames=False), truth.scale)
        return score(found, truth, truth.scale) | {
            "cpu_s": took,
            "as_built": {key: built[key] for key in ("R_deg", "p_mm", "com_mm")},
        }
    if task.method == "transfer":
        return _transfer(task, folder, recordings, truth)
    if task.method == "weighed":
        return _weighed(task, folder, recordings, truth)
    free, prior = [], PRIORS.get(task.method)
    if task.method == "free":
        (free, _), prior = task.team.recordings(folder, free=True), PRIORS["masses"]
    start = time.process_time()
    calibration = calibrate(recordings, free=free, prior=prior)
    took = time.process_time() - start
    return score_calibration(calibration, 0, truth) | _fit(calibration) | {"cpu_s": took}


def _transfer(task: Task, folder: Path, recordings: list[Recording], truth: Truth) -> dict[str, Any]:
    calibration = calibrate(replace(task.team, payload="a").recordings(folder)[0])
    start = time.process_time()
    found = calibrate(recordings, robots=calibration)
    took = time.process_time() - start
    return score_calibration(found, 0, truth) | {"cpu_s": took}


def _weighed(task: Task, folder: Path, recordings: list[Recording], truth: Truth) -> dict[str, Any]:
    """This team's payload is weighed; a second one's mass is asked for."""
    other = replace(task.team, payload="bcda"["abcd".index(task.team.payload)])
    more, told = other.recordings(folder)
    known = {task.team.payload: (truth.mass, WEIGHED * truth.mass)}
    start = time.process_time()
    calibration = calibrate([*recordings, *more], known_mass=known)
    took = time.process_time() - start
    second = score_calibration(calibration, 1, Truth.of(told))
    return score_calibration(calibration, 0, truth) | _fit(calibration) | {"cpu_s": took, "second": second}


def _fit(calibration: Calibration) -> dict[str, Any]:
    return {
        "steps": calibration.steps,
        "trials": [
            {"kind": one.kind, "before": one.before, "after": one.after, "held_out": one.held_out}
            for one in calibration.trials
        ],
    }
