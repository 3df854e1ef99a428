"""Estimate two bodies that a joint connects: joint, its motion, and inertial parameters.

``relative.relative_motion`` tells which robots hold which body and how the bodies move against each other, from
encoders alone. ``estimate.estimate_two_bodies`` adds masses, inertias and the joint's stiffness, damping and friction.
"""
