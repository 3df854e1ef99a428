"""Which body of a robot a cause sits at."""

from collections.abc import Iterable

from discrepancy.result.read import NamedCause
from discrepancy.team.causes import CAUSES
from mocobot_view.bodies.robot import GIMBAL


def by_place(causes: Iterable[NamedCause]) -> dict[tuple[int | None, str | None], list[NamedCause]]:
    """Causes by robot (None for the payload) and its body as ``body_of`` has it."""
    places: dict[tuple[int | None, str | None], list[NamedCause]] = {}
    for cause in causes:
        places.setdefault((cause.robot, body_of(cause)), []).append(cause)
    return places


def body_of(cause: NamedCause) -> str | None:
    """The robot's body, such as ``proximal1``; None for the base, or the payload."""
    at = CAUSES[cause.name].at if cause.name in CAUSES else None
    if cause.robot is not None and cause.joint is not None:
        return GIMBAL[cause.joint - 1] if at == "gimbal joint" else f"proximal{cause.joint}"
    return "flange" if cause.robot is not None and at == "grasp" else None
