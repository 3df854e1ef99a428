"""How far the law of a listed cause may be from that of a real one."""

from dataclasses import dataclass

from discrepancy import rules


@dataclass(frozen=True)
class LawDoubt:
    """Of one cause on one machine.

    Attributes:
        share: amplitude that the law leaves of its trace where the cause is there: a standard deviation.
        towards_rivals: the same along what parts the cause from a rival; 0 where laws are those of the machine.
        unseen_nats: what something unlisted may leave beside the cause without being seen; 0 where all is seen.
    """

    share: float = rules.LAW_SHARE
    towards_rivals: float = 0.0
    unseen_nats: float = 0.0
