"""Whatever is wrong with a command, its scene or its files: one clear sentence, exit code 2, nothing written.

Every line of the tables spoils one thing of a small scene and says what the sentence must hold: what was asked, what
was found, what to do or what is known. They run within the test's own process; `test_interruptions` starts real ones.
"""
import os
import re

import h5py
import numpy as np
import pytest
from small_scene import TEXT, spoilt
from synthetic_sidescan import sidescan

import mitsonar

HEADER = "time,x,y,z,roll,pitch,heading\n"
PINGS = '<integer name="pings" value="$pings"/>'
WATER = '<float name="sound_speed" value="1500"/>'
FILM = '<float name="range" value="$range"/>'
RAYS = '<integer name="rays" value="$rays"/>'
DEPTH = '<float name="depth" value="30"/>'
END = "</scene>"
END_OF_SHAPE = "</shape></scene>"
BITMAP = '<texture type="bitmap" name="mu_db"><string name="filename" value="{}"/></texture>'
MESH_ATTRIBUTE = '<texture type="mesh_attribute" name="mu_db"><string name="name" value="face_mud"/></texture>'


def whole(tag):
    """The text of an element of the scene, from its beginning to its end."""
    return re.search(rf" *<{tag}[ >].*?</{tag}>\n?", TEXT, re.S)[0]


def sensor(text):
    return (PINGS, PINGS + text)


def water(text):
    return (WATER, text)


def ball(material):
    return (END, '<shape type="sphere" id="ball"><point name="center" x="9" y="0" z="-20"/>' + material + END_OF_SHAPE)


