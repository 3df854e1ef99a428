"""Physical effects that can be hidden in a simulated team, one file per cause; ``catalogue`` lists them.

What they are, take and allow is known without MuJoCo: an effect edits the scene that it is given, and loads nothing
of what made it. So a wrong number is refused at once.
"""

from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.catalogue import (
    EFFECTS,
    apply_effects,
    effect_from_dict,
    effect_to_dict,
    make_effect,
)

__all__ = ["EFFECTS", "Effect", "apply_effects", "effect_from_dict", "effect_to_dict", "make_effect"]
