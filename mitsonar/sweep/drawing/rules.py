"""Rules by which a parameter gets its value: drawn at random, computed from others, or chosen by the case of another.

    { uniform = [1, 2] }                                        drawn
    { of = "min(8, 0.15 * depth)" }                             computed
    { when = "bed", cases = { sand = RULE or value }, else = RULE or value }
"""
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from mitsonar.device.spelling import meant
from mitsonar.io.scene_files import scenes

from ..strata import draw
from ..values import rounded, shortened, value
from .expressions import Expression, expression

DEEPEST = 5                        # cases within cases
LONGEST_CHAIN = 100                # parameters that need one another in turn
ALL = "true", "false"              # cases of a condition


class Chance(NamedTuple):
    """Random numbers of one value."""

    bits: int
    share: float | None = None  # fraction of its distribution, if it is drawn together with others


class When(NamedTuple):
    """Cases of a rule."""

    of: Expression
    cases: tuple[str, ...]
    has_else: bool
    where: str


@dataclass(frozen=True, kw_only=True)
class Rule:
    """Rule by which a parameter gets its value."""

    value: Callable[[Chance, Mapping[str, Any]], Any]  # from chance and the values of `needs`
    needs: tuple[str, ...] = ()
    is_drawn: bool = False
    is_stratified: bool = False
    choices: tuple = ()  # values that it may take, as far as they are known
    is_closed: bool = False  # these are all
    whens: tuple[When, ...] = ()


def rule(given: object, where: str, depth: int = 0) -> Rule:
    """Return the rule that a plan gives a parameter."""
    if isinstance(given, dict) and "of" in given:
        return _computed(given, where)
    if isinstance(given, dict) and "when" in given:
        return _chosen(given, where, depth)
    drawn = draw(given, where)
    return Rule(value=lambda chance, values: drawn.at(chance.bits) if chance.share is None else
                drawn.quantile(chance.share), is_drawn=True, is_stratified=drawn.stratified,
                choices=drawn.choices, is_closed=bool(drawn.choices))


def is_derived(given: object) -> bool:
    """Return True for a value of [set] that follows from other parameters."""
    return isinstance(given, dict) and ("of" in given or "when" in given)


def ordered(rules: Mapping[str, Rule], known: Mapping[str, Any]) -> dict[str, Rule]:
    """Return rules in an order in which each comes after those that it needs.

    Parameters
    ----------
    rules : dict of str to Rule
        Rules by parameter.
    known : mapping
        Parameters that have a value without a rule.

    Raises
    ------
    ValueError
        If a rule needs an unknown parameter, or rules need each other.
    """
    done: dict[str, Rule] = {}
    for name in rules:
        _visit(name, rules, known, done, [])
    return done


def check_cases(rules: Mapping[str, Rule], columns: Mapping[str, Sequence[Any]]) -> None:
    """Raise `ValueError` if a value of a parameter has no case, or a case no value; `columns` are values by name."""
    for when in (when for given in rules.values() for when in given.whens):
        name = when.of.name
        others = rules.get(name or "")
        if when.of.is_condition:
            values = ALL
        elif name is not None and name in columns and (others is None or others.is_closed):
            values = tuple(dict.fromkeys(map(case_of, columns[name])))
        elif not when.has_else:
            raise ValueError(f"{when.where} chooses by {shortened(when.of.text)}, which may have any value; add else")
        else:
            continue
        unknown = next((case for case in when.cases if case not in values and number_text(case) not in values), None)
        if unknown is not None:
            raise ValueError(f"{when.where} has the case {shortened(unknown)}{meant(unknown, values)}, but "
                             f"{when.of.text} is one of {shortened(', '.join(values))}; give cases of these")
        lacking = [text for text in values if text not in when.cases and text not in map(number_text, when.cases)]
        if lacking and not when.has_else:
            raise ValueError(f"{when.where} has no case {shortened(lacking[0])} of {when.of.text}; add this case, or "
                             "`else`")


def case_of(given: Any) -> str:
    """Return the case that a value stands for: its text in a scene, a whole number without a point."""
    return str(int(given)) if isinstance(given, float) and given.is_integer() else scenes.text("", given)


def number_text(text: str) -> str:
    """Return the text of a number as `case_of` writes it; other texts as they are."""
    try:
        return case_of(float(text))
    except (ValueError, OverflowError):
        return text


def _visit(name, rules, known, done, path):
    if name in done:
        return
    if name in path:
        loop = [*path[path.index(name):], name]
        raise ValueError(f"{' needs '.join(loop)}: these parameters need each other; give one of them a value of its "
                         "own")
    if len(path) >= LONGEST_CHAIN:
        raise ValueError(f"{path[0]} needs a chain of over {LONGEST_CHAIN} parameters that are computed from one "
                         "another; compute some of them directly")
    for other in rules[name].needs:
        if other in rules:
            _visit(other, rules, known, done, [*path, name])
        elif other not in known:
            raise ValueError(f"{name} needs the parameter {shortened(other)}{meant(other, [*rules, *known])}, for "
                             "which neither the plan nor the scene has a value; give it one")
    done[name] = rules[name]


def _computed(given, where):
    if len(given) > 1:
        other = next(key for key in given if key != "of")
        raise ValueError(f"{where} has the key {shortened(other)} beside of; leave it out")
    of = expression(given["of"], f"{where}: of")
    return Rule(value=lambda chance, values: _tidied(of.value(values), of.where), needs=of.needs)


def _tidied(computed, where):
    """Return a computed value as a plan may give it."""
    computed = value(computed, where)
    return rounded(computed) if isinstance(computed, float) else computed


def _chosen(given, where, depth):
    if depth >= DEEPEST:
        raise ValueError(f"{where} has cases within cases, {DEEPEST} deep; give fewer levels")
    unknown = next((key for key in given if key not in ("when", "cases", "else")), None)
    if unknown is not None:
        raise ValueError(f"{where} has the unknown key {shortened(unknown)} beside when; give cases and else")
    cases = given.get("cases")
    if not isinstance(cases, dict) or not cases:
        raise ValueError(f"{where}: cases is {shortened(cases)}; give a value for each case, such as "
                         "cases = { sand = 0.05, mud = 0 }")
    of = expression(given["when"], f"{where}: when")
    parts = {text: _part(case, f"{where}: cases.{text}", depth) for text, case in cases.items()}
    other = _part(given["else"], f"{where}: else", depth) if "else" in given else None
    by_text = {number_text(text): part for text, part in parts.items()} | parts
    every = [*parts.values(), *([other] if other is not None else [])]

    def chosen(chance: Chance, values: Mapping[str, Any]) -> Any:
        text = case_of(of.value(values))
        found = by_text.get(text, other)
        if found is None:
            raise ValueError(f"{where} has no case {shortened(text)} of {of.text}; add this case, or `else`")
        return found.value(chance, values)

    return Rule(value=chosen, needs=tuple(dict.fromkeys([*of.needs, *(name for part in every for name in part.needs)])),
                is_drawn=any(part.is_drawn for part in every),
                is_stratified=any(part.is_stratified for part in every),
                choices=tuple(item for part in every for item in part.choices),
                is_closed=all(part.is_closed for part in every),
                whens=(When(of, tuple(parts), other is not None, where), *(when for part in every
                                                                          for when in part.whens)))


def _part(given, where, depth):
    """Return the rule of a case, or of its value."""
    if isinstance(given, dict):
        return rule(given, where, depth + 1)
    constant = value(given, where)
    return Rule(value=lambda chance, values: constant, choices=(constant,), is_closed=True)
