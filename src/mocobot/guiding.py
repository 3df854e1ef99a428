"""A person guides the payload: hands that move it, arms that float under it."""

from mocobot_sim.guided import FLOAT_GAINS, FloatArms, Grip, GuidingHand, HandLog, Move, Payload

__all__ = ["FLOAT_GAINS", "FloatArms", "Grip", "GuidingHand", "HandLog", "Move", "Payload"]