SCENES = {
    # attributes
    "unknown attribute": ([sensor('<float name="altitud" value="3"/>')],
                          'scene.xml, line 7: sidescan "sonar": got the float 3.0 for the unknown attribute "altitud" '
                          '(did you mean "altitude"?). Known: altitude, back_db, beam_width_deg,'),
    "unknown attribute of the water": ([water('<float name="soundspeed" value="1"/>')], 'did you mean "sound_speed"?'),
    "unknown attribute of the film": ([(FILM, '<integer name="width" value="5"/>')], "Known: bins, range, range_min"),
    "unknown attribute of the integrator": ([(RAYS, '<integer name="deep" value="5"/>')],
                                            "Known: cell, ensonification, fans, first_pass, ground_seed, max"),
    "unknown attribute of the material": ([('"mu_db"', '"mu"')], 'lambert "sand": got the float -27.0'),
    "unknown attribute of the seabed": ([('"spacing"', '"spacin"')], 'did you mean "spacing"?'),
    "wrong type": ([(PINGS, '<string name="pings" value="many"/>')],
                   'pings is the string "many"; expected an integer at least 1'),
    "float where an integer belongs": ([(PINGS, '<float name="pings" value="5"/>')], "pings is the float 5.0"),
    "written twice": ([sensor('<integer name="pings" value="3"/>')], "attribute pings is written twice"),
    "no value": ([sensor('<float name="speed_knots"/>')], 'missing required attribute "value" in <float>'),
    "unknown preset": ([sensor('<string name="preset" value="towed_40khz"/>')],
                       '"auv_900khz", or the name of an instrument (did you mean "towed_400khz"?)'),
    "preset of another sonar": ([sensor('<string name="preset" value="multibeam_750khz"/>')],
                                'an instrument ("multibeam_750khz" is a preset of forward_looking).'),
    "integrator of light with rays": ([('"sonar_path"', '"path"')],
                                      'path: sonars need <integrator type="sonar_path">, which takes "rays"'),
    "film of light": ([('"sonar_film"', '"hdrfilm"')], 'hdrfilm: sonars need <film type="sonar_film">, which takes'),
    "seabed above the water": ([(DEPTH, DEPTH.replace("30", "-12"))],
                               "the seabed is 12.00 m above the sea surface; depths are positive down: write the"),
    "seabed above the sonar and the water": (
        [(DEPTH, DEPTH.replace("30", "-12")), sensor('<point name="start" x="0" y="0" z="-9"/>')],
        "depths are positive down"),
    "table without colons": ([water(WATER + '<spectrum name="absorption" value="0,1508; 3,1507"/>')],
                             'the table holds "0"; expected pairs with a colon, such as depth:speed in 0:1490.5'),
    "table in a foreign file": ([water(WATER + '<spectrum name="absorption" filename="scene.xml"/>')],
                                'the file "scene.xml", line 1, is not a table; expected two numbers a line'),
    "ping rate too high": ([sensor('<float name="ping_rate_hz" value="50"/>')], "use at most 12.500 Hz"),
    "frequency": ([sensor('<float name="frequency_khz" value="0"/>')], "expected a number [kHz] at least 0.001"),
    "beam without width": ([sensor('<float name="beam_width_deg" value="0"/>')], "at least 0.01 and at most 180"),
    "level beyond numbers": ([sensor('<float name="source_level_db" value="1e6"/>')], "at most 300"),
    "infinite level": ([sensor('<float name="noise_level_db" value="inf"/>')], "noise_level_db is the float inf"),
    "start and altitude": ([sensor('<point name="start" x="0" y="0" z="-9"/><float name="altitude" value="3"/>')],
                           "start and altitude are both given"),
    "pulse of too many bins": ([sensor('<float name="pulse_ms" value="1e5"/>')], "more than 10000 bins; take fewer"),
    "pulse of too few metres": ([sensor('<float name="pulse_ms" value="1e-5"/>')], "take longer bins, a longer pulse"),
    "range window": ([(FILM, FILM + '<float name="range_min" value="200"/>')], "not below range 60.0 m; lower it"),
    "bins and sample rate": ([(FILM, FILM + '<float name="sample_rate_khz" value="9"/>')], "give one of them"),
    "sample rate": ([('<integer name="bins" value="50"/>', '<float name="sample_rate_khz" value="1e9"/>')],
                    "makes 8e+10 bins of the range; lower it"),
    "share of the first pass": ([(RAYS, RAYS + '<float name="first_pass" value="2"/>')], "at most 0.9"),
    "material brighter than its law": ([('"-27"', '"0"')], "mu_db is the float 0.0; expected a number [dB] at most"),
    # materials
    "attribute that the mesh has not": ([('<float name="mu_db" value="-27"/>', MESH_ATTRIBUTE)],
                                        'a texture of "bed" reads the mesh attribute "face_mud", which this'),
    "attribute of a sphere": ([ball(f'<bsdf type="lambert">{MESH_ATTRIBUTE}</bsdf>')], 'a texture of "ball" reads the'),
    "mirror of Mitsuba's": ([ball('<bsdf type="conductor"/>')], "use rigid, soft or impedance for a smooth surface"),
    "smooth material within another": ([ball('<bsdf type="twosided"><bsdf type="rigid"/></bsdf>')],
                                       'the material of "ball" holds another, Rigid[], which must stand alone'),
    "bitmap without a file": ([('<float name="mu_db" value="-27"/>', '<texture type="bitmap" name="mu_db"/>')],
                              'scene.xml: the bitmap "mu_db" has no filename; write <string name="filename"'),
    "bitmap that is not there": ([('<float name="mu_db" value="-27"/>', BITMAP.format("no.png"))],
                                 'bitmap: cannot open "no.png": no such file or directory.'),
    "bitmap that is none": ([('<float name="mu_db" value="-27"/>', BITMAP.format("scene.xml"))],
                            "line 13: bitmap: the picture scene.xml is cut short, or no picture"),
    "mesh attribute without a name": ([('<float name="mu_db" value="-27"/>',
                                        '<texture type="mesh_attribute" name="mu_db"/>')], "name is missing."),
    "something nested": ([('<float name="mu_db" value="-27"/>', '<shape type="cube"/>')],
                         "lambert: something is nested that a bsdf of this type does not take"),
    "attribute where none is known": ([ball('<bsdf type="soft"><float name="mu_db" value="-9"/></bsdf>')],
                                      'for the unknown attribute "mu_db". Known: none.'),
    "sphere without extent": ([ball('<float name="radius" value="0"/><bsdf type="rigid"/>')],
                              'the shape "ball" has no extent; give it a radius'),
    "ball inside out": ([ball('<float name="radius" value="-1"/><bsdf type="rigid"/>')],
                        "sphere: radius is -1; expected a number [m] above 0"),
    "sediment within another": ([ball('<bsdf type="mask"><bsdf type="sediment"/></bsdf>')], "Sediment[medium sand]"),
    # water
    "volume above the surface": ([water(WATER + '<string name="volume_strength_db" value="-20:-70, -5:-80"/>')],
                                 "volume_strength_db has the depth -20 m; depths are positive down."),
    "layer above the surface": ([water(WATER + '<string name="layers" value="kelp -12 -5 -55"/>')],
                                "layer kelp begins at -12 m; depths are positive down."),
    "layer without numbers": ([water(WATER + '<string name="layers" value="kelp"/>')], 'is not "name top bottom dB"'),
    "volume as loud as a wall": ([water(WATER + '<float name="volume_strength_db" value="20"/>')],
                                 "strength is 20 dB re 1/m; it must lie in -200..0 dB"),
    "profile against z": ([water('<spectrum name="profile" value="-20:1490, -5:1500"/>')],
                          "profile has the depth -20 m; depths are positive down."),
    "NaN in the profile": ([water('<spectrum name="profile" value="0:1500, 10:nan"/>')],
                           'line 10: seawater "water": profile is a spectrum; expected a table of finite numbers'),
    "NaN in a written profile": ([water('<string name="profile" value="0:1500, 10:nan"/>')], "of finite numbers"),
    "decreasing depths": ([water('<spectrum name="profile" value="0:1500, 10:1490, 5:1480"/>')], "must increase"),
    "decreasing depths in a string": ([water('<string name="profile" value="0:1500, 10:1490, 5:1480"/>')],
                                      "depth[2] = 5 m follows depth[1] = 10 m; sort the nodes"),
    "speed out of range": ([water('<spectrum name="profile" value="0:1500, 10:15000"/>')],
                           "sound_speed[1] = 15000 m/s at 10 m is outside 300..3000 m/s; check columns and units"),
    "word in the profile": ([water('<spectrum name="profile" value="0:1500, ten:1490"/>')], 'holds "ten:1490"'),
    "constant speed out of range": ([('"1500"', '"0"')], "expected a number [m/s] above 300.0 and below 3000.0"),
    "two kinds of profile": ([water(WATER + '<spectrum name="profile" value="0:1500, 9:1490"/>')], "give one of them"),
    "hot water": ([water(WATER + '<float name="temperature" value="90"/>')], "temperature is 90 deg C"),
    # what belongs into a scene
    "no sensor": ([(whole("sensor"), "")], 'the scene has no sensor; write <sensor type="sidescan">'),
    "camera": ([(whole("sensor"), '<sensor type="perspective"/>')], "needs a sonar, such as <sensor"),
    "no integrator": ([(whole("integrator"), "")], 'write <integrator type="sonar_path"/>'),
    "integrator of light": ([(whole("integrator"), '<integrator type="path"/>')], "cannot render sound"),
    "no water": ([(whole("medium"), "")], 'hold the water it works in: <medium type="seawater"/>'),
    "other medium": ([(whole("medium"), '<medium type="homogeneous"/>')], '<medium type="seawater"/>'),
    "no film": ([(whole("film"), "")], 'hold the record it makes: <film type="sonar_film"/>'),
    "film of a camera": ([(whole("film"), '<film type="hdrfilm"/>')], '<film type="sonar_film"/>'),
    "no shape": ([(whole("shape"), "")], "the scene has no shape to hit; add a seabed"),
    "unknown plugin": ([('"sidescan"', '"sidscan"')], 'line 7: there is no plugin of type "sidscan"'),
    "unknown element": ([(END, '<shpe type="cube"/></scene>')], "unsupported XML element: <shpe>"),
    "reference to nothing": ([('<ref id="sand"/>', '<ref id="snad"/>')], 'no object has the id "snad"'),
    "parameter without a value": ([('<default name="rays" value="2000"/>', "")], 'give one, or a <default name="rays"'),
    "mesh that is not there": ([(END, '<shape type="ply"><string name="filename" value="no.ply"/></shape></scene>')],
                               'ply: Error while loading PLY file "no.ply": file not found'),
    "mesh that is none": ([(END, '<shape type="ply"><string name="filename" value="scene.xml"/></shape></scene>')],
                          "ply: the mesh scene.xml is damaged, or no PLY file of triangles: it does not begin"),
    "scene without version": ([(' version="3.0.0"', "")], 'must begin with <scene version="3.0.0">'),
    "broken XML": ([("</sensor>", "")], "the XML is broken"),
    "XML that only Mitsuba reads": ([(END, "<!-- a -- b --></scene>")], "the XML is broken"),
    # the track
    "track longer than the seabed": ([('<default name="pings" value="2"/>', '<default name="pings" value="9000"/>')],
                                     "track outside the bathymetry: 9000 pings cover"),
    "start outside": ([sensor('<point name="start" x="0" y="500" z="-9"/>')],
                      "ping 0 is at x = 0.0 m, y = 500.0 m, where no seabed lies below (the scene spans x -100.0.."),
    "way out of the scene": ([sensor('<point name="start" x="0" y="99.9" z="-9"/>')],
                             "ping 1 is at x = 0.0 m, y = 100.1 m"),
    "below the seabed": ([sensor('<point name="start" x="0" y="0" z="-31"/>')],
                         "sonar below the seabed: at ping 0 it is 31.00 m deep, the seabed 30.00 m; raise the track"),
    "above the surface": ([sensor('<point name="start" x="0" y="0" z="1"/>')],
                          "ping 0: the sonar is 1.00 m above the sea surface"),
    "altitude above the surface": ([sensor('<float name="altitude" value="31"/>')],
                                   "above the sea surface: the seabed is 30.0 m deep; lower the altitude"),
    "negative altitude": ([sensor('<float name="altitude" value="-5"/>')], "altitude is the float -5.0"),
    "seabed in the air": ([(DEPTH, DEPTH.replace("30", "-30"))], "depths are positive down"),
    "record beyond the memory": ([sensor('<float name="speed_knots" value="0"/>'), ("$pings", "300000"),
                                  ('value="50"', 'value="1000000"'), ("$range", "2000")],
                                 "of 300000 pings with 2 x 1000000 bins takes 61800 GB, more than"),
}

