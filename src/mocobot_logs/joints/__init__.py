"""Logs of one serial robot: joint positions with torques, currents or commands."""
