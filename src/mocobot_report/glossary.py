"""What the page's words of the trade mean: each is linked from its first place in every section."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from discrepancy.evidence.settings import SETTINGS
from mocobot_report.blocks.html import Node, el

LEFT_ALONE = {
    "a", "button", "code", "h1", "h2", "h3", "h4", "label", "legend", "script", "section", "style", "svg", "summary",
}  # fmt: skip
"""Elements whose text gets no links; a section has its own."""


@dataclass(frozen=True)
class Term:
    """One entry.

    Attributes:
        name: as the glossary lists it.
        pattern: how texts write it, a regular expression.
        meaning: in one or two sentences.
    """

    name: str
    pattern: str
    meaning: str

    @property
    def identity(self) -> str:
        """Id of its entry."""
        return "term-" + re.sub(r"[^a-z]+", "-", self.name.lower()).strip("-")


TERMS = (
    Term("balance and kinematic channels", r"(?:balance|kinematic) channels",
         "Balance: forces and moments of all robots minus what the payload's motion needs. Kinematic: where each robot "
         "has its grasp minus where the others have it."),
    Term("chi²/n, misfit", r"chi²/n|[Cc]hi-square|[Mm]isfit",
         "Differences between recording and model, each divided by what noise alone would make of it, squared; chi² is "
         f"their sum, and chi²/n their mean. 1 is noise alone; up to {SETTINGS.clean_chi2:g} counts as clean."),
    Term("clean data, clean noise", r"[Cc]lean (?:data|noise)|× clean",
         "What these sensors would record if nothing were wrong: their noise and rounding alone."),
    Term("closed loop, response to the commands",
         r"[Cc]losed loop|[Rr]esponse to the (?:recorded )?commands|recorded commands",
         "The recorded commands are given to the simulated robots, controllers included; what these do is compared "
         "with what was recorded."),
    Term("condition", r"\bcondition\b",
         "Strongest over weakest direction of what a step solves for; large numbers mean that one direction is known "
         "much worse than another."),
    Term("Coulomb and viscous friction", r"\b[Cc]oulomb\b|\bviscous\b",
         "Coulomb friction has one size while something slides; viscous friction grows with the speed."),
    Term("evidence", r"\b[Ee]vidence\b",
         "By how much likelier the recordings are if something is there than if it is not, all sizes that it may have "
         "taken together; in nats."),
    Term("excess error", r"[Ee]xcess error|error beyond noise",
         "The part of an error that noise does not explain: the root of chi²/n − 1."),
    Term("excitation", r"[Ee]xcitation|signal over noise",
         "How strongly the motion shows a number that is to be estimated, against the noise."),
    Term("fold", r"\bfolds?\b",
         "One trial left out and foretold by the others: better where it is likelier with the cause than without."),
    Term("frame {1}, grasp frame", r"\{1\}|[Gg]rasp frames?|frame \{[ij]\}",
         "Axes at the wrist of a robot, fixed to the payload: {1} is that of robot 1, in which the payload's numbers "
         "are given; {i} is that of robot i. p_12 is the place of frame {2} in frame {1}, R_12 its rotation."),
    Term("held out", r"[Hh]eld[- ]out|left out of the fit|not used for the fit",
         "Tried on trials that it was not fitted to. What only imitates one trial fails there."),
    Term("in sample", r"\bin sample\b", "Measured on the same trials that it was fitted to."),
    Term("miscalibrated", r"\b[Mm]iscalibrated\b",
         "All places of a kind, such as all encoder zeros, are off by more than the tolerance; no single one stands "
         "out. The robots need a calibration, not a repair."),
    Term("nat", r"\bnats?\b",
         "A factor of e = 2.7 in likelihood: 5 nats are a factor of 150, 20 nats of 500 million."),
    Term("phi, theta, tau", r"\b(?:phi|theta|tau)\b",
         "Angles of the driven joints, angles of the gimbal, torques of the springs between motor and link."),
    Term("pooled", r"\bpooled\b", "From all recordings together."),
    Term("principal moment, principal axes", r"[Pp]rincipal (?:moments?|axes)",
         "The moments of inertia about the three axes through the centre of mass about which a body turns without "
         "wobbling, smallest first."),
    Term("prior", r"\b[Pp]riors?\b|as assumed beforehand",
         "How far robots may be off their design as far as is known before any recording: standard deviations."),
    Term("probability of a cause", r"\b[Pp]robability\b",
         "That this cause is at this place, and not a rival, nothing at all, or something that is not in the catalogue "
         "and looks like it. It rests on the recordings and on how likely each was beforehand. A cause is named where "
         f"something is there with more than {100 * SETTINGS.named:g} %."),
    Term("rank", r"\brank\b", "How many independent directions the data determine."),
    Term("residual", r"\b[Rr]esiduals?\b", "What is left when the model is taken from what was recorded."),
    Term("rms", r"\b[Rr]ms\b", "Root mean square, the usual size of something that varies about zero."),
    Term("rod error, weld error", r"(?:[Rr]od|[Ww]eld|[Gg]rasp) error|weld angle",
         "How far the simulation's closed chains opened: rods at their joints, grasps at the payload. Small ones mean "
         "that the simulated physics held."),
    Term("rotation vector", r"[Rr]otation vector", "Axis of a rotation times its angle."),
    Term("spread of a kind", r"\b[Ss]pread\b|\bscatters?\b",
         "Standard deviation, over all its places, of one kind of inaccuracy such as the encoder zeros; learnt from "
         "the recordings, at least the tolerance. What is off by no more is not named."),
    Term("standard error", r"[Ss]tandard errors?",
         "How far a number would typically scatter if the experiment were repeated; two of three results lie within "
         "it. It comes from noise alone, not from wrong calibration."),
    Term("tolerance", r"\b[Tt]olerances?\b",
         "How far a healthy robot is typically from its drawing, as assumed before any recording. Being slightly off "
         "within it is normal and never named."),
    Term("whitened", r"\b[Ww]hitened\b",
         "Divided by the noise and freed of what noise repeats from sample to sample, so that every number of clean "
         "data is independent and has size 1."),
)  # fmt: skip


_ANY = re.compile("|".join(f"(?P<t{k}>{term.pattern})" for k, term in enumerate(TERMS)))


def link_terms(parts: Sequence[Node]) -> list[Term]:
    """Link terms at their first place in every section of a page, and return those that were met."""
    met: set[Term] = set()
    for scope in [section for part in parts for section in part.iter("section")]:
        done: set[Term] = set()
        _link(scope, done)
        met |= done
    return sorted(met, key=lambda term: term.name.lower())


def glossary(terms: Sequence[Term]) -> Node:
    """Terms and their meanings."""
    entries = [(el("dt", term.name, id=term.identity), el("dd", term.meaning)) for term in terms]
    return el("dl", entries, class_="list")


def _link(node: Node, done: set[Term]) -> None:
    """In the order of reading; sections inside have links of their own."""
    children = list(node)
    node.text, links = _links(node.text, done)
    for k, link in enumerate(links):
        node.insert(k, link)
    for child in children:
        if child.tag not in LEFT_ALONE:
            _link(child, done)
        child.tail, links = _links(child.tail, done)
        at = list(node).index(child) + 1
        for k, link in enumerate(links):
            node.insert(at + k, link)


def _links(text: str | None, done: set[Term]) -> tuple[str | None, list[Node]]:
    """A text up to its first term, and links, each with the text that follows it."""
    if not text:
        return text, []
    first, links, end = text, [], 0
    for match in _ANY.finditer(text):
        term = TERMS[int(str(match.lastgroup)[1:])]
        if term in done:
            continue
        done.add(term)
        between = text[end : match.start()]
        if links:
            links[-1].tail = between
        else:
            first = between
        links.append(el("a", match[0], href=f"#{term.identity}", title=term.meaning, class_="term"))
        end = match.end()
    if links:
        links[-1].tail = text[end:]
    return first, links
