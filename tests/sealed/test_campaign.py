"""The sealed campaign runs: a set is drawn, simulated, kept, scored and told in a table."""

from dataclasses import asdict, replace

import pytest

from hidden import Schedule
from sealed import sets
from sealed.limits import LIMITS
from sealed.score import score, score_laws
from sealed.sets import FORMS, plan
from sealed.tables import misses, tables

TINY = Schedule(randoms=1, vias=1, periodic_s=None, hold_s=None)


@pytest.mark.slow
def test_a_set_is_made_kept_and_scored(tmp_path):
    """The same seed gives the same bits; the hidden cause at its place is right, another one is not."""
    assert set(LIMITS) == set(FORMS)
    request = replace(plan("forms", 3, "x3", 4.0, "driven_lugre"), schedule=TINY)
    truths = [sets.simulate(request, tmp_path / name) for name in "ab"]
    assert truths[0] == truths[1] == sets.truth_of(request, tmp_path / "a")
    files = [sets.recordings_of(request, tmp_path / name) for name in "ab"]
    assert [f.read_bytes() for f in files[0]] == [f.read_bytes() for f in files[1]]
    assert sets.kept(tmp_path / "a") == [request]
    (effect,) = truths[0]["effects"]
    answer = effect["answer"]
    assert answer["cause"] == "joint_friction"
    for cause, whole in (("joint_friction", True), ("sea_bias", False)):
        values = answer["known"] if whole else {"bias_Nm": 0.1}
        named = {
            "cause": cause, "family": "dissipation", "name": cause, "robot": answer["robot"], "told": [],
            "joint": answer["joint"], "probability": 0.95, "alternatives": [], "kind": cause, "law": None,
            "parameters": {name: {"value": 1.02 * value, "se": 0.02 * value} for name, value in values.items()},
        }  # fmt: skip
        result = {
            "key": request.key, "set": asdict(request), "error": None, "cpu_s": 10.0, "peak_gb": 0.5,
            "truth": truths[0],
            "verdict": {"verdict": "explained", "causes": [named], "gain": None, "residual": {"chi2_per_n": 1.0}},
        }  # fmt: skip
        result["law_scores"] = [asdict(one) for one in score_laws(result)]
        scored = score(result)
        assert scored.whole is whole
        assert scored.stated == ((0.95, whole),)
        assert f"| forms | 1 | {int(whole)} of 1 |" in tables([result])
        assert bool(misses([result])) is not whole
