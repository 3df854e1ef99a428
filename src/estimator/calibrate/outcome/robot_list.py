"""Lists with one entry for every robot but the first, in whose frames the others are."""

from __future__ import annotations

from estimator.strict import Fields


def by_robot(
    read: Fields, key: str, N: int, keys: tuple[str, ...], more: tuple[str, ...] = ()
) -> list[Fields]:
    """Entries for robots 2 to N, in order.

    Args:
        read: the object with the list.
        key: of the list.
        N: number of robots.
        keys: of an entry, ``i`` among them.
        more: keys that it may have besides.

    Raises:
        InputError: there are not so many, or one is of another robot.
    """
    out = []
    for k, entry in enumerate(read.list(key, N - 1), 1):
        one = Fields(entry, keys, f"{read.where}: {key}[{k}]", more)
        if one.values["i"] != k + 1:
            one.refuse("i", f"{k + 1}")
        out.append(one)
    return out
