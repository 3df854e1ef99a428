"""Small result folders for the report: the real writers' files, numbers made up, names that try to break the page."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from diagnosed import small_diagnosis
from discrepancy.result.traces import Channel, Trace, save_traces
from estimator.calibrate.json import calibration_to_dict
from estimator.estimate.payload import estimate_payload
from estimator.estimate.result import PayloadEstimate
from estimator.files import write_json
from estimator.recording.parquet import write_recording
from invented_calibration import invented_calibration
from mocobot.results import provenance
from mocobot_sim.paper.experiment import SELF_CALIBRATED, TRANSFER
from mocobot_sim.paper.scoring import ENCODER_FRAMES, MOMENTS, SPRING_SCALE, published_errors
from recorded_team import COM, GRASPS, INERTIA, MASS, Sines, carry

NASTY = '</script><script>alert("x")</script><!-- & \u2028'
"""A label that would end a script, start one, or a comment."""
RATE_HZ, ROWS = 12.5, 400


def paper_folder(folder: Path, presets: tuple[str, ...] = ("ideal", "nominal", "uncalibrated")) -> Path:
    """Scores are the published ones, divided by 1000, 100 and 2, with one number missing.

    Beside the last preset a fit, a quarter of the published ones, a thousandth in the encoders' frames, and its
    transfer from (a).
    """
    folder.mkdir()
    scores = {}
    for preset, part in zip(presets, (1e-3, 1e-2, 0.5), strict=False):
        scores[preset] = {p: _scaled(published_errors(p), part) for p in "ab"}
        for values in scores[preset].values():
            values["random"] = values["periodic"] = values["all"]
    scale = {"percent": -0.64, "m_percent": 0.02} | {f"{name}_percent": 0.03 for name in MOMENTS}
    fits = {}
    for payload in "ab":
        seen = {key: part for key, part in _scaled(published_errors(payload), 1e-3).items() if key[0] in "Rp"}
        fits[payload] = {
            **_scaled(published_errors(payload), 0.25),
            ENCODER_FRAMES: seen,
            SPRING_SCALE: scale,
        }
    scores |= {SELF_CALIBRATED: fits, TRANSFER: {"a": None, "b": fits["b"]}}
    scores[presets[0]]["b"]["p1c_m"] = scores[presets[0]]["b"]["p1c_percent"] = None
    trial = {
        "rotation_deg": 8.0,
        "damping_ratio": 0.35,
        "torque_Nm": 12.0,
        "rod_error_m": 3e-6,
        "weld_error_m": 2e-6,
        "weld_error_deg": 6e-5,
    }
    _write(folder / "paper.json", scores)
    _write(folder / "trials.json", {"trials": [{"name": f"a random {k} nominal", **trial} for k in range(3)]})
    made = provenance("paper", {"payload": ["a", "b"], "seed": 0})
    _write(folder / "provenance.json", {"format": "mocobot-provenance", "version": 1, **made, "written": []})
    (folder / "estimates").mkdir()
    for preset in presets:
        values = payload_estimate().to_dict()
        _write(folder / "estimates" / f"a_{preset}.json", values)
    return folder


def payload_estimate(name: str = "rec.parquet") -> PayloadEstimate:
    """Of three exact robots that carry payload (a)'s look-alike for 12 s."""
    recording = carried(name)
    return estimate_payload([recording], "joint")


def carried(name: str, seconds: float = 12.0):
    """A recording of exact sensors, with steps of 1 mN m in its torques."""
    rng = np.random.default_rng(4)
    path = Sines.draw(rng, [0.06] * 3 + [0.02] * 3, 6, 0.1, 1.0)
    recording = carry(path, Sines.draw(rng, [4.0] * 3, 6, 0.1, 1.0), seconds).recording
    return replace(recording, tau=np.round(recording.tau, 3), name=name)


def estimate_folder(folder: Path, label: str | None = NASTY) -> Path:
    """One recording, the truth beside it, and its estimate with provenance."""
    folder.mkdir()
    path = folder / "a b.parquet"
    recording = carried(path.name)
    write_recording(recording, path)
    moments, axes = np.linalg.eigh(INERTIA)
    from scipy.spatial.transform import Rotation

    axes *= np.sign(np.linalg.det(axes))
    truth = {
        "mass_kg": MASS,
        "p_1c_m": COM.tolist(),
        "R_1c_rotvec_deg": np.rad2deg(Rotation.from_matrix(axes).as_rotvec()).tolist(),
        "principal_inertia_kgm2": moments.tolist(),
        "grasps": [
            {
                "R_1i_rotvec_deg": np.rad2deg(Rotation.from_matrix(R).as_rotvec()).tolist(),
                "p_1i_m": p.tolist(),
            }
            for R, p in GRASPS
        ],
    }
    _write(path.with_suffix(".truth.json"), truth)
    estimate = replace(estimate_payload([recording], "joint"), payload=label)
    made = provenance("estimate", {"method": "joint", "cutoff_hz": 5.0}, [path])
    _write(folder / "est.json", estimate.to_dict() | {"provenance": made})
    return folder


def channels(robot: bool = False) -> list[Channel]:
    """Of a team of two, or of a robot with one slide."""
    if robot:
        return [Channel("slide force", "joint 1", None, "N")]
    names = (("grasp 2 rotation", "rad"), ("grasp 2 position", "m"), ("force", "N"), ("moment", "N m"))
    return [Channel(f"{name} {a}", "kinematic", None, unit) for name, unit in names for a in "xyz"]


