"""Trials: what is commanded, simulated and recorded."""
