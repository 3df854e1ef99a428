"""Hand guiding: simulated hands that move the payload, and soft arms that carry its weight."""

from mocobot_sim.guided import (
    FLOAT_GAINS,
    FloatArms,
    FloatTwoBodies,
    Grip,
    GuidingHand,
    HandLog,
    Move,
    Payload,
)

__all__ = ["FLOAT_GAINS", "FloatArms", "FloatTwoBodies", "Grip", "GuidingHand", "HandLog", "Move", "Payload"]
