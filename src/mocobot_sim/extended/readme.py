"""The page that goes with an extended model."""

from collections.abc import Mapping, Sequence
from typing import Any


def readme(effects: Sequence[Mapping[str, Any]], robots: int, healthy: int = 0) -> str:
    """Markdown for a user who finds the folder.

    Args:
        effects: as ``effect_to_dict`` gives them.
        robots: number of robots.
        healthy: how many of the effects, the last ones, are of parts that are off by no more than others.
    """
    named = len(effects) - healthy
    table = _table(effects[:named])
    if healthy:
        table = table if named else "No cause was named."
        rest = _table(effects[named:])
        table = f"{table}\n\nEvery other part is as far off as it was found, within its tolerance:\n\n{rest}"
    many = "1 Omnid" if robots == 1 else f"{robots} Omnids"
    return f"""# Extended model

A team of {many} and its payload in MuJoCo, with these effects built in:

{table}

- `team.xml`: the scene, complete. `mujoco.MjModel.from_xml_path("team.xml")` or MuJoCo's viewer loads it. What MJCF
  cannot express is not in it: encoder and torque zeros, sensor timing, pushes, laws, a payload whose mass
  changes, friction that gives way before it slips (`presliding_...` above 0).
- `effects.json`: all numbers, those included.

Simulate a trial with it:

    mocobot simulate --model . --trajectory random --out trial.parquet

From Python: `mocobot_sim.extended.extended.load_extended(folder)`, then `mocobot_sim.trial.trial.run_trial` or
`mocobot_sim.trial.resimulate.resimulate`.
"""


def _table(effects: Sequence[Mapping[str, Any]]) -> str:
    rows = []
    for effect in effects:
        place = (
            ", ".join(f"{name} {effect[name]}" for name in ("robot", "joint") if name in effect) or "payload"
        )
        numbers = ", ".join(f"`{name}` = {_shown(value)}" for name, value in effect["parameters"].items())
        rows.append(f"| `{effect['cause']}` | {place} | {numbers} |")
    return "\n".join(["| cause | where | parameters |", "|---|---|---|", *rows]) if rows else "None."


def _shown(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"
