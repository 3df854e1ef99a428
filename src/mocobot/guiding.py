"""A person guides the payload: hands that move it, arms that float under it."""

from mocobot_sim.guided.float_arms import FLOAT_GAINS, FloatArms
from mocobot_sim.guided.hand import Grip, GuidingHand, HandLog, Move
from mocobot_sim.guided.weight import Payload

__all__ = ["FLOAT_GAINS", "FloatArms", "Grip", "GuidingHand", "HandLog", "Move", "Payload"]
