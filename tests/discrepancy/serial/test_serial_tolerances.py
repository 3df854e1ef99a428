"""What is within its tolerance: together exactly, even of causes left out; and laws of other forms than real ones."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from discrepancy.serial.causes import CAUSES
from discrepancy.serial.causes.friction import bent
from discrepancy.serial.causes.stribeck import slowest_fading
from discrepancy.serial.rig import SerialRig
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from discrepancy.inference.base import without_any
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.other_forms import beside_other_forms
from discrepancy.inference.scan import scan
from discrepancy.inference.search import search
from discrepancy.joints.model import load_model
from discrepancy.least_squares.problem import Problem
from discrepancy.rules import PRIOR_ODDS
from discrepancy.rules import serial as rules
from serial_made import ARM, nominal, nominal_file, simulated, spec

TILT, ZERO, SHARE = 0.03, 0.01, 0.2


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> SerialRig:
    """An arm with a heavier forearm on a tilted base, and a zero that is off, by MuJoCo."""
    hidden = spec()
    fore = hidden.body("fore")
    fore.mass *= 1.0 + SHARE
    fore.fullinertia = np.asarray(fore.fullinertia) * (1.0 + SHARE)
    hidden.option.gravity = Rotation.from_rotvec([-TILT, 0.0, 0.0]).apply([0.0, 0.0, -9.81])
    off = ZERO * np.array([0.0, 1.0, 0.0, 0.0])
    log = simulated(hidden.compile(), 3, seconds=12.0, step_rad=0.0, read=lambda q, torque: (q - off, torque))
    return SerialRig.of(nominal(tmp_path_factory.mktemp("arm")), [log])


def test_tolerances_together_are_exact(rig: SerialRig) -> None:
    """A mass and a tilt, each in straight columns, miss their product."""
    values = {
        ("link_mass", 3): [2.0 * SHARE],
        ("gravity_direction", None): [TILT, 0.0],
        ("joint_zero", 2): [ZERO],
    }
    active = [
        (c, np.array(values[c.cause, c.joint])) for c in rig.candidates() if (c.cause, c.joint) in values
    ]
    assert len(active) == 3
    none = rig.physical_residual([])
    straight = [r - sum(rig.physical(c)[t] @ v for c, v in active) for t, r in enumerate(none)]
    exact = rig.physical_residual(active)
    noise = np.sqrt(np.mean(np.concatenate([rig.sigma(t) for t in range(len(none))]) ** 2, axis=0))
    size = [np.sqrt(np.mean(np.concatenate(x) ** 2, axis=0)) for x in (straight, exact)]
    assert np.all(size[1] < 2.0 * noise)
    assert size[0][0] > 5.0 * size[1][0]  # the waist feels gravity only where the base is tilted


@pytest.mark.slow
def test_links_scatter_no_further_than_links_can_be(tmp_path: Path) -> None:
    """Rotors of a model that has none: links of ten times their inertia would explain them as well."""
    bare = load_model(nominal_file(tmp_path, re.sub(r' armature="[0-9.]*"', "", ARM)))
    rig = SerialRig.of(bare, [simulated(spec().compile(), 5, seconds=12.0)])
    own = spec().compile().body_inertia[1:]  # principal moments, by MuJoCo
    links = [c for c in rig.candidates() if c.cause == "link_inertia"]
    twice = [2.0 * c.most_spread * c.parameters[0].tolerance for c in links]
    np.testing.assert_allclose(twice, rules.MOST_INERTIA_SHARE * own.mean(axis=1), rtol=1e-6)
    searched = search(rig)
    rotors = {c.joint for c in searched.best.causes if c.cause == "armature"}
    assert rotors >= {1, 2, 3}
    problem = searched.best.problem
    for index, candidate in enumerate(problem.candidates):
        if candidate.cause == "link_inertia":
            assert problem.spread[problem.columns_of(index)].max() <= candidate.most_spread


def test_friction_that_gives_way_is_dahls() -> None:
    """By integration of his equation, db/dt = v / s (1 - b sgn v)."""
    time, length = np.linspace(0.0, 6.0, 3001), 2e-3

    def rate(t: float, b: np.ndarray) -> np.ndarray:
        v = 0.02 * np.cos(2.0 * t) + 0.015 * np.cos(5.0 * t)
        return v / length * (1.0 - b * np.sign(v))

    q = 0.01 * np.sin(2.0 * time) + 0.003 * np.sin(5.0 * time)
    found = solve_ivp(rate, (0.0, 6.0), [0.0], t_eval=time, max_step=1e-3, rtol=1e-8)
    assert bent(q, length) == pytest.approx(found.y[0], abs=0.01)


def test_what_is_left_out_keeps_its_tolerance(tmp_path: Path) -> None:
    """It is not named, and healthy deviations of it are no news for others."""
    rubs = ARM.replace("armature=", 'frictionloss="0.15" damping="0.2" armature=')
    model = load_model(nominal_file(tmp_path, rubs))
    rig = SerialRig.of(model, [simulated(spec(rubs).compile(), 5, seconds=12.0)], excluded=["friction"])
    friction = [c for c in rig.candidates() if c.cause == "friction"]
    assert [c.hidden for c in friction] == [True] * 4
    assert friction[0].parameters[0].tolerance == pytest.approx(0.15 * rules.JOINT_SHARE)
    nothing = without_any(rig, PRIOR_ODDS, lambda what: None)
    assert "friction" not in {item.candidate.cause for item in scan(nothing.fit)}
    assert {item.candidate.cause for item in scan(nothing.fit)} >= {"stribeck", "joint_zero"}


@pytest.mark.parametrize(
    ("cause", "values"),
    [("stribeck", [-0.1]), ("sublinear_friction", [-0.1]), ("load_friction", [-0.1]),
     ("coupled_drive", [0.1, 0.1, -0.1])],
)  # fmt: skip
def test_what_no_contact_can_do(rig: SerialRig, cause: str, values: list[float]) -> None:
    se = np.full(len(values), 0.01)
    assert not CAUSES[cause].possible(rig.tree, 2, np.array(values), se)
    assert CAUSES[cause].possible(rig.tree, 2, np.abs(values), se)


def test_what_is_hardly_negative_beside_much_is_nought(rig: SerialRig) -> None:
    """By chance up to three standard errors; by the law's own error up to a fifth of what stands out."""
    pair, se = CAUSES["coupled_drive"], np.array([0.01, 0.02, 0.001])
    for rotor, much, can in ((-2.9, 5.0, True), (-3.1, 5.0, False), (-9.0, 50.0, True), (-11.0, 50.0, False)):
        assert pair.possible(rig.tree, 2, se * [much, 0.0, rotor], se) is can
    assert not pair.possible(rig.tree, 2, se * [-50.0, 0.0, 0.0], se)


