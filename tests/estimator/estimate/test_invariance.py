"""An estimate in other units, from other bases and with other numbers of robots says the same, errors included."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.estimate import uncertainty
from estimator.estimate.consistency import Trial
from estimator.estimate.payload import Method, estimate_from_trials
from estimator.estimate.result import PayloadEstimate
from estimator.signals import GraspData
from rigid_body_data import make_body, moving, still

NOISE = {"twist_noise": 1e-4, "linear_noise": 2e-5, "wrench_noise": 0.05}
TILTS = ((0.0, 0.0), (0.08, 0.0), (0.0, 0.08), (-0.06, 0.05))
METHODS: tuple[Method, ...] = ("joint", "staged")


@cache
def trials() -> tuple[GraspData, GraspData]:
    """Motion, and holds."""
    body = make_body(3)
    return moving(body, 14, seed=3, **NOISE), still(body, TILTS, 7.0, seed=4, **NOISE)


def estimated(data: Sequence[GraspData], method: Method) -> PayloadEstimate:
    every = [Trial(f"trial {k}", "random", None, each) for k, each in enumerate(data)]
    return estimate_from_trials(every, method)


@cache
def plain(method: Method) -> PayloadEstimate:
    return estimated(trials(), method)


def same(
    found: PayloadEstimate,
    expected: PayloadEstimate,
    *,
    mass: float = 1.0,
    length: float = 1.0,
    rtol: float = 1e-5,
) -> None:
    """Equal in units of a mass and a length."""

    def close(a: object, b: object, factor: float = 1.0) -> None:
        b = factor * np.asarray(b)
        np.testing.assert_allclose(a, b, rtol=rtol, atol=rtol * float(np.abs(b).max()))

    for estimate in (found, expected):
        assert estimate.mass is not None
        assert estimate.inertia is not None
        assert estimate.p_1c_se_m is not None
        assert estimate.grasps is not None
    assert found.method == expected.method
    close(found.mass.mass, expected.mass.mass, mass)
    close(found.mass.se, expected.mass.se, mass)
    close(found.p_1c, expected.p_1c, length)
    close(found.p_1c_se_m, expected.p_1c_se_m, length)
    close(found.inertia.inertia, expected.inertia.inertia, mass * length**2)
    close(found.inertia.covariance, expected.inertia.covariance, mass**2 * length**4)
    close(found.grasps.R_1i, expected.grasps.R_1i)
    close(found.grasps.p_1i, expected.grasps.p_1i, length)
    scale = np.tile(np.repeat([1.0, length], 3), found.robots - 1)
    close(found.grasps.covariance / np.outer(scale, scale), expected.grasps.covariance)
    assert [step.step for step in found.steps] == [step.step for step in expected.steps]
    assert [step.rank for step in found.steps] == [step.rank for step in expected.steps]
    for a, b in zip(found.recordings, expected.recordings, strict=True):
        assert a.holds == b.holds
        close(a.force_residual, b.force_residual)
        assert (a.moment_residual_m is None) == (b.moment_residual_m is None)
        if a.moment_residual_m is not None:
            close(a.moment_residual_m, b.moment_residual_m, length)


@pytest.mark.parametrize("method", METHODS)
def test_bases_that_stand_elsewhere(method: Method) -> None:
    turn = Rotation.from_rotvec([[0.0, 0.0, 2.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.5]]).as_matrix()
    data = [
        replace(each, R_bi=turn @ each.R_bi, p_bi=(turn @ each.p_bi[..., None])[..., 0] + [1.0, -2.0, 0.3])
        for each in trials()
    ]
    same(estimated(data, method), plain(method))


@pytest.mark.parametrize("method", METHODS)
def test_forces_in_other_units(method: Method) -> None:
    data = [replace(each, wrench=1.5 * each.wrench) for each in trials()]
    # Holds begin and end by newtons.
    same(estimated(data, method), plain(method), mass=1.5, rtol=1e-5 if method == "joint" else 0.05)


@pytest.mark.parametrize("method", METHODS)
def test_lengths_in_other_units(method: Method) -> None:
    """Gravity is a length over the square of a time, and so are forces at the same mass."""
    f = 1.1
    own = np.repeat([1.0, f], 3)
    data = [
        replace(
            each, p_bi=f * each.p_bi, twist=own * each.twist, twist_dot=own * each.twist_dot,
            gravity_mps2=f * each.gravity_mps2, wrench=np.repeat([f * f, f], 3) * each.wrench,
        )
        for each in trials()
    ]  # fmt: skip
    same(estimated(data, method), plain(method), length=f, rtol=1e-3 if method == "joint" else 0.05)


@pytest.mark.parametrize("method", METHODS)
def test_times_in_other_units(method: Method, monkeypatch: pytest.MonkeyPatch) -> None:
    f = 1.1
    expected = estimated(trials()[:1], method) if method == "joint" else plain(method)
    monkeypatch.setattr(uncertainty, "WINDOW_S", f * uncertainty.WINDOW_S)
    data = [
        replace(
            each, time=f * each.time, rate_hz=each.rate_hz / f, twist=each.twist / f, twist_dot=each.twist_dot / f**2,
            wrench=each.wrench / f**2, gravity_mps2=each.gravity_mps2 / f**2,
        )
        for each in trials()
    ]  # fmt: skip
    if method == "joint":
        same(estimated(data[:1], method), expected, rtol=1e-4)
    else:
        found = estimated(data, method)
        assert found.mass is not None
        assert expected.mass is not None
        assert found.mass.mass == pytest.approx(expected.mass.mass, rel=1e-3)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("order", [(0, 2, 1), (1, 0, 2)])
def test_robots_with_other_numbers(method: Method, order: tuple[int, ...]) -> None:
    at = list(order)
    data = [
        replace(
            each, R_bi=each.R_bi[:, at], p_bi=each.p_bi[:, at], twist=each.twist[:, at],
            twist_dot=each.twist_dot[:, at], wrench=each.wrench[:, at],
        )
        for each in trials()
    ]  # fmt: skip
    found, expected = estimated(data, method), plain(method)
    assert found.grasps is not None
    assert expected.grasps is not None
    assert found.mass is not None
    assert expected.mass is not None
    assert found.p_1c is not None
    assert expected.p_1c is not None
    rtol = 1e-5 if order[0] == 0 else 0.05  # the linear part of twists is weighed in the frame of robot 1
    assert found.mass.mass == pytest.approx(expected.mass.mass, rel=1e-4)
    assert found.mass.se == pytest.approx(expected.mass.se, rel=rtol)
    for i in range(3):
        for j in range(3):
            if i != j:
                a, b = found.grasps.pair(i + 1, j + 1), expected.grasps.pair(at[i] + 1, at[j] + 1)
                np.testing.assert_allclose(a.p_ij, b.p_ij, atol=1e-4)
                np.testing.assert_allclose(a.R_ij, b.R_ij, atol=1e-4)
                np.testing.assert_allclose(a.p_se_m, b.p_se_m, rtol=max(rtol, 1e-4))
                np.testing.assert_allclose(a.axis_angle_se_rad, b.axis_angle_se_rad, rtol=max(rtol, 1e-4))
    first = expected.grasps
    c = first.R_1i[at[0]].T @ (expected.p_1c - first.p_1i[at[0]])
    np.testing.assert_allclose(found.p_1c, c, atol=1e-4)


def test_a_recording_in_two_parts() -> None:
    """Nothing but the edges of windows and of holds changes where the parts are given one by one."""
    (whole, _), half = trials(), trials()[0].samples // 2

    def part(rows: slice) -> GraspData:
        names = ("time", "R_bi", "p_bi", "twist", "twist_dot", "wrench")
        return replace(whole, **{name: getattr(whole, name)[rows] for name in names})

    found = estimated([part(slice(0, half)), part(slice(half, None))], "joint")
    expected = estimated([whole], "joint")
    assert found.mass is not None
    assert expected.mass is not None
    assert found.grasps is not None
    assert expected.grasps is not None
    assert found.mass.mass == pytest.approx(expected.mass.mass, rel=1e-9)
    np.testing.assert_allclose(found.grasps.p_1i, expected.grasps.p_1i, rtol=1e-9, atol=1e-9)
    assert found.p_1c == pytest.approx(expected.p_1c, rel=1e-6)
    assert 0.5 < found.mass.se / expected.mass.se < 2.0


@pytest.mark.parametrize(("rest_s", "tells"), [(9.0, True), (11.0, False)])
def test_recordings_at_rest_half_of_the_time_tell_no_inertia(rest_s: float, tells: bool) -> None:
    body = make_body(3)
    moves, rests = moving(body, 10, seed=3, **NOISE), still(body, TILTS[:1], rest_s, seed=4, **NOISE)
    names = ("R_bi", "p_bi", "twist", "twist_dot", "wrench")
    both = {name: np.concatenate([getattr(moves, name), getattr(rests, name)]) for name in names}
    time = np.arange(len(both["twist"])) / moves.rate_hz
    found = estimated([*trials(), replace(moves, time=time, **both)], "staged")
    assert [record.inertia is not None for record in found.recordings] == [True, False, tells]
    assert [record.holds for record in found.recordings] == [0, 4, 1]
