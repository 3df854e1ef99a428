"""Pictures of teams, one call each; for several, ``render_shots`` renders shots in one process.

All return a picture, shape (height, width, 3), or one sentence that says why there is none.
"""

from collections.abc import Sequence
from pathlib import Path

from discrepancy.result.read import NamedCause
from estimator.estimate.result import PayloadEstimate
from estimator.recording.model import Recording
from mocobot_view.facts.body_facts import BodyFacts
from mocobot_view.pictures.render import Picture, Shot, render_shots
from mocobot_view.pictures.shots import diagnosis_shot, estimate_shot, team_shot

WIDTH, HEIGHT = 1600, 1000


def team_view(payload: str | Path, width: int = WIDTH, height: int = HEIGHT) -> Picture | str:
    """The team as designed, at rest, holding a payload; see ``team_shot``."""
    return _one(team_shot(payload, width / height), width, height)


def estimate_view(
    recording: Recording,
    estimate: PayloadEstimate,
    width: int = WIDTH,
    height: int = HEIGHT,
    *,
    truth: BodyFacts | None = None,
    payload: str | Path | None = None,
    time_s: float | None = None,
) -> Picture | str:
    """The team as estimated, at one measured instant; see ``estimate_shot``."""
    return _one(estimate_shot(recording, estimate, truth, payload, time_s, width / height), width, height)


def diagnosis_view(
    recording: Recording,
    estimate: PayloadEstimate,
    causes: Sequence[NamedCause],
    width: int = WIDTH,
    height: int = HEIGHT,
    *,
    payload: str | Path | None = None,
    time_s: float | None = None,
) -> Picture | str:
    """The team as estimated, causes of a diagnosis in red; see ``diagnosis_shot``."""
    return _one(diagnosis_shot(recording, estimate, causes, payload, time_s, width / height), width, height)


def _one(shot: Shot, width: int, height: int) -> Picture | str:
    made = render_shots([shot], width, height)
    return made if isinstance(made, str) else made[0]
