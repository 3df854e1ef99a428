"""Fit a sparse formula to a free curve of one signal."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from discrepancy.evidence.settings import SETTINGS
from discrepancy.numbers import number
from estimator.arrays import Array

KNOTS, TRIED = 8, 40
"""Number of knots of a curve without a formula; number of grid values for a parameter inside a term."""
STEP_S = 0.05
"""Rise time of a step [s]."""
SIGN_SHARES = (0.03, 0.06, 0.12, 0.25, 0.5)
"""Widths over which a sign term fades, relative to the signal's standard deviation; a curve can resolve the first."""
Numbers = Sequence[float]


@dataclass(frozen=True)
class Shape:
    """A term of a formula: amplitudes times functions of the signal.

    Attributes:
        name: identifier in JSON and in ``mocobot_sim.laws.functions``, which lacks ``spline`` and ``step``.
        of: maps the signal (Q,) and the inner parameters to columns (Q, k), one for each amplitude.
        text: template with amplitude ``a``, signal ``x``, inner parameter ``n`` and phase ``p``.
        power: power of the signal, for the unit of the amplitude.
        width: number of amplitudes.
        inside: names of the inner parameters.
        tried: returns grid values of the inner parameters for a signal.
        fitted: whether the inner parameter is refined by a fit.
    """

    name: str
    of: Callable[[Array, Numbers], Array]
    text: str
    power: int = 0
    width: int = 1
    inside: tuple[str, ...] = ()
    tried: Callable[[Array], Sequence[Numbers]] = lambda x: [()]
    fitted: bool = False


def _plain(name: str, of: Callable[[Array], Array], text: str, power: int) -> Shape:
    return Shape(name, lambda x, n: of(x)[:, None], text, power)


def _knee(
    name: str, of: Callable[[Array, float], Array], text: str, at: Callable[[Array], Sequence[float]]
) -> Shape:
    """A term with a knee; ``at`` returns grid values for its position."""
    return Shape(
        name, lambda x, n: of(x, n[0])[:, None], text, 1, 1, ("knee",), lambda x: [(k,) for k in at(x)], True
    )


def _wave(x: Array, n: Numbers) -> Array:
    return np.stack([np.sin(n[0] * x), np.cos(n[0] * x)], axis=1)


def _hats(x: Array, n: Numbers) -> Array:
    knots = n[0] + n[1] * np.arange(KNOTS)
    return np.maximum(1.0 - np.abs(np.clip(x, knots[0], knots[-1])[:, None] - knots) / n[1], 0.0)


def _within(x: Array) -> list[float]:
    """Grid of values between the 3 % and 97 % quantiles of a signal."""
    return [float(q) for q in np.quantile(x, np.linspace(0.03, 0.97, TRIED))]


def _beyond(x: Array, knee: float) -> Array:
    return np.asarray(np.copysign(np.maximum(np.abs(x) - knee, 0.0), x))


ABOVE = _knee("above", lambda x, k: np.maximum(x - k, 0.0), "{a} max({x} - {n}, 0)", _within)
BELOW = _knee("below", lambda x, k: np.minimum(x - k, 0.0), "{a} min({x} - {n}, 0)", _within)
PLAIN = (
    _plain("linear", lambda x: x, "{a} {x}", 1),
    _plain("square", np.square, "{a} {x}^2", 2),
    _plain("cube", lambda x: x**3, "{a} {x}^3", 3),
)
SIGNED = (
    Shape("sign", lambda x, n: np.clip(x / n[0], -1.0, 1.0)[:, None], "{a} sign({x})", 0, 1, ("slow",),
          lambda x: [(share * float(np.std(x)),) for share in SIGN_SHARES]),
    replace(ABOVE, text="{a} max({x}, 0)", tried=lambda x: [(0.0,)], fitted=False),
    replace(BELOW, text="{a} min({x}, 0)", tried=lambda x: [(0.0,)], fitted=False),
    _plain("absolute", np.abs, "{a} |{x}|", 1),
    _plain("signed_square", lambda x: x * np.abs(x), "{a} {x} |{x}|", 2),
    _knee("beyond", _beyond, "{a} ({x} beyond +-{n})", lambda x: _within(np.abs(x))),
)  # fmt: skip
"""Terms for a signal with both signs."""
OF_TIME = (
    Shape("warming", lambda x, n: -np.expm1(-x / n[0])[:, None], "{a} (1 - exp(-{x} / {n} s))", 0, 1, ("time_s",),
          lambda x: [(float(t),) for t in np.max(x) * np.geomspace(0.05, 2.0, TRIED)], fitted=True),
    Shape("step", lambda x, n: np.clip(1.0 + (x - n[0]) / STEP_S, 0.0, 1.0)[:, None], "{a} from {n} s on", 0, 1,
          ("at_s",), lambda x: [(t,) for t in _within(x)]),
)  # fmt: skip
SINE = Shape("sine", _wave, "{a} sin({n} {x} {p})", 0, 2, ("times",), fitted=True)
TURNING = replace(SINE, fitted=False)
"""A sine with a whole number of periods in a turn."""
HUM = Shape(
    "hum", lambda x, n: _wave(2.0 * np.pi * x, n), "{a} sin(2 pi {n} Hz {x} {p})", 0, 2, ("frequency_hz",)
)
SPLINE = Shape("spline", _hats, "a curve of {x}", 0, KNOTS, ("low", "step"))


