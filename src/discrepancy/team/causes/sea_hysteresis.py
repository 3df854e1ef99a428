"""Dry friction inside a spring."""

from typing import ClassVar

from discrepancy.team.causes.sliding import Friction

PRESLIDING_RANGE_NM = (0.01, 1.0)
"""Derived: less is passed within a sample; more is hardly ever turned round."""

PRESLIDINGS_NM = (0.05, 0.2)
"""Torque that a spring takes up while the friction inside it gives way before it slips, tried first. Chosen: Bouc-Wen
springs that yield over 0.3 to 3 mrad at 100 N m/rad."""


class SeaHysteresis(Friction):
    """Friction parallel to the spring: the link gets more than the deflection tells while the torque grows.

    Torque that changes more slowly than ``slow_Nm_per_s`` counts as at rest.
    """

    title = "friction inside the spring of {driven joint}"
    parameters = ("friction_Nm",)
    tolerances = (2e-3,)
    clipped = ()
    shapes = (
        {"slow_Nm_per_s": 0.2}, {"slow_Nm_per_s": 0.6}, *({"presliding_Nm": x} for x in PRESLIDINGS_NM)
    )  # fmt: skip
    determined: ClassVar = {"presliding_Nm": 0.1}
    positive = ("friction_Nm",)
    moves = "tau"
    sign = -1.0
    gives = "presliding_Nm"
    gives_range = PRESLIDING_RANGE_NM
    separate = (
        "Motion with load reversals at rest separates friction in the spring from friction in the joint."
    )

    def sentence(self, n):
        soft = (
            f", and gives way over {n(self.gives, 'N m')} before it slips" if n.values.get(self.gives) else ""
        )
        return f"the spring rubs inside, with {n('friction_Nm', 'N m')}{soft}"
