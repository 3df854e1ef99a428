"""When a search ends with what it has."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

from discrepancy.evidence.search import Bent, Search, State


@dataclass
class Until:
    """When a search ends with what it has: after some time, or when the user breaks it off.

    Attributes:
        end_s: on the monotonic clock [s].
        broken: whether it has been broken off.
    """

    end_s: float = math.inf
    broken: bool = False

    def __call__(self) -> bool:
        """Whether to end."""
        self.broken = self.broken or time.monotonic() > self.end_s
        return self.broken

    def run(self, search: Search, state: State, bent: Bent = lambda state, new: False) -> State:
        """The likeliest set; the best so far where it is broken off."""
        try:
            return search.run(state, bent)
        except KeyboardInterrupt:
            self.broken = True
            return search.best or state
