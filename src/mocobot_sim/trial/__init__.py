"""Trials: commands, simulation and recordings."""
