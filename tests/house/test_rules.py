"""Numbers that decide a verdict stand in one folder."""

from __future__ import annotations

import ast

import pytest

from discrepancy import rules
from source_tree import SRC, module_files

RULES = {"inference": 40, "team": 30, "axis": 40, "serial": 60, "laws": 20, "rollouts": 8}
"""Files of ``discrepancy.rules``, and how many statements each has at least."""
FREE = {
    "discrepancy.emps.recording.axis_log": {"FIRST_GUESS_KG", "LIMIT_V"},  # the nominal axis
    "discrepancy.emps.recording.whole": {"HEADER_BYTES", "TAG_BYTES"},  # of MATLAB's format
    "discrepancy.result.remains": {"FARTHEST"},  # of a text
    "discrepancy.result.evidence_list": {"CLOSELY", "MOST"},  # of a picture
    "discrepancy.result.json": {"MOST_PLACES"},
    "discrepancy.result.read": {"VERSION"},
    "discrepancy.result.pictures.residual_statistics": {"RUNNING_S", "BINS", "SEGMENT_S", "LEAST_ROWS"},
    "discrepancy.result.sensitivity": {"FINER", "LEARNT"},  # a grid
    "discrepancy.result.text": {"NEAREST", "SAID", "WIDTH"},
    "discrepancy.result.text_rollouts": {"WIDTH"},
    "discrepancy.result.traces_file": {"VERSION"},
    "discrepancy.team.linear.by_unknowns": {"STEP"},  # of a difference
    "discrepancy.team.linear.reduction": {"TOGETHER"},  # speed alone
}
"""Formats, layouts and sizes of pictures, by module."""


def constants(source: str) -> dict[str, ast.expr]:
    """Upper-case names that a module assigns at its top level, and their values."""
    out = {}
    for node in ast.parse(source).body:
        if isinstance(node, ast.AnnAssign):
            pairs = [(node.target, node.value)]
        elif isinstance(node, ast.Assign):
            pairs = [(target, node.value) for target in node.targets]
        else:
            continue
        for target, value in pairs:
            split = isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)
            both = zip(target.elts, value.elts, strict=True) if split else [(target, value)]
            out |= {
                name.id: of for name, of in both if isinstance(name, ast.Name) and name.id.isupper() and of
            }
    return out


def is_numeric(value: ast.expr) -> bool:
    """Whether a value is made of numbers, and what is computed of them, but neither of words nor a table."""
    if isinstance(value, ast.Dict | ast.DictComp):
        return False
    literals = [node.value for node in ast.walk(value) if isinstance(node, ast.Constant)]
    return bool(literals) and not any(isinstance(literal, str | bytes | bool) for literal in literals)


def numbers(source: str) -> set[str]:
    return {name for name, value in constants(source).items() if is_numeric(value)}


def rules_source(name: str) -> str:
    return (SRC / "discrepancy" / "rules" / f"{name}.py").read_text(encoding="utf-8")


def test_numbers_that_decide_are_in_one_folder() -> None:
    elsewhere = {
        module: numbers(path.read_text(encoding="utf-8"))
        for module, path in module_files("discrepancy").items()
        if not module.startswith("discrepancy.rules.")
    }
    assert {module: names for module, names in elsewhere.items() if names} == FREE


def test_every_file_of_rules_is_looked_at() -> None:
    assert set(module_files("discrepancy.rules")) == {"discrepancy.rules"} | {
        f"discrepancy.rules.{n}" for n in RULES
    }


def test_rules_handed_on_have_names_of_their_own() -> None:
    """``discrepancy.rules`` hands on four files; of two rules of one name it would hide one."""
    handed = [numbers(rules_source(name)) for name in ("inference", "laws", "team", "axis")]
    assert sum(map(len, handed)) == len(set().union(*handed))
    assert set().union(*handed) <= set(dir(rules))


@pytest.mark.parametrize(("name", "least"), RULES.items())
def test_every_rule_says_where_it_comes_from(name: str, least: int) -> None:
    body = ast.parse(rules_source(name)).body[1:]
    assert len(body) > least
    for rule, words in zip(body[::2], body[1::2], strict=True):
        assert isinstance(rule, ast.Assign), ast.unparse(rule)
        assert isinstance(words, ast.Expr), ast.unparse(rule)
        said = ast.unparse(words)
        assert any(origin in said for origin in ("Derived", "Measured", "Chosen")), ast.unparse(rule)


def test_what_counts_as_a_number() -> None:
    source = (
        "A = 1\nB, C = -2.5, (1e-3, 2.0)\nD: int = 2 * 3\nE = 'x'\nF = {'a': 1}\nG = H * 2\ni = 3\nJ = f(K)\n"
    )
    assert numbers(source) == {"A", "B", "C", "D", "G"}
