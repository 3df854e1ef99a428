"""Rows of a linear problem by channel and frequency band, with their Gram matrices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, idct

from estimator.arrays import Array

Series = Mapping[int, Sequence[Array]]
"""A column: for each channel one time series (W,) for each trial."""


@dataclass(frozen=True, eq=False)
class Bands:
    """Rows of the problem: cosine coefficients of each trial, assigned to frequency bands.

    Attributes:
        rates_hz: sampling rate of each trial.
        lengths: number of samples of each trial.
        edges_hz: K + 1 increasing edges of K bands.
        fade_s: fade-in and fade-out time of each series [s]; abrupt ends would leak noise from above the bands.
        kept: weight of each sample, shape (W, C) for each trial; empty: all samples count.
    """

    rates_hz: Sequence[float]
    lengths: Sequence[int]
    edges_hz: Array
    fade_s: float = 0.0
    kept: Sequence[Array] = ()

    def share(self, channel: int) -> float:
        """Effective share of a channel's rows if samples are weighted."""
        return float(np.mean(np.concatenate([w[:, channel] for w in self.kept]) ** 2)) if self.kept else 1.0

    def faded(self, x: Array, trial: int) -> Array:
        """Fade a series of a trial in from zero and out to zero."""
        return (x.T * _fade(len(x), max(self.fade_s * self.rates_hz[trial], 0.5))).T

    def of_trial(self, trial: int) -> NDArray[np.intp]:
        """Band of each coefficient that is a row, shape (n,)."""
        frequency = np.arange(self.lengths[trial]) * self.rates_hz[trial] / (2.0 * self.lengths[trial])
        count = int(np.searchsorted(frequency, self.edges_hz[-1]))
        return np.searchsorted(self.edges_hz, frequency[:count], side="right") - 1

    def spectrum(self, series: Sequence[Array], channel: int) -> Array:
        """Orthonormal cosine coefficients of one channel, concatenated over trials, shape (n,)."""
        out = []
        for t, x in enumerate(series):
            own = x * self.kept[t][:, channel] if self.kept else x
            out.append(dct(self.faded(own, t), norm="ortho")[: len(self.of_trial(t))])
        return np.concatenate(out)


@lru_cache(maxsize=64)  # thousands of series are as long as one another
def _fade(count: int, samples: float) -> Array:
    """Weights that rise from zero within a number of samples and fall to zero at the end, shape (count,)."""
    place = np.arange(count) + 0.5
    return np.asarray(np.sin(0.5 * np.pi * np.minimum(np.minimum(place, place[::-1]) / samples, 1.0)) ** 2)


@dataclass(frozen=True, eq=False)
class Columns:
    """Rows of some columns in single precision. Each channel holds only the columns that are not zero in it.

    Attributes:
        count: number of columns k.
        at: for each channel, increasing indices of its columns, shape (k_c,).
        X: for each channel, rows of these columns, sorted by band, shape (n, k_c).
    """

    count: int
    at: Sequence[NDArray[np.intp]]
    X: Sequence[NDArray[np.float32]]

    @classmethod
    def of(cls, X: NDArray[Any]) -> Columns:
        """Drop the zeros of columns, shape (C, n, k)."""
        at = [np.flatnonzero(x.any(axis=0)) for x in X]
        return cls(X.shape[2], at, [x[:, k].astype(np.float32) for x, k in zip(X, at, strict=True)])

    @classmethod
    def joined(cls, each: Sequence[Columns]) -> Columns:
        """Append columns to one another."""
        first = np.cumsum([0, *(e.count for e in each)])
        places = [[k + at for at in e.at] for k, e in zip(first, each, strict=False)]
        at = [np.concatenate(own) for own in zip(*places, strict=True)]
        X = [np.concatenate(own, axis=1) for own in zip(*(e.X for e in each), strict=True)]
        return cls(int(first[-1]), at, X)

    def part(self, own: slice) -> Columns:
        """Some successive columns."""
        ends = [slice(*np.searchsorted(at, [own.start, own.stop])) for at in self.at]
        at = [at[k] - own.start for at, k in zip(self.at, ends, strict=True)]
        return Columns(own.stop - own.start, at, [x[:, k] for x, k in zip(self.X, ends, strict=True)])

    @property
    def dense(self) -> NDArray[Any]:
        """The columns with their zeros, shape (C, n, k)."""
        out = np.zeros((len(self.X), len(self.X[0]), self.count), dtype=np.float32)
        for own, at, x in zip(out, self.at, self.X, strict=True):
            own[:, at] = x
        return out


