"""Straight vector of a leg: to the origin of the traced ray, and to the array's centre at reception.

The equations are those of `vector_approximation`. All is float64, of NumPy or Dr.Jit.
"""
from collections.abc import Callable

from mitsonar.device.types import Numbers, Triple

from .straight_vectors import StraightLeg, dot, library, select, straight_delay
from .travel import Travel
from .vector_approximation import LEVEL, corrections


def matched_leg(range_per_parameter: Numbers, second: Numbers, third: Numbers, ray_parameter: Numbers,
                speed: Numbers) -> StraightLeg:
    """Match a straight vector to a leg."""
    # range_per_parameter, second, third (H,); ray_parameter (H,) [s/m]; speed (H,) [m/s]
    y, p, xp = range_per_parameter, ray_parameter, library(ray_parameter)
    matched = (second > 0) & (y > 0)
    local = xp.maximum(1 / (speed * speed) - p * p, (LEVEL / speed) ** 2)
    e = select(matched, second, y / local)
    g = select(matched, third - e * e / xp.maximum(y, 1e-30), 0.0)
    speed = xp.sqrt(e / xp.maximum(y + p * p * e, 1e-30))
    u = xp.sqrt(y / xp.maximum(e, 1e-30))
    return StraightLeg(y / speed, speed, p * speed, u * speed, 0.5 * g * p**3 / (speed * speed))


def centre_return(leg: StraightLeg, travel_time: Numbers, bearing: tuple[Numbers, Numbers], upwards: Numbers,
                  travel: Travel,
                  slice_to: Callable[[Numbers], tuple[Numbers, Numbers]], elapsed: Numbers | None = None,
                  later: Numbers | None = None) -> tuple[Numbers, Numbers, StraightLeg, Triple, Numbers]:
    """Find the array's centre at reception, and match the leg to this point, or to that of sound sent `later`."""
    # travel_time (H,) [s]; bearing (H,) [-]; upwards (H,) [-]; elapsed (H,) [s]; later (1,) [s]
    # -> return_time (H,) [s], time of reception of what leaves `later` (H,) [s], direction (H,), rise (H,) [m]
    xp = library(travel_time)
    n = (-bearing[0] * leg.horizontal, -bearing[1] * leg.horizontal, upwards * leg.vertical)
    elapsed = travel_time if elapsed is None else elapsed
    wait = travel_time + elapsed
    # the way as a straight one, x + v (t - wait), that touches it within microseconds of when the echo is there
    about = wait + dot(n, travel.moved(wait)) / leg.speed
    velocity = travel.velocity(about)
    place = [part + v * (wait - about) for part, v in zip(travel.moved(about), velocity)]
    inverse = 1 / xp.maximum(leg.length, 1e-9)
    square, along = dot(velocity, velocity), dot(velocity, place)
    toward = dot(n, velocity)
    closing = leg.speed - toward - inverse * along
    c2 = leg.speed * leg.speed
    straight, shrinking = straight_delay(dot(n, place), dot(place, place), inverse, leg.speed, closing, c2 - square)
    delay, height, excess = straight, 0.0, 0.0
    closing = leg.speed - (leg.speed - closing + inverse * square * delay) * shrinking
    for again in range(2):      # the slice moves the time, the time the slice: a thousandth of it
        height = upwards * (place[2] + velocity[2] * delay)
        if not again:           # its water stays the same within micrometres
            mean, variance = slice_to(upwards * height)
            excess = c2 * mean - 1
        correction = corrections(leg.vertical, leg.horizontal, leg.third, inverse, shrinking, height, excess,
                                 c2 * c2 * variance)[0]
        delay = straight + correction / closing
    # the leg to there: the matched layer and the slice in a row, at the p that spans the new range; in units of c_m
    place, received = [part + v * delay for part, v in zip(place, velocity)], wait + delay
    if later is not None:
        # the point where the array is then, to first order of v / c in the time; only the leg's shape depends on it
        ahead = [part - before for part, before in zip(travel.moved(received + later), place)]
        received = received + later + dot(n, ahead) / leg.speed
        place = travel.moved(received)
        excess = c2 * slice_to(place[2])[0] - 1
    x, y = leg.length * n[0] + place[0], leg.length * n[1] + place[1]
    across = xp.sqrt(x * x + y * y)
    layer, height = leg.length * leg.vertical, upwards * place[2]
    p = across / xp.sqrt(across * across + xp.maximum(layer + height, 1e-9) ** 2)
    for _ in range(2):
        first, second, _ = _two_layers(leg, p, layer, height, excess)
        p = xp.minimum(p + (across - p * first) / (first + p * p * second), 1 - 0.5 * LEVEL**2)
    there = matched_leg(*_two_layers(leg, p, layer, height, excess), p, 1.0)
    # a level ray has no layer to match; it only moves
    level = leg.vertical <= 2 * LEVEL
    there = StraightLeg(select(level, leg.length + dot(n, place), there.length), leg.speed * select(level, 1.0,
                                                                                                    there.speed),
                select(level, leg.horizontal, there.horizontal), select(level, leg.vertical, there.vertical),
                there.third)
    still = across < 1e-9
    scale = there.horizontal / select(still, 1.0, across)
    direction = select(still, 0.0, x * scale), select(still, 0.0, y * scale), upwards * there.vertical
    return travel_time + delay, received, there, direction, upwards * height


def _two_layers(leg: StraightLeg, p: Numbers, layer: Numbers, height: Numbers,
                excess: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Y, E and G, speeds in units of c_m, of the leg's layer and the slice above it; to third order of the leg."""
    xp = library(p)
    below = xp.maximum(1 - p * p, LEVEL**2)
    above = xp.maximum(below + excess, LEVEL**2)
    first, further = layer / xp.sqrt(below), height / xp.sqrt(above)
    second, third = first / below + further / above, first / (below * below) + further / (above * above)
    first = first + further
    beyond = third - second * second / first + 2 * leg.third / xp.maximum(leg.horizontal, 1e-6) ** 3
    change = p - leg.horizontal
    bent = 3 * leg.third * change / xp.maximum(leg.horizontal, 1e-6) ** 2
    first, second = first + bent * change * leg.horizontal, second + 2 * bent
    return first, second, second * second / first + beyond
