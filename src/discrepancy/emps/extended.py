"""The axis with its causes, to take away: MJCF for what it can express, a small file for the rest."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from discrepancy.rig import Candidate
from estimator.errors import InputError
from mocobot_sim.emps.mjcf import LACKS, axis_spec
from mocobot_sim.emps.plant import ForcePush, Plant, PulseTrain, Ripple

Array = NDArray[np.float64]

FORMAT, VERSION = "mocobot-extended-axis", 1
SCENE, NUMBERS, README = "axis.xml", "plant.json", "README.md"
NESTED = {"ripples": Ripple, "voltage_pulses": PulseTrain, "force_pulses": PulseTrain, "pushes": ForcePush}


def write_extended(
    plant: Plant, active: Sequence[tuple[Candidate, Array]], folder: Path, recordings: Sequence[str]
) -> None:
    """Write ``axis.xml``, ``plant.json`` and a README into a new folder.

    Raises:
        InputError: the folder cannot be written.
    """
    causes = [
        {
            "cause": candidate.cause,
            "parameters": {p.name: float(v) for p, v in zip(candidate.parameters, values, strict=True)}
            | {name: float(v) for name, v in candidate.shape.items()},
        }
        for candidate, values in active
    ]
    numbers = {
        "format": FORMAT, "version": VERSION, "plant": asdict(plant), "causes": causes, "recordings": list(recordings)
    }  # fmt: skip
    spec = axis_spec(plant)
    spec.compile()
    try:
        folder.mkdir()
        (folder / SCENE).write_text(spec.to_xml(), encoding="utf-8")
        (folder / NUMBERS).write_text(json.dumps(numbers, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        (folder / README).write_text(_readme(causes), encoding="utf-8")
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror or error})") from error


def load_plant(folder: Path) -> Plant:
    """The plant of an extended axis, for ``loop.run``.

    Raises:
        InputError: ``plant.json`` cannot be read or is something else.
    """
    path = Path(folder) / NUMBERS
    try:
        values: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        if (values["format"], values["version"]) != (FORMAT, VERSION):
            raise ValueError("another format")
        given = values["plant"]
        if set(given) != {entry.name for entry in fields(Plant)}:
            raise ValueError("unknown or missing numbers")
        for name, kind in NESTED.items():
            given[name] = tuple(kind(**item) for item in given[name])
        for name in ("coulomb_N", "viscous_Ns_per_m"):
            given[name] = (float(given[name][0]), float(given[name][1]))
        return Plant(**given)
    except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
        raise InputError(f"{path}: is not the file of an extended axis ({error})") from error


def _readme(causes: Sequence[dict[str, Any]]) -> str:
    rows = [
        f"| `{c['cause']}` | {', '.join(f'`{n}` = {v:.6g}' for n, v in c['parameters'].items())} | "
        f"{'`plant.json`' if c['cause'] in LACKS else '`axis.xml`'} |"
        for c in causes
    ]
    table = "\n".join(["| cause | parameters | in |", "|---|---|---|", *rows]) if rows else "None."
    return f"""# Extended axis

The EMPS axis in MuJoCo with these causes built in:

{table}

- `axis.xml`: loads in plain MuJoCo. The control of `drive` is the reference position [m], its force the voltage [V],
  limited to +-10 V; a step is one period of the loop, which holds its voltage that long. What only `plant.json` has
  is not in it.
- `plant.json`: all numbers, those included.

With the digital loop and all causes:

    from discrepancy.emps.extended import load_plant
    from mocobot_sim.emps.loop import Start, run
    position, voltage = run(load_plant("."), time, reference, Start(x0, v0, velocities, voltages))
"""
