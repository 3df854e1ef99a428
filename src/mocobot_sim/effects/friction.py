"""Coulomb friction that sticks: the solver settings for MuJoCo's ``frictionloss``.

Under its limit, a friction row lets its coordinate creep at -R f / B (see ``soft``): with the smallest R and a rate B
that stops a coordinate within a millisecond, a coordinate of inertia I creeps at 1e-7 f / I [1/s].
"""

from typing import Any

STICK: dict[str, Any] = {
    "solreffriction": [-1.0, -1000.0],
    "solimpfriction": [0.9999, 0.9999, 0.001, 0.5, 2.0],
}
