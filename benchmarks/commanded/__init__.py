"""Robots that log commands and positions and no torque: generator, scores and what other programs make of the sets.

``make`` writes a set, ``score`` judges a fit of it, ``baselines`` fits it with CMA-ES and ``mujoco.sysid``. The truth
comes from MuJoCo's stepping; nothing here takes a formula from ``src``.
"""
