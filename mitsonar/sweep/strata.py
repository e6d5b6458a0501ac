"""Stratified draws: values of a parameter that fill its distribution evenly, however many samples there are.

Number k of a sequence takes the k-th point of van der Corput's sequence in base 2, whose digits are scrambled (Owen,
"Randomly permuted (t,m,s)-nets", 1995) after its order was shuffled in the same nested way (Burley, "Practical
hash-based Owen scrambling", 2020). Every 2^m draws from a multiple of 2^m on lie in 2^m equal parts of the
distribution, one in each; parameters of other names are independent. A value of share w therefore occurs n w times in n
draws, off by 1 or 2 where independent draws are off by sqrt(n w (1 - w)).
"""
from dataclasses import replace

from . import values
from .values import Draw, random_bits

DIGITS = 32                        # of the number of a draw; later bits are random
BITS = 256                         # of `random_bits`


def stratified_bits(seed: int | str, name: str, number: int, *again: object) -> int:
    """Return 256 bits as `values.random_bits` does, of which the highest are stratified over `number`.

    Draws made `again` stay in their part of the distribution.
    """
    place = _scrambled(number, f"{seed}/{name}/order")
    point = _scrambled(int(f"{place:0{DIGITS}b}"[::-1], 2), f"{seed}/{name}/point")
    rest = random_bits(seed, name, "stratified", number, *again)
    return point << (BITS - DIGITS) | rest >> DIGITS


def draw(given: object, where: str) -> Draw:
    """Return the distribution of a parameter as `values.draw` does, with ``stratified = true`` a stratified one."""
    if not isinstance(given, dict) or "stratified" not in given:
        return values.draw(given, where)
    flag = given["stratified"]
    if not isinstance(flag, bool):
        raise ValueError(f"{where}: stratified is {values.shortened(flag)}; give true or false")
    given = {name: item for name, item in given.items() if name != "stratified"}
    drawn = values.draw(given, where)
    if not flag:
        return drawn
    # these two follow the lowest bits otherwise
    if drawn.choices and "weights" not in given:
        drawn = replace(drawn, at=lambda bits, choices=drawn.choices: choices[bits * len(choices) >> BITS])
    elif "integer" in given:
        low, high = given["integer"]
        drawn = replace(drawn, at=lambda bits: low + (bits * (high - low + 1) >> BITS))
    return replace(drawn, stratified=True)


def _scrambled(number, salt):
    """Return a number of `DIGITS` bits with each bit flipped by chance that depends on all higher bits."""
    result = 0
    for digit in range(DIGITS - 1, -1, -1):
        higher = number >> digit + 1
        result |= (number >> digit & 1 ^ random_bits(salt, digit, higher) & 1) << digit
    return result
