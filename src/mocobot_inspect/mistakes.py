"""Wiring mistakes of a team's log that are searched for: one function each, listed in ``SUSPICIONS``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import combinations, product
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from estimator.arm.delta import inverse_kinematics
from estimator.arm.design import OmnidDesign
from mocobot_inspect.signals import KINDS, Kind, Signals
from mocobot_logs.log import CHANNELS, Level

NAMES: dict[Level, dict[Kind, str]] = {
    "joint": {"position": "phi", "theta": "theta", "effort": "tau"},
    "wrist": {"position": "h", "theta": "theta", "effort": "force"},
}


@dataclass(frozen=True)
class Mistake:
    """A possible mistake in some robots' channels."""

    kind: str  # name of the mistake in reports
    robots: tuple[int, ...]  # affected robots, from 0
    who: str  # the robots in words
    channels: tuple[str, ...]  # affected channels, as in ``CHANNELS[level]``
    what: str  # the mistake in words, without the robots
    subject: str  # topic in words, shared with the opposite mistake
    undo: Callable[[Signals], Signals] = field(compare=False)  # returns signals with the mistake undone
    sizes: tuple[tuple[str, Any], ...] = ()  # its numbers for reports, by name
    # returns the same mistake with another size, if its size must be fitted
    resized: Callable[[float], Mistake] | None = field(default=None, compare=False)

    @property
    def sentence(self) -> str:
        return f"{self.who}: {self.what}"

    def to_dict(self) -> dict[str, Any]:
        return {
            "kind": self.kind,
            "robots": [robot + 1 for robot in self.robots],
            "channels": list(self.channels),
            "sentence": self.sentence,
            **dict(self.sizes),
        }


def listed(words: Sequence[str]) -> str:
    """Join words with commas and an "and"."""
    if len(words) < 2:
        return "".join(words)
    return ", ".join(words[:-1]) + " and " + words[-1]


def _numbered(robots: Sequence[int], team: int) -> str:
    if len(robots) == team > 1:
        return "all robots"
    return f"robot{'s' * (len(robots) > 1)} {listed([str(robot + 1) for robot in robots])}"


def _teams(team: int) -> Iterator[tuple[tuple[int, ...], str]]:
    """Yield all robots together, then each alone, with their description in words."""
    every = [tuple(range(team))] if team > 1 else []
    for robots in (*every, *((robot,) for robot in range(team))):
        yield robots, _numbered(robots, team)


def _channels(level: Level, *kinds: Kind) -> tuple[str, ...]:
    """Return the names of the three channels of each group."""
    return tuple(CHANNELS[level][3 * KINDS.index(kind) + k] for kind in kinds for k in range(3))


def _mapped(signals: Signals, kinds: Sequence[Kind], robots: Sequence[int], **change: Any) -> Signals:
    """Return signals with groups of some robots changed by ``Group.mapped``."""
    return signals.having(**{kind: signals.group(kind).mapped(robots, **change) for kind in kinds})


# Units

DEGREE = float(np.pi / 180)
ANGLES = (("in degrees, not radians", DEGREE), ("converted from degrees, but was in radians", 1 / DEGREE))
LENGTHS = (("in millimetres, not metres", 1e-3), ("converted from millimetres, but was in metres", 1e3))
TORQUES = (("in mN m, not N m", 1e-3), ("converted from mN m, but was in N m", 1e3))
FORCES = (("in mN, not N", 1e-3), ("converted from mN, but was in N", 1e3))
UNITS: dict[Level, dict[Kind, tuple[tuple[str, float], ...]]] = {
    "joint": {"theta": ANGLES, "position": ANGLES, "effort": TORQUES},
    "wrist": {"theta": ANGLES, "position": LENGTHS, "effort": FORCES},
}
"""Units in words, and factors from the logged number to SI."""
COUNTS_FROM_RAD = 50.0  # angle above which encoder counts are tried as the unit [rad]
COUNT_BITS = tuple(range(8, 25))


def wrong_unit(signals: Signals, design: OmnidDesign) -> Iterator[Mistake]:
    """Yield wrong units: degrees, factors of a thousand and encoder counts, for all robots and for each."""
    level = signals.level
    counts = [(f"in counts of 2^{bits} per turn, not radians", 2 * np.pi / 2**bits) for bits in COUNT_BITS]
    for robots, who in _teams(signals.robots):
        for kind, choices in UNITS[level].items():
            large = choices is ANGLES and np.abs(signals.group(kind).values[0]).max() > COUNTS_FROM_RAD
            for words, factor in (*choices, *(counts if large else ())):
                yield Mistake(
                    "wrong_unit",
                    robots,
                    who,
                    _channels(level, kind),
                    f"{NAMES[level][kind]} is {words}",
                    f"unit of {NAMES[level][kind]}",
                    partial(_mapped, kinds=(kind,), robots=robots, factors=factor),
                    sizes=(("factor", factor),),
                )


# Order and signs