def trace(name: str, robot: bool = False, holds: int = 3, seed: int = 0) -> Trace:
    """White noise after, ten times as much before, with a pause, and a few holds at the end."""
    rng, count = np.random.default_rng(seed), len(channels(robot))
    time = np.arange(ROWS) / RATE_HZ + np.where(np.arange(ROWS) >= ROWS // 2, 4.0, 0.0)
    time = np.concatenate([time, time[-1] + 5.0 * np.arange(1, holds + 1)])
    white = rng.standard_normal((len(time), count))
    sigma = np.full_like(white, 1e-3)
    quantities = {name: rng.uniform(0.0, 1.0, len(time)) for name in ("speed", "position", "load")}
    return Trace(
        name, time, ROWS, RATE_HZ, 10.0 * sigma * white, sigma * white, sigma, 10.0 * white, white, quantities
    )


def diagnosis_folder(folder: Path, verdict: str = "explained", robot: bool = False) -> Path:
    """A diagnosis of two trials with residuals and an extended model's file."""
    folder.mkdir()
    values = small_diagnosis(verdict)
    names = ["data/one.parquet", f"{NASTY}.parquet"]
    values["recordings"] = names
    for entry, name in zip(values["gain"]["trials"], names, strict=True):
        entry["name"] = name
    values["notes"] = [NASTY]
    for part in (values["residual"], values["residual"]["nominal"]):
        size = 1.1 if part is values["residual"] else 90.0
        part["signature"] = {
            "chi2_per_n": size, "sentence": "chi2/n is 1.", "kind": {},
            "channel": {c.name: size for c in channels(robot)}, "trial": dict.fromkeys(names, size),
            "along": {"robot 2's torque channel 1": 0.9, NASTY: 0.05},
        }  # fmt: skip
    if robot:
        values["gain"] = None
        values["not_simulated"] = "the closed loop was left out on request"
    values["provenance"] = provenance(
        "diagnose", {"model": "slide.xml" if robot else None, "closed_loop": not robot}
    )
    values["provenance"]["files"] = [
        {"name": "one.parquet", "path": "data/one.parquet", "bytes": 3, "sha256": "0" * 64}
    ]
    _write(folder / "diagnosis.json", values)
    save_traces(
        [trace(n, robot, seed=k) for k, n in enumerate(names)], channels(robot), folder / "residuals.npz"
    )
    (folder / "extended").mkdir()
    (folder / "extended" / "team.xml").write_text("<mujoco/>")
    return folder


def _scaled(values: object, part: float) -> object:
    if isinstance(values, dict):
        return {key: _scaled(item, part) for key, item in values.items()}
    return values * part if isinstance(values, int | float) else values


def calibration_folder(folder: Path, findings: tuple[str, ...] = ()) -> Path:
    """Invented numbers, written as the command does but for model and pictures; labels and names that break pages."""
    folder.mkdir()
    made = invented_calibration(3)
    trials = tuple(replace(trial, name=f"{trial.name[:-8]} {NASTY}.parquet") for trial in made.trials)
    said = (f"The zeros of {NASTY} are open.",)
    made = replace(
        made, payloads=(replace(made.payloads[0], label=NASTY),), trials=trials, findings=findings, open=said
    )
    made_with = provenance("calibrate", {"tilt": False, "known_mass": []})
    write_json(folder / "calibration.json", calibration_to_dict(made) | {"provenance": made_with})
    return folder


def rolled(*, named: bool = True) -> dict[str, Any]:
    """Two joints, one of which slides; at the second horizon the first diverged in the given model."""

    def side(first: float | None, second: float, gone: int) -> dict[str, Any]:
        return {"rms": [first, second], "diverged": [gone, 0]}

    def horizon(
        seconds: float, before: dict[str, Any], after: dict[str, Any], removed: list[Any]
    ) -> dict[str, Any]:
        return {"seconds": seconds, "starts": 40, "before": before, "after": after if named else None,
                "removed": removed if named else None}  # fmt: skip

    return {
        "joints": ["hip", "lift"],
        "units": ["rad", "m"],
        "validated": True,
        "why_not": None,
        "horizons": [
            horizon(0.1, side(0.05, 0.004, 0), side(0.01, 0.001, 0), [0.8, 0.75]),
            horizon(0.5, side(None, 0.02, 30), side(0.08, 0.005, 0), [None, 0.75]),
        ],
        "not_simulated": ["elasticity of joint 1 (hip)"],
        "refused": [],
        "commanded": {
            "why_not": None, "joints": [1],
            "blocks": [
                {"name": "one", "seconds": 6.0, "motion": [0.5, 0.1], "before": [0.03, 0.002],
                 "after": [0.02, 0.001] if named else None},
                {"name": "two", "seconds": 6.0, "motion": [0.5, 0.1], "before": [None, 0.002],
                 "after": [0.02, 0.001] if named else None},
            ],
            "before": [0.03, 0.002], "after": [0.02, 0.001] if named else None,
            "removed": [0.33, 0.5] if named else None,
        },
    }  # fmt: skip


def _write(path: Path, values: object) -> None:
    path.write_text(json.dumps(values))