FILES = {
    # a file of the scene: attributes of the sensor, of the water, of a bathymetry; then the file's name and content
    "cast with NaN": ("cast", "c.csv", "depth,speed\n0,1500\n10,nan\n", "line 3: sound speed is nan"),
    "cast going up": ("cast", "c.csv", "depth,speed\n0,1500\n10,1490\n5,1490\n", "line 4: depth 5 m follows 10 m"),
    "cast too fast": ("cast", "c.csv", "depth,speed\n0,1500\n10,14900\n", "14900 m/s is outside 300..3000 m/s"),
    "empty cast": ("cast", "c.csv", "", "it is empty"),
    "cast without samples": ("cast", "c.csv", "depth,speed\n", "it holds no samples"),
    "cast that is none": ("cast", "c.csv", b"\x00\xff\xfe" * 50, "none of the formats known"),
    "missing cast": ("cast", None, "", 'cast names the file "missing.csv", which is not there'),
    "track outside": ("track", "t.csv", HEADER + "0,0,0,-9,0,0,0\n9,0,900,-9,0,0,0\n", "track outside the bathymetry"),
    "track far away": ("track", "t.csv", HEADER + "0,4e5,5e6,-9,0,0,0\n9,4e5,5e6,-9,0,0,0\n", "at x = 400000 m, "),
    "track below the seabed": ("track", "t.csv", HEADER + "0,0,0,-99,0,0,0\n", "sonar below the seabed: at ping 0"),
    "track in the air": ("track", "t.csv", HEADER + "0,0,0,9,0,0,0\n", "line 2: z = 9 m is above the sea surface"),
    "track with a word": ("track", "t.csv", HEADER + "0,0,here,-9,0,0,0\n", "line 2: y is 'here'"),
    "track going back": ("track", "t.csv", HEADER + "1,0,0,-9,0,0,0\n0,1,0,-9,0,0,0\n", "time 0 is not later than 1"),
    "track without records": ("track", "t.csv", HEADER, "a header but no records"),
    "empty track": ("track", "t.csv", "", "no header and no records"),
    "missing track": ("track", None, "", 'track names the file "missing.csv", which is not there'),
    "BAG that is not a BAG": ("filename", "area.bag", b"\x89HDF\r\n\x1a\nrubbish" * 20, "the HDF5 file is damaged"),
    "text for a BAG": ("filename", "area.bag", "hello", "not a bathymetry grid that GDAL can read"),
    "strengths without a header": ("strengths", "b.csv", "5,-38\n45,-24\n", "line 1: numbers where the names of"),
    "strengths with a word": ("strengths", "b.csv", "grazing,dB\n5,high\n", "line 2: db is 'high', which is no"),
    "strengths of losses": ("strengths", "b.csv", "grazing,dB\n5,38\n45,24\n", "more comes back than arrives"),
    "strengths twice": ("strengths", "b.csv", "grazing,9 kHz,9 kHz\n5,-3,-4\n", "above 0, and each be there once"),
    "strengths that are none": ("strengths", "b.csv", b"\x00\xff\xfe" * 50, "it is not a text file; give a CSV file"),
    "missing strengths": ("strengths", None, "", "which is not there; it is looked for beside the scene"),
    "missing bathymetry": ("filename", None, "", 'filename names the file "missing.csv", which is not there'),
}

