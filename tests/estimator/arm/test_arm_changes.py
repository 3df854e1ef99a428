"""Derivatives of an arm's data against central differences of the data themselves."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.arm.motion import BY_UNIT, COUNT, STEPS, ArmChanges, ArmData
from estimator.arm.unit import COUNT as DEVIATIONS
from estimator.arm.unit import ArmUnit
from estimator.arrays import Array
from estimator.rigid_team import robot_data
from omnid_design import DESIGN

INSTANTS = 12
RNG = np.random.default_rng(0)
UNIT = ArmUnit(DESIGN, 5e-3 * RNG.standard_normal(DEVIATIONS))
SIGNALS: Array = np.concatenate([
    RNG.uniform(0.2, 0.5, (INSTANTS, 3)), RNG.normal(size=(INSTANTS, 6)),
    RNG.uniform(-0.3, 0.3, (INSTANTS, 3)), RNG.normal(size=(INSTANTS, 6)),
    RNG.normal(0.0, 5.0, (INSTANTS, 3)),
], axis=1)  # fmt: skip


def difference(data: list[ArmData], step: float) -> list[Array]:
    return [(after - before) / (2.0 * step) for before, after in zip(*data, strict=True)]


def compare(found: ArmData, k: int, expected: list[Array]) -> None:
    for name, part, whole in zip(ArmData._fields, expected, found, strict=True):
        scale = max(1.0, float(np.abs(whole).max()))
        assert whole[k] == pytest.approx(part, abs=3e-5 * scale), (name, k)


@pytest.mark.parametrize("k", range(COUNT))
def test_by_signals(k: int) -> None:
    step = STEPS[k]
    moved = [SIGNALS + sign * step * np.eye(COUNT)[k] for sign in (-1.0, 1.0)]
    expected = difference([robot_data(s, UNIT) for s in moved], step)
    compare(ArmChanges(SIGNALS, UNIT).by_signals(), k, expected)


@pytest.mark.parametrize("k", range(len(BY_UNIT)))
def test_by_deviations(k: int) -> None:
    step = 1e-6
    moved = [UNIT.moved(sign * step * np.eye(DEVIATIONS)[BY_UNIT[k]]) for sign in (-1.0, 1.0)]
    expected = difference([robot_data(SIGNALS, unit) for unit in moved], step)
    compare(ArmChanges(SIGNALS, UNIT).by_unit(), k, expected)
