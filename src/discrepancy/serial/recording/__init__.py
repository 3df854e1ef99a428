"""Logs of the robot's joints."""
