"""Three channels of a robot in another order or with other signs, one entry of ``REARRANGED`` per suspicion."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import get_args

from estimator.arm.design import OmnidDesign
from mocobot_inspect.signals import Kind, Signals
from mocobot_inspect.wiring.mistakes.base import NAMES, Mistake, channel_names, listed, teams
from mocobot_logs.log import Level

Three = tuple[int, int, int]
SAME_ORDER, SAME_SIGNS = (0, 1, 2), (1, 1, 1)
ORDERS: tuple[Three, ...] = (SAME_ORDER, (0, 2, 1), (1, 0, 2), (2, 1, 0), (1, 2, 0), (2, 0, 1))
SIGNS: tuple[Three, ...] = (
    SAME_SIGNS, (-1, -1, -1), (-1, 1, 1), (1, -1, 1), (1, 1, -1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1),
)  # fmt: skip


@dataclass(frozen=True)
class Rearranged(Mistake):
    """Three channels of each group in another order or with other signs, all groups in the same way.

    Attributes:
        order, signs: the true channel k is ``signs[k]`` times the logged channel ``order[k]``.
    """

    order: Three
    signs: Three

    def undo(self, signals: Signals) -> Signals:
        for kind in self.groups:
            signals = signals.having(kind, signals.group(kind).arranged(self.robots, self.order, self.signs))
        return signals

    @property
    def channels(self) -> tuple[str, ...]:
        names = [channel_names(self.level, kind) for kind in self.groups]
        return tuple(of_group[self.order[k]] for of_group in names for k in self._changed)

    def what(self) -> str:
        return " and ".join(self._of(channel_names(self.level, kind), kind) for kind in self.groups)

    def subject(self) -> str:
        signs, order = self.signs != SAME_SIGNS, self.order != SAME_ORDER
        return ("order and signs" if signs and order else "signs" if signs else "order") + f" of {self.named}"

    @property
    def _changed(self) -> list[int]:
        return [k for k in range(3) if (self.order[k], self.signs[k]) != (k, 1)]

    def _of(self, names: tuple[str, ...], kind: Kind) -> str:
        changed = self._changed
        if self.order == SAME_ORDER:
            turned = NAMES[self.level][kind] if len(changed) == 3 else listed([names[k] for k in changed])
            return f"{turned} {'have' if len(changed) == 2 else 'has'} the wrong sign"
        if len(changed) == 2 and self.signs == SAME_SIGNS:
            return f"{names[changed[0]]} and {names[changed[1]]} are exchanged"
        return listed(
            [f"column {names[self.order[k]]} holds {'-' * (self.signs[k] < 0)}{names[k]}" for k in changed]
        )


@dataclass(frozen=True)
class Rearrangements:
    """A suspicion: every order and sign of some groups, of all robots and of each.

    Attributes:
        kind: name of the mistake in reports.
        levels: levels of a log at which it is looked for.
        choices: groups that are rearranged together.
        orders, signs: those that are tried; order *and* signs as they should be are none.
    """

    kind: str
    levels: tuple[Level, ...]
    choices: tuple[tuple[Kind, ...], ...]
    orders: tuple[Three, ...]
    signs: tuple[Three, ...]

    def suspects(self, signals: Signals, design: OmnidDesign) -> Iterator[Rearranged]:
        """Every such mistake."""
        if signals.level not in self.levels:
            return
        every = product(teams(signals.robots), self.choices, self.orders, self.signs)
        for robots, groups, order, signs in every:
            # Signs of torques or forces alone are a suspicion of their own.
            told = self.orders != (SAME_ORDER,) and groups == ("effort",)
            if order != SAME_ORDER or (signs != SAME_SIGNS and not told):
                yield Rearranged(self.kind, signals.level, robots, signals.robots, groups, order, signs)


_BOTH_LEVELS: tuple[Level, ...] = get_args(Level)
_TOGETHER_OR_ALONE: tuple[tuple[Kind, ...], ...] = (("position", "effort"), ("position",), ("effort",))
REARRANGED = {
    rule.kind: rule
    for rule in (
        Rearrangements("torque_sign", _BOTH_LEVELS, (("effort",),), (SAME_ORDER,), SIGNS),
        Rearrangements("gimbal_axes", _BOTH_LEVELS, (("theta",),), ORDERS, SIGNS),
        Rearrangements("joint_order", ("joint",), _TOGETHER_OR_ALONE, ORDERS, (SAME_SIGNS,)),
        Rearrangements("joint_sign", ("joint",), _TOGETHER_OR_ALONE[:2], (SAME_ORDER,), SIGNS),
        Rearrangements("wrist_axes", ("wrist",), _TOGETHER_OR_ALONE, ORDERS, SIGNS),
    )
}
