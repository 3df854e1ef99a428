"""What is refused costs no imports, and machine code is kept where an installation cannot be written."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from command import refused, run
from mocobot.cli import COMMANDS
from mocobot.option_types import TrialKind as Kind

ROOT = Path(__file__).resolve().parents[2]
SLOW = {"numpy", "scipy", "pyarrow", "mujoco", "dm_control", "numba", "matplotlib", "plotly", "joblib"}
REFUSED = {
    "watch": "watch none.parquet",
    "paper": "paper --payload z",
    "estimate": "estimate none.parquet",
    "calibrate": "calibrate none.parquet",
    "diagnose": "diagnose none.parquet",
    "convert": "convert none.csv rec.parquet",
    "map": "map none.csv",
    "replay": "replay none.parquet --save rec.rrd",
    "inspect": "inspect none.csv",
    "report": "report none",
    "compare": "compare none.json none.json",
    "simulate": "simulate --payload z --out rec.parquet",
    "campaign": "campaign --payload z --out blind",
    "effects": "effects rust",
    "example": "example arm --out whole.csv",
}
"""A mistake for every command."""
NAMES_AND_FILES = {
    "effect": "simulate --effect rust:robot=1 --out new.parquet",
    "cause of a team": "diagnose whole.csv --exclude rust",
    "cause of a tree": "diagnose whole.csv --model whole.xml --exclude rust",
    "empty file": "estimate empty.parquet",
    "cut file": "calibrate cut.parquet",
    "no format": "diagnose whole.h5",
    "no format of a tree": "map whole.h5 --model whole.xml",
}
"""Mistakes that names of causes and effects tell, or a few bytes of a file."""
NUMBERS = {
    "joint_friction:robot=0,joint=1,coulomb=1": "it must be a whole number of at least 1",
    "joint_friction:robot=2,joint=4,coulomb=0.05": "it must be 1, 2 or 3",
    "joint_friction:robot=2,joint=1,coulomb=-1": "it must be a finite number of at least 0",
    "base_tilt:robot=1,roll=1": "it must be a finite number of at least -0.2 and at most 0.2",
    "slosh:mass=1,length=0.1": "damping_ratio must be given",
    "push:trial=1,start=soon": "it must be",
    "law:target=tau_2_1,function=linear,of=pi,amplitude=1": "of is 'pi'; it must be one of",
}
"""Mistakes in the numbers of an effect."""


def test_every_command_refuses_something_at_once():
    assert set(REFUSED) == set(COMMANDS)


@pytest.mark.parametrize("name", REFUSED | NAMES_AND_FILES)
def test_a_refusal_loads_nothing_that_takes_time(name, tmp_path):
    for file in ("whole.csv", "whole.h5", "whole.xml", "empty.parquet"):
        (tmp_path / file).touch()
    (tmp_path / "cut.parquet").write_bytes(b"PAR1" + bytes(100))
    code = (
        "import sys, mocobot.cli\n"
        f"try: mocobot.cli.main({(REFUSED | NAMES_AND_FILES)[name].split()!r})\n"
        "except SystemExit as stop: assert stop.code == 2, stop.code\n"
        "else: raise AssertionError('not refused')\n"
        f"assert not {SLOW!r} & set(sys.modules), {SLOW!r} & set(sys.modules)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr.startswith("mocobot: ")
    assert any(
        why in done.stderr
        for why in (
            "there is no such",
            "does not exist",
            "or a damaged one",
            "no known format",
            "is a file",
        )
    )


@pytest.mark.parametrize("text", NUMBERS)
def test_an_effects_numbers_are_refused_without_the_simulator(text, tmp_path):
    code = (
        "import sys, mocobot.cli\n"
        f"try: mocobot.cli.main(['simulate', '--effect', {text!r}, '--out', 'new.parquet'])\n"
        "except SystemExit as stop: assert stop.code == 2, stop.code\n"
        "else: raise AssertionError('not refused')\n"
        f"slow = {SLOW - {'numpy'}!r} & set(sys.modules)\n"
        "assert not slow, slow\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert NUMBERS[text] in done.stderr


def test_effects_are_known_without_the_simulator():
    code = (
        "import sys, mocobot_sim.effects.catalogue as spec\n"
        "assert len(spec.EFFECTS) == 27 and all(spec.allowed(kind) for kind in spec.EFFECTS.values())\n"
        f"slow = {SLOW - {'numpy'}!r} & set(sys.modules)\n"
        "assert not slow, slow\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


THREADS = """
import ctypes, sys
import numpy.linalg._umath_linalg, scipy.linalg._fblas
for module in (numpy.linalg._umath_linalg, scipy.linalg._fblas):
    library = ctypes.CDLL(module.__file__)
    names = [f"{maker}openblas_get_num_threads{bits}" for maker in ("scipy_", "") for bits in ("64_", "")]
    found = [getattr(library, name)() for name in names if hasattr(library, name)]
    print(module.__name__, *found)
