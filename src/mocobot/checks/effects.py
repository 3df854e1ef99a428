"""What ``mocobot effects`` refuses at once."""

from mocobot.options import Effects
from mocobot_sim.effect_names import check_effect_name


def check(options: Effects) -> None:
    """Names of effects.

    Raises:
        InputError: there is no such effect.
    """
    for name in options.name:
        check_effect_name(name)
