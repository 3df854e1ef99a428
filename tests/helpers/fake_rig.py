"""A rig of pure numbers: random columns for a dozen causes, nothing of robots, a closed loop made up by a test."""

from dataclasses import dataclass, field

import numpy as np

from discrepancy.candidate import Candidate, Parameter, Transient
from discrepancy.engine.explanation import explain
from discrepancy.inference.search import search
from discrepancy.rig import Channel, Rig, Rows

ROWS, CHANNELS, RATE_HZ = 120, 4, 12.5


def cause(name, robot=1, tolerance=1.0, parameters=1, family="", transient=None, joint=None):
    """A candidate; of a family of its own where none is given."""
    listed = tuple(Parameter(f"p{k}", tolerance, 1.0) for k in range(parameters))
    return Candidate(name, family or name, robot, joint, listed, {}, transient)


CATALOGUE = tuple(cause(f"cause {k}", parameters=2 if k == 5 else 1) for k in range(8))


NINE = tuple(cause("many", robot, joint=joint) for robot in (1, 2, 3) for joint in (1, 2, 3))
"""A kind of nine places; the first is candidate 0."""

TWINS = {4: (2, 0.005)}  # cause 4 leaves the trace of cause 2, but for half a percent


@dataclass
class FakeRig(Rig):
    """Data are noise + unknowns + causes in place, all linear.

    Attributes:
        present: values of the causes that are there (in units), by index into the catalogue.
        trials: their names.
        catalogue: what the diagnosis knows.
        foreign: size of a misfit that no cause makes, or 0.
        burst: index of a trial, size of a random misfit there for 4 s, columns of the transient; or None.
        twins: pairs of causes whose columns differ by that share only.
        loop: chi2_per_n of a closed loop from the names of its causes; None if there is none.
        seed: of all that is random.
        own: true values of every trial's own unknowns.
        kinds: of the channels.
        calls: simulations asked for: trial, names of the causes, their values.
    """

    present: dict
    trials: tuple = ("a", "b", "c", "d")
    catalogue: tuple = CATALOGUE
    foreign: float = 0.0
    burst: tuple | None = None
    twins: dict = field(default_factory=dict)
    loop: object = None
    seed: int = 3
    calls: list = field(default_factory=list)
    local_unknowns: int = 2
    kinds: tuple = ("made up",) * CHANNELS

    def __post_init__(self):
        rng = np.random.default_rng(self.seed)
        shape = (ROWS, CHANNELS)
        self.data, self.own, self.columns_of = [], [], {c.key: [] for c in self.catalogue}
        # Every cause is a little off, within its tolerance, and alike in all trials.
        off = [
            rng.standard_normal(len(c.parameters)) * (c.parameters[0].tolerance > 0) for c in self.catalogue
        ]
        for t in range(len(self.trials)):
            local, shared = rng.standard_normal((*shape, 2)), rng.standard_normal((*shape, 3))
            self.own.append(rng.uniform(-5, 5, 2))
            x = rng.standard_normal(shape) + local @ self.own[-1] + shared @ np.array([4.0, -3.0, 2.0])
            for k, c in enumerate(self.catalogue):
                column = 0.3 * rng.standard_normal((*shape, len(c.parameters)))
                if k in self.twins:
                    other, apart = self.twins[k]
                    column = self.columns_of[self.catalogue[other].key][t] + apart * column
                self.columns_of[c.key].append(column)
                values = off[k] + np.asarray(self.present.get(k, 0.0))
                x = x + column @ (values * c.units)
            x = x + self.foreign * rng.standard_normal(shape)
            if self.burst and self.burst[0] == t:
                x[40:90] += self.burst[1] * rng.standard_normal((50, CHANNELS))
            self.data.append((x, local, shared))

    @property
    def channels(self):
        return [Channel(f"channel {k}", kind, None, "m") for k, kind in enumerate(self.kinds)]

    def candidates(self):
        return list(self.catalogue)

    def rows(self, candidates):
        time = np.arange(ROWS) / RATE_HZ
        return [
            Rows(name, x, local, shared, [self.columns(c)[t] for c in candidates], time)
            for t, (name, (x, local, shared)) in enumerate(zip(self.trials, self.data, strict=True))
        ]

    def columns(self, candidate):
        if candidate.transient:
            return [self._burst_columns(t, candidate) for t in range(len(self.trials))]
        return self.columns_of[candidate.key]

    def _burst_columns(self, t, candidate):
        """One column per channel during the interval, a random pattern each."""
        out = np.zeros((ROWS, CHANNELS, len(candidate.parameters)))
        if t == candidate.transient.trial:
            rng = np.random.default_rng(int(100 * candidate.transient.start_s))
            out[40:90] = rng.standard_normal((50, CHANNELS, len(candidate.parameters)))
        return out

    def residual(self, shared, local, active):
        out = []
        for t, (x, own, common) in enumerate(self.data):
            # Unknowns move the model by what their columns say; causes are taken out of the data.
            x = x + common @ shared + own @ local[t]
            for candidate, values in active:
                x = x - self.columns(candidate)[t] @ values
            out.append(x)
        return out

    def transients(self, remaining):
        if not self.burst:
            return []
        when = Transient(self.burst[0], 3.2, 4.0)
        return [cause("push", None, 0.0, self.burst[2], "push", when)]

    def can_resimulate(self):
        return None if self.loop else "it is made up"

    def simulation(self, trial, shared, local, active, healthy=()):
        names = tuple(sorted(c.cause for c, _ in active))
        self.calls.append((trial, names, [v for _, v in active]))
        chi2 = self.loop(names, trial)
        return lambda: None if chi2 is None else {"phi": np.full((10, 3), np.sqrt(chi2))}

    def response_scale(self, trial):
        return {"phi": (np.ones(3), np.full(3, 2.0))}

    def quantities(self, trial):
        return {"speed": np.ones(ROWS)}

    def row_rate_hz(self, trial):
        return RATE_HZ

    def effect_parameters(self, candidate, values, covariance):
        return {p.name: v for p, v in zip(candidate.parameters, values, strict=True)}, {}

    def write_extended(self, explanation, folder):
        raise NotImplementedError


def names(found):
    return [f.candidate.cause for f in found]


def found_in(rig, **options):
    return explain(search(rig, **options))
