"""Two results side by side: what is said to have changed, and what not."""

from __future__ import annotations

import copy
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.stats import chi2

import mocobot
from command import refused, run
from diagnosed import small_diagnosis
from estimator.arm.unit import AT
from estimator.calibrate.json import calibration_to_dict
from estimator.files import write_json
from invented_calibration import invented_calibration
from mocobot.api.comparison_groups import Group

RNG = np.random.default_rng(7)


def spread(size: int) -> np.ndarray:
    """A covariance with correlations."""
    root = RNG.standard_normal((size, size))
    return root @ root.T


def test_false_alarms_are_as_rare_as_they_are_said_to_be():
    """Draws of one truth, with correlations and a common error: p is uniform, by scipy's own distribution."""
    A, B, by_a, by_b = spread(3), spread(3), *RNG.standard_normal((2, 3))
    p, chi = [], []
    for _ in range(4000):
        shared = RNG.standard_normal()
        a, b = (RNG.multivariate_normal(np.zeros(3), C) + by * shared for C, by in ((A, by_a), (B, by_b)))
        group = Group.of("com", "m", ("x", "y", "z"), (a, A), (b, B), common=(by_a, by_b))
        p.append(group.p)
        chi.append(group.chi2)
    np.testing.assert_allclose(p[:20], chi2.sf(chi[:20], 3), rtol=1e-9)
    for level in (0.01, 0.1, 0.5):
        assert np.mean(np.array(p) < level) == pytest.approx(
            level, abs=4 * np.sqrt(level * (1 - level) / 4000)
        )


def test_errors_that_move_together_are_heeded():
    """A difference against a correlation of 0.99 is clear where each number alone is not."""
    C = 0.5 * np.array([[1.0, 0.99], [0.99, 1.0]])
    zero, apart = np.zeros(2), np.array([0.6, -0.6])
    group = Group.of("lengths", "mm", ("1", "2"), (zero, C), (apart, C))
    assert np.abs(group.ratio).max() == pytest.approx(0.6)
    assert group.chi2 == pytest.approx(0.72 / 0.01)
    assert group.p < 1e-12
    assert [(i, j, pytest.approx(r)) for i, j, r in group.together] == [("2", "1", 0.99)]


@pytest.fixture(scope="module")
def estimates(tmp_path_factory) -> Path:
    """Twice one payload, and the same with 50 g of slosh in it."""
    folder = tmp_path_factory.mktemp("compare")
    slosh = mocobot.make_effect(
        "slosh", {"mass_kg": 0.05, "length_m": 0.2, "damping_ratio": 0.2, "point_x_m": 0.3}
    )
    for name, seed, effects in (("a", 1, []), ("b", 2, []), ("c", 3, [slosh])):
        recording = mocobot.simulate("b", vias=9, seed=seed, effects=effects)
        mocobot.estimate(recording).write(folder / f"{name}.json")
    return folder


@pytest.mark.pictures
def test_two_estimates_of_one_payload(estimates, tmp_path, capsys):
    out = tmp_path / "ab"
    code, said, _ = run(
        capsys, "compare", estimates / "a.json", estimates / "b.json", "--strict", "--out", out
    )
    assert code == 0
    assert "NOTHING CHANGED beyond its errors (7 groups" in said
    values = json.loads((out / "comparison.json").read_text())
    assert values["changed"] is False
    assert {group["name"] for group in values["groups"]} >= {"mass", "centre of mass", "inertia"}
    assert (out / "report.txt").read_text().strip() in said
    assert (out / "comparison.png").stat().st_size > 10_000


def test_a_payload_that_got_heavier(estimates, capsys):
    code, said, err = run(capsys, "compare", estimates / "a.json", estimates / "c.json", "--strict")
    assert code == 1
    assert err.startswith("mocobot: they differ: mass (by 0.0")
    (row,) = (line for line in said.splitlines() if line.startswith("mass [kg]"))
    assert row.endswith(" *")
    found = mocobot.compare(estimates / "a.json", mocobot.read_estimate(estimates / "c.json"))
    mass = found.groups[0]
    assert mass.difference[0] == pytest.approx(0.05, abs=3 * mass.se[0])
    assert "grasp of robot 2, position" not in {group.name for group in found.changed_groups}


