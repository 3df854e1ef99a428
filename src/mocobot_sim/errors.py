"""Error of a failed trial, in a separate module so that callers can catch it without loading MuJoCo."""


class TrialError(RuntimeError):
    """A trial failed a check of the simulation; the message says what failed, where and when."""
