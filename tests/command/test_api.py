"""The public face: what ``import mocobot`` costs and offers, and that docs/api.md tells of it and runs."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import mocobot

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
ROWS = [
    name
    for cell in re.findall(r"^\| (`.+?) \| ", PAGE, re.MULTILINE)
    for name in re.findall(r"`([\w.]+)", cell)
]
"""Names in the first column of the page's tables."""


def modules() -> dict[str, ModuleType]:
    """The public modules of the package."""
    return {
        name: found for name in mocobot.__all__ if isinstance(found := getattr(mocobot, name), ModuleType)
    }


def public() -> set[str]:
    """All public names, those of modules behind the module's."""
    inside = {f"{name}.{each}" for name, module in modules().items() for each in module.__all__}
    return set(mocobot.__all__) | inside


def test_every_public_name_is_documented_and_no_other():
    assert len(ROWS) > 50
    assert len(ROWS) == len(set(ROWS)), "a name is documented twice"
    assert set(ROWS) == public()


def test_every_public_name_is_there_and_says_what_it_is():
    assert set(modules()) == {"bases", "guiding", "pictures", "robots", "serial", "trajectories"}
    for name in public():
        found: object = mocobot
        for part in name.split("."):
            found = getattr(found, part)
        if callable(found) or isinstance(found, ModuleType):
            assert found.__doc__, name
    assert dir(mocobot) == sorted(mocobot.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        mocobot.nothing  # noqa: B018


def test_type_checkers_see_the_same_names():
    tree = ast.parse(Path(mocobot.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = [entry for entry in tree.body if isinstance(entry, ast.ImportFrom)]
    seen = {alias.asname: entry.module for entry in imports for alias in entry.names}
    assert seen == mocobot._HOMES
    assert (Path(mocobot.__file__).parent / "py.typed").is_file()


@pytest.mark.parametrize(
    ("code", "unwanted"),
    [
        ("import mocobot", {"numpy", "scipy", "mujoco", "pyarrow", "tyro"}),
        ("import mocobot; mocobot.read_recording", {"mujoco", "dm_control", "numba", "matplotlib"}),
        ("import mocobot; mocobot.estimate", {"mujoco", "dm_control", "numba", "matplotlib"}),
        (
            "import mocobot.cli\ntry: mocobot.cli.main(['--help'])\nexcept SystemExit: pass",
            {"numpy", "mujoco", "dm_control", "pyarrow"},
        ),
    ],
)
def test_what_is_not_used_is_not_loaded(code, unwanted):
    check = f"{code}\nimport sys\nassert not {unwanted!r} & set(sys.modules), {unwanted!r} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", check], check=True, capture_output=True)


class Tags(HTMLParser):
    """Counts what is open, and keeps every text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: set[str] = set()
        self.texts: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open.append(tag)
        self.seen.add(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


@pytest.mark.slow
def test_every_example_of_the_page_runs(tmp_path, monkeypatch):
    """In order and in one place, as a reader would run them; what they leave is looked at here."""
    monkeypatch.chdir(tmp_path)
    assert len(EXAMPLES) == 8
    space: dict[str, object] = {"__name__": "page"}
    for example in EXAMPLES:
        exec(compile(example, f"docs/api.md: {example[:40]!r}", "exec"), space)

    estimate, verdict, look, calibration = (space[name] for name in ("est", "verdict", "look", "cal"))
    assert isinstance(calibration, mocobot.Calibration)
    np.testing.assert_allclose(calibration.units.of("phi_zero"), 0.0, atol=1e-3)
    assert json.loads(Path("calibration/calibration.json").read_text()) == calibration.to_dict()
    assert isinstance(estimate, mocobot.Estimate)
    assert isinstance(verdict, mocobot.Diagnosis)
    assert isinstance(look, mocobot.Inspection)
    assert estimate.mass is not None
    assert estimate.mass.mass == pytest.approx(11.672, rel=2e-3)
    assert verdict.verdict == "explained"
    assert [(cause.cause, cause.robot, cause.joint) for cause in verdict.causes] == [("sea_bias", 2, 1)]
    assert verdict.causes[0].parameters["bias_Nm"] == pytest.approx(0.08, rel=0.1)
    assert str(verdict).startswith("EXPLAINED: one finding accounts for")
    assert json.loads(Path("est.json").read_text()) == estimate.to_dict()
    for result, word in (
        (estimate, "11.67"),
        (verdict, "sea_bias"),
        (look, "rec.parquet"),
        (calibration, "Robot 3"),
    ):
        assert repr(result).startswith(f"<{type(result).__name__} ")
        assert len(repr(result)) < 200
        page = Tags(result._repr_html_())
        assert page.open == []
        assert "table" in page.seen
        assert not page.seen & {"script", "link", "img", "iframe"}
        assert any(word in text for text in page.texts)


def test_text_of_a_file_is_no_markup(tmp_path):
    rec = mocobot.simulate("b", vias=4)
    hostile = replace(rec, metadata=replace(rec.metadata, payload="<script>alert(1)</script>"))
    path = tmp_path / "<script>.parquet"
    hostile.write(path)
    for result, word in (
        (mocobot.estimate(hostile), "alert(1)"),
        (mocobot.inspect(path), "<script>.parquet"),
    ):
        page = Tags(result._repr_html_())
        assert "script" not in page.seen
        assert any(word in text for text in page.texts)


def test_a_simulated_recording_is_the_commands(tmp_path, capsys):
    from mocobot.cli import main

    rec = mocobot.simulate("b", vias=4, seed=3, preset="uncalibrated", level="wrist")
    rec.write(tmp_path / "face.parquet")
    options = ["--payload", "b", "--vias", "4", "--seed", "3", "--preset", "uncalibrated", "--level", "wrist"]
    main(["simulate", *options, "--out", str(tmp_path / "command.parquet")])
    capsys.readouterr()
    assert (tmp_path / "face.parquet").read_bytes() == (tmp_path / "command.parquet").read_bytes()
    assert (tmp_path / "face.truth.json").read_bytes() == (tmp_path / "command.truth.json").read_bytes()
    assert rec.truth.units != ()
    assert rec.log.p_W1.shape == (len(rec.time), 3)


def test_options_are_one_object_or_words():
    rec = mocobot.simulate("b", vias=6, seed=5)
    options = mocobot.EstimateOptions(method="joint", cutoff_hz=4.0)
    found = mocobot.estimate(rec, options).to_dict()
    assert found == mocobot.estimate(rec, method="joint", cutoff_hz=4.0).to_dict()
    assert found == mocobot.estimate(rec, replace(options, cutoff_hz=5.0), cutoff_hz=4.0).to_dict()
    told = mocobot.simulate("b", vias=1, effects=["sea_bias:robot=2,joint=1,bias=0.1"]).truth.effects
    assert told == (mocobot.make_effect("sea_bias", {"bias_Nm": 0.1}, robot=2, joint=1),)
    with pytest.raises(TypeError, match="colour"):
        mocobot.estimate(rec, colour="red")
    with pytest.raises(mocobot.InputError, match="self_calibrate and method are both given"):
        mocobot.estimate(rec, options, self_calibrate=True)
    with pytest.raises(mocobot.InputError, match="rate_hz is 5; it must be from 20 to 2000"):
        mocobot.convert("none.csv", rate_hz=5)


def test_effects_act_on_robots_as_they_were_built():
    bias = mocobot.make_effect("sea_bias", {"bias_Nm": 1.0}, robot=2, joint=1)
    clean, faulty = (
        mocobot.simulate("b", vias=1, preset="uncalibrated", effects=effects) for effects in ((), [bias])
    )
    assert faulty.truth.effects == (bias,)
    built, biased = ([vars(unit) for unit in rec.truth.units] for rec in (clean, faulty))
    for i, (before, after) in enumerate(zip(built, biased, strict=True)):
        for name, value in before.items():
            moved = [1.0, 0.0, 0.0] if (i, name) == (1, "tau_zero_Nm") else 0.0
            np.testing.assert_allclose(after[name] - value, moved, atol=1e-12, err_msg=name)
    assert np.any(built[0]["phi_zero_rad"] != 0.0)
    assert np.median(faulty.tau[:, 1, 0] - clean.tau[:, 1, 0]) == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"vias": 3, "trajectory": "static"}, "vias is for a random or free trajectory; this one is static"),
        ({"duration_s": 9.0}, "duration_s is for a periodic trajectory; this one is random"),
        ({"robots": 3}, "robots is for a free trajectory; this one is random"),
        ({"robots": 3, "payload": "a", "trajectory": "free"}, "payload and robots are both given"),
        ({"payload": "a", "model": "folder"}, "payload and model are both given"),
        ({"preset": "best"}, "preset 'best' does not exist"),
    ],
)
def test_simulate_refuses_in_the_callers_words(arguments, words):
    with pytest.raises(mocobot.InputError, match=words):
        mocobot.simulate(**arguments)


def test_a_diagnosis_checks_what_it_is_given(tmp_path):
    with pytest.raises(mocobot.InputError, match="no recording given"):
        mocobot.diagnose([])
    short = mocobot.simulate("b", vias=1)
    with pytest.raises(mocobot.InputError, match="a diagnosis needs at least 5 s"):
        mocobot.diagnose(short)
    with pytest.raises(mocobot.InputError, match="cause 'ghost' does not exist"):
        mocobot.diagnose(mocobot.simulate("b", vias=6), exclude=["ghost"])
    with pytest.raises(mocobot.InputError, match=r"nowhere\.parquet"):
        mocobot.diagnose("nowhere.parquet")


SCENARIOS = sorted((ROOT / "scenarios").glob("*.py"))
LIBRARIES = {"mocobot", "numpy", "scipy", "matplotlib", "PIL"} | set(sys.stdlib_module_names)


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_scenarios_use_the_face_and_nothing_below_it(path):
    allowed = {"mocobot", *(f"mocobot.{name}" for name in modules())}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            taken = {alias.name: () for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.module is not None
            taken = {node.module: tuple(alias.name for alias in node.names)}
        else:
            continue
        for module, names in taken.items():
            assert module.split(".")[0] in LIBRARIES, module
            if module.startswith("mocobot"):
                assert module in allowed
                assert set(names) <= set(import_module(module).__all__)
