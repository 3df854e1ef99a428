"""A preflight look at a log: what is in it, what is wrong with it, and what it is good for."""
