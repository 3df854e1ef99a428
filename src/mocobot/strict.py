"""What ``--strict`` makes of an answer that is not good."""


class NotGood(Exception):
    """The work is done and written, and the answer is not good: one sentence that says why."""
