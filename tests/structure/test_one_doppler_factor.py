"""The two-way Doppler factor stands in one file: nobody else divides a speed of sound and a closing speed by another.

Read from the sources by AST: quotients (x + a) / (x - b) of one x, whatever their names, and quotients of sums whose
both parts name a closing speed, which is the factor minus 1. One way alone, c / (c + v), is free.
"""
import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FACTOR = ROOT / "mitsonar" / "signal" / "doppler.py"
ROOMS = "propagation", "sonar", "signal", "synthetic_aperture", "echoes", "survey", "gradients", "inversion"
SOURCES = sorted(path for room in ROOMS for path in (ROOT / "mitsonar" / room).rglob("*.py") if path != FACTOR)
WORDS = "closing", "velocity", "approach"


def sums(node, kind=(ast.Add, ast.Sub)):
    """Sums or differences among the factors of an expression."""
    if isinstance(node, ast.BinOp):
        if isinstance(node.op, kind):
            yield node
        elif isinstance(node.op, (ast.Mult, ast.Div)):
            yield from (*sums(node.left, kind), *sums(node.right, kind))


def closing(node):
    """True if an expression names a closing speed."""
    names = (part.attr if isinstance(part, ast.Attribute) else getattr(part, "id", "") for part in ast.walk(node))
    return any(word in name for name in names for word in WORDS)


def written_again(tree):
    """Quotients of a tree that are two-way Doppler factors."""
    return [ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div)
            for below in sums(node.right) for above in sums(node.left)
            if (closing(above) and closing(below))
            or (isinstance(above.op, ast.Add) and isinstance(below.op, ast.Sub)
                and ast.dump(above.left) == ast.dump(below.left))]


def test_nobody_else_writes_the_doppler_factor():
    found = [f"{path.relative_to(ROOT)} has {quotient}; take it from signal.doppler" for path in SOURCES
             for quotient in written_again(ast.parse(path.read_text(encoding="utf-8")))]
    assert SOURCES and not found, "\n".join(found)


@pytest.mark.parametrize("text", ["d = (c + v) / (c - v)", "d = gain * (1 + m_back) / (1 - m_out)",
                                  "d = (closing + sent_closing) / (c - sent_closing)"])
def test_a_second_doppler_factor_would_be_found(text):
    assert written_again(ast.parse(text))


@pytest.mark.parametrize("text", ["s = sine * c / (c + closing)", "step = (t - time) / (1 - closing / c)"])
def test_one_way_is_free(text):
    assert not written_again(ast.parse(text))
