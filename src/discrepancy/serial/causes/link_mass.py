"""A link is heavier or lighter than modelled."""

import numpy as np

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause
from discrepancy.serial.mechanics.regressor import body_regressor, inertial_parameters
from discrepancy.serial.rows.moved import with_tree


class LinkMass(Cause):
    """A link is denser or less dense: its mass is off, and its moments of inertia in proportion."""

    title = "mass of {link}"
    family = "inertia"
    part = "link"
    built = True
    parameters = ("excess_kg",)
    scales = (1.0,)
    separate = "A scale; or a known weight, if torques may be off in scale."

    def sentence(self, n):
        return f"has {n('excess_kg', 'kg')} {n.either('excess_kg', 'more', 'less')} than modelled"

    def normal(self, tree, at):
        return [rules.INERTIA_SHARE * float(tree.mass[tree.joint_body[at]])]

    def sizes(self, tree, at):
        return self.normal(tree, at)

    def possible(self, tree, at, values, se):
        # Less than nothing it cannot weigh; of steel in place of aluminium it weighs three times as much. At the last
        # link that would be a payload.
        most = self.most(tree, at)[0]
        more = most if at == tree.last_link else rules.DENSER * most
        return -most - 2.0 * se[0] < values[0] < more + 2.0 * se[0]

    def most(self, tree, at):
        return [rules.MOST_INERTIA_SHARE * float(tree.mass[tree.joint_body[at]])]

    def applied(self, signals, at, values, shape):
        tree, b = signals.tree, int(signals.tree.joint_body[at])
        here = np.arange(len(tree.mass)) == b
        factor = 1.0 + here * values[0] / tree.mass[b]
        return with_tree(signals, mass=tree.mass * factor, inertia=tree.inertia * factor[:, None, None])

    def columns(self, signals, at, shape):
        return self.slopes(signals, signals, at, shape)

    def slopes(self, model, signals, at, shape):
        tree, b = model.tree, int(model.tree.joint_body[at])
        each = inertial_parameters(1.0, signals.tree.com[b], tree.inertia[b] / tree.mass[b])
        return (body_regressor(signals.motion, b) @ each)[..., None]
