"""Rollouts of serial robots; origins are named as in ``discrepancy.rules``. None of these changes a verdict."""

HORIZONS_S = (0.1, 0.2, 0.5)
"""How far ahead a robot is rolled out. Chosen: from where friction tells to where an arm has turned round."""
MOST_STARTS = 60
"""Of rollouts in all blocks together. Chosen: root mean squares are known to a tenth then, and it takes seconds."""
MOST_LOOP_S = 100.0
"""Of closed loops in all blocks together, each as long as the others. Chosen: they take seconds, too."""
LONGEST_STEP_S = 1e-3
"""Of MuJoCo's integration. Chosen: a twentieth of the period of what the rows' low-pass leaves."""
DIVERGED_RAD = 3.141592653589793
"""How far off a joint that turns may be. Derived: from half a turn on its angle says nothing of where the link is.
A joint that slides may be off by the extent of the model, or by its own travel in the log if that is more."""
MOST_DIVERGED = 0.5
"""Share of the starts at which a joint may diverge for its error over the others to be told. Chosen: those left
are the easy ones."""
EDGE_PERIODS = 2.5
"""Usable samples before a start and after an end, in periods of the smoothing. Derived: as long as its filter
remembers (``serial.HALF_PERIODS``)."""
