"""What a trial can fail with; apart, so that whoever catches it need not load MuJoCo."""


class TrialError(RuntimeError):
    """The physics of a trial cannot be trusted; the sentence says what broke, where and when."""