@dataclass(eq=False)
class Channel:
    """The rows of one channel.

    Attributes:
        y: residual, sorted by band, shape (n,).
        starts: first row of each band, and the end, shape (bands + 1,).
        columns: indices of the columns that are nonzero in this channel, shape (k,).
        X: coefficients of these columns, shape (n, k).
        grams, products: X' X and X' y of each band, shapes (bands, k, k) and (bands, k).
        squares: y' y of each band, shape (bands,).
    """

    y: Array
    starts: NDArray[np.intp]
    columns: NDArray[np.intp]
    X: Array
    grams: Array
    products: Array
    squares: Array


@dataclass(eq=False)
class Cells:
    """A linear problem y = X x + noise with one noise variance for each channel and band.

    Attributes:
        bands: definition of the rows.
        channels: rows of each channel.
        count: number of columns.
        order: permutation that sorts the coefficients of a channel by band.
    """

    bands: Bands
    channels: list[Channel]
    count: int = 0
    order: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    _last: tuple[NDArray[np.intp], Cells] | None = None

    @classmethod
    def of(cls, bands: Bands, residual: Sequence[Array]) -> Cells:
        """Build without columns; ``residual`` has one array (W, C) for each trial."""
        band = np.concatenate([bands.of_trial(t) for t in range(len(residual))])
        order = np.argsort(band, kind="stable")
        number = len(bands.edges_hz) - 1
        starts = np.searchsorted(band[order], np.arange(number + 1))
        none = np.zeros(0, dtype=np.intp)
        channels = []
        for c in range(residual[0].shape[1]):
            y = bands.spectrum([r[:, c] for r in residual], c)[order]
            squares = np.array([y[a:b] @ y[a:b] for a, b in pairwise(starts)])
            X, grams, products = np.zeros((len(y), 0)), np.zeros((number, 0, 0)), np.zeros((number, 0))
            channels.append(Channel(y, starts, none, X, grams, products, squares))
        return cls(bands, channels, 0, order)

    def around(self, residual: Sequence[Array], x: Array) -> Cells:
        """Keep the columns and replace the residual, given as what remains at values x, shape (K,)."""
        channels = []
        for c, old in enumerate(self.channels):
            y = self.bands.spectrum([r[:, c] for r in residual], c)[self.order] + old.X @ x[old.columns]
            parts = list(pairwise(old.starts))
            products = np.array([old.X[a:b].T @ y[a:b] for a, b in parts])
            squares = np.array([y[a:b] @ y[a:b] for a, b in parts])
            channels.append(replace(old, y=y, products=products, squares=squares))
        return replace(self, channels=channels, _last=None)

    @property
    def rows(self) -> Array:
        """Number of rows by channel and band, shape (C, bands); less if samples are weighted."""
        return np.array([np.diff(c.starts) * self.bands.share(i) for i, c in enumerate(self.channels)])

    def add(self, series: Sequence[Series]) -> list[int]:
        """Append columns, and return their indices."""
        first, self._last = self.count, None
        seen: dict[int, list[tuple[int, Array]]] = {}
        for k, one in enumerate(series):
            for c, x in one.items():
                seen.setdefault(c, []).append((first + k, self.bands.spectrum(x, c)[self.order]))
        for c, found in seen.items():
            self.append(self.channels[c], [i for i, _ in found], np.column_stack([x for _, x in found]))
        self.count += len(series)
        return list(range(first, self.count))

    def add_rows(self, columns: Columns) -> list[int]:
        """Append columns, and return their indices."""
        first, self._last = self.count, None
        for channel, at, X in zip(self.channels, columns.at, columns.X, strict=True):
            if len(at):
                self.append(channel, (first + at).tolist(), X.astype(np.float64))
        self.count += columns.count
        return list(range(first, self.count))

    @staticmethod
    def append(channel: Channel, indices: list[int], X: Array) -> None:
        """Append columns to one channel, given by their indices and rows sorted by band, shape (n, k)."""
        old, new = channel.X.shape[1], X.shape[1]
        grams = np.zeros((len(channel.starts) - 1, old + new, old + new))
        products = np.zeros((len(channel.starts) - 1, old + new))
        grams[:, :old, :old], products[:, :old] = channel.grams, channel.products
        for band, (a, b) in enumerate(pairwise(channel.starts)):
            cross = channel.X[a:b].T @ X[a:b]
            grams[band, :old, old:], grams[band, old:, :old] = cross, cross.T
            grams[band, old:, old:] = X[a:b].T @ X[a:b]
            products[band, old:] = X[a:b].T @ channel.y[a:b]
        channel.columns = np.append(channel.columns, indices)
        channel.X, channel.grams, channel.products = np.concatenate([channel.X, X], axis=1), grams, products

    def truncate(self, count: int) -> None:
        """Remove all columns from an index on."""
        self._last = None
        for channel in self.channels:
            keep = int(np.sum(channel.columns < count))
            channel.columns, channel.X = channel.columns[:keep], channel.X[:, :keep]
            channel.grams, channel.products = channel.grams[:, :keep, :keep], channel.products[:, :keep]
        self.count = count

    def only(self, at: NDArray[np.intp]) -> Cells:
        """Restrict the problem to some columns and renumber them, without X; the last result is cached."""
        if self._last is None or not np.array_equal(self._last[0], at):
            place, channels, none = np.full(self.count, -1), [], np.zeros((0, 0))
            place[at] = np.arange(len(at))
            for c in self.channels:
                seen = np.flatnonzero(place[c.columns] >= 0)
                grams, products = c.grams.take(seen, 1).take(seen, 2), c.products[:, seen]
                channels.append(
                    Channel(c.y, c.starts, place[c.columns[seen]], none, grams, products, c.squares)
                )
            self._last = at, Cells(self.bands, channels, len(at))
        return self._last[1]

    def weighted_residual(self, x: Array, variance: Array) -> list[Array]:
        """Time series of W (y - X x), one array (W, C) for each trial; its dot product with a column is the score."""
        spectra = []
        for channel, own in zip(self.channels, variance, strict=True):
            left = channel.y - channel.X @ x[channel.columns]
            rows = np.empty_like(left)
            rows[self.order] = left / np.repeat(own, np.diff(channel.starts))
            spectra.append(rows)
        out, first = [], 0
        for t, length in enumerate(self.bands.lengths):
            n = len(self.bands.of_trial(t))
            wide = np.zeros((length, len(spectra)))
            wide[:n] = np.column_stack([rows[first : first + n] for rows in spectra])
            own = self.bands.faded(np.asarray(idct(wide, axis=0, norm="ortho")), t)
            out.append(own * self.bands.kept[t] if self.bands.kept else own)
            first += n
        return out

    def weighted(self, variance: Array) -> tuple[Array, Array, float]:
        """Compute X' W X (K, K), X' W y (K,) and y' W y for noise variances (C, bands)."""
        G, b, yy = np.zeros((self.count, self.count)), np.zeros(self.count), 0.0
        for channel, own in zip(self.channels, variance, strict=True):
            weight = 1.0 / own
            at = channel.columns
            flat = channel.grams.reshape(len(weight), -1)
            G[at[:, None], at] += np.dot(weight[None], flat).reshape(channel.grams.shape[1:])
            b[at] += weight @ channel.products
            yy += float(weight @ channel.squares)
        return G, b, yy

    def left(self, x: Array, covariance: Array | Sequence[Array]) -> tuple[Array, Array]:
        """Squared residuals at given values, and the squares that their covariance explains, shape (C, bands) each.

        Args:
            x: values, shape (K,).
            covariance: of all values, shape (K, K), or for each channel that of its columns.
        """
        out = np.zeros((2, len(self.channels), len(self.bands.edges_hz) - 1))
        for c, channel in enumerate(self.channels):
            own, at = x[channel.columns], channel.columns
            spread = covariance[np.ix_(at, at)] if isinstance(covariance, np.ndarray) else covariance[c]
            both = np.stack([np.outer(own, own).ravel(), spread.ravel()], axis=1)
            explained = channel.grams.reshape(len(channel.grams), -1) @ both
            out[0, c] = channel.squares - 2.0 * channel.products @ own + explained[:, 0]
            out[1, c] = explained[:, 1]
        return np.maximum(out[0], 0.0), out[1]

    @property
    def owners(self) -> NDArray[np.intp]:
        """Channel of each column that is nonzero in one channel only, else -1, shape (K,)."""
        out = np.full(self.count, -2)
        for c, channel in enumerate(self.channels):
            out[channel.columns] = np.where(out[channel.columns] == -2, c, -1)
        return np.maximum(out, -1)
