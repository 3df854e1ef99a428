"""Recordings that no calibration can be made of are refused, with what is wrong."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from estimator.calibrate.calibrate import calibrate
from estimator.errors import InputError
from estimator.recording.model import Recording
from recorded_team import Sines, carry
from recordings import small_recording


def named(name: str, **changes: Any) -> Recording:
    return replace(small_recording(**changes), name=name)


A, B, FREE = named("a"), named("b"), named("unloaded", trial="free", payload=None)
OTHER = replace(A.metadata.design, rod_mass_kg=0.3)


@pytest.mark.parametrize(
    ("carrying", "free", "said"),
    [
        ([], [], "no recording with a payload was given"),
        ([A, FREE], [], "unloaded is of robots that hold nothing; give it as a free recording"),
        ([A], [B], "b is a random trial of a payload; a free recording is of robots that hold nothing"),
        ([A, named("b", payload="x")], [], "a does not say which payload it is of, and others do; name it"),
        ([A, named("b", robots=2)], [], "b has 2 robots and a has 3; a calibration is of the same robots"),
        ([A], [named("u", robots=2, trial="free")], "u has 2 robots and a has 3; a calibration is of the same robots"),
        ([A, named("b", design=OTHER)], [], "b and a differ in design; a calibration is of the same robots"),
        ([named("one", robots=1)], [], "one: one robot closes no loop; two or more that carry one payload are needed"),
    ],
)  # fmt: skip
def test_what_does_not_belong_together(carrying: list[Recording], free: list[Recording], said: str) -> None:
    with pytest.raises(InputError) as error:
        calibrate(carrying, free)
    assert str(error.value).startswith(said)


@pytest.fixture(scope="module")
def exact() -> Recording:
    rng = np.random.default_rng(4)
    path = Sines.draw(rng, [0.06] * 3 + [0.02] * 3, 6, 0.1, 1.0)
    return replace(carry(path, Sines.draw(rng, [4.0] * 3, 6, 0.1, 1.0), 6.0).recording, name="exact")


@pytest.mark.parametrize(
    ("known", "said"),
    [
        ({"x": (1.0, 0.1)}, "known mass of payload 'x': the recordings are of ''"),
        *[
            (
                {"": given},
                rf"known mass of payload '' is {given[0]} \+- {given[1]} kg; both must be greater than 0",
            )
            for given in ((0.0, 0.1), (-1.0, 0.1), (np.inf, 0.1), (11.0, 0.0), (11.0, -0.1), (11.0, np.nan))
        ],
    ],
)
def test_masses_that_cannot_be(exact: Recording, known: dict[str, tuple[float, float]], said: str) -> None:
    with pytest.raises(InputError, match=f"^{said}"):
        calibrate([exact], known_mass=known)


def test_motion_that_determines_nothing(exact: Recording) -> None:
    still = {name: np.repeat(getattr(exact, name)[:1], 600, axis=0) for name in ("phi", "theta", "tau")}
    rng = np.random.default_rng(1)
    noisy = {name: values + 1e-5 * rng.standard_normal(values.shape) for name, values in still.items()}
    with pytest.raises(InputError, match=r"^nothing can be estimated from these recordings: rotation R_12"):
        calibrate([replace(exact, time=np.arange(600) / 100.0, **noisy)])
