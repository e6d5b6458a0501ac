"""Make every salt, hash, uniform number, seed and key that rays and scatterers are drawn with.

Numbers are hashed from the cell of the seabed or the ray of a ping that they belong to. Blocks and threads therefore do
not change them. There are two hashes, a sequence that fills the interval evenly (`even_bits`), and a scrambling of
sequences that keeps them even (`scrambled`):

    hashed     rounds of multiplying and shifting over any number of words, for scatterers, patches and echoes
    pair       the Tiny Encryption Algorithm, 4 rounds, for a ray's number under a key

A key is a 32-bit word made of the seed, the ping and a salt. Each use of chance has its own salt, so that two draws of
the same ray are independent. NumPy generators on the host are seeded from keys too.

References
----------
Zafar, Olano and Curtis (2010), GPU random numbers via the tiny encryption algorithm, Proc. High Performance Graphics.
Weyl (1916), Über die Gleichverteilung von Zahlen mod. Eins, Math. Annalen 77.
Laine and Karras (2011), Stratified sampling for stochastic transparency, Computer Graphics Forum 30, 1197.
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
SCRAMBLE_FACTORS = 0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6
TEA_STEP, TEA_ROUNDS = 0x9E3779B9, 4
TEA_KEY = 0xA341316C, 0xC8013EA4, 0xAD90777D, 0x7E95761E


class Salt:
    """Hold one word for each use of random numbers."""

    FIRST_PASS, SECOND_PASS = 0x51ED270B, 0x2545F491    # rays of a sidescan's ping: trial pass, image pass
    TAILS = 0x4F1BBCDD             # number shared by neighbouring rays outside the beam
    BOUNCES, WATER = 0x6C62272E, 0x1B873593             # longer paths and points of the water, energy records
    BOUNCE_RAYS = 0x4B1D3C27       # rays of a sidescan's ping that longer paths begin with
    ARRAY_BOUNCES, ARRAY_WATER = 0x3C6EF372, 0x78DDE6E4
    FAN_TRUTH = 0x3C6EF372         # added to keys; the others are mixed in
    PARTNER, DIRECTION, TARGET = 0x2C1B3C6D, 0x297A2D39, 0x5F356495    # of a ray that bounces on
    GOES_ON = 0x3D4F7A63           # of rays at a bounce, those that are followed further
    CANDIDATE, FAINT_PAIR = 0x7C9E1A4F, 0x1F6D2B95     # candidates for a ray's partner; pairs left out as faint
    PLACE, AMPLITUDE = 0x0B5297A4, 0x68E31DA4           # of the scatterers of a facet
    COUNT = 0x1B56C4E9             # fraction of a scatterer by which facets with the same need differ
    OF_ONE_PASS, PASS = 0x2F0B4C47, 0x3A8C35D1          # a scatterer's part of one pass; seed of a pass
    PATCH = 0x6A09E667             # strength of a patch of seabed
    BORDER = 0x3AF54FA5            # sediment of a place within a border of two
    GLINT = 0x4F9D2E8B             # number of the glints of a square of seabed
    WEED = 0x5C7A11D3              # field whose high parts are weed; octaves are added
    WATER_SPECKLE = 0x35C0FBCF     # a sidescan's speckle of the water
    YAW_JITTER, PHASE_JITTER = 0x59415721, 0x50484153   # errors of a sidescan's faces from ping to ping
    BEAM_AMBIENT, BEAM_NOISE = 0x1F83D9AB, 0x5BE0CD19   # noise in beams: on rows of sine, on waves along the line
    RECEIVER_FLAWS = 0x464C4157    # errors of an array's receivers
    RECORDER = 0x5243444B          # noise, faults and gains of a recorder
    EDGES = 0x6A3C91D7             # points on edges, for gradients
    OUTLINES = 0x71C8E2B5          # points on outlines of shapes without facets
    SONAR = 0x510E527F             # a sonar that shares the track of another
    PROBES = 0x63D83595            # directions in which a fit probes its Jacobian
    NOISE = 0x6E6F697365           # word of Philox's counter: noise shares no numbers with other uses of the seed


# ---- keys

def shape_key(name: str) -> int:
    """Return the number of a shape's id in hashes, its CRC-32."""
    return zlib.crc32(str(name).encode())


def ping_key(seed: int, ping: int, number: int = 0, salt: int = 0) -> int:
    """Return the key of a ping; `number` separates sources or passes of the same ping."""
    return (int(seed) * SEED_FACTOR + int(ping) * PING_FACTOR + int(number) * NUMBER_FACTOR + salt) & WORD


def sonar_seed(seed: int, name: str) -> int:
    """Return the seed of a sonar that works beside another, with its own rays, speckle and noise."""
    return ping_key(seed, 0, shape_key(name), Salt.SONAR)


def pass_seed(seed: int, number: int) -> int:
    """Return the seed of a pass over the ground: `seed` for pass 0, others for the noise and water of later passes."""
    return ping_key(seed, 0, number, Salt.PASS) if number else seed


