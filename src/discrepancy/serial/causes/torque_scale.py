"""The torque's reading is off in scale."""

import numpy as np

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause, at_joint


class TorqueScale(Cause):
    """The torque reads ``1 + scale`` times what it is, such as by a torque constant that is off.

    It may depend on the load: 1 + scale (1 + bend (|torque| / typical load - 1)). Where iron saturates a current gives
    less torque than is told, so that the factor grows with the load; where a reading saturates it falls.
    """

    title = "scale of the torque of {joint}"
    family = "torque_scale"
    laden = True
    parameters = ("scale",)
    tolerances = (rules.SCALE_SHARE,)
    separate = "A known weight on the arm."

    def sentence(self, n):
        said = f"the torque reads {n('scale', '%', 100.0)} {n.either('scale', 'too much', 'too little')}"
        if not n.values["bend"]:
            return said
        what = "iron" if n.values["scale"] * n.values["bend"] > 0.0 else "a reading"
        return (
            f"{said} at its typical load of {n('typical_load', 'N m')}, at twice the load "
            f"{n('bend', '%', 100.0)} of that {n.either('bend', 'more', 'less')}, as where {what} saturates"
        )

    def shapes(self, hints, at):
        load = float(hints.load[at])
        # What a volt or an ampere is worth was fitted to these very loads: how it bends is what else the gear does.
        bends = rules.SCALE_BENDS if load > 0.0 and not hints.unscaled[at] else ()
        return [{"bend": bend, "typical_load": load} for bend in (0.0, *bends)]

    def steps(self, shape):
        return {"bend": rules.SCALE_BEND_STEP} if 0.0 < abs(shape["bend"]) < rules.MOST_BEND else {}

    def possible(self, tree, at, values, se):
        return bool(abs(values[0]) < self.most(tree, at)[0])

    def stands_out(self, values, shape):
        return not shape["bend"] or bool(abs(values[0]) > rules.LEAST_SCALE)

    def most(self, tree, at):
        return [rules.MOST_SCALE]

    def columns(self, signals, at, shape):
        # The model's torque, not the measured one: that would explain itself. What it lacks of friction counts as read.
        asked = signals.asked[:, at]
        if shape["bend"]:
            asked = asked * (1.0 + shape["bend"] * (np.abs(asked) / shape["typical_load"] - 1.0))
        return at_joint(signals, at, asked)

    def by_load(self, signals, at, values, shape, torque):
        share = values[0]
        if shape["bend"]:
            load = np.abs(signals.asked[:, at])
            share = share * (1.0 + shape["bend"] * (2.0 * load / shape["typical_load"] - 1.0))
        out = np.zeros_like(torque)
        out[:, at] = share * torque[:, at]
        return out
