"""An unlisted law that is likelier than the cause in the fit: its formula comes from a fit of its own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from discrepancy.evidence.probability import Odds, Rival, odds_of
from discrepancy.evidence.search import Search, State
from discrepancy.joints import verdict
from discrepancy.joints.diagnosed import JointDiagnosed
from serial_made import nominal, simulated, spec

PER_LOAD = 0.15
"""Dry friction over torque."""


def rubs(_q: np.ndarray, v: np.ndarray, torque: np.ndarray, _time: float) -> np.ndarray:
    return 0.2 * v + np.array([0.0, PER_LOAD, 0.0, 0.0]) * np.abs(torque) * np.tanh(v / 1e-3)


def test_a_likelier_unlisted_law_has_values_of_its_own_fit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Friction by load is in the fit; told that an unlisted law of load is likelier, its curve is that friction."""

    def likelier(search: Search, state: State) -> list[Odds]:
        found = odds_of(search, state)
        k = next(k for k, o in enumerate(found) if o.chosen.group.cause == "load_friction")
        law = next(
            g
            for g in search.problem.groups
            if g.cause == "unlisted" and g.place == "shoulder" and dict(g.shape)["signal"] == 4.0
        )
        others = tuple(r for r in found[k].rivals if r.group is None or r.group.cause != "unlisted")
        found[k] = replace(found[k], probability=0.3, rivals=(Rival(law, 0.7), *others))
        return found

    monkeypatch.setattr(verdict, "odds_of", likelier)
    judged = verdict.judged(nominal(tmp_path), [simulated(spec().compile(), 3, rubs)])
    (found,) = (f for f in judged.findings if f.probability == 0.7)
    assert (found.place, found.of, found.probability) == ("shoulder", "load and direction", 0.7)
    assert ("load_friction", "shoulder") in {(r.cause, r.place) for r in found.rivals}
    assert not [r for r in found.rivals if r.cause == "unlisted" and r.probability == 0.7]
    assert found.law is not None
    # Per load, and not per torque of the drive, which rises with the friction.
    assert found.law.numbers[0]["amplitude"] == pytest.approx(PER_LOAD / (1.0 - PER_LOAD), rel=0.2)
    names = [cause["name"] for cause in JointDiagnosed(judged).values["causes"]]
    assert "something unlisted at joint 2 (shoulder) by its load and direction" in names