Three = tuple[int, int, int]
SAME_ORDER, SAME_SIGNS = (0, 1, 2), (1, 1, 1)
ORDERS: tuple[Three, ...] = (SAME_ORDER, (0, 2, 1), (1, 0, 2), (2, 1, 0), (1, 2, 0), (2, 0, 1))
SIGNS: tuple[Three, ...] = (
    SAME_SIGNS, (-1, -1, -1), (-1, 1, 1), (1, -1, 1), (1, 1, -1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1),
)  # fmt: skip
_TOGETHER_OR_ALONE: tuple[tuple[Kind, ...], ...] = (("position", "effort"), ("position",), ("effort",))


def rearranged(
    signals: Signals,
    design: OmnidDesign,
    *,
    kind: str,
    level: Level | None = None,
    groups: Sequence[tuple[Kind, ...]],
    orders: Sequence[Three] = (SAME_ORDER,),
    signs: Sequence[Three] = SIGNS,
) -> Iterator[Mistake]:
    """Yield three channels in another order or with other signs, for all robots and for each.

    Groups in one tuple are rearranged together; the true channel k is ``signs[k]`` times the logged ``order[k]``. With
    a ``level``, the mistake ``kind`` is tried at that level alone.
    """
    if level not in (None, signals.level):
        return
    for (robots, who), together, order, turned in product(_teams(signals.robots), groups, orders, signs):
        # Signs of torques or forces alone are a separate suspicion.
        elsewhere = len(orders) > 1 and together == ("effort",)
        if order == SAME_ORDER and (turned == SAME_SIGNS or elsewhere):
            continue
        changed = [k for k in range(3) if (order[k], turned[k]) != (k, 1)]
        names = [_channels(signals.level, group) for group in together]
        about = " and ".join(["order"] * (order != SAME_ORDER) + ["signs"] * (turned != SAME_SIGNS))
        yield Mistake(
            kind,
            robots,
            who,
            tuple(of_group[order[k]] for of_group in names for k in changed),
            " and ".join(
                _rearranged_words(NAMES[signals.level][group], of_group, order, turned, changed)
                for group, of_group in zip(together, names, strict=True)
            ),
            f"{about} of {' and '.join(NAMES[signals.level][group] for group in together)}",
            partial(_mapped, kinds=together, robots=robots, order=order, factors=turned),
        )


def _rearranged_words(
    group: str, names: Sequence[str], order: Three, signs: Three, changed: Sequence[int]
) -> str:
    if order == SAME_ORDER:
        turned = group if len(changed) == 3 else listed([names[k] for k in changed])
        return f"{turned} {'have' if len(changed) == 2 else 'has'} the wrong sign"
    if len(changed) == 2 and signs == SAME_SIGNS:
        return f"{names[changed[0]]} and {names[changed[1]]} are exchanged"
    return listed([f"column {names[order[k]]} holds {'-' * (signs[k] < 0)}{names[k]}" for k in changed])


# Columns of others

MOST_AT_ONCE = 3  # largest number of robots in a cycle; cycles are tried in teams of at most one robot more


def swapped_robots(signals: Signals, design: OmnidDesign) -> Iterator[Mistake]:
    """Yield exchanges of one group within every pair of robots and, in small teams, within every cycle of three.

    An exchange of *all* groups of two robots only renumbers them, which no data can show. An exchanged phi is
    therefore the same as exchanged theta and tau.
    """
    level, N = signals.level, signals.robots
    cycles = [(pair, pair[::-1]) for pair in combinations(range(N), 2)]
    if N <= MOST_AT_ONCE + 1:
        for i, j, k in combinations(range(N), 3):
            cycles += [((i, j, k), (j, k, i)), ((i, j, k), (k, i, j))]
    for (robots, sources), kind in product(cycles, KINDS):
        name = NAMES[level][kind]
        has = dict(zip(robots, sources, strict=True))
        if len(robots) == 2:
            others = " and ".join(NAMES[level][other] for other in KINDS if other != kind)
            what = (
                f"their {name} columns are exchanged (or those of {others}: the same but for their numbers)"
            )
        else:
            parts = [f"robot {has[i] + 1} has those of robot {i + 1}" for i in robots]
            what = f"their {name} columns are mixed up: {listed(parts)}"
        yield Mistake(
            "swapped_robots",
            robots,
            f"robots {listed([str(robot + 1) for robot in robots])}",
            _channels(level, kind),
            what,
            f"{name} of robots exchanged",
            partial(_taken, robots=robots, of=sources, kinds=(kind, kind)),
            sizes=(("order", tuple(has.get(i, i) + 1 for i in range(N))),),
        )


def exchanged_groups(signals: Signals, design: OmnidDesign) -> Iterator[Mistake]:
    """Yield exchanges of every pair of groups, for all robots and for each."""
    level = signals.level
    for (robots, who), pair in product(_teams(signals.robots), combinations(KINDS, 2)):
        named = " and ".join(NAMES[level][kind] for kind in pair)
        yield Mistake(
            "exchanged_groups",
            robots,
            who,
            _channels(level, *pair),
            f"the columns of {named} are exchanged",
            f"{named} exchanged",
            partial(_taken, robots=robots, of=robots, kinds=pair),
        )


