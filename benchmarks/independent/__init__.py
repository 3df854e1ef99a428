"""Recordings from inverse dynamics of a prescribed motion: written apart from simulator, estimator and diagnosis."""
