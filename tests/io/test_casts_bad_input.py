"""Whatever is wrong with the file of a cast: one sentence that says what; and any damage ends in a cast or in that."""
import cast_samples
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from mitsonar.io import casts

AML, KONGSBERG, HYPACK = cast_samples.AML, cast_samples.KONGSBERG, cast_samples.HYPACK
SEABIRD, VALEPORT, TABLE = cast_samples.SEABIRD, cast_samples.VALEPORT, cast_samples.TABLE
NONE = "is none of the formats known"

SPOILT = {
    # the file as a whole
    "empty": ("", "it is empty, which " + NONE),
    "only blanks": (" \n\t\n\n", "it is empty, which " + NONE),
    "binary": (bytes(range(256)) * 9, "it is binary, which " + NONE),
    "UTF-16 without its mark": (TABLE.encode("utf-16-le"), "it is binary, which " + NONE),
    "UTF-16 that was cut": (TABLE.encode("utf-16")[:-1], "it is binary, which " + NONE),
    "prose": ("The water was cold.\nWe saw fish.\n", "its content " + NONE),
    "a picture in text": ("P3\n2 2\n255\n", "its content " + NONE),
    "no format at all": ("{\"depth\": [0, 1], \"speed\": [1500, 1490]}", NONE),
    # AML
    "AML cut before its data": (AML[:300], "no section [data]; the file was cut"),
    "AML without samples": (AML[:AML.index("2021-04-10,")], "it holds no samples"),
    "AML with a column too many": (AML.replace(",1456", ",1,1456"), "its 10 columns have no titles, and the settings"),
    "AML with battery and temperature exchanged": (AML.replace("CT.X C SN 100001 01/02/21 T", "T.X SN 1 C.X"),
                                                   "salinity is not that of its conductivity"),
    "AML in feet": (cast_samples.AML_TITLES.replace("Depth (m)", "Depth (ft)"), "depth is given in 'ft'; convert"),
    "AML with depth twice": (cast_samples.AML_TITLES.replace("Calc. SV (m/s)", "Depth (m)"), "names depth twice"),
    "AML of a thermometer": (cast_samples.AML_TITLES.replace("SV", "XX"), "it must name depth and sound_speed"),
    "AML with a word": (AML.replace("0003.00", "deep"), "line 29: pressure is deep, not a finite number"),
    "AML going up only": (AML[:AML.index("2021-04-10,")] + "\n".join(AML.splitlines()[-3:-6:-1]), "no way down"),
    # Kongsberg
    "Kongsberg that was cut": (KONGSBERG[:-14], "its header counts 3 samples, but 2 follow; the file was cut"),
    "Kongsberg header only": (KONGSBERG.splitlines()[0].replace("P 0003 ", ""), "it holds no samples"),
    "Kongsberg without speed": (KONGSBERG.replace("2.00 1490.00", "2.00"), "line 3: sound speed is missing"),
    "Kongsberg in kilometres per second": (KONGSBERG.replace("1490.00", "1.49"), "1.49 m/s is outside 300..3000 m/s"),
    "Kongsberg of the Moon": (KONGSBERG.replace("9.00 14", "13000.00 14"), "depth 13000 m is outside -20..12000 m"),
    # Sea-Bird
    "Sea-Bird cut in its header": (SEABIRD[:500], "no line *END*, after which the samples come; the file was cut"),
    "Sea-Bird without samples": (SEABIRD[:SEABIRD.index("*END*")] + "*END*\n", "it holds no samples"),
    "Sea-Bird without pressure": (SEABIRD.replace("prdM: Pressure", "ptempC: Pressure Temperature"),
                                  "needs pressure or depth, and sound velocity or"),
    "Sea-Bird in feet": (SEABIRD.replace("prdM: Pressure, Strain Gauge [db]", "depSF: Depth [salt water, ft]"),
                         "in metric units"),
    "Sea-Bird all flagged": (SEABIRD.replace("0.0000e+00", "-9.990e-29"), "all 15 samples are marked bad"),
    "Sea-Bird with a row too short": (SEABIRD[:-13], "flag is missing, not a finite number"),
    "Sea-Bird with NaN": (SEABIRD.replace("1488.17", "-nan"), "sound speed is -nan, not a finite number"),
    # HYPACK
    "HYPACK header only": (HYPACK.splitlines()[0], "it holds no samples"),
    "HYPACK in feet per second": (HYPACK.replace("1490.50", "4890.09"), "4890.09 m/s is outside 300..3000 m/s"),
    "HYPACK with exchanged columns": (HYPACK.replace("9.0 1486.00", "1486.00 9.0"), "sound speed 9 m/s is outside"),
    # Valeport
    "Valeport in air": (VALEPORT.replace("\t14", "\t00"), "all 6 samples were taken in air"),
    "Valeport in psi": (VALEPORT.replace("units: dBar", "units: psi"), "its pressure is in 'psi'; set the instrument"),
    "Valeport cut in its header": (VALEPORT[:150], "no line says 'Pressure units:'"),
    "Valeport without a column": (VALEPORT.replace("\t1489.540", ""), "line 12: sound speed is missing"),
    # tables
    "table in fathoms": (TABLE.replace("depth (m)", "depth (fathoms)"), "depth is given in 'fathoms'; convert it to m"),
    "table with a column twice": (TABLE.replace("temperature", "depth"), "given in 'deg c'; convert it to m"),
    "table with two depths": (TABLE.replace("temperature (deg C)", "z"), "names depth twice; keep one"),
    "table of a conductivity without its unit": (cast_samples.CTD_TABLE.replace(" (mS/cm)", ""),
                                                 "conductivity is given without its unit; convert it to mS/cm"),
    "table with a huge field": (TABLE.replace("1490.5", "7" * 9000), "is 777777777777777777777777777777..., not a"),
    "table with underscores": (TABLE.replace("1490.5", "1_490.5"), "sound speed is 1_490.5, not a finite number"),
    "table with salinity of brine": (cast_samples.CTD_TABLE.replace("36,8", "136,8"), "salinity is 1"),
}


