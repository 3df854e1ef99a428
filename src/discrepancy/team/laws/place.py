"""Where something may be wrong: a reading, a torque, a wrench, a displacement, a mass."""

from __future__ import annotations

from dataclasses import dataclass

from discrepancy.team.laws.variable import Variable


@dataclass(frozen=True)
class Place:
    """One error signal, or one for each of some axes.

    Attributes:
        name: what is wrong, as in the JSON, such as ``tau reading``.
        robot, joint: where, from 1, or None.
        targets: the simulator's name of what each component adds to, such as ``tau_2_1``.
        axes: names of the components in words; one empty name where there is one.
        unit: of the error.
        title: in words, with the part in braces as in ``Candidate.title``.
        own: signals of the same joint or robot: those that it most likely depends on.
        offset: whether a constant has to go with every law, because no cause of the catalogue is one here.
        without: signals that hold the error itself, such as the very torque that is read; it is no function of those.
        where: the place in words, of what sits at no robot and no joint.
        called: what the part is called besides its number, such as `` (elbow)``.
        units: of each component where they differ from ``unit``; empty where they do not.
        twin: name of a place whose rows are the same, minus these; only the response to the commands separates them.
    """

    name: str
    robot: int | None
    joint: int | None
    targets: tuple[str, ...]
    axes: tuple[str, ...]
    unit: str
    title: str
    own: tuple[Variable, ...] = ()
    offset: bool = False
    units: tuple[str, ...] = ()
    twin: str | None = None
    without: tuple[Variable, ...] = ()
    where: str = "payload"
    called: str = ""

    @property
    def key(self) -> tuple[str, int | None, int | None]:
        """Which place."""
        return self.name, self.robot, self.joint