def _taken(signals: Signals, robots: Sequence[int], of: Sequence[int], kinds: tuple[Kind, Kind]) -> Signals:
    """Return signals in which ``robots`` take each of two groups from the other group of robots ``of``.

    The two kinds may be equal; then one group moves between robots.
    """
    first, second = (signals.group(kind) for kind in kinds)
    return signals.having(
        **{kinds[0]: first.taken(robots, second, of), kinds[1]: second.taken(robots, first, of)}
    )


# Zeros

STEP_RAD = float(np.deg2rad(15.0))
STEPS = tuple(k for k in range(-6, 7) if k)
"""Offsets of one joint that are tried before the best is refined, in units of ``STEP_RAD``."""


def wrong_zero(signals: Signals, design: OmnidDesign) -> Iterator[Mistake]:
    """Yield positions with another origin, then every encoder with another zero; for all robots and for each."""
    yield from _other_origin(signals, design)
    kinds: tuple[Kind, ...] = ("position", "theta") if signals.level == "joint" else ("theta",)
    for (robots, who), kind, joint, k in product(_teams(signals.robots), kinds, range(3), STEPS):
        yield _shifted(signals.level, robots, who, kind, joint, k * STEP_RAD)


def _other_origin(signals: Signals, design: OmnidDesign) -> Iterator[Mistake]:
    """Yield positions that count from another posture or in the other direction."""
    joint, name = signals.level == "joint", NAMES[signals.level]["position"]
    home = np.array([0.0, 0.0, design.home_height_m])
    x, y, z = (float(x) for x in (inverse_kinematics(home, design) if joint else home))
    what, unit = ("phi counts", "rad") if joint else ("h is measured", "m")
    at_home = f"{what} from the home posture at ({x:.4g}, {y:.4g}, {z:.4g}) {unit}"
    choices = [("counts_from_home", at_home, 1, [x, y, z])]
    for sign, way in ((-1, "outward and down"), (1, "the right way round")) if joint else ():
        words = f"phi counts from the vertical, {way}"
        choices.append(("counts_from_vertical", words, sign, [np.pi / 2] * 3))
    for (robots, who), (kind, words, sign, offset) in product(_teams(signals.robots), choices):
        undo = partial(_mapped, kinds=("position",), robots=robots, factors=sign, offset=offset)
        channels = _channels(signals.level, "position")
        yield Mistake(kind, robots, who, channels, words, f"zero of {name}", undo)


def _shifted(
    level: Level, robots: tuple[int, ...], who: str, kind: Kind, joint: int, offset_rad: float
) -> Mistake:
    """Return the mistake of one encoder, to whose angle an offset must be added."""
    channel, amount = _channels(level, kind)[joint], np.rad2deg(abs(offset_rad))
    why = ""
    if len(robots) > 1:
        why = f" (the map lacks an offset, or has one of {amount / 2:.1f} deg with the wrong sign)"
    offset = [offset_rad * (k == joint) for k in range(3)]
    return Mistake(
        "wrong_zero",
        robots,
        who,
        (channel,),
        f"{channel} reads {amount:.1f} deg too {'little' if offset_rad > 0 else 'much'}{why}",
        f"zero of {channel}",
        partial(_mapped, kinds=(kind,), robots=robots, offset=offset),
        sizes=(("offset_rad", offset_rad),),
        resized=partial(_shifted, level, robots, who, kind, joint),
    )


def refined(mistake: Mistake, total: Callable[[Mistake], float]) -> Mistake:
    """Return a mistake with its size fitted, if it has one; ``total`` is the misfit with a mistake undone."""
    if mistake.resized is None:
        return mistake
    resized, start = mistake.resized, dict(mistake.sizes)["offset_rad"]
    found: Any = minimize_scalar(
        lambda offset: min(total(resized(float(offset))), 1e12),
        bounds=(start - STEP_RAD, start + STEP_RAD),
        method="bounded",
        options={"xatol": 1e-3},
    )
    return resized(float(found.x))


SUSPICIONS: tuple[Callable[[Signals, OmnidDesign], Iterator[Mistake]], ...] = (
    wrong_unit,
    partial(rearranged, kind="torque_sign", groups=(("effort",),)),
    partial(rearranged, kind="gimbal_axes", groups=(("theta",),), orders=ORDERS),
    swapped_robots,
    partial(
        rearranged,
        kind="joint_order",
        level="joint",
        groups=_TOGETHER_OR_ALONE,
        orders=ORDERS,
        signs=(SAME_SIGNS,),
    ),
    partial(rearranged, kind="joint_sign", level="joint", groups=_TOGETHER_OR_ALONE[:2]),
    partial(rearranged, kind="wrist_axes", level="wrist", groups=_TOGETHER_OR_ALONE, orders=ORDERS),
    exchanged_groups,
    wrong_zero,
)
"""Suspicions in order of plausibility; the first wins if the data cannot distinguish them."""