"""


@pytest.mark.parametrize("first", ["mocobot", "numpy, mocobot", "numpy, scipy.special, mocobot"])
def test_matrices_have_one_thread_whatever_is_imported_first(first):
    """Of two that the environment asks for: results must not depend on how many there are."""
    done = subprocess.run(
        [sys.executable, "-c", f"import {first}\n{THREADS}"],
        env=os.environ | {"OPENBLAS_NUM_THREADS": "2"}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    found = dict(line.split() for line in done.stdout.splitlines())
    assert found == {"numpy.linalg._umath_linalg": "1", "scipy.linalg._fblas": "1"}


def test_kinds_of_trials_are_those_of_recordings():
    from typing import get_args

    from estimator.recording.metadata import TRIALS

    assert get_args(Kind) == tuple(TRIALS)


def test_simulating_needs_numba_only_when_it_runs():
    """Nor does it filter anything: ``scipy.signal`` takes 0.4 s to load."""
    code = (
        "import sys, mocobot\nmocobot.simulate\n"
        "assert not {'numba', 'matplotlib', 'scipy.signal', 'scipy.stats'} & set(sys.modules)\n"
        "mocobot.build_team('b'); assert 'numba' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


CODE = (
    "from mocobot_sim.kernels import update_drives\n"
    "kept = getattr(update_drives._cache, '_impl', None)\n"
    "print(kept.locator.get_cache_path() if kept else 'nowhere')\n"
)


@pytest.mark.parametrize("home", [True, False])
def test_machine_code_goes_to_the_users_cache(tmp_path, home):
    """Where nothing can be put beside the source; without such a folder either it is compiled, and not kept."""
    site, cache = tmp_path / "site", tmp_path / "cache"
    for package in ("mocobot_sim", "estimator"):
        shutil.copytree(ROOT / "src" / package, site / package, ignore=shutil.ignore_patterns("__pycache__"))
    for place in (site / "mocobot_sim" / "__pycache__", *([] if home else [cache])):
        place.touch()  # a file is in the way, whoever runs the test
    done = subprocess.run(
        [sys.executable, "-B", "-c", CODE],
        env=os.environ | {"PYTHONPATH": str(site), "XDG_CACHE_HOME": str(cache), "NUMBA_CACHE_DIR": ""},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    kept = done.stdout.strip()
    assert kept.startswith(str(cache)) if home else kept == "nowhere"


def test_a_completion_is_written_where_it_can_be(tmp_path, capsys):
    code, _, _ = run(capsys, "--tyro-write-completion", "bash", tmp_path / "mocobot")
    assert code == 0
    assert "campaign" in (tmp_path / "mocobot").read_text()
    said = refused(capsys, "--tyro-write-completion", "bash", tmp_path / "none" / "mocobot")
    assert "cannot be written" in said
