"""What a campaign consists of: teams, first diagnosed as they are, then with one effect hidden in them at a time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from discrepancy.team.causes import CAUSES, default_tolerances
from estimator.calibrate.calibration import Calibration
from mocobot.campaign.background import SPREAD_IN_UNCALIBRATED
from mocobot_sim.effects import EFFECTS
from mocobot_sim.scene.as_built import AsBuilt

Background = Literal["calibrated", "uncalibrated", "units"]


@dataclass(frozen=True)
class CampaignPlan:
    """Everything that a campaign's outcomes depend on; equal plans give equal bits.

    Attributes:
        payload: name of a shipped payload, or path of a payload MJCF.
        trials: kind of every trial of a set.
        vias: vias of each random trial, or None for the default.
        duration_s: length of each periodic motion [s], or None for the default.
        preset: calibrated sensors.
        backgrounds: the robots: ``calibrated`` (as designed), ``uncalibrated`` (drawn for every team) or ``units``.
            Besides, everything is off by a draw of its tolerance.
        units: the robots of the background ``units``.
        calibration: the robots as the diagnosis knows them, or None for what recordings say.
        tolerances: of a healthy robot, standard deviations by cause and parameter: drawn, and known to the diagnosis.
        exclude: causes that the diagnosis does not consider; they are not hidden.
        closed_loop: whether diagnoses run the recorded commands again.
        causes: what is hidden; all that the catalogue has if empty.
        sizes: over the detection limit, in turn.
        teams: per background, each with a clean set.
        sets: with something hidden, per background; teams take turns.
        seed: of everything random.
    """

    payload: str = "a"
    trials: tuple[str, ...] = ("random", "random", "periodic", "static")
    vias: int | None = None
    duration_s: float | None = None
    preset: str = "nominal"
    backgrounds: tuple[Background, ...] = ("calibrated", "uncalibrated")
    units: tuple[AsBuilt, ...] = ()
    calibration: Calibration | None = None
    tolerances: Mapping[str, Mapping[str, float]] = field(default_factory=default_tolerances)
    exclude: tuple[str, ...] = ()
    closed_loop: bool = False
    causes: tuple[str, ...] = ()
    sizes: tuple[float, ...] = (1.0, 2.0, 4.0)
    teams: int = 2
    sets: int = 12
    seed: int = 0

    def clean_sets(self) -> list["CampaignSet"]:
        """One for every team."""
        return [CampaignSet(b, team) for b in self.backgrounds for team in range(1, self.teams + 1)]

    def hidden_sets(self) -> list["CampaignSet"]:
        """Those with something hidden; more of them begin with the same."""
        return [
            CampaignSet(b, k % self.teams + 1, k + 1, cause, self.sizes[k % len(self.sizes)])
            for b in self.backgrounds
            for k, cause in enumerate(self._in_turn(self.candidates(b), b))
        ]

    def candidates(self, background: Background) -> list[str]:
        """Causes that can be hidden in a background: none that it has everywhere."""
        has = () if background == "calibrated" or self.calibration is not None else SPREAD_IN_UNCALIBRATED
        names = self.causes or tuple(CAUSES)
        return [name for name in names if name in EFFECTS and name not in (*has, *self.exclude)]

    def _in_turn(self, names: Sequence[str], background: Background) -> list[str]:
        """As many as there are sets: every one once, then again in another order."""
        out: list[str] = []
        while names and len(out) < self.sets:
            rng = self.rng(background, "turn", len(out) // len(names))
            out += [names[int(k)] for k in rng.permutation(len(names))]
        return out[: self.sets]

    def rng(self, *purpose: object) -> np.random.Generator:
        """Independent stream for one purpose."""
        return np.random.default_rng([self.seed, *" ".join(map(str, purpose)).encode()])


@dataclass(frozen=True)
class CampaignSet:
    """One set of recordings of a team.

    Attributes:
        background: the robots.
        team: which, from 1.
        number: which of the background's sets with something hidden, from 1; None of a clean one.
        cause: what is hidden, or None.
        factor: its size over the detection limit, or None.
    """

    background: Background
    team: int
    number: int | None = None
    cause: str | None = None
    factor: float | None = None

    @property
    def key(self) -> str:
        """Its name."""
        if self.number is None:
            return f"{self.background}-team{self.team}-clean"
        return f"{self.background}-{self.number:04}-team{self.team}-{self.cause}-x{self.factor:g}"

    @property
    def clean(self) -> "CampaignSet":
        """The same team's clean set, which says how large effects must be."""
        return CampaignSet(self.background, self.team)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, the key with them."""
        return {"key": self.key, **vars(self)}
