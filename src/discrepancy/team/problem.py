"""Build the linear diagnosis problem of a team, linearised around given robots, payload and causes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, idct
from scipy.special import logsumexp

from discrepancy.candidate import Candidate, Transient
from discrepancy.evidence.cells import Bands, Cells, Columns, Series
from discrepancy.evidence.posterior import Group, Posterior
from discrepancy.evidence.search import Chosen
from discrepancy.team.candidates import in_shapes, origin_of, shape_steps
from discrepancy.team.causes import CAUSES
from discrepancy.team.laws import OPEN_NATS, Laws
from discrepancy.team.rig import TeamRig
from estimator.arrays import Array

TEAM_PUSH_S = (0.4, 0.8, 1.6, 3.2, 6.4)
"""Push durations where the search starts [s]. Chosen: octaves."""

EDGES_HZ = np.array([0.0, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2])
"""Band edges of the noise model [Hz], in octaves. Rows come at 12.5 Hz; rows of holds form an extra band."""
UNKNOWN = 1e6
"""Prior standard deviation of an unknown over the one that the data alone give it: the prior has no influence."""
SLAB = 64.0
"""Largest prior standard deviation of a chosen cause, in tolerances or typical sizes."""
LIKELIEST = 8
"""Number of shapes proposed in each step. The exact linear gain ranks them."""
NEAR = 3
"""Number of neighbouring shapes, and of pushes, proposed in each step."""
BLOCK = 64
"""Number of columns that are copied at a time. Chosen: limits memory."""
ENDS = 3
"""Passes that move both ends of a push to the largest linear gain. Chosen: two passes nearly always suffice."""
STEP_SHARE = 1.0
"""Prior standard deviation of a Gauss-Newton step of a shape number, as a share of that number."""
EXACT = (
    "phi_zero", "theta_zero", "link_length", "base_tilt", "sea_bias", "payload_mass", "clock_delay", "torque_skew",
)  # fmt: skip
"""Causes whose law is pure geometry or arithmetic, so that they need no model discrepancy."""


@dataclass(frozen=True, eq=False)
class RowBands(Bands):
    """Frequency bands of the rows: cosine coefficients of moving rows by octave, and rows of holds as the last band.

    Attributes:
        moving: number of moving rows of each trial.
    """

    moving: Sequence[int] = ()

    def of_trial(self, trial: int) -> NDArray[np.intp]:
        """Return the band of every row of one channel of three components, shape (3 n,)."""
        m, last = self.moving[trial], len(self.edges_hz) - 2
        frequency = np.arange(m) * self.rates_hz[trial] / (2.0 * m)
        band = np.minimum(np.searchsorted(self.edges_hz, frequency, side="right") - 1, last - 1)
        return np.repeat(np.append(band, np.full(self.lengths[trial] - m, last)), 3)

    def spectrum(self, series: Sequence[Array], channel: int = 0) -> Array:
        """Transform the rows of one channel, shape (n, 3, ...) a trial, into coefficients, shape (sum 3 n, ...)."""
        out = []
        for t, x in enumerate(series):
            m = self.moving[t]
            moved = np.asarray(dct(x[:m], axis=0, norm="ortho"))
            out.append(np.concatenate([moved, x[m:]]).reshape(3 * len(x), *x.shape[2:]))
        return np.concatenate(out)

    def rows(self, spectrum: Array) -> list[Array]:
        """Transform coefficients, shape (sum 3 n, ...), back into rows, shape (n, 3, ...) a trial."""
        out, first = [], 0
        for m, n in zip(self.moving, self.lengths, strict=True):
            x = spectrum[first : first + 3 * n].reshape(n, 3, *spectrum.shape[1:])
            out.append(np.concatenate([np.asarray(idct(x[:m], axis=0, norm="ortho")), x[m:]]))
            first += 3 * n
        return out


@dataclass(frozen=True, eq=False)
class Listed:
    """Candidate causes whose columns are kept outside the problem.

    Attributes:
        rig: the rig whose linearisation gives the columns.
        groups: the candidates, without column indices.
        columns: of all groups.
    """

    rig: TeamRig
    groups: Sequence[Group]
    columns: Columns

    def of(self, group: Group) -> Columns | None:
        """Columns of a group, or None if it is not listed."""
        k = self._index.get(group.identity)
        return None if k is None else self.columns.part(self.spans[k])

    @cached_property
    def _index(self) -> dict[Hashable, int]:
        return {g.identity: k for k, g in enumerate(self.groups)}

    @cached_property
    def spans(self) -> list[slice]:
        """Columns of each group in ``columns``."""
        ends = np.cumsum([len(g.slab) for g in self.groups])
        return [slice(e - len(g.slab), e) for e, g in zip(ends, self.groups, strict=True)]


@dataclass(eq=False)
class TeamProblem:
    """The linear problem of a team; implements ``evidence.search.Linear``.

    Attributes:
        rig: the linearised recordings.
        cells, groups, families, laws: as in ``evidence.search.Linear``.
        labels: candidate and parameter index of every column; None for nuisance parameters.
        tolerance: prior standard deviation of every column in a healthy team, shape (K,).
        listed: other shapes of the causes, whose columns are not in the problem.
        shared, local: columns of the unknowns that all trials share, and of each trial's own.
        opened: for each trial, matrices that whiten the rows against latent states of the chosen causes, such as
            friction at rest, shape (n, C, C); None without latent states.
        candidates: candidate of every group, by the group's identity.
        catalogue: columns that stay the same during the search.
        there: parameter values at the linearisation point, shape (K,).
        near: neighbours of the shape that was refined last, and their columns.
    """

    rig: TeamRig
    cells: Cells
    groups: list[Group] = field(default_factory=list)
    families: list[list[int]] = field(default_factory=list)
    laws: list[list[int]] = field(default_factory=list)
    labels: list[tuple[Candidate, int] | None] = field(default_factory=list)
    tolerance: list[float] = field(default_factory=list)
    listed: Listed | None = None
    shared: list[int] = field(default_factory=list)
    local: list[list[int]] = field(default_factory=list)
    opened: Sequence[Array] | None = None
    candidates: dict[Hashable, Candidate] = field(default_factory=dict)
    catalogue: Catalogue | None = None
    there: Array = field(default_factory=lambda: np.zeros(0))
    near: Listed | None = None

    @property
    def bands(self) -> RowBands:
        """Frequency bands of the rows."""
        return cast("RowBands", self.cells.bands)

    @property
    def sensors(self) -> Array:
        """Noise variance of every channel and band. It is one, because the rows are whitened."""
        return np.ones((len(self.cells.channels), len(self.cells.bands.edges_hz) - 1))

    def prior(self, chosen: Sequence[Chosen], values: Array | None) -> Array:
        """Prior variances of all columns in a healthy team."""
        return np.array(self.tolerance) ** 2

    # --- columns

    def rows_of(self, x: Sequence[Array]) -> list[Array]:
        """Whiten rows (n, C, ...) of every trial against the latent states of the chosen causes."""
        if self.opened is None:
            return list(x)
        return [
            (w @ r.reshape(*r.shape[:2], -1)).reshape(r.shape) for w, r in zip(self.opened, x, strict=True)
        ]

    def columns_of(self, candidate: Candidate) -> list[Array]:
        """Columns of a candidate, shape (n, C, k) a trial."""
        return self.rows_of(self.rig.columns(candidate))

    def spectra(self, columns: Sequence[Array]) -> Columns:
        """Turn columns (n, 3 C, k), one array a trial, into rows of the cells."""
        bands, order, columns = self.bands, self.cells.order, list(columns)
        there = np.any([x.any(axis=0) for x in columns], axis=0)
        at = [np.flatnonzero(there[c : c + 3].any(axis=0)) for c in range(0, len(there), 3)]
        X = [bands.spectrum([x[:, 3 * c : 3 * c + 3, k] for x in columns]) for c, k in enumerate(at)]
        return Columns(there.shape[1], at, [x[order].astype(np.float32) for x in X])

    def add(self, columns: Sequence[Array]) -> list[int]:
        """Append columns (n, 3 C, k), one array a trial, and return their indices."""
        return self.cells.add_rows(self.spectra(columns))

    def beside(self, columns: Columns) -> Columns:
        """Whiten columns against the latent states of the chosen causes."""
        if self.opened is None or not columns.count:
            return columns
        blocks = [slice(k, min(k + BLOCK, columns.count)) for k in range(0, columns.count, BLOCK)]
        return Columns.joined([self._beside(columns.part(block).dense) for block in blocks])

    def _beside(self, X: NDArray[Any]) -> Columns:
        bands, order = self.bands, self.cells.order
        plain = np.empty_like(X)
        plain[:, order] = X
        each = [np.concatenate(parts, axis=1) for parts in zip(*(bands.rows(x) for x in plain), strict=True)]
        return self.spectra(self.rows_of(each))

    def listing(self, candidates: Iterable[Candidate], count: int) -> Listed:
        """List candidates and their columns outside the problem.

        Args:
            candidates: the causes in their shapes.
            count: number of equally probable shapes; a candidate's own ``among`` takes precedence.
        """
        groups, each = [], []
        for c in candidates:
            groups.append(self.group_of(c, -math.log(c.among or count)))
            each.append(self.spectra(self.columns_of(c)))
        return Listed(self.rig, groups, Columns.joined(each))

    def group_of(self, candidate: Candidate, log_prior: float, columns: Sequence[int] = ()) -> Group:
        """Turn a candidate into a group of the search and register it."""
        at = candidate.transient
        place = (
            candidate.place
            if at is None
            else f"{candidate.place} from {at.start_s:.1f} s of trial {at.trial + 1}"
        )
        shape = tuple((k, float(v)) for k, v in candidate.shape.items())
        shape += (("trial", float(at.trial)),) if at else ()
        positive = CAUSES[candidate.cause].positive
        least = (
            tuple(0.0 if p.name in positive else -np.inf for p in candidate.parameters) if positive else ()
        )
        g = Group(
            candidate.cause, place, tuple(columns), tuple(SLAB * candidate.units), log_prior, shape, least,
            event=at is not None,
        )  # fmt: skip
        self.candidates[g.identity] = candidate
        return g

    def values_of(self, group: Group, x: Array) -> Array:
        """Values of all parameters of a group, shape (k,); parameters without a column are zero."""
        out = np.zeros(len(self.candidates[group.identity].parameters))
        for n, k in enumerate(group.columns):
            label = self.labels[k] if k < len(self.labels) else None
            out[n if label is None else label[1]] = x[k]
        return out

    def place(self, group: Group) -> Group:
        """Add the columns of a shape or an unlisted law to the problem."""
        if group.late:
            pairs = zip(self.rig.whitening, self.laws_of.columns(self.laws_of.of(group)), strict=True)
            return replace(group, columns=tuple(self.add(self.rows_of([w(x) for w, x in pairs]))))
        for listed in filter(None, (self.listed, self.near)):
            known = listed.of(group) if listed.rig is self.rig else None
            if known is not None:
                return replace(group, columns=tuple(self.cells.add_rows(known)))
        return replace(group, columns=tuple(self.add(self.columns_of(self.candidates[group.identity]))))

    # --- proposals

    def proposals(self, posterior: Posterior, *, late: bool = False) -> list[Group]:
        """Return the most promising shapes and pushes.

        Args:
            posterior: of the current set of causes.
            late: whether to propose unlisted laws, too.
        """
        out: list[Group] = []
        if late:
            rows = self.cells.rows
            v = np.maximum(posterior.variance, posterior.left[0] / np.maximum(rows, 1.0))
            each = 0.5 * (rows * (v - 1.0 - np.log(v)) - 1.0)  # pure chance contributes half a nat per band
            noise = float(np.sum(each[rows > 0.0]))
            least = {"auto": OPEN_NATS, "always": -math.inf, "never": math.inf}[self.rig.laws]
            # The learnt noise may absorb an unlisted law, so use at most the noise of the sensors.
            quiet = replace(posterior, variance=np.minimum(v, self.sensors))
            out += (
                self.laws_of.proposed(self.left(quiet.mean, quiet.variance), self._white)
                if noise > least
                else []
            )
        if self.listed is not None:
            gains, most = self.gains(posterior, self.listed), len(out) + LIKELIEST
            for i in np.argsort(-gains):
                group = self.listed.groups[i]
                if sum(g.key == group.key for g in out) < 2:
                    out.append(group)
                if len(out) == most:
                    break
        return [*out, *self.pushes(posterior)]

    def gains(self, posterior: Posterior, listed: Listed, octaves: int = 5) -> Array:
        """Log evidence that each listed shape adds, including its prior, shape (L,).

        Args:
            posterior: of the current set of causes.
            listed: the shapes.
            octaves: number of prior sizes to average over, each half of the one before.
        """
        cells, spans = self.cells, listed.spans
        s, L, z = posterior._factor
        active = posterior.active
        at = np.full(cells.count, -1)
        at[active] = np.arange(len(active))
        K = listed.columns.count
        G, b, squares = (
            np.zeros((len(active), K)),
            np.zeros(K),
            [np.zeros((len(g.slab),) * 2) for g in listed.groups],
        )
        each = zip(cells.channels, posterior.variance, listed.columns.at, listed.columns.X, strict=True)
        for channel, own, there, X in each:
            weight = np.repeat(1.0 / own, np.diff(channel.starts)).astype(np.float32)[:, None]
            keep = np.flatnonzero(at[channel.columns] >= 0)
            Y = channel.X[:, keep].astype(np.float32) * weight
            G[at[channel.columns[keep], None], there] += Y.T @ X
            b[there] += X.T @ (weight[:, 0] * channel.y)
            ends = np.searchsorted(there, [[k.start, k.stop] for k in spans])
            for square, k, (low, high) in zip(squares, spans, ends, strict=True):
                x, place = X[:, low:high], there[low:high] - k.start
                square[place[:, None], place] += (x * weight).T @ x
        U = L.forward(s[:, None] * G)
        Q, scales = b - U.T @ z, 0.5 ** np.arange(octaves)
        value, widths = np.empty((len(spans), octaves)), np.array([len(g.slab) for g in listed.groups])
        for width in np.unique(widths):  # all groups of one width at once: thousands of small matrices
            alike = np.flatnonzero(widths == width).tolist()
            B = np.array([listed.groups[i].slab for i in alike])[:, None] * scales[:, None]
            each = [squares[i] - U[:, k].T @ U[:, k] for i in alike for k in [spans[i]]]
            w, V = np.linalg.eigh(B[..., None] * np.array(each)[:, None] * B[..., None, :])
            lam = 1.0 + np.maximum(w, 0.0)
            u = np.swapaxes(V, -1, -2) @ (B * np.array([Q[spans[i]] for i in alike])[:, None])[..., None]
            value[alike] = 0.5 * np.sum(u[..., 0] ** 2 / lam - np.log(lam), axis=-1)
        priors = np.array([g.log_prior for g in listed.groups])
        return np.asarray(logsumexp(value, axis=1) - np.log(octaves) + priors)

    def pushes(self, posterior: Posterior) -> list[Group]:
        """Return the most promising pushes: a constant force and moment on the payload for a limited time."""
        if "push" in self.rig.excluded:
            return []
        found: dict[tuple[int, int, int], float] = {}
        windows = 0
        for t, (score, D) in enumerate(
            zip(self.left(posterior.mean, posterior.variance), self.wrenches, strict=True)
        ):
            m, rate = self.rig.linear[t].reduction.moving, self.cells.bands.rates_hz[t]
            Q = np.einsum("nck,nc->nk", D[:m], score[:m, -6:])
            R = np.einsum("nck,ncl->nkl", D[:m], D[:m])
            q, r = (np.concatenate([np.zeros((1, *x.shape[1:])), np.cumsum(x, axis=0)]) for x in (Q, R))
            r = r + np.arange(m + 1.0)[:, None, None] * 1e-6 * np.eye(6) * np.trace(r[-1]) / max(m, 1) ** 2

            def gains(starts: NDArray[np.intp], ends: NDArray[np.intp], q: Array = q, r: Array = r) -> Array:
                dq, dr = q[ends] - q[starts], r[ends] - r[starts]
                return 0.5 * np.einsum("wk,wk->w", dq, np.linalg.solve(dr, dq[..., None])[..., 0])

            for seconds in TEAM_PUSH_S:
                n = max(2, round(seconds * rate))
                if 2 * n > m:
                    continue
                starts = np.arange(m + 1 - n)
                windows += 2 * len(starts) // n
                first = int(np.argmax(gains(starts, starts + n)))
                stop = first + n
                for _ in range(ENDS):  # start from the octave, then refine both ends
                    stop = (
                        first
                        + 2
                        + int(np.argmax(gains(np.full(m - first - 1, first), np.arange(first + 2, m + 1))))
                    )
                    first = int(np.argmax(gains(np.arange(stop - 1), np.full(stop - 1, stop))))
                found[t, first, stop] = float(gains(np.array([first]), np.array([stop]))[0])
        events = []
        for t, first, stop in sorted(found, key=lambda key: -found[key])[:NEAR]:
            start = float(self.rig.linear[t].reduction.time[first])
            events.append(Transient(t, start, (stop - first) / self.cells.bands.rates_hz[t]))
        given = self.rig.tolerances.get("push", {})
        return [self.group_of(CAUSES["push"].event(given, when), -math.log(windows)) for when in events]

    @cached_property
    def wrenches(self) -> list[Array]:
        """Whitened balance rows per unit force along {b1} and unit moment in {1}, shape (n, 6, 6) a trial."""
        out = []
        for linear, white in zip(self.rig.linear, self.rig.whitening, strict=True):
            R = linear.data.R_bi[:, 0]
            eye = np.broadcast_to(np.eye(3), R.shape)
            force = linear.of_wrench(np.swapaxes(R, 1, 2), np.zeros_like(R))
            moment = linear.of_wrench(np.zeros_like(R), eye)
            out.append(white(np.concatenate([force, moment], axis=2)))
        return [x[:, -6:] for x in self.rows_of(out)]

    def left(self, x: Array, variance: Array | None = None) -> list[Array]:
        """Residual rows after subtracting the columns times ``x``, shape (n, C) a trial.

        Args:
            x: values of the columns.
            variance: divides the rows if given, shape (C, bands).
        """
        parts = []
        for c, channel in enumerate(self.cells.channels):
            known, rows = channel.columns < len(x), np.empty_like(channel.y)
            left = channel.y - channel.X[:, known] @ x[channel.columns[known]]
            rows[self.cells.order] = (
                left if variance is None else left / np.repeat(variance[c], np.diff(channel.starts))
            )
            parts.append(self.bands.rows(rows))
        return [np.concatenate(each, axis=1) for each in zip(*parts, strict=True)]

    def _white(self, rows: Sequence[Array]) -> list[Array]:
        """Whiten each row (n, C, k) by itself, without the correlation along time."""
        return self.rows_of([w.rows_only(r) for w, r in zip(self.rig.whitening, rows, strict=True)])

    @cached_property
    def laws_of(self) -> Laws:
        """Laws that no listed cause describes."""
        return Laws(self.rig.linear)

    # --- shapes and forms

    def nearby(self, group: Group, posterior: Posterior) -> list[Group]:
        """Return the same cause in neighbouring shapes, ranked by their evidence in its place."""
        if group.late:
            return self.laws_of.finer(group)
        candidate = self.candidates[group.identity]
        out = self._stepped(candidate, group, posterior)
        cause, trials = CAUSES[candidate.cause], len(self.rig.linear)
        near = in_shapes(candidate, cause.finer(candidate.shape), trials)
        further, grown = (
            () if candidate.transient else of(candidate.shape) for of in (cause.further, cause.grown)
        )
        near += in_shapes(candidate, further, trials)
        for more in in_shapes(candidate, grown, trials):  # same columns until the additional number has moved
            of_more = replace(group, log_prior=-math.log(more.among)) if more.among else group
            out += self._stepped(more, of_more, posterior)
        if near:
            prior = posterior.prior.copy()
            base = self.prior((), None)
            for k in group.columns:
                prior[k] = base[k] if k < len(base) else 0.0
            listed = self.near = self.listing(near, 1)
            listed = replace(listed, groups=[replace(g, log_prior=-math.log(c.among or math.exp(-group.log_prior)))
                                             for g, c in zip(listed.groups, near, strict=True)])  # fmt: skip
            gains = self.gains(Posterior(self.cells, prior, posterior.variance), listed)
            out += [listed.groups[i] for i in np.argsort(-gains)[:NEAR]]
        return out

    def slopes(self, candidate: Candidate, x: Array) -> tuple[list[int], Array, Array]:
        """Append the derivatives of the rows by those numbers of a shape that the data determine.

        Returns:
            Indices of the new columns, the current numbers, and the prior standard deviations of their steps. All are
            empty if the shape has no such numbers.
        """
        steps = shape_steps(candidate)
        names = [n for n in CAUSES[candidate.cause].determined if n in candidate.shape]
        if not steps or len(steps) != len(names):
            return [], np.zeros(0), np.zeros(0)
        ends = [[self.columns_of(c) for c in pair] for *pair, _ in steps]
        slopes = [
            [(b - a) @ x / width for a, b in zip(*pair, strict=True)]
            for pair, (_, _, width) in zip(ends, steps, strict=True)
        ]
        numbers = np.array([candidate.shape[n] for n in names])
        size = [max(abs(v), width) * STEP_SHARE for v, (_, _, width) in zip(numbers, steps, strict=True)]
        return (
            self.add([np.stack(each, axis=2) for each in zip(*slopes, strict=True)]),
            numbers,
            np.array(size),
        )

    def _stepped(self, candidate: Candidate, group: Group, posterior: Posterior) -> list[Group]:
        """The cause with its shape numbers moved by one Gauss-Newton step."""
        count = self.cells.count
        index, numbers, size = self.slopes(candidate, self.values_of(group, posterior.mean))
        if not index:
            return []
        prior = np.append(posterior.prior, np.zeros(self.cells.count - len(posterior.prior)))
        prior[index] = np.square(size)
        step = Posterior(self.cells, prior, posterior.variance).mean[index]
        self.cells.truncate(count)
        cause = CAUSES[candidate.cause]
        names = [n for n in cause.determined if n in candidate.shape]
        # Numbers that cannot change sign, such as a time or a mass, take a limited step in their logarithm.
        scale = np.array(
            [not cause.slope_step(n, 0.0) and bool(x) for n, x in zip(names, numbers, strict=True)]
        )
        share = np.divide(step, numbers, out=np.zeros_like(step), where=scale).clip(-STEP_SHARE, STEP_SHARE)
        moved = np.where(scale, numbers * np.exp(share), numbers + step)
        shape = dict(candidate.shape) | dict(zip(names, moved.tolist(), strict=True))
        shape = CAUSES[candidate.cause].around(self.values_of(group, posterior.mean), shape)
        try:
            return [self.group_of(candidate.in_shape(shape), group.log_prior)]
        except (ValueError, ArithmeticError):
            return []

    def forms(self, group: Group, values: Array) -> list[Series]:
        """Forms of a cause's model discrepancy.

        These are its trace times smooth functions of time, place, speed and load, and its trace shifted in time.

        Args:
            group: the cause.
            values: of all columns.
        """
        if group.cause in EXACT or group.event or group.late:
            return []
        x = self.values_of(group, values)
        each = self.columns_of(self.candidates[group.identity])
        return [form for k in np.flatnonzero(x) for form in self._forms([c[..., k] * x[k] for c in each])]

    def _forms(self, traces: Sequence[Array]) -> list[Series]:
        """Discrepancy forms of one trace, rows (n, C) a trial."""
        parts, moving = [], self.bands.moving
        slopes = [np.gradient(r[:m], axis=0) for r, m in zip(traces, moving, strict=True)]
        size, steep = (math.sqrt(sum(float(np.sum(r**2)) for r in rows)) for rows in (traces, slopes))
        for t, trace in enumerate(traces):
            smooth = [math.sqrt(3.0) * np.linspace(-1.0, 1.0, len(trace))]
            for name, q in self.rig.quantities(t).items():
                q = np.log(q + 0.1 * np.sqrt(np.mean(q**2)) + 1e-12) if name == "speed" else q
                smooth.append((q - q.mean()) / (q.std() + 1e-12))
            late = np.zeros_like(trace)
            late[: moving[t]] = slopes[t] * size / max(steep, 1e-300)
            parts.append(np.stack([*(trace * f[:, None] for f in smooth), late], axis=2))
        return [
            {c: [x[:, 3 * c : 3 * c + 3, k] for x in parts] for c in range(len(self.cells.channels))}
            for k in range(parts[0].shape[2])
        ]


@dataclass(frozen=True, eq=False)
class Catalogue:
    """Columns of a healthy team and of all shapes of the causes.

    Attributes:
        rig: the rig whose linearisation gives the columns.
        groups: causes in their first shapes; column indices start at zero.
        labels, tolerance: of every column, as in ``TeamProblem``.
        kinds: column indices by cause.
        columns: of all groups.
        listed: all other shapes.
        apart: for each candidate, columns that describe how its other shapes differ from the first.
        candidates: candidate of every group, by the group's identity.
    """

    rig: TeamRig
    groups: list[Group]
    labels: list[tuple[Candidate, int] | None]
    tolerance: list[float]
    kinds: Mapping[str, list[int]]
    columns: Columns
    listed: Listed
    apart: Mapping[Hashable, Columns]
    candidates: Mapping[Hashable, Candidate]

    @classmethod
    def of(cls, plain: TeamProblem, near: Catalogue | None = None) -> Catalogue:
        """Compute the catalogue of a rig.

        Args:
            plain: the rig's problem, without columns and without latent states.
            near: catalogue of a nearby rig with the same whitening. Its other shapes are reused, because they only
                serve as proposals.
        """
        rig = plain.rig
        groups: list[Group] = []
        labels: list[tuple[Candidate, int] | None] = []
        none = Columns.of(np.zeros((len(plain.cells.channels), len(plain.cells.order), 0)))
        tolerance, kinds, rows = list[float](), dict[str, list[int]](), [none]
        others = [Listed(rig, [], none)]
        apart: dict[Hashable, Columns] = {}
        for candidate in rig.candidates():
            shapes = in_shapes(candidate, CAUSES[candidate.cause].shapes, len(rig.linear))
            count, first = 1 + len(shapes), len(labels)
            if not any(candidate.tolerant):
                others += [] if near else [plain.listing([candidate, *shapes], count)]
                continue
            own = plain.spectra(rig.columns(candidate))
            shown = np.unique(np.concatenate(own.at))
            g = plain.group_of(candidate, -math.log(count), range(first, first + len(shown)))
            least = tuple(g.least[k] for k in shown) if g.least else ()
            groups.append(replace(g, slab=tuple(g.slab[k] for k in shown), least=least))
            labels += [(candidate, int(k)) for k in shown]
            tolerance += [candidate.parameters[k].tolerance for k in shown]
            rows.append(Columns(len(shown), [np.searchsorted(shown, at) for at in own.at], own.X))
            if shapes:
                if near:
                    apart[candidate.key] = near.apart[candidate.key]
                else:
                    others.append(plain.listing(shapes, count))
                    firsts = [span.start for span in others[-1].spans]
                    more = others[-1].columns.dense[..., firsts].astype(float)
                    apart[candidate.key] = _apart(own.dense[..., :1], more)
                rows.append(apart[candidate.key])
                tolerance += [candidate.parameters[0].tolerance] * rows[-1].count
                labels += [None] * rows[-1].count
            kinds.setdefault(candidate.cause, []).extend(range(first, len(labels)))
        every = [g for e in others for g in e.groups]
        listed = near.listed if near else Listed(rig, every, Columns.joined([e.columns for e in others]))
        known = {**near.candidates, **plain.candidates} if near else plain.candidates
        return cls(rig, groups, labels, tolerance, kinds, Columns.joined(rows), listed, apart, known)


def _apart(first: Array, others: Array, most: int = 2) -> Columns:
    """Main directions in which other shapes of a healthy part, (C, n, s), differ from its first shape, (C, n, 1)."""
    apart = others - first
    _, V = np.linalg.eigh(np.einsum("cnk,cnl->kl", apart, apart))
    return Columns.of(apart @ V[:, ::-1][:, :most] / math.sqrt(others.shape[2]))


def team_problem(
    rig: TeamRig, opened: Sequence[Array] | None = None, catalogue: Catalogue | None = None
) -> TeamProblem:
    """Build the linear problem of a rig.

    Args:
        rig: the linearised recordings.
        opened: whitening against the latent states of the chosen causes, shape (n, C, C) a trial.
        catalogue: columns of this rig, or of a nearby one with the same whitening. None computes them.
    """
    linears = list(zip(rig.linear, rig.whitening, strict=True))
    rows = [white(linear.residual) for linear, white in linears]
    moving = [linear.reduction.moving for linear in rig.linear]
    rates = [linear.signals.rate_hz / linear.reduction.step for linear in rig.linear]
    edges = np.append(EDGES_HZ, [np.inf, np.inf])
    bands = RowBands(rates, [len(r) for r in rows], edges, moving=moving)
    plain = TeamProblem(rig, Cells.of(bands, [x.reshape(len(x), -1, 3) for x in rows]))
    if catalogue is None or catalogue.rig is not rig:
        catalogue = Catalogue.of(plain, catalogue)
    out = TeamProblem(rig, Cells(bands, []), opened=opened, catalogue=catalogue)
    out.candidates = dict(catalogue.candidates)
    out.cells = plain.cells
    columns = out.beside(catalogue.columns)
    residual = [x.reshape(len(x), -1, 3) for x in out.rows_of(rows)]
    out.cells = Cells.of(bands, residual)
    there = np.zeros(len(catalogue.labels))  # values count from the design, not from the linearisation point
    for k, label in enumerate(catalogue.labels):
        at = None if label is None else origin_of(label[0], rig.origin)
        there[k] = 0.0 if label is None or at is None else at[label[1]]
    for channel, at, X in zip(out.cells.channels, columns.at, columns.X, strict=True):
        channel.y += X @ there[at]
        channel.squares = np.array([channel.y[a:b] @ channel.y[a:b] for a, b in pairwise(channel.starts)])

    def unknown(columns: Sequence[Array]) -> list[int]:
        columns = out.rows_of(columns)
        size = np.sqrt(sum(np.sum(x**2, axis=(0, 1)) for x in columns))
        out.tolerance += list(np.where(size > 0, UNKNOWN / np.maximum(size, 1e-300), 0.0))
        out.labels += [None] * len(size)
        return out.add(columns)

    out.shared = unknown([white(linear.by_shared) for linear, white in linears])
    for t, (linear, white) in enumerate(linears):
        local = white(np.concatenate([linear.by_bases, linear.by_clocks, linear.by_odometry], axis=2))
        none = (np.zeros((*r.shape, local.shape[2])) for r in rows)
        out.local.append(unknown([local if k == t else x for k, x in enumerate(none)]))
    first = out.cells.count
    out.cells.add_rows(columns)
    out.there = np.append(np.zeros(first), there)
    out.labels += catalogue.labels
    out.tolerance += catalogue.tolerance
    out.groups = [replace(g, columns=tuple(first + k for k in g.columns)) for g in catalogue.groups]
    places = Counter(g.cause for g in catalogue.groups)  # a spread cannot be learnt from a single part
    out.families = [[first + k for k in kind] for cause, kind in catalogue.kinds.items() if places[cause] > 1]
    out.listed = replace(catalogue.listed, columns=out.beside(catalogue.listed.columns))
    return out
