"""Parts of a log: crop, drop, split at gaps."""
