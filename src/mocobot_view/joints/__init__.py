"""Replays of logs of one robot's joints."""
