"""``mocobot effects``: what can be hidden in a simulated team, from the effects' own classes."""

import shutil
import textwrap

from mocobot.options import Effects
from mocobot_sim.effects.catalogue import EFFECTS, EXAMPLE, Allowed, allowed, paragraphs

WIDEST, INDENT = 100, "    "


def run(options: Effects) -> None:
    """Run the command."""
    width = min(WIDEST, shutil.get_terminal_size((WIDEST, 24)).columns)
    print("\n".join(_lines(name, width, whole=bool(options.name)) for name in options.name or EFFECTS))
    print(textwrap.fill(f"Hide one with mocobot simulate --effect {EXAMPLE} ...", width))


def _lines(name: str, width: int, *, whole: bool) -> str:
    """An effect, its documentation whole or in a nutshell, and its numbers."""
    said = paragraphs(EFFECTS[name])
    texts = said if whole else said[:1]
    lines = [
        name,
        *(textwrap.fill(text, width, initial_indent=INDENT, subsequent_indent=INDENT) for text in texts),
    ]
    lines += [f"{INDENT}{each.short:15}{each.unit:12}{_rule(each)}" for each in allowed(EFFECTS[name])]
    return "\n".join([*lines, ""])


def _rule(number: Allowed) -> str:
    return (
        number.range if number.default is None else f"{number.range}; {_given(number.default)} if not given"
    )


def _given(default: float | str) -> str:
    return (default or "none") if isinstance(default, str) else f"{default:g}"
