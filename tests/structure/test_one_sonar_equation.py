"""The sonar equation stands in one file: nobody else divides by a spreading area, or one sound speed by another.

Read from the sources by AST. What takes an area as a length (√A is the radius of a wave), or adds to it, is free to.
"""
import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EQUATION = ROOT / "mitsonar" / "echoes" / "sonar_equation.py"
SOURCES = sorted(path for room in ("echoes", "survey") for path in (ROOT / "mitsonar" / room).rglob("*.py")
                 if path != EQUATION)
AREAS, SPEEDS = {"spreading_area"}, {"sound_speed", "source_speed"}


def named(node):
    """All names and attributes within an expression."""
    return {part.attr if isinstance(part, ast.Attribute) else part.id for part in ast.walk(node)
            if isinstance(part, (ast.Attribute, ast.Name))}


def quotients(tree):
    """Pairs of dividend and divisor: of a / b, of a /= b, and of the reciprocals of b."""
    for node in ast.walk(tree):
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
            yield node.left, node.right
        elif isinstance(node, ast.AugAssign) and isinstance(node.op, ast.Div):
            yield node.target, node.value
        elif isinstance(node, ast.Call) and named(node.func) & {"rcp", "rsqrt"}:
            yield node.func, node


def written_again(tree):
    """Quotients of a tree that belong to the sonar equation."""
    return [ast.unparse(b) for a, b in quotients(tree)
            if named(b) & AREAS or (named(a) & SPEEDS and named(b) & SPEEDS)]


def test_nobody_else_writes_the_sonar_equation():
    found = [f"{path.relative_to(ROOT)} divides by {divisor}; take what echoes.sonar_equation has" for path in SOURCES
             for divisor in written_again(ast.parse(path.read_text(encoding="utf-8")))]
    assert SOURCES and not found, "\n".join(found)


@pytest.mark.parametrize("text", ["e = s / way.spreading_area", "e /= (a * hits.spreading_area)",
                                  "r = hits.sound_speed / source_speed", "g = s * dr.rcp(leg.spreading_area)"])
def test_a_second_sonar_equation_would_be_found(text):
    assert written_again(ast.parse(text))
