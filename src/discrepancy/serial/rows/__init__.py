"""From samples of a log to rows of a linear problem."""
