"""Impedance control of the wrists with inner SEA torque loops."""