@pytest.fixture(scope="module")
def spoilt(tmp_path_factory):
    """Read a cast of these bytes or this text."""
    path = tmp_path_factory.mktemp("casts") / "cast.any"

    def read(content, **choices):
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return casts.read(path, **choices)

    return read


@pytest.mark.parametrize("content, words", SPOILT.values(), ids=SPOILT)
def test_faults_are_told_in_one_sentence(spoilt, content, words):
    with pytest.raises(ValueError) as error:
        spoilt(content)
    said = str(error.value)
    assert said.startswith("cannot read the cast ") and words in said and "\n" not in said and len(said) < 600


def test_files_larger_than_a_cast_are_refused_unread(tmp_path):
    path = tmp_path / "huge.cnv"
    with path.open("wb") as file:
        file.truncate(300 * 2**20)
    with pytest.raises(ValueError, match="it has 300 MiB, and no cast has more than 32"):
        casts.read(path)


def test_lines_without_end_or_number_are_refused(spoilt):
    with pytest.raises(ValueError, match="line 2 has 20000000 characters"):
        spoilt(b"0 1500\n" + b"1 " * 10_000_000)
    with pytest.raises(ValueError, match="it has 3000001 lines, and no cast has more than 1000000"):
        spoilt(b"0 1500\n" + b"\n" * 3_000_000)


def damaged(content):
    """Damage of a text: lines dropped, doubled, swapped or cut, characters replaced, bytes put in."""
    place = st.floats(0, 1, exclude_max=True)
    strange = st.sampled_from(["", "-", ".", "e9", "nan", "inf", "0", "9" * 40, ",", ";", "\t", "\r", "#", "[", "*END*",
                               "\u00e9", "\x00", "\x85", ":", "_", " " * 300, "1e308", "=", "%", ")"])
    change = st.one_of(st.tuples(st.sampled_from(["drop", "double", "swap", "cut"]), place, place),
                       st.tuples(st.sampled_from(["replace", "insert"]), place, strange))

    def apply(changes):
        text = content
        for kind, where, what in changes:
            lines, at = text.split("\n"), int(where * len(text))
            k = int(where * len(lines))
            if kind in ("replace", "insert"):
                text = text[:at] + what + text[at + (kind == "replace"):]
                continue
            if kind == "cut":
                text = text[:at]
                continue
            other = int(what * len(lines))
            if kind == "swap":
                lines[k], lines[other] = lines[other], lines[k]
            else:
                lines[k:k + 1] = [] if kind == "drop" else [lines[k]] * 2
            text = "\n".join(lines)
        return text

    return st.lists(change, min_size=1, max_size=4).map(apply)


@pytest.mark.parametrize("name", cast_samples.SAMPLES)
def test_damage_gives_a_cast_or_one_sentence(spoilt, name):
    choices = st.fixed_dictionaries({"sound_speed": st.sampled_from(casts.SOUND_SPEEDS),
                                     "extension": st.sampled_from(casts.EXTENSIONS)})

    @settings(derandomize=True, database=None, deadline=10_000, max_examples=200)
    @given(st.one_of(*map(damaged, cast_samples.SAMPLES[name])), st.sampled_from(["utf-8", "cp1252", "utf-16"]),
           choices)
    def attempt(content, encoding, choices):
        try:
            cast = spoilt(content.encode(encoding, errors="replace"), **choices)
        except ValueError as error:
            assert str(error).startswith("cannot read the cast ") and "\n" not in str(error)
        else:
            assert isinstance(cast, casts.Cast)
            for column in (cast.temperature, cast.salinity):
                assert column is None or (column.shape == cast.profile.depth.shape and np.isfinite(column).all())

    attempt()
