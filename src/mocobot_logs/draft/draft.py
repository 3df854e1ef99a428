"""A draft of a map: TOML that reads the log as far as names and values tell, with comments where they do not."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mocobot_logs.draft.candidates import Candidate
from mocobot_logs.draft.channels import Found
from mocobot_logs.draft.robots import HOLE, Robots, Templates
from mocobot_logs.draft.values import DOUBTFUL, doubt_unit, guess_unit, printable
from mocobot_logs.log import CHANNELS, REF
from mocobot_logs.map.units import COUNTS

_LISTED = 12


@dataclass(frozen=True)
class Draft:
    """A draft of a map.

    Attributes:
        text: TOML.
        robots: number of robots found.
        doubtful: number of lines that need a look.
        missing: channels that were not found; without them the map is not complete.
    """

    text: str
    robots: int
    doubtful: int
    missing: tuple[str, ...]


def put_together(name: str, found: Found, settings: Sequence[str]) -> Draft:
    """Put a map together.

    Args:
        name: the log, for the first line.
        found: what its names tell.
        settings: lines of [time] and [csv].
    """
    channels, robots = found.channels, found.robots
    level = max(CHANNELS, key=lambda each: sum(channel in channels for channel in CHANNELS[each]))
    wanted = [*CHANNELS[level], *(REF if all(channel in channels for channel in REF) else ())]
    entries = {
        channel: _entry(channel, channels.get(channel, []), found.templates.get(channel, {}), robots)
        for channel in wanted
    }
    missing = tuple(channel for channel, entry in entries.items() if entry.startswith("#"))
    lines = [
        f"# Draft of a map for {printable(name)}. Lines that need a look say that they are doubtful;",
        f"# docs/measured-data.md says what may stand here. Then: mocobot inspect {printable(name)} --map THIS_FILE",
        "version = 1",
        f'level = "{level}"',
    ]
    if robots.placeholder == "{name}":
        lines.append(f"names = {json.dumps(robots.called, ensure_ascii=False)}")
    elif robots.called:
        lines.append(f"robots = {len(robots.called)}")
    lines += ["", *settings, "[channels]", *entries.values()]
    used = {c.name for channel in wanted for c in channels.get(channel, [])}
    rest = [c.name for c in found.candidates if c.name not in used and c.reading.group != "time"]
    if rest:
        more = ", ..." if len(rest) > _LISTED else ""
        lines += ["", "# not used: " + printable(", ".join(rest[:_LISTED])) + more]
    text = "\n".join(lines) + "\n"
    return Draft(text, max(len(robots.called), 1), text.count(DOUBTFUL), missing)


def _entry(channel: str, candidates: Sequence[Candidate], templates: Templates, robots: Robots) -> str:
    """The line of one channel."""
    if not candidates:
        return f"# {DOUBTFUL}nothing is called like {channel}\n# {channel} = {{ ... }}"
    name, mine, doubts = _choose(candidates, templates, robots)
    reading = candidates[0].reading if not mine else mine[0].reading
    values = [c.values for c in mine if c.values is not None and len(c.values)]
    every = np.concatenate(values) if values else np.empty(0)
    said = ""
    if reading.unit is not None:
        unit, doubt = reading.unit, doubt_unit(channel, reading.unit, every)
    elif len(every):
        (unit, doubt), said = guess_unit(channel, every), ", unit by the values"
    else:
        (unit, doubt) = guess_unit(channel, every)[0], "its values cannot be read"
    doubts += [each for each in (reading.doubt, doubt) if each is not None]
    place = mine[0].place(name)
    pairs = [f"{key} = {json.dumps(text, ensure_ascii=False)}" for key, text in place.items()]
    pairs.append(f'unit = "{unit}"')
    if unit == COUNTS:
        pairs.append("counts_per_turn = ?")
    if channel in REF:
        pairs.append("optional = true")
    line = f"{channel} = {{ {', '.join(pairs)} }}"
    extent = f"{np.min(every):.4g} to {np.max(every):.4g} {unit}{said}" if len(every) else ""
    if doubts:
        comment = f"  # {DOUBTFUL}{'; '.join(doubts)}" + (f" ({extent})" if extent else "")
    else:
        comment = f"  # {extent}" if extent else ""
    return ("# " if unit == COUNTS else "") + line + printable(comment)


def _choose(
    candidates: Sequence[Candidate], templates: Templates, robots: Robots
) -> tuple[str, list[Candidate], list[str]]:
    """Name of a channel with the placeholder in it, what it stands for, and what is doubtful about the choice."""
    if not robots.called:
        best = min(candidates, key=lambda c: (c.reading.unit is None, len(c.name)))
        others = [c.name for c in candidates if c is not best]
        return best.name, [best], [f"or {printable(others[0])}?"] if others else []
    fit: Mapping[str, list[str]] = {
        template: [told for told in robots.called if told in each] for template, each in templates.items()
    }
    ranked = sorted(fit, key=lambda t: (-len(fit[t]), len(t)))
    best = ranked[0]
    lacking = [told for told in robots.called if told not in fit[best]]
    doubts = [f"no such name for {', '.join(lacking)}"] if lacking else []
    if len(ranked) > 1 and len(fit[ranked[1]]) == len(fit[best]):
        doubts.append(f"or {printable(ranked[1].replace(HOLE, robots.placeholder))}?")
    mine = [templates[best][told] for told in fit[best]]
    return best.replace(HOLE, robots.placeholder), mine or [candidates[0]], doubts
