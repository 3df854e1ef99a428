"""Estimate grasps and inertial parameters from motions and wrenches."""
