"""A play, against the rule that defines it, sample by sample."""

import numpy as np
import pytest

from discrepancy.team.causes.friction import played


def stepped(x, half_width):
    """It stays where it is until the signal is farther off than half the width."""
    at, out = float(x[0]), []
    for value in x.tolist():
        at = min(max(at, value - half_width), value + half_width)
        out.append(at)
    return np.array(out)


@pytest.mark.parametrize("samples", [1, 2, 3, 7, 400])
@pytest.mark.parametrize("half_width", [0.0, 1e-3, 0.7, 50.0])
def test_from_turn_to_turn_is_from_sample_to_sample(samples, half_width):
    rng = np.random.default_rng(samples)
    noise = rng.standard_normal(samples)
    for x in (
        noise,
        np.cumsum(noise),
        np.round(np.cumsum(noise)),
        np.repeat(np.round(noise), 3),
        0.0 * noise,
    ):
        np.testing.assert_array_equal(played(x, half_width), stepped(x, half_width))
