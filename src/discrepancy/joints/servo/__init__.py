"""Drives that tell no torque: what a motor makes of its voltage or current, and what the loop makes of an error."""
