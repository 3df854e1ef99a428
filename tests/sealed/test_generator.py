"""The blind generator: equal bits, sealed truth, limits; and that what hides and what finds share no code."""

import ast
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import discrepancy.team.causes
import mocobot_sim.effects
from discrepancy.team.causes import CAUSES
from hidden import LIMITS, HiddenSet, Schedule, Sealed, generate, ground_of, pendulum_limit_kg
from mocobot.campaign.effects import draw_effect
from mocobot_sim.effects import EFFECTS

generated = cache(generate)


def tiny_set(seed: int) -> HiddenSet:
    """Hardly a second of motion."""
    schedule = Schedule(randoms=1, vias=1, periodic_s=4.0, hold_s=None)
    return HiddenSet("single", seed, ("sea_bias",), schedule=schedule, timestep_s=1e-3)


def test_equal_requests_give_equal_bits():
    first, second = generated(tiny_set(3)), generate(tiny_set(3))
    assert first[1].open({}) == second[1].open({})
    assert all((a.tau == b.tau).all() for a, b in zip(first[0], second[0], strict=True))
    other = generated(tiny_set(4))
    assert other[1].open({}) != first[1].open({})


def test_recordings_do_not_say_what_is_hidden():
    recordings, _ = generated(tiny_set(3))
    assert len(recordings) == 2
    for recording in recordings:
        assert not [cause for cause in EFFECTS if cause in recording.metadata.to_json() + recording.name]


def test_truth_is_sealed_without_a_verdict():
    with pytest.raises(ValueError, match="sealed"):
        Sealed({"effects": []}).open(None)


def test_pendulum_is_measured_by_the_limit_of_its_own_length():
    """A slow one is hardly excited, and has to be twice as heavy to be seen."""
    assert pendulum_limit_kg(0.2) == LIMITS["slosh"]["mass_kg"]
    assert pendulum_limit_kg(0.5) > 1.9 * LIMITS["slosh"]["mass_kg"]
    ground = ground_of(3, np.zeros(3), [])
    for seed in range(5):
        effect = draw_effect("slosh", 4.0, ground, np.random.default_rng(seed))
        assert effect.mass_kg == pytest.approx(4.0 * pendulum_limit_kg(effect.length_m))


def test_every_cause_has_a_limit_and_an_effect():
    assert set(LIMITS) == set(CAUSES) == set(EFFECTS) - {"law", "zero_scatter"}


def imports(package) -> dict[str, set[str]]:
    """Modules imported by every module of a package."""
    out = {}
    for path in Path(package.__file__).parent.glob("*.py"):
        names = set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names |= {node.module or ""} | {f"{node.module}.{alias.name}" for alias in node.names}
        out[path.name] = names
    assert len(out) > 5
    return out


@pytest.mark.parametrize(
    ("package", "forbidden"),
    [(discrepancy.team.causes, "mocobot_sim"), (mocobot_sim.effects, "discrepancy")],
    ids=["causes", "effects"],
)
def test_what_hides_and_what_finds_share_no_code(package, forbidden):
    for module, names in imports(package).items():
        assert not [name for name in names if name.split(".")[0] == forbidden], module
