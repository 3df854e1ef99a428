"""Stiffness of a spring: scale of a torque reading."""

from discrepancy.team.causes.base import ReadingError, one_joint


class SeaScale(ReadingError):
    """The spring is stiffer than believed by a factor 1 + scale, so the reading is low by it.

    A scale common to all springs cannot be told from the payload's mass; a single one can.
    """

    title = "spring stiffness of {driven joint}"
    family = "sea_torque"
    parameters = ("scale",)
    tolerances = (1e-3,)
    adjusted = True
    separate = "Loads of both signs on the joint (a known added weight) separate bias, scale and hardening."

    def sentence(self, n):
        stiffer, small = n.either("scale", "stiffer", "softer"), n.either("scale", "too small", "too large")
        return f"the spring is {n('scale', '%', 1e2)} {stiffer} than assumed, so the torque is read {small}"

    def errors(self, signals, robot, joint, shape, design):
        return [{"tau": one_joint(-signals.tau[:, robot, joint], joint)}]
