"""Lever arms and mounting angles of a Kongsberg survey line, from the text of its installation parameters.

.all: ``WLZ=1.031,S1X=12.341,...`` (STC defines which of S0 to S3 transmit and receive). KMALL: ``TRAI_TX1:X=..;Y=..``.
Angles are R, P, H of an array whose cable leaves forward or aft: see `places.straight`.
"""
from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mitsonar.device.rotations import mounted

from ..places import straight

# Positions of an EM 2040's arrays in their housings: port, middle and starboard part of the transmitter, and the
# receiver, as the installation text of its KMALL files lists them; .all files do not contain them.
_HOUSED = np.array([[0.0, -0.05538, -0.012], [0.0, 0.01315, -0.006], [0.0, 0.05538, -0.012]])
_HOUSED_RECEIVER = np.array([0.011, 0.0, -0.006])
_EM2040 = 2040
_SENDING = {0: "1", 1: "1", 2: "1", 3: "1", 4: "0", 5: "1", 6: "1"}           # by STC: the first transmit array
_RECEIVING = {0: "2", 1: "1", 2: "12", 3: "23", 4: "23", 5: "1", 6: "2"}      # by STC: the receive arrays


@dataclass(frozen=True, kw_only=True, eq=False)
class KongsbergInstallation:
    """Lever arms and mounting angles."""

    waterline: float  # [m]: below the reference point
    transmit_offset: np.ndarray  # (3,) [m]
    transmit_mounting: np.ndarray  # (3,) [rad]
    receive_offset: np.ndarray  # (R, 3) [m]
    receive_mounting: np.ndarray  # (R, 3) [rad]
    transmit_parts: np.ndarray  # (3, 3) [m]: port, middle and starboard part, from transmit_offset
    antenna: np.ndarray  # (3,) [m]: of the active position sensor
    motion_mounting: np.ndarray  # (3,) [rad]: of the active attitude sensor
    backwards: bool  # the transmit array's cable leaves forward
    receive_backwards: tuple[bool, ...]


def of_all(text: str, model: int) -> KongsbergInstallation:
    """Parse the parameters of an .all file of an echo sounder model."""
    values = dict(re.findall(r"(\w+)=([^,\x00]*)", text))
    configuration = int(_number(values, "STC"))
    arrays = [f"S{number}" for number in _SENDING.get(configuration, "1") + _RECEIVING.get(configuration, "2")]
    active = int(_number(values, "APS")) + 1
    sensor = "NS" if int(_number(values, "ARO")) in (3, 9) else "MS"
    mountings = [np.deg2rad(_three(values, array, "RPH")) for array in arrays]
    offsets = [_three(values, array, "XYZ") for array in arrays]
    parts = np.zeros((3, 3))
    if model == _EM2040:
        offsets[0] = offsets[0] + mounted(_HOUSED[1], *mountings[0])
        parts = mounted(_HOUSED - _HOUSED[1], *mountings[0])
        offsets[1:] = [offset + mounted(_HOUSED_RECEIVER, *mounting)
                       for offset, mounting in zip(offsets[1:], mountings[1:])]
    return _installation(
        waterline=_number(values, "WLZ"), parts=parts, offsets=offsets, mountings=mountings,
        antenna=_three(values, f"P{active}", "XYZ"), motion=np.deg2rad(_three(values, sensor, "RPG")))


def of_kmall(text: str) -> KongsbergInstallation:
    """Parse the parameters of a KMALL file."""
    groups = {name: dict(re.findall(r"(\w+)=([^;,]*)", rest))
              for name, rest in re.findall(r"(\w+):(\w+=[^,]*)", text)}
    names = sorted(name for name in groups if re.fullmatch(r"TRAI_RX\d", name))
    if names:
        arrays = ["TRAI_TX1", *names]
    else:
        heads = sorted(name for name in groups if re.fullmatch(r"TRAI_HD\d", name)) or ["TRAI_HD1"]
        arrays = [heads[0], *heads]
    inner = ["IT" if arrays[0].startswith("TRAI_HD") else "IC",
             *("IR" if name.startswith("TRAI_HD") else "I" for name in arrays[1:])]
    mountings = [np.deg2rad(_three(groups.get(name, {}), "", "RPH")) for name in arrays]
    own = [mounted(_three(groups.get(name, {}), prefix, "XYZ"), *mounting)
           for name, prefix, mounting in zip(arrays, inner, mountings)]
    parts = [mounted(_three(groups.get(arrays[0], {}), prefix, "XYZ"), *mountings[0]) - own[0]
             if f"{prefix}X" in groups.get(arrays[0], {}) else np.zeros(3) for prefix in ("IP", "IC", "IS")]
    active = {kind: next((values for name, values in sorted(groups.items())
                          if name.startswith(kind) and values.get("U") == "ACTIVE"), {}) for kind in ("POSI", "ATTI")}
    return _installation(
        waterline=_number(groups.get("EMXI", {}), "SWLZ"), parts=np.array(parts),
        offsets=[_three(groups.get(name, {}), "", "XYZ") + inside for name, inside in zip(arrays, own)],
        mountings=mountings, antenna=_three(active["POSI"], "", "XYZ"),
        motion=np.deg2rad(_three(active["ATTI"], "", "RPH")))


def part_of(installed: KongsbergInstallation, sector: np.ndarray) -> np.ndarray:
    """Return the positions (S, 3) of the parts that transmit sectors (S,): 0 port, 1 middle, 2 starboard."""
    return installed.transmit_parts[2 - sector if installed.backwards else sector]


def _installation(*, waterline, parts, offsets, mountings, antenna, motion):
    """Return the installation; the first array transmits."""
    turned = [straight(mounting) for mounting in mountings]
    return KongsbergInstallation(
        waterline=waterline, transmit_parts=parts, antenna=antenna, motion_mounting=motion,
        transmit_offset=offsets[0], transmit_mounting=turned[0][0], backwards=turned[0][1],
        receive_offset=np.array(offsets[1:]), receive_mounting=np.array([mounting for mounting, _ in turned[1:]]),
        receive_backwards=tuple(backwards for _, backwards in turned[1:]))


def _three(values: Mapping[str, str], prefix: str, letters: str) -> np.ndarray:
    return np.array([_number(values, prefix + letter) for letter in letters])


def _number(values: Mapping[str, str], name: str) -> float:
    """Return a parameter, 0 if it is missing."""
    text = values.get(name, "0") or "0"
    try:
        number = float(text)
    except ValueError:
        raise ValueError(f"its installation parameter {name} is {text!r}, not a number; it is damaged.") from None
    if not abs(number) < 1e4:
        raise ValueError(f"its installation parameter {name} is {number:g}, too large for a ship; it is damaged.")
    return number