RENDER = ["render", "scene.xml", "-o", "o.exr"]
COMMANDS = {
    "no command": ([], "the following arguments are required: COMMAND; see mitsonar --help"),
    "unknown command": (["rendr"], "choose from"),
    "unknown option": ([*RENDER, "--foo"], "unrecognized arguments: --foo"),
    "no output": (["render", "scene.xml"], "required: -o/--output; see mitsonar render --help"),
    "missing scene": (["render", "no.xml", "-o", "o.exr"],
                      "scene no.xml does not exist; give the path of a Mitsuba XML file or one of: divers, "),
    "missing scene by name": (["render", "no", "-o", "o.exr"], "sidescan_survey, sidescan_targets"),
    "folder for a scene": (["render", ".", "-o", "o.exr"], "is a folder; give the path of a Mitsuba XML file"),
    "unknown parameter": ([*RENDER, "-D", "ping=5"],
                          "has no parameter ping (did you mean \"pings\"?); parameters are its <default name=...> "
                          "entries. Known: pings, range, rays, speckle."),
    "parameter without -D": ([*RENDER, "pings=3"], "a parameter has -D before it: -D pings=3"),
    "parameter without -D and output": (["render", "scene.xml", "pings=3"], "-D before it: -D pings=3"),
    "parameter without value": ([*RENDER, "-D", "pings"], "takes KEY=VALUE, got 'pings'"),
    "parameter without name": ([*RENDER, "-D", "=5"], "takes KEY=VALUE, got '=5'"),
    "parameter empty": ([*RENDER, "-D", "pings="], 'line 8: "" is not an integer value'),
    "parameter twice": ([*RENDER, "-D", "pings=2", "-D", "pings=3"], "given twice, as 2 and 3"),
    "parameter of Mitsuba's": ([*RENDER, "-D", "optimize=3"], "cannot be called optimize"),
    "no number": ([*RENDER, "-D", "rays=many"], '"many" is not an integer value'),
    "no whole number": ([*RENDER, "-D", "rays=1.5"], '"1.5" is not an integer value'),
    "neither true nor false": ([*RENDER, "-D", "speckle=maybe"], "not a boolean value"),
    "zero rays": ([*RENDER, "-D", "rays=0"], "rays is the integer 0; expected an integer"),
    "negative rays": ([*RENDER, "-D", "rays=-1"], "rays is the integer -1"),
    "endless rays": ([*RENDER, "-D", f"rays={10 ** 30}"], "too large for an integer"),
    "rays for a week": ([*RENDER, "-D", "rays=1000000000"], "at least 1 and at most 50000000"),
    "digits of rays": ([*RENDER, "-D", f"rays={'9' * 10_000}"], f'9...{"9" * 29}" is too large for an integer'),
    "digits of a seed": ([*RENDER, "--seed", "9" * 10_000], "9...9"),
    "digits of a name": ([*RENDER, "-D", f"{'q' * 10_000}=1"], "has no parameter qqq"),
    "range 0": ([*RENDER, "-D", "range=0"], "expected a number [m] above 0 and at most"),
    "no range": ([*RENDER, "-D", "range=nan"], "range is the float nan"),
    "range of an ocean": ([*RENDER, "-D", "range=1e9"], "at most 100000"),
    "no pings": ([*RENDER, "-D", "pings=0"], "pings is the integer 0"),
    "seed a word": ([*RENDER, "--seed", "abc"], "--seed: 'abc' is not a whole number"),
    "seed negative": ([*RENDER, "--seed", "-3"], "seed is -3; give a whole number from 0 to"),
    "seed huge": ([*RENDER, "--seed", str(1 << 32)], "from 0 to 4294967295"),
    "no thread": ([*RENDER, "--threads", "0"], "--threads is 0; give 1 to 1024"),
    "threads without end": ([*RENDER, "--threads", "100000"], "give 1 to 1024"),
    "folder of the output missing": (["render", "scene.xml", "-o", "no/o.exr"], "/no does not exist; make it first"),
    "output a folder": (["render", "scene.xml", "-o", "."], "it is a folder; give a file name inside it"),
    "output within a file": (["render", "scene.xml", "-o", "scene.xml/o.exr"], "is a file, not a folder"),
    "output without a name": (["render", "scene.xml", "-o", ""], "it names no file"),
    "output a device": (["render", "scene.xml", "-o", "/dev/null"], "it is a device or a pipe"),
    "output a picture": (["render", "scene.xml", "-o", "o.png"], "must end in .exr; pictures are made by --preview"),
    "output not UTF-8": (["render", "scene.xml", "-o", "\udcff.exr"], "not UTF-8; give another name"),
    "preview of no known kind": ([*RENDER, "--preview", "p.xyz"],
                                 "must end in .png, .pdf or .svg"),
    "gain without a preview": ([*RENDER, "--tvg", "counts"], "--tvg counts is for a preview"),
    "folder of the preview missing": ([*RENDER, "--preview", "no/p.png"], "make it first"),
    "plot of nothing": (["plot", "no.exr"], "cannot read no.exr: there is no such file"),
    "plot of a folder": (["plot", "."], "it is a folder"),
    "plot of a scene": (["plot", "scene.xml"], "it is no EXR, no netCDF, and no line of a sounder"),
    "plot with a word for a ping": (["plot", "no.exr", "--ping", "x"], "--ping: 'x' is not a whole number"),
    "unknown gain": (["plot", "no.exr", "--tvg", "x"], "choose from"),
    "demo into a picture": (["demo", "-o", "demo.png"], "must end in .exr; pictures are made by --preview"),
    "demo of something": (["demo", "x"], "unrecognized arguments: x"),
}


