"""What is told of a verdict on a robot of joints: words, JSON, text, folder, page, comparison."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from command import refused, run
from diagnosed import check_finite, small_diagnosis
from discrepancy.cause_names import JOINTS as EXCLUDABLE
from discrepancy.evidence.findings import Finding, Limit, Rival
from discrepancy.joints import diagnosed
from discrepancy.joints.causes import CAUSES, OTHERS, WORDS, Said, parameter_name
from discrepancy.joints.diagnosed import verdict_to_dict
from discrepancy.result.read import read_diagnosis
from discrepancy.result.report import format_verdict
from estimator.errors import InputError
from joint_verdicts import (
    JOINTS,
    TRIALS,
    a_payload,
    a_push,
    finding,
    friction_everywhere,
    joint_verdict,
    member,
    off_everywhere,
    offset_or_spring,
    prediction,
)  # fmt: skip
from mocobot.api.comparison_groups import diagnosis_changes as changes_of
from mocobot.api.comparison_groups import diagnosis_groups as groups_of
from mocobot.api.diagnosis import Diagnosis
from mocobot_view.replay_trial import replay_trial
from recordings import small_recording


def values(folder: Path, findings: Sequence[Finding] = (), **more: Any) -> dict[str, Any]:
    return verdict_to_dict(joint_verdict(folder, findings, **more))


def first_part(text: str) -> str:
    """The sentences before the table."""
    return text.split("\n\n")[0].replace("\n", " ")


def table(text: str) -> list[str]:
    return text.split("\n\n")[1].splitlines()


@pytest.fixture
def writes_models(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """In place of what writes the extended model: where it would go."""
    asked: list[Path] = []
    monkeypatch.setattr(diagnosed, "write_extended", lambda verdict, folder: asked.append(folder))
    return asked


def made(folder: Path, findings: Sequence[Finding] = (), **more: Any) -> Diagnosis:
    return Diagnosis(diagnosed.JointDiagnosed(joint_verdict(folder, findings, **more)))


# --- words


def test_names_of_the_tables_are_those_that_can_be_excluded() -> None:
    names = [cause.name for cause in (*CAUSES, *OTHERS)]
    assert len(names) == len(set(names))
    assert set(names) == {*EXCLUDABLE, "unlisted"}


@pytest.mark.parametrize("slide", [False, True])
@pytest.mark.parametrize("name", list(WORDS))
def test_every_cause_tells_its_numbers_and_what_parts_it(name: str, slide: bool) -> None:
    cause = WORDS[name]
    parameters = {parameter_name(p, slide=slide): 0.25 for p in cause.parameters}
    shape = {"middle_rad": 1.5, "turns": 2.0, "ratio": -1.0}
    assert cause.sentence is not None
    said = cause.sentence(Said({**parameters, **shape}, {}, "joint 4", slide))
    told = [
        p
        for p in cause.parameters
        if not p.startswith(("inertia_", "damping_x_", "damping_y_", "damping_z_"))
        and (name, p) != ("spring", "offset_Nm")
    ]
    assert len(re.findall(r"0\.25|\b250\b|\b25 %", said)) == len(told)
    assert cause.separate.endswith(".")
    if slide and "{joint}" in cause.title:
        assert not re.search(r"rad|N m\b|kg m\^", said)


@pytest.mark.parametrize(
    ("cause", "slide", "numbers", "said"),
    [
        ("armature", False, {"armature_kgm2": -0.08},
         "the rotor of joint 4 adds 0.080 +- 0.010 kg m^2 less than modelled"),
        ("armature", True, {"armature_kg": 0.08}, "the rotor of joint 4 adds 0.080 +- 0.010 kg more than modelled"),
        ("joint_zero", True, {"zero_m": -0.08}, "joint 4 stands 80 +- 10 mm less far than it reads"),
        ("torque_delay", False, {"delay_s": 0.08}, "the torque of joint 4 comes 80 +- 10 ms late"),
        ("spring", False, {"stiffness_Nm_per_rad": 2.0, "offset_Nm": 1.0, "middle_rad": 0.7},
         "a spring of 2.000 +- 0.010 N m/rad pulls joint 4 back to 0.2 rad"),
        ("stribeck", True, {"excess_N": 0.08, "fade_rad_per_s": 0.3},
         "near standstill joint 4 rubs with 0.080 +- 0.010 N more than in fast motion, fading over 0.3 m/s"),
        ("link_com", False, {"x_m": 0.1, "y_m": 0.2, "z_m": -0.3},
         "the centre of mass of joint 4 is off by (100 +- 10, 200 +- 10, -300 +- 10) mm"),
        ("link_mass", False, {"excess_kg": -0.3, "x_m": 0.1, "y_m": 0.2, "z_m": 0.3},
         "joint 4 has 0.300 +- 0.010 kg less than modelled, and its centre of mass is off by "
         "(100 +- 10, 200 +- 10, 300 +- 10) mm"),
        ("unlisted", False, {}, "something that no table lists acts at joint 4"),
    ],
)  # fmt: skip
def test_sentences(cause: str, slide: bool, numbers: dict[str, float], said: str) -> None:
    errors = {name: 0.01 for name in numbers if not name.startswith(("middle", "fade"))}
    sentence = WORDS[cause].sentence
    assert sentence is not None
    assert sentence(Said(numbers, errors, "joint 4", slide)) == said


# --- JSON


def test_a_kind_is_one_entry_with_the_medians_of_its_members(tmp_path: Path) -> None:
    sizes = (2e-3, 9e-3, 4e-3)
    kind = finding("torque_delay", *(member(JOINTS[j], j + 1, delay_s=sizes[j]) for j in range(3)))
    (cause,) = values(tmp_path, [kind])["causes"]
    assert (cause["joint"], cause["place"]) == (None, "all joints")
    assert cause["name"] == "delay of the torque of all joints"
    assert cause["parameters"] == {"delay_s": {"value": 4e-3, "se": None}}
    assert [m["parameters"]["delay_s"]["value"] for m in cause["members"]] == list(sizes)
    assert [m["joint"] for m in cause["members"]] == [1, 2, 3]
    assert "the torque of the typical joint (median of 3) comes 4 ms late" in cause["sentence"]


def test_the_values_are_strict_json_with_all_that_readers_ask_for(tmp_path: Path) -> None:
    found = [friction_everywhere(), offset_or_spring(), a_payload(), a_push()]
    suspected = finding("elasticity", member("turn", 1, compliance_rad_per_Nm=2e-5), probability=0.3)
    told = values(tmp_path, found, suspected=(suspected,), scatter=(off_everywhere(),))
    check_finite(json.loads(json.dumps(told, allow_nan=False)))
    team = small_diagnosis("miscalibrated") | {"causes": small_diagnosis()["causes"]}
    assert set(team) | {"reference"} == set(told)
    assert (told["version"], told["machine"], told["finished"]) == (3, "joints", True)
    for cause in told["causes"]:
        assert set(cause) == set(team["causes"][0]) | {"at", "event", "told"}
        others = [*cause["instead"].values(), *(rival["probability"] for rival in cause["alternatives"])]
        assert cause["probability"] + sum(others) == pytest.approx(1.0)
    for key in ("scatter", "detection_limits"):
        assert set(team[key][0]) <= set(told[key][0])
    assert set(told["residual"]) == set(team["residual"])
    offset, push = told["causes"][1], told["causes"][3]
    assert [entry["name"] for entry in offset["told"]] == [
        "offset of the torque of joint 2",
        "spring at joint 2",
    ]
    assert [rival["ambiguous"] for rival in offset["alternatives"]] == [True, False]
    assert push["event"] == {"trial": 2, "start_s": 3.2, "duration_s": 0.25}
    assert push["sentence"].endswith("in tuesday.csv.")
    assert told["gain"]["units"] == {"turn torque": "N m", "joint2 torque": "N m", "lift torque": "N"}


def test_numbers_of_trials_left_out(tmp_path: Path) -> None:
    better = replace(prediction(TRIALS[0], True), chi2_before=5.0, chi2_after=2.0)
    gain = values(tmp_path, [friction_everywhere()], predictions=(better,), validated=False)["gain"]
    assert gain["removed"]["share"] == pytest.approx(0.5)  # of an error of 2 beyond noise 1 is left
    assert gain["held_out"]["before"]["lift torque_nrmse"] == pytest.approx(9.0 / 40.0)
    assert gain["held_out"]["after"]["chi2_per_n"] == 2.0
    assert gain["noise"]["turn torque_rms"] == pytest.approx(0.02)


def test_what_logs_say_nothing_of_is_undecidable(tmp_path: Path) -> None:
    limits = (
        Limit("link_com", "arm", None, {"x_m": None, "y_m": None}),
        Limit("ripple", "turn", 1, {"cosine_Nm": 0.1}),
    )
    (entry,) = values(tmp_path, limits=limits)["undecidable"]
    assert entry["what"] == "centre of mass of a link (link arm)"


# --- text

CASES: dict[str, dict[str, Any]] = {
    "several": {"findings": [friction_everywhere(), offset_or_spring(), a_payload(), a_push()]},
    "many": {"findings": [finding("armature", member("turn", 1, armature_kgm2=0.1))] * 12},
    "consistent": {},
    "miscalibrated": {"verdict": "miscalibrated", "scatter": (off_everywhere(),), "chi2_per_n": (9.0, 8.0, 7.0)},
    "partly": {"findings": [finding("unlisted", place="turn")], "verdict": "partly_explained",
               "chi2_per_n": (9.0, 8.0, 7.0), "scatter": (off_everywhere(),)},
    "besides": {"findings": [offset_or_spring(), a_payload()], "scatter": (off_everywhere(),)},
    "no change": {"reference": ("healthy.csv",)},
    "unexplained": {"verdict": "unexplained", "chi2_per_n": (9.0, 8.0, 7.0)},
    "unfinished": {"findings": [offset_or_spring()], "finished": False},
    "one trial": {"findings": [offset_or_spring()], "trials": TRIALS[:1], "validated": False,
                  "predictions": (prediction(TRIALS[0], True),)},
    "reference": {"findings": [a_payload()], "reference": ("healthy.csv",)},
}  # fmt: skip


@pytest.mark.parametrize("case", list(CASES))
def test_at_most_five_sentences_and_one_narrow_table(tmp_path: Path, case: str) -> None:
    told = values(tmp_path, **CASES[case])
    short, long = format_verdict(told), format_verdict(told, verbose=True)
    assert len(re.findall(r"\.(?= |$)", first_part(short))) <= 5
    assert len(short.split("\n\n")) <= 2
    assert max(map(len, long.splitlines())) <= 100
    assert first_part(long).replace("listed below", "listed with --verbose") == first_part(short)
    assert "[[" not in short
    assert "[[Misfit]]" in long
    assert "A note." in long


def test_a_kind_is_a_group_of_rows_and_rivals_stand_with_or(tmp_path: Path) -> None:
    suspected = finding("elasticity", member("turn", 1, compliance_rad_per_Nm=2e-5), probability=0.31)
    text = format_verdict(
        values(tmp_path, [friction_everywhere(), offset_or_spring()], suspected=(suspected,))
    )
    assert "friction in all joints; and offset of the torque of joint 2 or spring at joint 2." in first_part(
        text
    )
    assert "To decide what joint 2 has: read the torque without power." in first_part(text)
    rows = table(text)
    at = {line.split("  ")[0] or line.strip().split("  ")[0]: k for k, line in enumerate(rows)}
    assert rows[at["all joints"]].endswith("> 99.9 %")
    assert "joint 1 (turn)" in rows[at["all joints"] + 1]
    assert "Coulomb 0.500 +- 0.010 N m" in rows[at["all joints"] + 1]
    assert any("Coulomb 12.00 +- 0.24 N," in row for row in rows)
    assert "or spring at joint 2 (30 %)" in rows[at["joint 2"] + 1]
    below = next(k for k, row in enumerate(rows) if row.startswith("-- suspected"))
    assert "elasticity" in rows[below + 1]
    assert "31 %" in rows[below + 1]
    assert "elasticity" not in "\n".join(rows[:below])


def test_what_is_likelier_than_what_was_fitted_comes_first(tmp_path: Path) -> None:
    """Where the smallest set that holds 90 % is another cause alone."""
    rivals = (Rival("payload", "carriage", None, 0.98, -6.6),)
    link = member("carriage", None, excess_kg=1.2)
    mass = finding(
        "link_mass", link, probability=0.01, unlisted=0.01, rivals=rivals, told=(("payload", "carriage"),)
    )
    text = format_verdict(values(tmp_path, [mass]))
    assert "by payload at link carriage or mass of link carriage." in first_part(text)
    assert "(fitted as mass)" in table(text)[2]
    assert "or payload at link carriage (98 %)" in " ".join(line[15:50].strip() for line in table(text)[3:])


def test_what_signal_something_unlisted_goes_with(tmp_path: Path) -> None:
    some = finding("unlisted", place="turn", joint=1, of="position and direction")
    text = format_verdict(values(tmp_path, [some]))
    assert "by something unlisted at joint 1 (turn) by its position and direction." in first_part(text)
    assert "something unlisted by its" in table(text)[2]
    (cause,) = values(tmp_path, [some])["causes"]
    assert cause["sentence"].endswith("acts at joint 1 (turn) and goes with its position and direction.")
    assert " or " not in text.replace("or repair", "")


@pytest.mark.parametrize(
    ("case", "begins", "says"),
    [
        ("consistent", "CONSISTENT: the model explains the 2 trials", "--verbose"),
        ("no change", "CONSISTENT: nothing but noise has changed in the 2 trials.", "--verbose"),
        ("miscalibrated", "MISCALIBRATED:", "Correct the model by these values"),
        (
            "partly",
            "PARTLY EXPLAINED: one finding accounts for a part",
            "something unlisted at joint 1 (turn)",
        ),
        (
            "besides",
            "EXPLAINED:",
            "Besides, all places alike are off by more than their tolerances: zero of a joint.",
        ),
        ("unexplained", "UNEXPLAINED:", "chi2/n 7 of 9 remains"),
        ("unfinished", "UNFINISHED, SO FAR EXPLAINED:", "Let the search come to its end"),
        (
            "one trial",
            "EXPLAINED: one finding accounts for what the model gets wrong in the trial.",
            "not tested",
        ),
        (
            "reference",
            "EXPLAINED: one finding accounts for what has changed in the 2 trials.",
            "differs from the reference by payload at link carriage",
        ),
        ("many", "EXPLAINED: 12 findings account", "and 8 more"),
    ],
)
def test_first_sentences(tmp_path: Path, case: str, begins: str, says: str) -> None:
    said = first_part(format_verdict(values(tmp_path, **CASES[case])))
    assert said.startswith(begins)
    assert says in said


# --- folder, page, comparison, Python


@pytest.mark.parametrize(
    "case", [pytest.param("several", marks=pytest.mark.pictures), "consistent", "miscalibrated", "partly"]
)
def test_the_folder_is_whole_and_read_by_all(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], writes_models: list[Path], case: str
) -> None:
    diagnosis, out = made(tmp_path, **CASES[case]), tmp_path / "out"
    diagnosis.write(out)
    assert {"diagnosis.json", "report.txt", "residuals.npz", "evidence.png", "residual_against.png"} <= {
        path.name for path in out.iterdir()
    }
    assert len(writes_models) == bool(diagnosis.causes)
    assert (out / "report.txt").read_text() == f"{diagnosis.verbose_text()}\n"
    assert [cause.name for cause in read_diagnosis(out).causes] == [cause.cause for cause in diagnosis.causes]
    assert run(capsys, "report", out)[0] == 0
    page = html.unescape(re.sub("<[^>]+>", "", (out / "report.html").read_text()))
    assert "of a robot's joints" in page
    for cause in diagnosis.causes:
        assert cause.sentence.split(" +- ")[0].split(": ")[-1] in page
    code, said, _ = run(capsys, "compare", out, out)
    assert code == 0
    assert "alone" not in said
    assert "<table>" in diagnosis._repr_html_()


def test_causes_in_python(tmp_path: Path) -> None:
    diagnosis = made(tmp_path, [friction_everywhere(), offset_or_spring()])
    kind, offset = diagnosis.causes
    assert [(m.place, m.joint) for m in kind.members] == [
        ("joint 1 (turn)", 1),
        ("joint 2", 2),
        ("joint 3 (lift)", 3),
    ]
    assert kind.members[2].parameters == {"coulomb_N": 12.0, "viscous_Ns_per_m": 4.0}
    assert offset.standard_errors == {"offset_Nm": pytest.approx(0.0042)}
    assert offset.told == ("offset of the torque of joint 2", "spring at joint 2")
    assert repr(diagnosis).startswith("<Diagnosis of 2 trials: explained; friction in all joints, offset")
    assert "[[" not in str(diagnosis)


def test_rivals_are_told_on_the_page_and_in_notebooks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], writes_models: list[Path]
) -> None:
    diagnosis = made(tmp_path, [offset_or_spring()])
    assert "It may as well be spring at joint 2." in diagnosis._repr_html_()
    diagnosis.write(tmp_path / "out")
    assert run(capsys, "report", tmp_path / "out")[0] == 0
    assert "It may as well be spring at joint 2." in (tmp_path / "out" / "report.html").read_text()


def test_two_days_are_compared_place_by_place(tmp_path: Path) -> None:
    """All joints rub on one day, one of them on the other; links that have no number are no one place."""
    kind = values(tmp_path, [friction_everywhere(), finding("link_mass", member("arm", None, excess_kg=0.3))])
    one = finding("friction", member("joint2", 2, coulomb_Nm=0.9, viscous_Nms_per_rad=0.1))
    other = values(tmp_path, [one, finding("link_mass", member("carriage", None, excess_kg=0.3))])
    assert [group.name for group in groups_of(kind, other)] == [
        "friction in joint 2, coulomb_Nm", "friction in joint 2, viscous_Nms_per_rad"
    ]  # fmt: skip
    said = [line.split(", ")[0] for line in changes_of(kind, other)]
    assert said == [
        "Named in A alone: friction in joint 1 (turn)", "Named in A alone: friction in joint 3 (lift)",
        "Named in A alone: mass of link arm", "Named in B alone: mass of link carriage",
    ]  # fmt: skip
    alone = changes_of(values(tmp_path, [friction_everywhere()]), values(tmp_path, [a_push()]))
    assert [line.split(", ")[0] for line in alone] == [
        "Named in A alone: friction in all joints", "Named in B alone: push on the last link"
    ]  # fmt: skip


def test_a_team_and_a_robot_of_joints_are_not_mixed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, told in (("team", small_diagnosis()), ("arm", values(tmp_path))):
        (tmp_path / name).mkdir()
        (tmp_path / name / "diagnosis.json").write_text(json.dumps(told))
    said = refused(capsys, "compare", tmp_path / "team", tmp_path / "arm")
    assert "are diagnoses of a team and of one robot's joints; both must be of one kind" in said
    with pytest.raises(InputError, match="the diagnosis is of one robot's joints; "):
        replay_trial(small_recording(), "rec", diagnosis=read_diagnosis(tmp_path / "arm"))


def test_diagnoses_of_version_2_are_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old = small_diagnosis() | {"version": 2}
    for key in ("machine", "finished"):
        del old[key]
    del old["causes"][0]["members"]
    path = tmp_path / "diagnosis.json"
    path.write_text(json.dumps(old))
    assert run(capsys, "report", tmp_path, "--out", tmp_path / "page.html")[0] == 0
    assert run(capsys, "compare", path, path)[0] == 0
    path.write_text(json.dumps(old | {"version": 4}))
    assert "version 4; this mocobot reads versions 2 and 3" in refused(capsys, "compare", path, path)
