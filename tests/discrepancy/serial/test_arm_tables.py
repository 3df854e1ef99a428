"""What the arm's campaign makes of a cause that the catalogue does not have."""

import pytest

from arm.tables import score, strangers, tables
from discrepancy.serial.causes import CAUSES


def result(hidden, *named, seed=1):
    """A set with one cause left out, in joint 2, and what was named: cause and probability."""
    return {
        "seed": seed,
        "kind": "left-out",
        "error": None,
        "cpu_s": 1.0,
        "truth": {"effects": [{"name": hidden, "cause": hidden, "joint": 2, "factor": 4.0, "size": 1.0}]},
        "verdict": {
            "verdict": "explained" if named else "consistent",
            "residual": {"chi2_per_n": 1.0},
            "causes": [
                {"cause": cause, "joint": 2, "probability": p, "family": family(cause), "alternatives": []}
                for cause, p in named
            ],
        },
    }


def family(cause):
    return "law" if cause == "law" else CAUSES[cause].family


@pytest.mark.parametrize(
    ("hidden", "named", "outside"),
    [
        ("ripple", "counterbalance", False),
        ("friction", "asymmetric_coulomb", False),
        ("torque_offset", "asymmetric_coulomb", False),
        ("torque_offset", "stribeck", True),
        ("payload", "counterbalance", True),
        ("elasticity", "spring", True),
        ("torque_scale", "law", False),
    ],
)
def test_a_stranger_is_of_no_family_that_is_hidden(hidden, named, outside):
    one = score(result(hidden, (named, 0.8)))
    assert [e["cause"] for e in strangers(one)] == ([named] if outside else [])


def test_every_set_left_out_is_in_one_column():
    sets = [
        result("ripple"),
        result("ripple", ("law", 0.9)),
        result("ripple", ("spring", 0.9), ("law", 0.9)),
        result("ripple", ("spring", 0.9), ("friction", 0.4)),
        result("payload", ("counterbalance", 0.52)),
    ]
    rows = [line for line in tables(sets).splitlines() if line.startswith(("| `", "| **all**"))]
    left_out = rows[:3]
    assert left_out == [
        "| `payload` | 1 | 0 | 0 | 0 | 1 | 1 |",
        "| `ripple` | 4 | 1 | 1 | 1 | 1 | 0 |",
        "| **all** | 5 | 1 | 1 | 1 | 2 | 1 |",
    ]
    assert "Left out" not in tables([result("ripple") | {"kind": "single"}])
