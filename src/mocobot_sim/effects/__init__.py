"""Physical effects that can be added to a simulated team; ``catalogue`` lists them."""

from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.catalogue import (
    EFFECTS,
    apply_effects,
    effect_from_dict,
    effect_to_dict,
    make_effect,
)

__all__ = ["EFFECTS", "Effect", "apply_effects", "effect_from_dict", "effect_to_dict", "make_effect"]
