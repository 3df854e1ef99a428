"""Simulated teams: recordings and truth of one, kept in a folder."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from calibration.payloads import write_plate
from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording, write_recording
from mocobot_sim.effects.geometry import BaseTilt
from mocobot_sim.trial.sensors import PRESETS, SensorPreset
from mocobot_sim.trial.simulate import TrialRequest, simulate

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
