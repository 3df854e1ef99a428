"""Dry friction inside a spring."""

from typing import ClassVar

from discrepancy import rules
from discrepancy.team.causes.sliding import Friction


class SeaHysteresis(Friction):
    """Friction parallel to the spring: the link gets more than the deflection tells while the torque grows.

    Torque that changes more slowly than ``slow_Nm_per_s`` counts as at rest.
    """

    title = "friction inside the spring of {driven joint}"
    parameters = ("friction_Nm",)
    tolerances = (2e-3,)
    clipped = ()
    shapes = (
        {"slow_Nm_per_s": 0.2}, {"slow_Nm_per_s": 0.6}, *({"presliding_Nm": x} for x in rules.PRESLIDINGS_NM)
    )  # fmt: skip
    determined: ClassVar = {"presliding_Nm": 0.1}
    positive = ("friction_Nm",)
    moves = "tau"
    sign = -1.0
    gives = "presliding_Nm"
    gives_range = rules.PRESLIDING_RANGE_NM
    separate = (
        "Motion with load reversals at rest separates friction in the spring from friction in the joint."
    )

    def sentence(self, n):
        soft = (
            f", and gives way over {n(self.gives, 'N m')} before it slips" if n.values.get(self.gives) else ""
        )
        return f"the spring rubs inside, with {n('friction_Nm', 'N m')}{soft}"
