"""What reader, preflight and verdict say about spoilt copies of the EMPS benchmark's first recording.

    python benchmarks/emps/emps_spoilt.py

The copies are made in a temporary folder and deleted.
"""

from __future__ import annotations

import contextlib
import io
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.io import loadmat, savemat

from emps_data import DATA, needed_folder
from mocobot.cli import main as mocobot

Data = dict[str, np.ndarray]
SERIES = ("t", "qm", "qg", "vir")
STROKE_M, BITS = 0.25, 12


def without_half(data: Data) -> Data:
    """Half of the samples dropped at random."""
    count = len(data["t"])
    keep = np.sort(np.random.default_rng(1).choice(count, count // 2, replace=False))
    return data | {name: data[name][keep] for name in SERIES}


def every_second(data: Data) -> Data:
    """Every second sample."""
    return data | {name: data[name][::2] for name in SERIES}


def coarse(data: Data) -> Data:
    """The position in 12 bits over 0.25 m."""
    step = STROKE_M / 2**BITS
    return data | {"qm": np.round(data["qm"] / step) * step}


def stuck(data: Data) -> Data:
    """The position stuck for a second."""
    qm = data["qm"].copy()
    qm[10000:11000] = qm[10000]
    return data | {"qm": qm}


def backwards(data: Data) -> Data:
    """The voltage with the wrong sign."""
    return data | {"vir": -data["vir"]}


def with_hole(data: Data) -> Data:
    """A tenth of a second missing."""
    keep = np.r_[0:12000, 12100 : len(data["t"])]
    return data | {name: data[name][keep] for name in SERIES}


SPOILT: tuple[Callable[[Data], Data], ...] = (without_half, every_second, coarse, stuck, backwards, with_hole)


def said(path: Path) -> tuple[int, str, str]:
    """Exit code, output and error of the command."""
    out, err, code = io.StringIO(), io.StringIO(), 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            mocobot(["diagnose", "--rig", "emps", str(path)])
        except SystemExit as stop:
            code = int(stop.code or 0)
    return code, out.getvalue(), err.getvalue().replace(str(path.parent) + "/", "")


def main() -> None:
    """Spoil, diagnose, and print verdict and notes."""
    source = needed_folder() / DATA
    data = {name: value for name, value in loadmat(source).items() if not name.startswith("__")}
    with tempfile.TemporaryDirectory() as folder:
        for spoil in SPOILT:
            path = Path(folder) / f"{spoil.__name__}.mat"
            savemat(path, spoil(data))
            code, out, err = said(path)
            print(f"\n=== {spoil.__name__}: {spoil.__doc__} Exit code {code}.")
            if err:
                print(err.strip())
                continue
            verdict, rest = out.split("\n\n", 1)
            notes = rest.split("[[Notes]]\n", 1)[1].split("\n\n", 1)[0]
            print(verdict, notes, sep="\n")


if __name__ == "__main__":
    main()
