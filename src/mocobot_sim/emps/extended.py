"""The axis with effects, to take away: MJCF for what it can express, a small file for the rest."""

from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from estimator.errors import InputError
from estimator.files import write_json, write_text
from estimator.strict import Fields, read_json
from mocobot_sim.emps.effects import AxisEffect, apply_effects
from mocobot_sim.emps.law import AxisLaw
from mocobot_sim.emps.mjcf import LACKS, axis_spec
from mocobot_sim.emps.plant import ForcePush, Plant, PulseTrain, Ripple

FORMAT, VERSION = "mocobot-extended-axis", 2
SCENE, NUMBERS, README = "axis.xml", "plant.json", "README.md"
NESTED = {"ripples": Ripple, "voltage_pulses": PulseTrain, "force_pulses": PulseTrain, "pushes": ForcePush}


def write_extended(
    nominal: Plant, effects: Sequence[AxisEffect], folder: Path, recordings: Sequence[str]
) -> None:
    """Write ``axis.xml``, ``plant.json`` and a README into a new folder.

    Args:
        nominal: the axis as assumed.
        effects: what is off.
        folder: is created.
        recordings: names of those that it was found from.

    Raises:
        InputError: the folder cannot be written.
    """
    plant = apply_effects(nominal, effects)
    spec = axis_spec(plant)
    spec.compile()
    numbers = {
        "format": FORMAT, "version": VERSION, "plant": asdict(plant),
        "causes": [{"cause": e.cause, "parameters": dict(e.parameters)} for e in effects],
        "recordings": list(recordings),
    }  # fmt: skip
    try:
        folder.mkdir()
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror or error})") from error
    write_text(folder / SCENE, spec.to_xml())
    write_json(folder / NUMBERS, numbers)
    write_text(folder / README, _readme(plant, effects))


def load_plant(folder: Path) -> Plant:
    """The plant of an extended axis, for ``loop.run``.

    Raises:
        InputError: ``plant.json`` cannot be read or is something else.
    """
    path = Path(folder) / NUMBERS
    keys = ("format", "version", "plant", "causes", "recordings")
    file = Fields(read_json(path, "the numbers of an extended axis"), keys, str(path))
    if (file.values["format"], file.values["version"]) != (FORMAT, VERSION):
        file.refuse("format", f"{FORMAT!r}, with version {VERSION}")
    plant = file.within("plant", [entry.name for entry in fields(Plant)])
    values: dict[str, Any] = {name: _items(plant, name, kind) for name, kind in NESTED.items()}
    laws = plant.list("laws")
    values["laws"] = tuple(AxisLaw.of_dict(item, f"{plant.where}: laws") for item in laws)
    values |= {name: tuple(plant.array(name, (2,)).tolist()) for name in ("coulomb_N", "viscous_Ns_per_m")}
    values |= {name: plant.number(name) for name in plant.required if name not in values}
    return Plant(**values)


def _items(plant: Fields, name: str, kind: type) -> tuple[Any, ...]:
    keys = [entry.name for entry in fields(kind)]
    entries = (Fields(item, keys, f"{plant.where}: {name}") for item in plant.list(name))
    return tuple(kind(*(item.number(key) for key in keys)) for item in entries)


def _readme(plant: Plant, effects: Sequence[AxisEffect]) -> str:
    rows = [
        f"| `{e.cause}` | {', '.join(_number(n, v) for n, v in e.parameters.items() if v != '')} | "
        f"{'`plant.json`' if LACKS.issuperset(e.changes(plant)) else '`axis.xml`'} |"
        for e in effects
    ]
    table = "\n".join(["| cause | parameters | in |", "|---|---|---|", *rows]) if rows else "None."
    return f"""# Extended axis

The EMPS axis in MuJoCo with these causes built in:

{table}

- `axis.xml`: loads in plain MuJoCo. The control of `drive` is the reference position [m], its force the voltage [V],
  limited to +-{plant.limit_V:g} V; a step is one period of the loop, which holds its voltage that long. What only
  `plant.json` has is not in it.
- `plant.json`: all numbers, those included.

With the digital loop and all causes:

    from mocobot_sim.emps.extended import load_plant
    from mocobot_sim.emps.loop import Start, run
    position, voltage = run(load_plant("."), time, reference, Start(x0, v0, velocities, voltages))
"""


def _number(name: str, value: float | str) -> str:
    return f"`{name}` = {value}" if isinstance(value, str) else f"`{name}` = {value:.6g}"
