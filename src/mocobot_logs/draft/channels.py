"""Which candidates are which channel, of how many robots."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mocobot_logs.draft.candidates import Candidate
from mocobot_logs.draft.robots import Robots, Templates, find_robots, templates_of

_AXES = "xyz"


@dataclass(frozen=True)
class Found:
    """What the names of a log tell.

    Attributes:
        candidates: all of them.
        channels: those that are channels.
        templates: by channel, how their names differ by the robot.
        robots: what these are called.
    """

    candidates: Sequence[Candidate]
    channels: Mapping[str, list[Candidate]]
    templates: Mapping[str, Templates]
    robots: Robots


def find_channels(candidates: Sequence[Candidate]) -> Found:
    """Sort candidates by channel and robot."""
    channels = _by_channel(candidates)
    templates = {channel: templates_of(each) for channel, each in channels.items()}
    return Found(candidates, channels, templates, find_robots(templates))


def _by_channel(candidates: Sequence[Candidate]) -> dict[str, list[Candidate]]:
    """Candidates by the channel that their names tell."""
    from_0 = {
        group
        for group in ("phi", "tau", "theta")
        if (seen := {c.reading.index for c in candidates if c.reading.group == group and not c.reading.axis})
        and 0 in seen
        and 3 not in seen
    }
    found: dict[str, list[Candidate]] = defaultdict(list)
    for candidate in candidates:
        reading = candidate.reading
        if reading.index is None:
            continue
        if reading.axis:
            if reading.index < 3:
                found[f"{reading.group}_{_AXES[reading.index]}"].append(candidate)
            continue
        joint = reading.index + (reading.group in from_0)
        if 1 <= joint <= 3:
            name = f"theta_{'zyx'[joint - 1]}" if reading.group == "theta" else f"{reading.group}{joint}"
            found[name].append(candidate)
    return dict(found)
