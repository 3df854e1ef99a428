"""The channels of a team's rows: every robot's loop closed with robot 1's, then the payload's balance."""

from discrepancy.channel import Channel


def channels_of(robots: int) -> list[Channel]:
    """Channels of N robots, 6 N."""
    out = []
    for i in range(2, robots + 1):
        out += [Channel(f"grasp {i} rotation {a}", "kinematic", i, "rad") for a in "xyz"]
        out += [Channel(f"grasp {i} position {a}", "kinematic", i, "m") for a in "xyz"]
    out += [Channel(f"force {a}", "balance", None, "N") for a in "xyz"]
    return out + [Channel(f"moment {a}", "balance", None, "N m") for a in "xyz"]
