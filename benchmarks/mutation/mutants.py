"""Changes of the code that a test should notice. Messages, annotations and decorators stay as they are."""

from __future__ import annotations

import ast
import random
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

NEGATED: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
}  # fmt: skip
BOUNDARY = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}
WHOLE = re.compile(r"\blen\(|\bsize\b|\bshape\b|(?<![\w.])\d+(?![\w.])")
"""Whole numbers are compared: elsewhere a bound itself hardly ever occurs."""
ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
}  # fmt: skip
OTHER = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "any": "all", "all": "any"}
KEPT = {"annotation", "returns", "decorator_list"}


@dataclass(frozen=True)
class Mutant:
    """A change of one node of a file.

    Attributes:
        path: from the top of the tree.
        node: what goes.
        kind: of the change.
        text: what stands there then.
        names: that the statement gives a value where it runs when the module is imported; () in a function.
        statement: lines of the statement that it is in, without those inside.
    """

    path: str
    node: ast.AST
    kind: str
    text: str
    names: tuple[str, ...]
    statement: range

    def lines(self) -> range:
        return range(self.node.lineno, self.node.end_lineno + 1)  # type: ignore[attr-defined]

    def place(self) -> str:
        column = self.node.col_offset  # type: ignore[attr-defined]
        return f"{self.path}:{self.lines()[0]}:{column} {self.kind} {self.text}"

    def apply(self, source: str) -> str:
        raw, lines = source.encode().splitlines(keepends=True), self.lines()
        before = b"".join(raw[: lines[0] - 1]) + raw[lines[0] - 1][: self.node.col_offset]  # type: ignore[attr-defined]
        after = raw[lines[-1] - 1][self.node.end_col_offset :] + b"".join(raw[lines[-1] :])  # type: ignore[attr-defined]
        return (before + self.text.encode() + after).decode()


def all_mutants(top: Path, packages: Sequence[str], rng: random.Random) -> list[Mutant]:
    """Every change, in random order."""
    files = sorted(path for name in packages for path in (top / "src" / name).rglob("*.py"))
    found: list[Mutant] = []
    for file in files:
        found += _walk(str(file.relative_to(top)), ast.parse(file.read_text()), (), range(0), rng)
    rng.shuffle(found)
    return found


def _walk(
    path: str, node: ast.AST, names: tuple[str, ...], statement: range, rng: random.Random
) -> Iterator[Mutant]:
    if isinstance(node, ast.stmt):
        body = getattr(node, "body", None)
        end = max(body[0].lineno - 1, node.lineno) if body else node.end_lineno or node.lineno
        statement = range(node.lineno, end + 1)
    for kind, text, gone in _changes(node, rng):
        yield Mutant(path, gone, kind, text, names, statement)
    if isinstance(node, ast.Raise | ast.JoinedStr):
        return
    for field, value in ast.iter_fields(node):
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST) or field in KEPT:
                continue
            inside = names
            if field == "body" and isinstance(node, ast.FunctionDef):
                inside = ()
            elif field == "body" and isinstance(node, ast.Module | ast.ClassDef):
                inside = tuple(sorted(_named(child)))
            yield from _walk(path, child, inside, statement, rng)


def _named(statement: ast.AST) -> set[str]:
    if isinstance(statement, ast.FunctionDef | ast.ClassDef):
        return {statement.name}
    return {
        n.id for n in ast.walk(statement) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
    } or {""}


def _changes(node: ast.AST, rng: random.Random) -> Iterator[tuple[str, str, ast.AST]]:
    """Kind of a change, what stands there then, and the node that goes."""
    u = ast.unparse
    match node:
        case ast.Compare(left, [op], [right]):
            yield "comparison", f"({u(ast.Compare(left, [NEGATED[type(op)]()], [right]))})", node
            if type(op) in BOUNDARY and WHOLE.search(u(node)):
                yield "boundary", f"({u(ast.Compare(left, [BOUNDARY[type(op)]()], [right]))})", node
        case ast.BinOp(left, op, right) if type(op) in ARITHMETIC:
            yield "arithmetic", f"({u(ast.BinOp(left, ARITHMETIC[type(op)](), right))})", node
        case ast.BoolOp(op, values):
            yield (
                "and/or",
                f"({u(ast.BoolOp(ast.Or() if isinstance(op, ast.And) else ast.And(), values))})",
                node,
            )
        case ast.UnaryOp(ast.Not() | ast.USub(), operand):
            yield "not or sign", f"({u(operand)})", node
        case ast.Constant(bool()):
            yield "boolean", str(not node.value), node
        case ast.Constant(int() | float() as value):
            yield "number", repr(rng.choice((value + 1, 2 * value, value / 2)) if value else 1), node
        case ast.Name(name) if name in OTHER:
            yield "min/max", OTHER[name], node
        case ast.Attribute(value, name) if name in OTHER:
            yield "min/max", f"{u(value)}.{OTHER[name]}", node
        case ast.Call(func, args, words):
            for k, word in enumerate(words):
                if word.arg and word.arg != "strict":
                    yield "keyword", u(ast.Call(func, args, words[:k] + words[k + 1 :])), node
        case ast.If(test, _, []):
            yield "guard", "False", test
        case ast.Return(value) if value and not (isinstance(value, ast.Constant) and value.value is None):
            yield "return", "return None", node
        case ast.Expr(ast.Call()) | ast.AugAssign() | ast.Raise() | ast.Continue() | ast.Break():
            yield "statement", "pass", node
        case ast.Assign([ast.Subscript() | ast.Attribute()]):
            yield "statement", "pass", node
