"""Chance: every salt, hash, uniform number, seed and key that rays and scatterers are drawn with.

Numbers are hashed from what they belong to (a cell of the seabed, a ray of a ping), so neither blocks nor threads
change them. Two hashes serve:

    hashed     rounds of multiplying and shifting over any number of words: of a scatterer, a patch, an echo
    pair       the Tiny Encryption Algorithm, 4 rounds: of a ray's number under a key

A third kind of number is drawn to lie evenly (`even_bits`).

A key is a 32-bit word made of the seed, the ping and a salt. A salt tells one use of chance from another, so that two
draws of the same ray are independent. What is drawn on the host, in NumPy, takes its generators from there.

References
----------
Zafar, Olano and Curtis (2010), GPU random numbers via the tiny encryption algorithm, Proc. High Performance Graphics.
Weyl (1916), Über die Gleichverteilung von Zahlen mod. Eins, Math. Annalen 77.
Box and Muller (1958), A note on the generation of random normal deviates, Ann. Math. Statist. 29.
"""
from __future__ import annotations

import zlib
from types import ModuleType
from typing import Any, overload

import drjit as dr
import numpy as np

from .types import DrJitArray, Float, Float64, UInt32

WORD = 0xFFFFFFFF
SEED_FACTOR, PING_FACTOR, NUMBER_FACTOR = 0x9E3779B1, 0x85EBCA6B, 0xC2B2AE35     # odd: each number has its own key
SMALLEST_UNIFORM = 2.0 ** -24
BELOW_ONE = float(np.nextafter(np.float32(1), np.float32(0)))
GOLDEN_STEP = 0x9E3779B9           # 2^32 over the golden ratio
HASH_STEP, HASH_ROUNDS = 0x9E3779B9, ((16, 0x7FEB352D), (15, 0x846CA68B))
TEA_STEP, TEA_ROUNDS = 0x9E3779B9, 4
TEA_KEY = 0xA341316C, 0xC8013EA4, 0xAD90777D, 0x7E95761E


class Salt:
    """What tells the uses of chance apart, one word each."""

    # rays of a sidescan's ping: of the pass that finds out where rays are needed, and of the one that gives the image
    FIRST_PASS, SECOND_PASS = 0x51ED270B, 0x2545F491
    TAILS = 0x4F1BBCDD             # of those rays: what the neighbours share that leave aside of the beam
    # paths of more bounces and points of the water: in an energy record, and for an array
    BOUNCES, WATER = 0x6C62272E, 0x1B873593
    BOUNCE_RAYS = 0x4B1D3C27       # rays of a sidescan's ping that such paths are made of
    ARRAY_BOUNCES, ARRAY_WATER = 0x3C6EF372, 0x78DDE6E4
    FAN_TRUTH = 0x3C6EF372         # added to keys, not mixed in as the others are
    # of a ray that bounces on: its partner, its next direction, its point target
    PARTNER, DIRECTION, TARGET = 0x2C1B3C6D, 0x297A2D39, 0x5F356495
    CANDIDATE = 0x7C9E1A4F         # of those that its partner is chosen from
    # of a cell of the seabed: where its scatterer lies, and that one's amplitude
    PLACE, AMPLITUDE = 0x0B5297A4, 0x68E31DA4
    # of a scatterer: what it has of one pass alone; and the seed of a pass, for what is not fixed to the ground
    OF_ONE_PASS, PASS = 0x2F0B4C47, 0x3A8C35D1
    # of a cell in the side lobes: whether it exists for a ping
    SIDE_LOBES, BESIDE_SIDE_LOBES = 0x4E6B5A73, 0x27D4EB2F
    # of a patch in the beam domain: how many scatterers it has, where they lie, their amplitudes
    THINNED_COUNT, THINNED_PLACE, THINNED_AMPLITUDE = 0x1B56C4E9, 0x7F4A7C15, 0x4CF5AD43
    PATCH = 0x6A09E667             # the strength of a patch of seabed
    BORDER = 0x3AF54FA5            # which of two sediments a place within their border has
    GROUND_SPECKLE = 0x35C0FBCF    # of the lattices that a sidescan's speckle comes from
    # noise in the beams of a line: on rows of sine, and on waves along the line
    BEAM_AMBIENT, BEAM_NOISE = 0x1F83D9AB, 0x5BE0CD19
    RECEIVER_FLAWS = 0x464C4157    # of a multibeam's receivers: what each is off
    EDGES = 0x6A3C91D7             # of points on edges, at which gradients see a record jump
    OUTLINES = 0x71C8E2B5          # the same on outlines of shapes without facets
    SONAR = 0x510E527F             # of a sonar that shares the track of another
    PROBES = 0x63D83595            # directions that a fit looks at its Jacobian along
    NOISE = 0x6E6F697365           # word of Philox's counter: noise shares no numbers with other uses of the seed


# ---- keys

def shape_key(name: str) -> int:
    """Return the number that stands for a shape's id in hashes: its CRC-32."""
    return zlib.crc32(str(name).encode())


def ping_key(seed: int, ping: int, number: int = 0, salt: int = 0) -> int:
    """Return the key of a ping; `number` tells apart sources, or passes, of the same ping."""
    return (int(seed) * SEED_FACTOR + int(ping) * PING_FACTOR + int(number) * NUMBER_FACTOR + salt) & WORD


