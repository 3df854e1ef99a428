"""Simulation of a team of Omnids in MuJoCo: scenes, control, trajectories, sensors, effects, trials."""
