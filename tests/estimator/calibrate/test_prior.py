"""The prior's file."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from estimator.arm.unit import AT, COUNT
from estimator.calibrate.calibration import LARGEST, Prior, read_prior
from estimator.errors import InputError


def written(folder: Path, text: str) -> Path:
    path = folder / "prior.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_what_is_given_and_defaults_for_the_rest(tmp_path: Path) -> None:
    read = read_prior(written(tmp_path, "geometry_m = 2e-3\ntilt_rad = 0.0035\narm_mass_ratio = 0\n"))
    assert read == Prior(geometry_m=2e-3, tilt_rad=0.0035)
    assert read_prior(written(tmp_path, "")) == Prior()


def test_every_field_may_be_given_and_defaults_are_allowed(tmp_path: Path) -> None:
    names = [field.name for field in fields(Prior)]
    assert set(LARGEST) == set(names)
    text = "\n".join(f"{name} = {0.4 * LARGEST[name]}" for name in names)
    assert read_prior(written(tmp_path, text)) == Prior(**{name: 0.4 * LARGEST[name] for name in names})
    assert all(0 <= getattr(Prior(), name) <= LARGEST[name] for name in names)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("geometry_mm = 1", r"unknown key 'geometry_mm' \(did you mean 'geometry_m'\?\); the keys are encoder_"),
        ("geometry_m = 1", "geometry_m is 1; it must be a standard deviation from 0 to 0.05 m$"),
        ("encoder_zero_rad = -0.01", "encoder_zero_rad is -0.01; it must be a standard deviation from 0 to 0.35 rad$"),
        ("stiffness_ratio = 2", "stiffness_ratio is 2; it must be a standard deviation from 0 to 0.5$"),
        ("tau_zero_Nm = nan", "tau_zero_Nm is nan; it must be a standard deviation from 0 to 5 N m$"),
        ("tilt_rad = true", "tilt_rad is True; it must be"),
        ("arm_mass_ratio = '10 %'", "arm_mass_ratio is '10 %'; it must be"),
        ("geometry_m 1", r"not a readable prior of a calibration \("),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=rf"prior\.toml: {said}"):
        read_prior(written(tmp_path, text))


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        read_prior(tmp_path / "none.toml")


def test_the_mean_of_all_springs_is_held_and_the_arms_weigh_more_or_less_together() -> None:
    """What a prior means, by draws of it."""
    factor = Prior(arm_mass_ratio=0.1).factor(2, hold_scale=True)
    draws = factor @ np.random.default_rng(2).standard_normal((factor.shape[1], 4000))
    x = draws.T.reshape(-1, 2, COUNT)
    springs = x[:, :, AT["stiffness_ratio"]]
    np.testing.assert_allclose(springs.mean(axis=(1, 2)), 0.0, atol=1e-15)
    np.testing.assert_allclose(springs.std(axis=0), 0.02 * np.sqrt(5 / 6), rtol=0.05)
    wrists = x[:, :, AT["wrist_mass_ratio"]][..., 0]
    assert np.mean(wrists[:, 0] * wrists[:, 1]) == pytest.approx(0.05**2, rel=0.25)
    assert wrists.std() == pytest.approx(np.hypot(0.1, 0.05), rel=0.05)