def test_a_default_that_no_attribute_takes(folder, refusal):
    (folder / "scene.xml").write_text(spoilt(('value="$pings"', 'value="2"')), encoding="utf-8")
    said = refusal(*RENDER, "-D", "pings=3")
    assert 'pings has a <default> there, but no attribute uses it' in said and 'write value="$pings"' in said


@pytest.mark.parametrize("edits, words", SCENES.values(), ids=SCENES)
def test_spoilt_scenes(folder, refusal, edits, words):
    (folder / "scene.xml").write_text(spoilt(*edits), encoding="utf-8")
    assert words in refusal(*RENDER)


@pytest.mark.parametrize("attribute, name, content, words", FILES.values(), ids=FILES)
def test_spoilt_files(folder, refusal, attribute, name, content, words):
    if name:
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    file = f'<string name="{attribute}" value="{name or "missing.csv"}"/>'
    edit = {"strengths": ball(f'<bsdf type="empirical">{file.replace("strengths", "filename", 1)}</bsdf>'),
            "cast": water(file), "track": (PINGS, file),
            "filename": (END, f'<shape type="bathymetry">{file}</shape></scene>')}[attribute]
    (folder / "scene.xml").write_text(spoilt(edit), encoding="utf-8")
    assert words in refusal(*RENDER)