def test_two_calibrations_share_the_scale_of_the_springs():
    """Two of the same robots, with a known weight and without: then it is an error of one of them alone."""
    a = invented_calibration()
    at = AT["stiffness_ratio"]
    found = {group.name: group for group in mocobot.compare(_calibration(a), _calibration(a)).groups}
    springs = found["robot 1, spring stiffness"]
    held = 1e4 * np.diag(a.covariance)[at]  # of the first robot [%^2]
    np.testing.assert_allclose(springs.se**2, 2 * held)
    weighed = replace(a, scale_sd=0.0, known_mass=("c",))
    found = {group.name: group for group in mocobot.compare(_calibration(a), _calibration(weighed)).groups}
    scale = 100.0 * a.scale_sd * a.by_scale[0, at]
    np.testing.assert_allclose(found["robot 1, spring stiffness"].se ** 2, 2 * held + scale**2)


def test_a_spring_that_got_softer():
    a = invented_calibration()
    moved = np.zeros_like(a.units.x)
    moved[1, AT["stiffness_ratio"]] = 0.0, -0.01, 0.0
    found = mocobot.compare(_calibration(a), _calibration(replace(a, units=a.units.moved(moved))))
    assert [group.name for group in found.changed_groups] == ["robot 2, spring stiffness"]
    assert found.changed_groups[0].difference == pytest.approx([0.0, -1.0, 0.0])


class _calibration:
    """A calibration that says what its file would."""

    def __init__(self, below: Any) -> None:
        self.below = below

    def to_dict(self) -> dict[str, Any]:
        return calibration_to_dict(self.below)


def test_two_diagnoses(tmp_path, capsys):
    """A cause that changed its size, one that the other could have seen, and one that it could not."""
    a = small_diagnosis()
    assert len(a["causes"]) == 1
    b = copy.deepcopy(a)
    (cause,) = b["causes"]
    name, parameter = next((n, p) for n, p in cause["parameters"].items() if p["se"] is not None)
    parameter["value"] += 10.0 * parameter["se"]
    more = {
        **copy.deepcopy(cause),
        "cause": "drag",
        "robot": None,
        "joint": None,
        "name": "drag of the payload",
    }
    more["parameters"] = {"coefficient_Ns_per_m": {"value": 1.0, "se": 0.1}}
    b["causes"].append(more)
    for limit, said in ((0.5, "so it was not there"), (2.0, "so it may be there as well")):
        a["detection_limits"] = [
            {"cause": "drag", "kind": "drag", "robot": None, "joint": None,
             "parameters": {"coefficient_Ns_per_m": limit}}
        ]  # fmt: skip
        for folder, values in (("a", a), ("b", b)):
            write_json(tmp_path / folder / "diagnosis.json", values)
        _, out, _ = run(capsys, "compare", tmp_path / "a", tmp_path / "b")
        text = " ".join(out.split())
        assert "Named in B alone: drag of the payload, coefficient_Ns_per_m 1 +- 0.1; A would" in text
        assert said in text
    found = mocobot.compare(tmp_path / "a", tmp_path / "b")
    (group,) = found.changed_groups
    assert group.name.endswith(f", {name}")
    assert group.ratio[0] == pytest.approx(10.0 / np.sqrt(2.0))


def test_nothing_is_compared_with_something_else(estimates, tmp_path, capsys):
    write_json(tmp_path / "verdict" / "diagnosis.json", small_diagnosis())
    (tmp_path / "empty").mkdir()
    (tmp_path / "other.json").write_text('{"format": "mine"}')
    pq.write_table(pa.table({"time": [0.0]}), tmp_path / "rec.parquet")
    est = estimates / "a.json"
    for other, said in (
        ("rec.parquet", "rec.parquet: a Parquet file, as recordings are; it must be an estimate of"),
        ("verdict", "is an estimate and verdict a diagnosis; both must be of one kind"),
        ("empty", "empty: holds no result; name the file of an estimate of"),
        ("other.json", "other.json: format is 'mine'; it must be an estimate of"),
        (estimates, "holds 3 JSON files; name the file of"),
    ):
        sentence = refused(capsys, "compare", est, tmp_path / other)
        assert said.replace("verdict", str(tmp_path / "verdict")) in sentence
