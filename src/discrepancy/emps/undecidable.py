"""What recordings of position and voltage alone cannot decide about the axis, whatever their length."""

from typing import Any

UNDECIDABLE = (
    (
        "the drive's gain (force per volt) against the mass, and with it every force",
        "a gain that is 1 % larger with 1 % more mass and friction moves in exactly the same way at the same voltage, "
        "so masses and forces here are those at the nominal gain",
        "a known weight on the carriage, or a load cell against the carriage at rest",
    ),
    (
        "a constant force against dry friction that differs between the directions, as long as the axis slides",
        "both are one constant in either direction",
        "rest: the voltage at which it breaks loose in each direction",
    ),
    (
        "where a voltage that is added to the loop enters, before or after its gains",
        "the law is linear, so a position of x, a velocity of kp x and a voltage of kv kp x are the same",
        "the velocity loop's own command in the log",
    ),
    (
        "which side of a play the mass and the friction are on",
        "the only encoder is the motor's",
        "a scale on the carriage",
    ),
)


def statements() -> list[dict[str, Any]]:
    """What, why, and what would decide it."""
    return [{"what": what, "why": why, "remedy": remedy} for what, why, remedy in UNDECIDABLE]