@pytest.mark.parametrize("arguments, words", [
    (["focus", "a.exr", "-o", "b.exr"], "a.exr is an OpenEXR image; focus needs a scene (.xml), or raw echoes"),
    (["render", "a.exr", "-o", "b.exr"], "a.exr is an OpenEXR image, not a scene; give a Mitsuba XML file"),
    (["describe", "a.exr"], "a.exr is an OpenEXR image, not a scene"),
    (["grid", "a.exr", "-o", "b.tif"], "cannot read a.exr: it is an OpenEXR image, not a line of soundings"),
    (["labels", "a.exr", "-o", "b"], "Choose at least one output: --coco, --yolo or --masks.")])
def test_files_of_another_kind_are_called_what_they_are(folder, refusal, arguments, words):
    mitsonar.write(sidescan(2, 3), folder / "a.exr")
    assert words in refusal(*arguments)


@pytest.mark.parametrize("arguments, words", COMMANDS.values(), ids=COMMANDS)
def test_spoilt_commands(refusal, arguments, words):
    assert words in refusal(*arguments)


@pytest.mark.parametrize("content, words", [
    (b"", "line 1: the XML is broken"), (b"text", "the XML is broken"), (b"\x00\xff" * 99, "the XML is broken"),
    (b"<html></html>", "the root element is <html>; expected <scene"), (b'<scene version="new"/>', "invalid version"),
    (b'<bsdf version="3.0.0" type="lambert"/>', "holds no scene but a single object; put it into <scene"),
], ids=["empty", "text", "binary", "html", "version", "object"])
def test_scenes_that_are_none(folder, refusal, content, words):
    (folder / "scene.xml").write_bytes(content)
    said = refusal(*RENDER)
    assert said.startswith("mitsonar: scene.xml") and words in said


