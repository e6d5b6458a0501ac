"""Expressions of parameters, such as ``min(8, 0.15 * depth)``, in a small part of Python's grammar.

Numbers, texts in quotes, names of parameters, ``+ - * / **``, comparisons, ``and or not``, and the functions below.
Python's parser reads them; nothing but what this file lists is ever executed.
"""
import ast
import contextlib
import math
import operator
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ..values import LARGEST_WHOLE, shortened

LONGEST, MOST_PARTS, DEEPEST = 500, 200, 30        # characters; parts of the syntax; levels of nesting
FUNCTIONS: dict[str, tuple[Callable[..., Any], int, int]] = {      # with the least and the largest number of arguments
    "min": (min, 2, 20), "max": (max, 2, 20), "abs": (abs, 1, 1), "sqrt": (math.sqrt, 1, 1), "exp": (math.exp, 1, 1),
    "log": (math.log, 1, 1), "sin": (math.sin, 1, 1), "cos": (math.cos, 1, 1), "tan": (math.tan, 1, 1),
    "radians": (math.radians, 1, 1), "round": (round, 1, 1), "floor": (math.floor, 1, 1), "ceil": (math.ceil, 1, 1)}
COMPARISONS = {ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
               ast.Eq: operator.eq, ast.NotEq: operator.ne}


def _power(base, exponent):
    """Return a power by floats, so that whole numbers cannot become endless."""
    result = math.pow(base, exponent)
    return int(result) if isinstance(base, int) and isinstance(exponent, int) and exponent >= 0 \
        and abs(result) <= LARGEST_WHOLE else result


OPERATORS = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
             ast.Pow: _power}
SIGNS = {ast.USub: operator.neg, ast.UAdd: operator.pos}
GRAMMAR = f"numbers, names of parameters, + - * / **, comparisons, and {', '.join(FUNCTIONS)}"
Evaluated = Callable[[Mapping[str, Any]], Any]


@dataclass(frozen=True, kw_only=True)
class Expression:
    """Expression of parameters."""

    text: str
    where: str  # its place in the plan
    needs: tuple[str, ...]  # names of the parameters
    evaluate: Evaluated
    is_condition: bool  # its value is true or false

    @property
    def name(self) -> str | None:
        """Return the parameter whose value it is, or None."""
        return self.needs[0] if self.needs == (self.text.strip(),) else None

    def value(self, values: Mapping[str, Any]) -> Any:
        """Return its value; raises `ValueError` if it has none, such as sqrt(-1)."""
        try:
            return self.evaluate(values)
        except (ArithmeticError, ValueError, TypeError) as error:
            at = ", ".join(f"{name} = {shortened(values[name])}" for name in self.needs)
            reason, mend = ("a text is no number", "choose texts by when") if isinstance(error, TypeError) else (
                error, "write one that has, for example by max()")
            raise ValueError(f"{self.where} is {shortened(self.text)}, which has no value{at and f' at {at}'} "
                             f"({reason}); {mend}") from None


def expression(given: object, where: str) -> Expression:
    """Return a checked expression; raises `ValueError` for what is none."""
    if not isinstance(given, str) or not 0 < len(given) <= LONGEST:
        raise ValueError(f"{where} is {shortened(given)}; give an expression as a text of at most {LONGEST} "
                         "characters, such as \"min(8, 0.15 * depth)\"")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")            # such as of 1and 2
            tree = ast.parse(given.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ValueError(f"{where} is {shortened(given)}, which is no expression; give one of {GRAMMAR}") from None
    if sum(1 for _ in ast.walk(tree)) > MOST_PARTS:
        raise ValueError(f"{where} is {shortened(given)}, which has too many parts; give a shorter expression")
    needs: dict[str, None] = {}
    try:
        evaluate = _compiled(tree, needs, 0)
    except ValueError as error:
        raise ValueError(f"{where} is {shortened(given)}, with {error}; give an expression of {GRAMMAR}") from None
    return Expression(text=given, where=where, needs=tuple(needs), evaluate=evaluate,
                      is_condition=isinstance(tree, (ast.Compare, ast.BoolOp))
                      or (isinstance(tree, ast.UnaryOp) and isinstance(tree.op, ast.Not)))


def _compiled(node, needs, depth) -> Evaluated:
    """Return a function of the parameters' values, and add their names to `needs`."""
    if depth > DEEPEST:
        raise ValueError("too many levels of brackets")

    def inner(part):
        return _compiled(part, needs, depth + 1)

    if isinstance(node, ast.Constant) and (isinstance(node.value, (bool, str)) or _is_bounded(node.value)):
        constant = node.value
        return lambda values: constant
    if isinstance(node, ast.Name):
        return _named(node.id, needs)
    if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        apply, left, right = OPERATORS[type(node.op)], inner(node.left), inner(node.right)
        return lambda values: apply(_number(left(values)), _number(right(values)))
    if isinstance(node, ast.UnaryOp) and type(node.op) in SIGNS:
        sign, operand = SIGNS[type(node.op)], inner(node.operand)
        return lambda values: sign(_number(operand(values)))
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        denied = inner(node.operand)
        return lambda values: not denied(values)
    if isinstance(node, ast.BoolOp):
        parts, both = [inner(part) for part in node.values], isinstance(node.op, ast.And)
        return lambda values: (all if both else any)(part(values) for part in parts)
    if isinstance(node, ast.Compare) and all(type(sign) in COMPARISONS for sign in node.ops):
        terms, signs = [inner(part) for part in (node.left, *node.comparators)], [COMPARISONS[type(sign)]
                                                                                 for sign in node.ops]
        return lambda values: _compared([term(values) for term in terms], signs)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        return _called(node.func.id, [inner(part) for part in node.args])
    raise ValueError(f"{shortened(ast.unparse(node))} in it")


def _named(name, needs):
    if name in FUNCTIONS:
        raise ValueError(f"the function {name} without its arguments")
    needs[name] = None
    return lambda values: values[name]


def _called(name, arguments):
    if name not in FUNCTIONS:
        raise ValueError(f"the unknown function {shortened(name)}")
    function, least, most = FUNCTIONS[name]
    if not least <= len(arguments) <= most:
        raise ValueError(f"{len(arguments)} arguments of {name}")
    return lambda values: function(*[_number(argument(values)) for argument in arguments])


def _compared(values, signs):
    return all(sign(*_alike(left, right)) for sign, left, right in zip(signs, values, values[1:]))


def _alike(left, right):
    """Return two values to compare: texts, or numbers."""
    return (left, right) if isinstance(left, str) and isinstance(right, str) else (_number(left), _number(right))


def _number(given):
    """Return a number, also of a text that reads as one, such as a default of the scene."""
    if isinstance(given, (int, float)):
        return given
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(given)
    raise TypeError


def _is_bounded(given):
    return isinstance(given, (int, float)) and abs(given) <= 1e150
