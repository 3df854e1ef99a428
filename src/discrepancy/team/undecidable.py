"""What recordings of a parked team that holds one rigid payload cannot decide, whatever the data."""

from typing import Any

UNDECIDABLE = (
    (
        "zero of the last gimbal axis",
        "it turns the grasp frame by a constant, and the grasp frame is itself unknown",
        "a grasp whose orientation is known",
    ),
    (
        "mass of the gimbal and the platform",
        "a point mass at the wrist is a part of the payload",
        "a run of the arm alone",
    ),
    (
        "a scale common to all torques",
        "it scales the payload's mass and inertia and nothing else",
        "a known weight on the payload",
    ),
    (
        "which robot's gimbal rubs",
        "a pure moment about parallel axes is the same wherever it acts; only the axis shows",
        "one robot released at a time",
    ),
)


def statements(robots: int, *, aligned: bool) -> list[dict[str, Any]]:
    """What, why, and what would decide it, for a team of N robots whose clocks the motion may have set (aligned)."""
    said = [{"what": what, "why": why, "remedy": remedy} for what, why, remedy in UNDECIDABLE]
    if aligned:
        why = "the conversion has taken out what the motion tells of the clocks"
        said.append(
            {"what": "the robots' clocks", "why": why, "remedy": "one clock for all, and no --clock correct"}
        )
    if robots == 1:
        what = "every error of angles, lengths, bases and grasps of a single robot"
        said.append(
            {"what": what, "why": "no other robot tells where the payload is", "remedy": "a second robot"}
        )
    return said
