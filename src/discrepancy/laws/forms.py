"""Is it a law of its own, or what the law of a listed cause at the same place leaves?"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.offer.propose import Proposed
from discrepancy.inference.probability import probability
from discrepancy.inference.remainder import form_share_of, share_left
from discrepancy.law_doubt import LawDoubt
from discrepancy.laws.bench import Bench
from discrepancy.laws.candidate import LawCandidate
from discrepancy.laws.said.numbers import formula_of
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Key


@dataclass(frozen=True)
class Refinement:
    """A law that is no more than listed causes in another form.

    Attributes:
        law: itself.
        causes: whose laws it may refine, the one that is expected to leave most first.
        share: its gain over the traces of those causes, in amplitude; None where its formula is that of the cause.
        expected: what their laws are expected to leave of these, in amplitude.
    """

    law: LawCandidate
    causes: tuple[Candidate, ...]
    share: float | None = None
    expected: float = 0.0

    @property
    def sentence(self) -> str:
        """In words, for the notes."""
        law, first = self.law.label, self.causes[0].label
        if self.share is None:
            return (
                f"{first[:1].upper()}{first[1:]} is there, but in another form than its law: {formula_of(self.law)}, "
                f"as {law}, would fit better. That is no cause of its own."
            )
        return (
            f"{law[:1].upper()}{law[1:]}: a formula fits what is left, but adds {100.0 * self.share:.2g} % to what "
            f"{first} does{' and others do' if len(self.causes) > 1 else ''}; real ones may differ by "
            f"{100.0 * self.expected:.2g} % from the catalogue's law, so it is a form of that and no cause of its own."
        )


def form_of_named(
    laws: Iterable[LawCandidate], named: Sequence[Candidate], bench: Bench
) -> Refinement | None:
    """The first of some laws that the rows cannot tell apart which is a named cause in another form."""
    for law in laws:
        for cause in named:
            if bench.is_form(law, cause):
                return Refinement(law, (cause,))
    return None


def refinement(
    hypothesis: Hypothesis, index: int, bench: Bench, before: Collection[Key] = ()
) -> Refinement | None:
    """What a law refines, where it explains no more than the laws of listed causes beside it are expected to leave.

    Counted are causes that are named, each with the share that the bench has for it, and those within their kind's
    scatter whose form is known to be another (``Candidate.form_share``), where what they leave may show at the law's
    place.

    Args:
        hypothesis: with the law.
        index: which candidate it is.
        bench: of the rig.
        before: causes that are named without the law. What is left of them beside it may be a kind's scatter.
    """
    problem, coefficients = hypothesis.problem, hypothesis.fit.coefficients
    law = problem.candidates[index]
    assert isinstance(law, LawCandidate)
    gram, parts = problem.grams.sum(axis=0), []
    for other, (candidate, span) in enumerate(zip(problem.candidates, problem.spans, strict=True)):
        if isinstance(candidate, LawCandidate):
            continue
        named = candidate.key in before or (other in hypothesis.free and is_likely(hypothesis, other))
        if not bench.beside(law.at, candidate, named=named):
            continue
        values = coefficients[span]
        share = max(form_share_of(candidate, values), bench.left if named else 0.0)
        trace = float(values @ gram[span, span] @ values)
        if share > 0.0 and trace > 0.0:
            parts.append((share**2 * trace, trace, candidate))
    expected = sum(form for form, _, _ in parts)
    gain = gain_of(hypothesis, index)
    if not parts or gain > expected:
        return None
    parts.sort(key=lambda part: -part[0])
    # Those that matter: what is expected of the others is little beside the first.
    parts = [part for part in parts if part[0] > 0.5 * parts[0][0]]
    total = sum(trace for _, trace, _ in parts)
    return Refinement(
        law, tuple(candidate for _, _, candidate in parts), float(np.sqrt(max(gain, 0.0) / total)),
        float(np.sqrt(sum(form for form, _, _ in parts) / total)),
    )  # fmt: skip


def is_likely(hypothesis: Hypothesis, index: int) -> bool:
    """Whether a cause is likelier than something unlisted that looks like it: if not, its form excuses nothing."""
    return probability([], share_left(hypothesis, index), LawDoubt()) >= rules.LEAST_PROBABILITY


def likely_causes(hypothesis: Hypothesis) -> tuple[Candidate, ...]:
    """Those of the catalogue, of a hypothesis."""
    pairs = zip(hypothesis.free, hypothesis.causes, strict=True)
    return tuple(c for i, c in pairs if not isinstance(c, LawCandidate) and is_likely(hypothesis, i))


def gain_of(hypothesis: Hypothesis, index: int) -> float:
    """Fall of chi-square by one of the causes, beside all others, at the noise of the hypothesis."""
    problem = hypothesis.problem
    others = [i for i in hypothesis.free if i != index]
    nothing = np.zeros(len(problem.candidates[index].parameters))
    without = Fit.of(problem, others, fixed=(index, nothing))
    return sum(without.held_out(t) - hypothesis.fit.held_out(t) for t in problem.trials)


@dataclass(frozen=True)
class Forms:
    """Tells laws that only refine those of listed causes, and keeps them.

    Attributes:
        bench: of the rig.
        named: causes that are named without the laws.
        found: such laws.
    """

    bench: Bench
    named: tuple[Candidate, ...]
    found: list[Refinement]

    def refined_by(self, hypothesis: Hypothesis, index: int) -> bool:
        """Whether a law of a hypothesis is such a one."""
        one = refinement(hypothesis, index, self.bench, {cause.key for cause in self.named})
        if one is not None:
            self.found.append(one)
        return one is not None

    def among(self, proposed: Proposed) -> bool:
        """Whether the likeliest law, or one that the rows cannot tell from it, is a named cause in another form."""
        top = proposed.offers[0].score
        alike = [one.candidate for one in proposed.offers if top - one.score < rules.AMBIGUOUS_NATS]
        one = form_of_named((c for c in alike if isinstance(c, LawCandidate)), self.named, self.bench)
        if one is not None:
            self.found.append(one)
        return one is not None