def test_fading_over_all_speeds_is_no_stribeck_friction() -> None:
    near = [{"fade_per_s": fade, "typical_per_s": 2.0} for fade in (0.17, 0.1)]
    fades = [[s["fade_per_s"] for s in CAUSES["stribeck"].finer(shape)] for shape in near]
    np.testing.assert_allclose(fades[0], [0.136])
    np.testing.assert_allclose(fades[1], [0.08, 0.125])
    # A joint that hardly moved may rub like that over all of its speeds.
    slow = CAUSES["stribeck"].finer({"fade_per_s": 0.05, "typical_per_s": 0.1})
    assert [s["fade_per_s"] for s in slow] == pytest.approx([0.04, 0.0625])


def test_most_of_a_peak_is_no_straight_line() -> None:
    """Over evenly spread speeds the longest peak is less than half Coulomb and viscous friction."""
    speed = np.linspace(0.0, 2.0, 4001)
    line = np.column_stack([np.ones_like(speed), speed])
    peak = np.exp(-speed / slowest_fading(1.0))
    left = peak - line @ np.linalg.lstsq(line, peak, rcond=None)[0]
    assert np.sum(left**2) > 0.5 * np.sum(peak**2)


def test_what_another_form_explains_is_no_credit(rig: SerialRig) -> None:
    """A torque twice a turn with a harmonic: a balancer beside it would be named for the harmonic."""
    # Of the elbow, in the rows of the residual that this arm has.
    q = [part.signals.q[part.reduction.samples[k], 2] for part, k in rig.block_of]
    pure = replace(rig, tolerances={}, _seen={})
    candidates = pure.candidates()
    index = {(c.cause, c.joint): i for i, c in enumerate(candidates)}
    ripple, balancer = index["ripple", 3], index["counterbalance", 3]
    assert candidates[ripple].shape["turns"] == 2.0
    rows = []
    for t, own in enumerate(pure.rows(candidates)):
        torque = np.zeros_like(own.residual)
        torque[:, 2] = 0.3 * np.sin(2.0 * q[t]) + 0.03 * np.sin(4.0 * q[t] + 1.0)
        noise = np.random.default_rng(t).standard_normal(own.residual.shape)
        rows.append(replace(own, residual=pure.whitening[t](torque) + noise))
    problem = Problem.of(rows, candidates)
    base, both = (Hypothesis.of(problem, free) for free in ([ripple], [ripple, balancer]))
    gained = both.learnt.log_evidence - base.learnt.log_evidence
    judged = beside_other_forms(pure, both, balancer, base)
    assert gained > 10.0
    assert judged.allowed[balancer] > 0.5 * gained
    # Beside nothing all of it is to its credit.
    alone = beside_other_forms(pure, Hypothesis.of(problem, [balancer]), balancer, Hypothesis.of(problem, []))
    assert not alone.allowed.get(balancer)