def row_keys(row: np.ndarray) -> np.ndarray:
    """Return a word (R,) for every row (R,) of an energy record."""
    return ((row.astype(np.uint64) + np.uint64(1)) * np.uint64(PING_FACTOR) & np.uint64(WORD)).astype(np.uint32)


def seeded(row_key: UInt32, seed: int, salt: int) -> UInt32:
    """Return the keys of rows for a seed and a salt; the seed is opaque, so that it changes without a new kernel."""
    return row_key ^ dr.opaque(type(row_key), (int(seed) * SEED_FACTOR + salt) & WORD)


@overload
def salted(key: int, salt: int, number: int = 0) -> int: ...
@overload
def salted(key: UInt32, salt: int, number: UInt32 | int = 0) -> UInt32: ...


def salted(key: UInt32 | int, salt: int, number: UInt32 | int = 0) -> UInt32 | int:
    """Return the key of another use; `number` separates repetitions of that use, such as bounces."""
    if isinstance(key, int):
        return (key ^ (salt + number)) & WORD
    return key ^ (type(key)(salt) + number)


# ---- hashes

def hashed(lib: ModuleType, *parts: UInt32) -> UInt32:
    """Mix UInt32 arrays into one, by rounds of multiplying and shifting."""
    U = lib.UInt32
    state = U(HASH_STEP)
    for part in parts:
        state = state ^ U(part)
        for shift, factor in HASH_ROUNDS:
            state = (state ^ (state >> shift)) * U(factor)
        state = (state ^ (state >> 16)) + U(HASH_STEP)
    return state


def hashed_pair(lib: ModuleType, *parts: UInt32) -> tuple[UInt32, UInt32]:
    """Mix UInt32 arrays into two independent ones."""
    first = hashed(lib, *parts)
    return first, hashed(lib, first)


def pair(index: DrJitArray, key: UInt32) -> tuple[UInt32, UInt32]:
    """Return two words of 32 random bits for numbers under a key, by 4 rounds of TEA.

    The first words of consecutive numbers deviate by up to 1.2 % from a uniform distribution, and the two words
    correlate by up to 2 %. This is enough within strata, not for statistics without strata.
    """
    U: Any = type(key) if dr.is_array_v(key) else type(index)
    v0, v1, total = U(index), U(key), 0
    for _ in range(TEA_ROUNDS):
        total = (total + TEA_STEP) & WORD
        v0 = v0 + ((v1 << 4) + U(TEA_KEY[0]) ^ v1 + U(total) ^ (v1 >> 5) + U(TEA_KEY[1]))
        v1 = v1 + ((v0 << 4) + U(TEA_KEY[2]) ^ v0 + U(total) ^ (v0 >> 5) + U(TEA_KEY[3]))
    return v0, v1


def other_pair(index: DrJitArray, key: UInt32) -> tuple[UInt32, UInt32]:
    """Return two more words for the same key, independent of `pair`."""
    return pair(index, ~key)


def scrambled(number: Any, seed: Any) -> Any:
    """Return numbers mixed so that bit i depends on bits 0 to i of the number alone, one to one; UInt32 or NumPy's.

    Rounds of multiplying by even factors (Laine and Karras 2011), with a word of the seed added to each.
    """
    U = type(number) if dr.is_array_v(number) else np.uint32
    mixed, added = number + seed, seed ^ U(GOLDEN_STEP)
    for factor in SCRAMBLE_FACTORS:
        mixed = (mixed ^ (mixed * U(factor))) + added
    return mixed


def even_bits(lib: ModuleType, number: UInt32, *parts: UInt32) -> UInt32:
    """Return 32 bits that fill [0, 2^32) evenly for consecutive numbers, from a start hashed of `parts` (Weyl 1916)."""
    return hashed(lib, *parts) + number * lib.UInt32(GOLDEN_STEP)


# ---- numbers

def uniform(lib: ModuleType, bits: UInt32) -> Float:
    """Return numbers in [0, 1) from 32 random bits."""
    return lib.Float(bits >> 8) * SMALLEST_UNIFORM


def uniform_inside(lib: ModuleType, bits: UInt32) -> Float64:
    """Return numbers in (0, 1), without either end, from 32 random bits."""
    return (lib.Float64(bits) + 0.5) * 2.0 ** -32


def stratified(lib: ModuleType, stratum: DrJitArray, share: Float, strata: DrJitArray) -> Float:
    """Return places in [0, 1) that lie a `share` in [0, 1) along a stratum."""
    return dr.minimum((lib.Float(stratum) + share) / lib.Float(strata), BELOW_ONE)


def gaussian(lib: ModuleType, first: UInt32, second: UInt32, turned: Float | float = 0.0) -> tuple[Float, Float]:
    """Return real and imaginary part of complex Gaussians of unit mean square, turned by an angle [rad]."""
    radius = dr.sqrt(-dr.log((lib.Float(first >> 8) + 0.5) * SMALLEST_UNIFORM))
    sine, cosine = dr.sincos((2 * np.pi) * uniform(lib, second) + turned)
    return radius * cosine, radius * sine