def sonar_seed(seed: int, name: str) -> int:
    """Return the seed of a sonar of that id that works beside another one: rays, speckle and noise are its own."""
    return ping_key(seed, 0, shape_key(name), Salt.SONAR)


def pass_seed(seed: int, number: int) -> int:
    """Return the seed of a pass over the ground: that of pass 0 is `seed`, others have other noise and water."""
    return ping_key(seed, 0, number, Salt.PASS) if number else seed


def row_keys(row: np.ndarray) -> np.ndarray:
    """Return a word for every row of an energy record."""
    # row (R,) -> (R,)
    return ((row.astype(np.uint64) + np.uint64(1)) * np.uint64(PING_FACTOR) & np.uint64(WORD)).astype(np.uint32)


def seeded(row_key: UInt32, seed: int, salt: int) -> UInt32:
    """Return the keys of rows, UInt32 (R,), for a seed and a use; the seed is opaque, so it changes without a kernel.
    """
    return row_key ^ dr.opaque(type(row_key), (int(seed) * SEED_FACTOR + salt) & WORD)


@overload
def salted(key: int, salt: int, number: int = 0) -> int: ...
@overload
def salted(key: UInt32, salt: int, number: UInt32 | int = 0) -> UInt32: ...


def salted(key: UInt32 | int, salt: int, number: UInt32 | int = 0) -> UInt32 | int:
    """Return the key of another use; `number` tells apart repetitions of that use, as the bounces of a path."""
    if isinstance(key, int):
        return (key ^ (salt + number)) & WORD
    return key ^ (type(key)(salt) + number)


# ---- hashes

def hashed(lib: ModuleType, *parts: UInt32) -> UInt32:
    """Mix UInt32 arrays into one UInt32, by rounds of multiplying and shifting: each bit in stirs every bit out."""
    U = lib.UInt32
    state = U(HASH_STEP)
    for part in parts:
        state = state ^ U(part)
        for shift, factor in HASH_ROUNDS:
            state = (state ^ (state >> shift)) * U(factor)
        state = (state ^ (state >> 16)) + U(HASH_STEP)
    return state


def hashed_pair(lib: ModuleType, *parts: UInt32) -> tuple[UInt32, UInt32]:
    """Mix UInt32 arrays into two independent UInt32."""
    first = hashed(lib, *parts)
    return first, hashed(lib, first)


def pair(index: DrJitArray, key: UInt32) -> tuple[UInt32, UInt32]:
    """Return two UInt32 of 32 random bits for numbers under a key, by 4 rounds of TEA.

    Four rounds leave the first word of consecutive numbers uneven by up to 1.2 % of its distribution, and both words
    correlated by up to 2 %: enough within strata, not for statistics of their own.
    """
    U: Any = type(key) if dr.is_array_v(key) else type(index)
    v0, v1, total = U(index), U(key), 0
    for _ in range(TEA_ROUNDS):
        total = (total + TEA_STEP) & WORD
        v0 = v0 + ((v1 << 4) + U(TEA_KEY[0]) ^ v1 + U(total) ^ (v1 >> 5) + U(TEA_KEY[1]))
        v1 = v1 + ((v0 << 4) + U(TEA_KEY[2]) ^ v0 + U(total) ^ (v0 >> 5) + U(TEA_KEY[3]))
    return v0, v1


def other_pair(index: DrJitArray, key: UInt32) -> tuple[UInt32, UInt32]:
    """Return two more for the same key, independent of `pair`."""
    return pair(index, ~key)


def even_bits(lib: ModuleType, number: UInt32, *parts: UInt32) -> UInt32:
    """Return 32 bits for consecutive numbers that fill [0, 2^32) evenly, from a start that `parts` decide (Weyl 1916).
    """
    return hashed(lib, *parts) + number * lib.UInt32(GOLDEN_STEP)


# ---- numbers

def uniform(lib: ModuleType, bits: UInt32) -> Float:
    """[0, 1) from 32 random bits, Float."""
    return lib.Float(bits >> 8) * SMALLEST_UNIFORM


def uniform_inside(lib: ModuleType, bits: UInt32) -> Float64:
    """(0, 1) from 32 random bits, Float64: neither end."""
    return (lib.Float64(bits) + 0.5) * 2.0 ** -32


def stratified(lib: ModuleType, stratum: DrJitArray, share: Float, strata: DrJitArray) -> Float:
    """Return a place in [0, 1), Float (R,), that lies a `share` in [0, 1) along a stratum, UInt32 (R,), of so many."""
    return dr.minimum((lib.Float(stratum) + share) / lib.Float(strata), BELOW_ONE)


def gaussian(lib: ModuleType, first: UInt32, second: UInt32, turned: Float | float = 0.0) -> tuple[Float, Float]:
    """Complex Gaussian of unit mean square from two hashes, turned by an angle [rad], which costs nothing more here.

    Real and imaginary part, Float (Box and Muller 1958).
    """
    radius = dr.sqrt(-dr.log((lib.Float(first >> 8) + 0.5) * SMALLEST_UNIFORM))
    sine, cosine = dr.sincos((2 * np.pi) * uniform(lib, second) + turned)
    return radius * cosine, radius * sine