MISSING = 0.2
"""Largest share of a formula's variance outside the span of the basis. Chosen: beyond it, other terms would appear."""
BEGUN, SAMPLES = 12, 1000
"""Number of best single terms that are combined in pairs; number of samples for comparisons."""
Kind = Literal["angle", "way", "time", "other"]
Piece = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Curve:
    """A free function of a signal, fitted to data.

    Attributes:
        x: signal at the samples, shape (Q,).
        basis: basis functions at the samples, shape (Q, K); a constant, if present, is the first.
        mean, covariance: of the amplitudes, shapes (K,) and (K, K).
        prior: prior variances of the amplitudes, shape (K,).
        kind: type of signal. A function of an ``angle`` [rad] is periodic with a turn. A function of a ``way`` [m] or
            ``time`` [s] may be periodic. Others are not.
    """

    x: Array
    basis: Array
    mean: Array
    covariance: Array
    prior: Array
    kind: Kind = "other"

    @cached_property
    def constant(self) -> bool:
        """Whether the basis contains a constant."""
        return bool(np.ptp(self.basis[:, 0]) == 0.0)

    @cached_property
    def told(self) -> tuple[Array, Array, float]:
        """Precision (K, K) and score (K,) of the amplitudes from data alone, and the curve's log-likelihood gain."""
        root = np.sqrt(self.prior)
        inverse = np.linalg.inv(self.covariance / np.outer(root, root))
        size, turn = np.linalg.eigh(inverse - np.eye(len(root)))
        seen = size > 1.0  # keep directions in which the data outweigh the prior
        turn = turn[:, seen] / root[:, None]
        precision = (turn * size[seen]) @ turn.T
        score = turn @ (turn.T @ (root**2 * (np.linalg.inv(self.covariance) @ self.mean)))
        return precision, score, 0.5 * float(score @ np.linalg.pinv(precision, hermitian=True) @ score)

    @cached_property
    def project(self) -> Array:
        """Least-squares projection of a series onto the basis, shape (K, Q)."""
        if self.constant:
            return np.asarray(np.linalg.pinv(self.basis), dtype=np.float64)
        rows = np.linalg.pinv(np.column_stack([np.ones(len(self.x)), self.basis]))[1:]
        return np.asarray(rows, dtype=np.float64)

    @property
    def thinned(self) -> Curve:
        """The curve at about ``SAMPLES`` of its samples, with the same distribution."""
        few = np.argsort(self.x, kind="stable")[:: max(len(self.x) // SAMPLES, 1)]
        return replace(self, x=self.x[few], basis=self.basis[few])

    def rows(self, x: Array) -> Array:
        """The basis at given values of the signal, shape (Q, K)."""
        order = np.argsort(self.x)
        return np.stack([np.interp(x, self.x[order], b[order]) for b in self.basis.T], axis=1)

    def at(self, x: Array) -> tuple[Array, Array]:
        """The curve and its standard error at given values of the signal, shape (Q,) each."""
        rows = self.rows(x)
        return rows @ self.mean, np.sqrt(
            np.maximum(np.einsum("qk,kl,ql->q", rows, self.covariance, rows), 0.0)
        )


@dataclass(frozen=True, eq=False)
class Formula:
    """A sum of terms with fitted amplitudes.

    Attributes:
        terms: shapes with their inner parameters.
        values: amplitudes of all terms, then the constant if present, then the fitted inner parameters.
        covariance: covariance of ``values``.
        constant: whether there is a constant.
        loss: log-likelihood of the free curve minus that of the formula [nats].
        missing: share of the formula's variance outside the span of the curve's basis.
    """

    terms: tuple[tuple[Shape, Numbers], ...]
    values: Array
    covariance: Array
    constant: bool
    loss: float = 0.0
    missing: float = 0.0

    @property
    def function(self) -> str:
        """Names of the terms, joined by plus signs."""
        return " + ".join(shape.name for shape, _ in self.terms) or "constant"

    def at(self, x: Array) -> Array:
        """The formula at given values of the signal, shape (Q,)."""
        columns = _columns(self.terms, x, self.constant)
        return columns @ self.values[: columns.shape[1]]

    def through(self, x: Array, basis: Array, mean: Array) -> Formula:
        """Fit the amplitudes of the same terms to another curve.

        Args:
            x: signal, shape (Q,).
            basis, mean: basis functions (Q, K) and their amplitudes (K,). Only the part of the formula in their span is
                fitted.
        """
        G = _columns(self.terms, x, self.constant)
        if not self.constant:
            G, basis = G - G.mean(axis=0), basis - basis.mean(axis=0)
        held = basis @ (np.linalg.pinv(basis) @ G)
        values = np.linalg.lstsq(held, basis @ mean, rcond=None)[0]
        return replace(self, values=np.append(values, self.values[len(values) :]))

    @property
    def _each(self) -> Iterator[tuple[str, Shape, Numbers, slice, Sequence[int]]]:
        """For each term: name suffix, shape, inner parameters, amplitude slice, indices of its fitted parameters."""
        k, inside = 0, sum(shape.width for shape, _ in self.terms) + self.constant
        for n, (shape, numbers) in enumerate(self.terms):
            fitted = list(range(inside, inside + len(numbers))) if inside < len(self.values) else []
            yield f"_{n + 1}" if n else "", shape, numbers, slice(k, k + shape.width), fitted
            k, inside = k + shape.width, inside + len(fitted)

    @property
    def parameters(self) -> dict[str, tuple[float, float | None]]:
        """Amplitudes, phases, offset and inner parameters with standard errors; None for those chosen from a grid."""
        out: dict[str, tuple[float, float | None]] = {}
        se = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        for end, shape, numbers, at, fitted in self._each:
            a, C = self.values[at], self.covariance[at, at]
            if len(a) == 2:
                size = max(float(np.hypot(*a)), 1e-300)
                along, across = a / size, np.array([-a[1], a[0]]) / size
                out[f"amplitude{end}"] = size, float(np.sqrt(along @ C @ along))
                out[f"phase_rad{end}"] = (
                    float(np.arctan2(a[1], a[0])),
                    float(np.sqrt(across @ C @ across)) / size,
                )
            elif shape is SPLINE:
                out |= {
                    f"at_knot_{k + 1}": (float(x), float(e))
                    for k, (x, e) in enumerate(zip(a, se, strict=False))
                }
            else:
                out[f"amplitude{end}"] = float(a[0]), float(np.sqrt(C[0, 0]))
            for name, x, k in zip(shape.inside, numbers, fitted or [None] * len(numbers), strict=True):
                out[f"{name}{end}"] = float(x), None if k is None else float(se[k])
        if self.constant:
            k = sum(shape.width for shape, _ in self.terms)
            out["offset" if self.terms else "amplitude"] = float(self.values[k]), float(se[k])
        return out

    @property
    def numbers(self) -> dict[str, float]:
        """Inner parameters of the terms by name."""
        each = (
            (f"{n}{end}", x)
            for end, shape, numbers, _, _ in self._each
            for n, x in zip(shape.inside, numbers, strict=True)
        )
        return dict(each)

    def text(self, symbol: str, *, unit: Callable[[int], str] | None = None, scale: float = 1.0) -> str:
        """The formula as text, with symbols or with numbers.

        Args:
            symbol: symbol of the signal.
            unit: returns the unit of an amplitude for a power of the signal; None: use symbols for amplitudes.
            scale: displayed units per own unit.
        """
        known, out = self.parameters, []

        def shown(name: str, power: int) -> str:
            return number(*known[name], unit(power), scale) if unit else name.replace("amplitude", "a")

        for end, shape, numbers, _, _ in self._each:
            a = "" if shape is SPLINE else shown(f"amplitude{end}", shape.power)
            angle = known.get(f"phase_rad{end}", (0.0, None))[0]
            phase = f"{'+' if angle >= 0 else '-'} {abs(angle):.2f}" if unit else f"+ phase{end}"
            n = f"{numbers[0]:.4g}" if numbers else ""
            out.append(shape.text.format(a=a, x=symbol, n=n, p=phase))
        if self.constant:
            out.append(shown("offset" if out else "amplitude", 0))
        return " + ".join(out)

    def pieces(self) -> Iterator[Piece]:
        """Split the formula into functions with one amplitude each, for ``mocobot_sim.functions``."""
        for _, shape, numbers, at, _ in self._each:
            a, n = self.values[at], [*numbers, 0.0]
            if len(a) == 2:
                yield _piece(shape.name, np.hypot(*a), n[0], 0.0, np.arctan2(a[1], a[0]))
            elif shape is SPLINE:
                names = ["first_hat", *["hat"] * (KNOTS - 2), "last_hat"]
                yield from (
                    _piece(h, x, n[0] + k * n[1], n[1]) for k, (h, x) in enumerate(zip(names, a, strict=True))
                )
            elif shape.name == "step":
                yield _piece("last_hat", a[0], n[0], STEP_S)
            else:
                yield _piece(shape.name, a[0], n[0])
        if self.constant:
            yield _piece("constant", self.values[sum(shape.width for shape, _ in self.terms)])


def formula_of(curve: Curve, hum_hz: float | None = None) -> Formula:
    """Find the sparsest formula that matches a curve; if there is none, return the curve's values at knots.

    A formula matches if its loss is below the larger of two limits. The first is the cost of the curve's additional
    amplitudes, each half the logarithm of the number of samples. The second is a share of the curve's log-likelihood
    gain: the square of ``form_share`` plus the share of the formula outside the span of the basis.

    Args:
        curve: the fitted curve.
        hum_hz: frequency [Hz] if the basis is a sine and a cosine of time; None: any other basis.
    """
    if hum_hz is not None:
        return Formula(((HUM, (hum_hz,)),), curve.mean, curve.covariance, constant=False)
    cost, whole, curve = 0.5 * math.log(len(curve.x)), curve, curve.thinned
    fits: list[Formula] = [_fitted(curve, ())] if curve.constant else []
    singles = [_fitted(curve, (term,)) for term in _terms(curve)]
    fits += singles
    found = _best(curve, fits, cost)
    if found is None:
        begun = sorted(singles, key=lambda f: f.loss)[:BEGUN]
        pairs = [
            (a.terms[0], b.terms[0]) for a in begun for b in singles if a.terms[0][0] is not b.terms[0][0]
        ]
        found = _best(curve, [_fitted(curve, pair) for pair in pairs], cost)
    return found or _knots(whole)


def _best(curve: Curve, fits: Sequence[Formula], cost: float) -> Formula | None:
    """The best matching formula with refined inner parameters; among nearly equal ones, the first in ``fits``."""
    sizes = [len(f.values) + sum(shape.fitted for shape, _ in f.terms) for f in fits]
    free, seen = curve.told[2], int(np.linalg.matrix_rank(curve.told[0], hermitian=True))
    good = [
        (-f.loss - cost * size, f)
        for f, size in zip(fits, sizes, strict=True)
        if f.missing < MISSING
        and f.loss <= max(cost * (seen - size), (SETTINGS.form_share**2 + f.missing) * free)
    ]
    most = max((worth for worth, _ in good), default=0.0)
    return next((_settled(curve, f) for worth, f in good if worth > most - 1.0), None)


def _terms(curve: Curve) -> Iterator[tuple[Shape, Numbers]]:
    """All terms at all grid values of their inner parameters."""
    signed = np.min(curve.x) < 0.0 < np.max(curve.x)
    shapes = [*PLAIN, *(OF_TIME if curve.kind == "time" else SIGNED if signed else ()), ABOVE, BELOW]
    yield from ((shape, numbers) for shape in shapes for numbers in shape.tried(curve.x))
    least = math.pi / max(float(np.ptp(curve.x)), 1e-300)  # half a period
    most = least * curve.basis.shape[1]
    if curve.kind == "angle":
        yield from ((TURNING, (float(w),)) for w in np.arange(1.0, most + 1.0))
    elif curve.kind != "other":
        yield from ((SINE, (float(w),)) for w in np.linspace(least, most, TRIED))


def _columns(terms: Sequence[tuple[Shape, Numbers]], x: Array, constant: bool) -> Array:
    each = [shape.of(x, numbers) for shape, numbers in terms]
    return np.concatenate([*each, *([np.ones((len(x), 1))] if constant else [])], axis=1)


def _fitted(curve: Curve, terms: Sequence[tuple[Shape, Numbers]], more: Array | None = None) -> Formula:
    """Fit the amplitudes of terms to the curve; ``more``: derivative columns by inner parameters, shape (Q, m)."""
    G = _columns(terms, curve.x, curve.constant)
    G = G if more is None else np.column_stack([G, more])
    P, (precision, score, free) = curve.project @ G, curve.told
    scale = 1.0 / np.maximum(np.linalg.norm(P, axis=0), 1e-300)
    P = P * scale
    covariance = np.linalg.pinv(P.T @ precision @ P, rcond=1e-9, hermitian=True)
    a = covariance @ (P.T @ score)
    series, held = G @ (scale * a), curve.basis @ (P @ a)
    missing = float(np.var(series - held) / np.var(series)) if np.ptp(series) else 0.0
    loss = max(free - 0.5 * float(a @ (P.T @ score)), 0.0)
    return Formula(
        tuple(terms), scale * a, covariance * np.outer(scale, scale), curve.constant, loss, missing
    )


def _settled(curve: Curve, found: Formula, rounds: int = 8) -> Formula:
    """Refine the inner parameters by Gauss-Newton steps while the loss decreases."""
    free = [k for k, (shape, _) in enumerate(found.terms) if shape.fitted]
    for _ in range(rounds if free else 0):
        slopes = [_slope(curve, found, k) for k in free]
        both = _fitted(curve, found.terms, np.stack(slopes, axis=1))
        steps = dict(zip(free, both.values[-len(free) :], strict=True))
        terms = [
            (s, (n[0] + float(steps.get(k, 0.0)), *n[1:]) if n else n) for k, (s, n) in enumerate(found.terms)
        ]
        moved = _fitted(curve, terms)
        if moved.loss > found.loss - 1e-3:
            values = np.append(found.values, [found.terms[k][1][0] for k in free])
            return replace(found, values=values, covariance=both.covariance)
        found = moved
    return found


def _slope(curve: Curve, found: Formula, k: int) -> Array:
    """Derivative of the formula by the inner parameter of its k-th term, shape (Q,)."""
    (shape, numbers), step = (
        found.terms[k],
        1e-4 * (abs(found.terms[k][1][0]) + 1e-3 * float(np.std(curve.x))),
    )
    ends = [shape.of(curve.x, (numbers[0] + sign * step,)) for sign in (-0.5, 0.5)]
    first = sum(s.width for s, _ in found.terms[:k])
    return np.asarray((ends[1] - ends[0]) @ found.values[first : first + shape.width] / step)


def _knots(curve: Curve) -> Formula:
    """The curve as values at equidistant knots."""
    low, high = np.quantile(curve.x, [0.01, 0.99])
    step = float(high - low) / (KNOTS - 1)
    rows = curve.rows(low + step * np.arange(KNOTS))
    return Formula(
        ((SPLINE, (float(low), step)),), rows @ curve.mean, rows @ curve.covariance @ rows.T, constant=False
    )


def _piece(function: str, amplitude: float, n: float = 0.0, second: float = 0.0, phase: float = 0.0) -> Piece:
    return {"function": function, "amplitude": float(amplitude), "number": float(n), "second": float(second),
            "phase_rad": float(phase)}  # fmt: skip