def test_texture_on_a_mesh_without_texture_coordinates(folder, refusal):
    (folder / "flat.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 -20\n9 0 -20\n0 9 -20\n3 0 1 2\n")
    (folder / "scene.xml").write_text(spoilt((END, """<shape type="ply" id="flat">
        <string name="filename" value="flat.ply"/>
        <bsdf type="lambert"><texture type="checkerboard" name="mu_db"/></bsdf></shape></scene>""")))
    assert '"flat" has a texture but no texture coordinates; write them into the mesh' in refusal(*RENDER)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may read every file")
@pytest.mark.parametrize("name", ["scene.xml", "cast.csv"])
def test_files_that_may_not_be_read(folder, refusal, name):
    (folder / "scene.xml").write_text(spoilt(water('<string name="cast" value="cast.csv"/>')), encoding="utf-8")
    (folder / "cast.csv").write_text("depth,speed\n0,1500\n")
    (folder / name).chmod(0)
    said = refusal(*RENDER)
    assert f"{name}" in said and "read" in said and "change its permissions" in said


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write everywhere")
def test_folder_that_may_not_be_written(folder, refusal):
    (folder / "locked").mkdir(mode=0o500)
    assert "no permission to write in" in refusal("render", "scene.xml", "-o", "locked/o.exr")


def test_georeferenced_track_needs_an_origin(folder, refusal):
    (folder / "t.csv").write_text(HEADER + "0,0,0,-9,0,0,0\n9,1,0,-9,0,0,0\n")
    text = spoilt((PINGS, '<string name="track" value="t.csv"/><boolean name="georeferenced" value="true"/>'))
    (folder / "scene.xml").write_text(text)
    assert "no bathymetry of the scene has a geographic origin" in refusal(*RENDER)


def test_plot_of_a_foreign_exr(folder, refusal):
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"Y": np.ones((4, 4), np.float32)}).write(str(folder / "photo.exr"))
    assert "no attribute mitsonar:config; give an EXR file that mitsonar wrote" in refusal("plot", "photo.exr")


def test_plot_refuses_what_it_does_not_know(folder, refusal):
    from mitsonar.cli import main as cli

    assert cli.main(["render", "scene.xml", "-o", "o.exr"]) == 0
    assert "there is no plot 'fal'; choose one of waterfall, ping, mean" in refusal("plot", "o.exr", "--what", "fal")
    assert "there is no ping 99; there are 2" in refusal("plot", "o.exr", "--what", "ping", "--ping", "99")
    assert "must end in .png, .pdf or .svg" in refusal("plot", "o.exr", "-o", "p.xyz")
    assert "make it first" in refusal("plot", "o.exr", "-o", "no/p.png")


def test_plot_of_a_file_without_variables(folder, refusal):
    with h5py.File(folder / "empty.nc", "w") as file:
        file.attrs["title"] = "nothing"
    assert "needs the variable 'level'; this dataset has none." in refusal("plot", "empty.nc")
