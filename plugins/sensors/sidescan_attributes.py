"""Faces and receivers of a sidescan, with the flaws that real instruments have; -200 dB leaves a flaw out."""
from dataclasses import replace

from mitsonar.io.scene_files import beam_levels
from mitsonar.sonar.faces.faces import BuiltFace, MeasuredBeam
from mitsonar.sonar.preset_tables import presets

from ..attributes import Attributes, File, FromTable, Number, SameAs, Text
from .sonar_sensor import (
    HIGHEST_DB,
    LOUDEST_FLOOR_DB,
    LOWEST_DB,
    VERTICAL_SIDELOBE,
    power_of,
)

PRESET = FromTable(table=presets(), by="preset")
LARGEST_SAG = 2.0

FACES = (
    Text("shading", default="boxcar",
         text='window along the transmit face, such as "taylor 4 30"; `beam_width_deg` is then the width of the '
              'shaded face'),
    Text("receive_shading", default=SameAs("shading"), text="window along the receive face"),
    Number("sidelobe_db", default=PRESET, minimum=LOWEST_DB, maximum=LOUDEST_FLOOR_DB, unit="dB",
           text="mean level of the diffuse side lobes along the track, of each face without a measured beam, one "
                "way, relative to its axis: the effect of errors of the face's segments; -20 to -35 in used faces"),
    replace(VERTICAL_SIDELOBE, default=PRESET,
            text="mean level of the diffuse side lobes across the track, at its full height downwards, where it sets "
                 "the brightness of the first return; upwards the housing shields it; -10 to -25"),
    Number("vertical_sag", default=0.0, minimum=0, maximum=LARGEST_SAG, unit="wavelengths",
           text="depth by which the edges of a face curved across the track stand back; 0: flat; 0.5 to 1 make "
                "flat-topped beams"),
    File("pattern", default=None,
         text="CSV file with `angle_deg` (from the normal, forward) and `level_db`: measured one-way beam along the "
              "track with its side lobes; speckle takes the forward half for both sides; not with `beam_width_deg` "
              "or `shading`"),
    File("vertical_pattern", default=None,
         text="CSV file of the measured beam across the track, angles downwards; not with `vertical_beam_width_deg` "
              "or `vertical_sag`"),
    File("receive_pattern", default=None, otherwise="`pattern`",
         text="measured beam of the receive face along the track; not with a width of that face"),
    File("receive_vertical_pattern", default=None, otherwise="`vertical_pattern`",
         text="measured beam of the receive face across the track; not with a width of that face"),
)
RECEIVERS = (
    Number("back_db", default=PRESET, minimum=LOWEST_DB, maximum=0, unit="dB",
           text="front-to-back ratio: level at which a face receives the echoes of the other side's transmission; "
                "-20 to -45"),
    Number("crosstalk_db", default=PRESET, minimum=LOWEST_DB, maximum=0, unit="dB",
           text="electrical crosstalk from the other side's channel; -35 to -70"),
    Number("chirp_ms", default=PRESET, minimum=0, unit="ms",
           text="length of the transmitted pulse; compression lowers the noise by the ratio of this length to "
                "`pulse_ms`; 0: no compression"),
    Number("self_noise_db", default=PRESET, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 µPa²/Hz",
           otherwise="*preset*; none without `noise`",
           text="self-noise of each side's receiver, as the level of sound on its axis; 20 to 60"),
)


def read_faces(attributes: Attributes) -> tuple[BuiltFace, BuiltFace]:
    """Return the transmitting and the receiving face."""
    for measured, others in (("pattern", ("beam_width_deg", "shading")),
                             ("vertical_pattern", ("vertical_beam_width_deg", "vertical_sag")),
                             ("receive_pattern", ("receive_beam_width_deg", "receive_shading")),
                             ("receive_vertical_pattern", ("receive_vertical_beam_width_deg",))):
        doubled = attributes.given(*others)
        if getattr(attributes, measured) is not None and doubled:
            raise attributes.error(f"{measured} and {doubled[0]} are both given; a measured beam has its own width, "
                                   "leave one of them out.")
    floor, vertical_floor = power_of(attributes.sidelobe_db), power_of(attributes.vertical_sidelobe_db)
    faces, files = [], {}
    for prefix in ("", "receive_"):
        pattern, vertical = (_measured(attributes, prefix, name, files) for name in ("pattern", "vertical_pattern"))
        faces.append(BuiltFace(
            width=getattr(attributes, f"{prefix}beam_width_deg"),
            vertical_width=getattr(attributes, f"{prefix}vertical_beam_width_deg"),
            window=getattr(attributes, f"{prefix}shading"), sag=attributes.vertical_sag,
            floor=floor, vertical_floor=vertical_floor, pattern=pattern, vertical_pattern=vertical))
    try:
        for face in faces:
            face.aperture(1.0)
    except ValueError as error:
        raise attributes.error(error) from None
    return faces[0], faces[1]


def read_leakage(attributes: Attributes) -> float:
    """Return the share of the other side's power in a channel: through the back of the face, and through the wires."""
    return power_of(attributes.back_db) + power_of(attributes.crosstalk_db)


def _measured(attributes: Attributes, prefix: str, name: str, files: dict[str, MeasuredBeam]) -> MeasuredBeam | None:
    """The measured beam of a face: the receiving one's own, or the transmitting one's where nothing else is said.

    `files` keeps what was read.
    """
    path = getattr(attributes, prefix + name)
    width = f"{prefix}{'beam_width_deg' if name == 'pattern' else 'vertical_beam_width_deg'}"
    if path is None and prefix and not attributes.given(width):
        path = getattr(attributes, name)
    if path is None:
        return None
    try:
        if path not in files:
            files[path] = beam_levels.read(path)
        return files[path]
    except ValueError as error:
        raise attributes.error(error) from None
