"""Short hidden sets: a random trial of 8 vias and a periodic one of 10 s, simulated at 1 ms to save time."""

from functools import cache
from typing import Any

from discrepancy.team.diagnosis import diagnose_team
from hidden.generator import HiddenSet, Kind, generate
from hidden.schedule import Schedule

TIMESTEP_S = 1e-3
QUICK = Schedule(randoms=1, vias=8, periodic_s=10.0, hold_s=None)


def quick_set(kind: Kind, seed: int, *causes: str, payload: str, factor: float = 12.0) -> HiddenSet:
    """A short set; a hidden effect is large, as little is recorded."""
    return HiddenSet(kind, seed, causes, factor, payload=payload, schedule=QUICK, timestep_s=TIMESTEP_S)


def tiny_set(seed: int) -> HiddenSet:
    """Hardly a second of motion, for what needs no diagnosis."""
    schedule = Schedule(randoms=1, vias=1, periodic_s=4.0, hold_s=None)
    return HiddenSet("single", seed, ("sea_bias",), schedule=schedule, timestep_s=TIMESTEP_S)


generated = cache(generate)


def blind(
    request: HiddenSet, excluded: tuple[str, ...] = (), **options: Any
) -> tuple[dict[str, Any], dict[str, Any]]:
    """The verdict by the rows, as its JSON, and the truth that is opened after it."""
    recordings, sealed = generated(request)
    verdict = diagnose_team(recordings, excluded=excluded, closed_loop=False, **options).to_dict()
    return verdict, sealed.open(verdict)
