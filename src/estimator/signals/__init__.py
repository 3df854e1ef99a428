"""From recordings to filtered motions and wrenches."""
