"""What a plugin's attribute reader accepts and refuses, and how load errors read once `plain` has shortened them.

A probe shape reads one attribute of every kind; scenes are a few lines of XML. Exact, no tolerance.
"""
import numpy as np
import pytest

import mitsonar  # noqa: F401  sets up LLVM before Dr.Jit is loaded

mi = pytest.importorskip("mitsuba")

SCENE = '<scene version="3.0.0">\n<shape type="probe" id="bed">\n%s\n</shape></scene>'
PRESETS = {"coarse": {"step": 4.0, "turn_deg": 180.0}, "fine": {"step": 0.25, "turn_deg": 90.0}}


def declared():
    """One attribute of every kind."""
    from mitsonar.plugins import attributes as a

    return (
        a.Integer("rays", default=256, minimum=1, maximum=4000, text="count"),
        a.Number("spacing", default=0.5, unit="m", above=0, below=10, text="distance"),
        a.Angle("heading_deg", default=90, minimum=0, text="direction"),
        a.Boolean("flat", default=True, text="shape"),
        a.Choice("vertical", default="auto", choices=("auto", "depth", "elevation"), text="sign"),
        a.Text("name", default=None, text="anything"),
        a.File("filename", default=None, text="source"),
        a.Files("meshes", default=None, text="sources"),
        a.TextOrFile("classes", default=None, sign=":", text="what codes mean"),
        a.Point("centre", default=None, text="place"),
        a.Transform("to_world", text="turns it"),
        a.Numbers("crop", default=None, count=4, unit="m", text="part"),
        a.Range("burial", default=(0.25,), minimum=0, maximum=1, text="share"),
        a.Table("profile", default=None, text="of depth"),
        a.NumberOrTable("strength", default=None, unit="dB", text="of depth, or one for all"),
        a.NumberOrTexture("mu", default=None, maximum=1, text="of places"),
        a.Choice("preset", default="fine", choices=tuple(PRESETS), text="where defaults come from"),
        a.Number("step", default=a.FromTable(table=PRESETS, by="preset"), unit="m", text="of the preset"),
        a.Angle("turn_deg", default=a.FromTable(table=PRESETS, by="preset"), text="of the preset"),
        a.Angle("return_deg", default=a.SameAs("turn_deg"), text="the way back"),
        a.Choice("fans", default="centre", choices=("centre", "some"), text="from where"),
        a.Integer("fan_count", default=3, only=("fans", ("some",)), text="how many"),
        a.Nested("bsdf", default=None, text="material"),
    )


@pytest.fixture(scope="module")
def read():
    """Load XML attributes into a probe shape and give what its readers made of them."""
    mi.set_variant("llvm_ad_mono")
    from mitsonar.plugins.attributes import Attributes

    class Probe(mi.Mesh):
        def __init__(self, props):
            self.read = Attributes(props, declared())
            self.given = self.read.given("rays", "spacing")
            super().__init__("probe", 3, 1, props=props)

        def to_string(self):
            return "Probe[]"

    mi.register_shape("probe", Probe)

    def load(attributes, **parameters):
        return mi.load_string(SCENE % attributes, optimize=False, **parameters).shapes()[0]
    return load


@pytest.fixture(scope="module")
def sentence(read):
    """Load XML that must fail and give the sentence `plain` makes of the exception."""
    from mitsonar.scene.errors import plain

    def fail(attributes, scene=SCENE, **parameters):
        with pytest.raises(RuntimeError) as caught:
            mi.load_string(scene % attributes, optimize=False, **parameters)
        said = plain(caught.value)
        assert "\n" not in said and ".cpp" not in said
        return said
    return fail


def test_defaults(read):
    values = read("").read
    assert (values.rays, values.spacing, values.flat, values.vertical) == (256, 0.5, True, "auto")
    assert values.heading_deg == pytest.approx(np.pi / 2)
    assert (values.name, values.filename, values.centre, values.crop, values.profile) == (None,) * 5
    assert np.array_equal(values.to_world, np.eye(4))


def test_values_as_written(read, tmp_path):
    (tmp_path / "a b.txt").write_text("x")
    shape = read(f'''<integer name="rays" value="12"/> <integer name="spacing" value="2"/>
        <float name="heading_deg" value="180"/> <boolean name="flat" value="false"/>
        <string name="vertical" value="depth"/> <string name="name" value=""/>
        <string name="filename" value="{tmp_path / "a b.txt"}"/> <point name="centre" value="1, 2, 3"/>
        <transform name="to_world"><translate x="5" z="-20"/></transform>
        <string name="crop" value="1, 2 3e2,-4"/> <spectrum name="profile" value="0:1490.5, 10:1485"/>
        <bsdf type="diffuse"/> <boolean name="flip_normals" value="true"/>''')
    values = shape.read
    assert shape.given == ["rays", "spacing"] and isinstance(values.bsdf, mi.BSDF)
    assert (values.rays, values.spacing, values.flat, values.vertical, values.name) == (12, 2.0, False, "depth", "")
    assert isinstance(values.spacing, float)
    assert values.heading_deg == pytest.approx(np.pi)
    assert values.filename == str(tmp_path / "a b.txt")
    assert values.centre.dtype == np.float64 and values.centre.tolist() == [1, 2, 3]
    assert values.to_world.dtype == np.float64 and values.to_world[:3, 3].tolist() == [5, 0, -20]
    assert values.crop.tolist() == [1, 2, 300, -4]
    assert [column.tolist() for column in values.profile] == [[0, 10], [1490.5, 1485]]


def test_empty_strings_stand_for_not_given(read):
    values = read('<string name="filename" value=""/><string name="crop" value=" "/>').read
    assert values.filename is None and values.crop is None


def test_table_from_a_string(read):
    depth, speed = read('<string name="profile" value="0:1490.5,10:1485, 50 : 1.48e3"/>').read.profile
    assert depth.tolist() == [0, 10, 50] and speed.tolist() == [1490.5, 1485, 1480]


@pytest.mark.parametrize("written, said", [
    ('<string name="rays" value="many"/>',
     'rays is the string "many"; expected an integer at least 1 and at most 4000'),
    ('<float name="rays" value="4"/>', "rays is the float 4.0; expected an integer"),
    ('<integer name="rays" value="0"/>', "rays is the integer 0; expected an integer at least 1"),
    ('<boolean name="rays" value="true"/>', "rays is the boolean true; expected an integer"),
    ('<float name="spacing" value="0"/>', "spacing is the float 0.0; expected a number [m] above 0 and below 10"),
    ('<float name="spacing" value="nan"/>', "spacing is the float nan; expected a number [m]"),
    ('<rgb name="spacing" value="1,2,3"/>', "spacing is a rgb; expected a number [m]"),
    ('<float name="heading_deg" value="-1"/>', "heading_deg is the float -1.0; expected a number [degrees] at least 0"),
    ('<integer name="flat" value="1"/>', "flat is the integer 1; expected true or false"),
    ('<string name="vertical" value="dept"/>',
     'vertical is the string "dept"; expected one of "auto", "depth", "elevation" (did you mean "depth"?).'),
    ('<float name="name" value="1"/>', "name is the float 1.0; expected a string"),
    ('<string name="filename" value="no.tif"/>', 'filename names the file "no.tif", which is not there; it is looked'),
    ('<string name="filename" value="/"/>', 'filename names the folder "/"; give the name of a file'),
    ('<string name="centre" value="1,2,3"/>', 'centre is the string "1,2,3"; expected a point [m]'),
    ('<float name="to_world" value="1"/>', "to_world is the float 1.0; expected a transform"),
    ('<string name="crop" value="1,2,3"/>', 'crop is the string "1,2,3"; expected 4 numbers [m] separated by commas'),
    ('<string name="crop" value="1,2,3,x"/>', 'crop is the string "1,2,3,x"; expected 4 numbers'),
    ('<string name="crop" value="1,2,3,nan"/>', "expected 4 numbers"),
    ('<string name="profile" value="0:1490, 10"/>', 'expected a table of finite numbers "0:1490.5, 10:1485"'),
    ('<spectrum name="profile" value="1490"/>', "profile is a spectrum; expected a table"),
    ('<float name="spaceing" value="3"/>',
     'got the float 3.0 for the unknown attribute "spaceing" (did you mean "spacing"?).'
     ' Known: burial, centre, classes, crop, fans, filename, flat, heading_deg, meshes, mu, name, preset, profile,'
     ' rays, return_deg, spacing, step, strength, to_world, turn_deg, vertical.'),
    ('<string name="bsdf" value="sand"/>', 'got the string "sand" for the unknown attribute "bsdf".'),
    ('<string name="burial" value="0.5, 0.2"/>',
     'burial is 0.5, 0.2; expected a number or two, "low, high", from 0 to 1.'),
    ('<string name="burial" value="deep"/>', 'burial is the string "deep"; expected a list of numbers separated by'),
    ('<float name="strength" value="inf"/>', "strength is the float inf; expected a number or a table of finite"),
    ('<float name="mu" value="2"/>', "mu is the float 2.0; expected a number at most 1 or a texture."),
    ('<bsdf type="diffuse" name="mu"/>', "mu is a nested object; expected a number at most 1 or a texture."),
    ('<integer name="fan_count" value="2"/>', 'fan_count is given, but it only counts with fans "some"; leave it out.'),
    ('<string name="fans" value="all"/>', 'fans is the string "all"; expected one of "centre", "some".'),
    ('<string name="classes" value="c.csv"/>', 'classes names the file "c.csv", which is not there'),
])
def test_refusals_name_place_plugin_attribute_expected_and_got(sentence, written, said):
    message = sentence(written)
    assert message.startswith('scene, line 2: probe "bed": ')
    assert said in message


def test_missing_attribute(read):
    from mitsonar.plugins.attributes import Attributes, Nested, Number
    props = mi.Properties("probe")
    with pytest.raises(ValueError, match=r"^probe: attribute depth is missing; expected a number \[m\] above 0\.$"):
        Attributes(props, (Number("depth", unit="m", above=0, text=""),))
    with pytest.raises(ValueError, match="^probe: a nested <medium> is missing"):
        Attributes(props, (Nested("medium", text=""),))
    props["dpth"] = 3.0
    with pytest.raises(ValueError, match=r'depth is missing \(is it written as "dpth"\?\); expected a number'):
        Attributes(props, (Number("depth", text=""),))


def test_a_number_or_a_texture(read):
    assert read('<float name="mu" value="0.25"/>').read.mu == 0.25
    assert isinstance(read('<texture type="checkerboard" name="mu"/>').read.mu, mi.Texture)


def test_a_number_stands_for_a_table_of_one_row(read):
    assert [column.tolist() for column in read('<float name="strength" value="-60"/>').read.strength] == [[0], [-60]]
    table = read('<spectrum name="strength" value="0:-60, 9:-70"/>').read.strength
    assert [column.tolist() for column in table] == [[0, 9], [-60, -70]]


def test_one_number_stands_for_two(read):
    assert read("").read.burial == (0.25, 0.25)
    assert read('<float name="burial" value="0.5"/>').read.burial == (0.5, 0.5)
    assert read('<string name="burial" value="0, 0.5"/>').read.burial == (0, 0.5)


@pytest.mark.parametrize("written, step, turn, back", [
    ("", 0.25, 90, 90), ('<string name="preset" value="coarse"/>', 4.0, 180, 180),
    ('<float name="turn_deg" value="45"/>', 0.25, 45, 45), ('<float name="return_deg" value="45"/>', 0.25, 90, 45)])
def test_defaults_of_a_preset_and_of_another_attribute(read, written, step, turn, back):
    values = read(written).read
    assert (values.step, values.turn_deg, values.return_deg) == (step, np.radians(turn), np.radians(back))


def test_an_attribute_counts_only_with_a_value_of_another(read):
    assert read('<string name="fans" value="some"/> <integer name="fan_count" value="5"/>').read.fan_count == 5
    assert read("").read.fan_count == 3


def test_text_or_the_name_of_a_file(read, tmp_path):
    (tmp_path / "c.csv").write_text("x")
    assert read('<string name="classes" value="1: sand"/>').read.classes == "1: sand"
    assert read(f'<string name="classes" value="{tmp_path}/c.csv"/>').read.classes == f"{tmp_path}/c.csv"
    assert read('<string name="classes" value=""/>').read.classes is None


def test_what_is_not_declared_is_no_attribute(read):
    with pytest.raises(AttributeError, match="colour is not declared"):
        read("").read.colour


def test_a_group_is_declared_once_and_read_under_every_prefix(read):
    from mitsonar.plugins.attributes import Attributes, Choice, Group, Integer
    props = mi.Properties("probe")
    props["left"], props["left_count"] = "many", 4
    group = Group(title="Sides", module="attributes", prefixes=("left", "right"), attributes=(
        Choice("", default="one", choices=("one", "many"), text="kind"),
        Integer("_count", only=("", ("many",)), text="how many")))
    values = Attributes(props, (group,))
    assert (values.left, values.left_count, values.right, values.right_count) == ("many", 4, "one", None)
    props["right_count"] = 2
    with pytest.raises(ValueError, match='^probe: right_count is given, but it only counts with right "many"; leave'):
        Attributes(props, (group,))
    props["left"] = "one"
    with pytest.raises(ValueError, match='^probe: left_count is given, but it only counts with left "many"; leave'):
        Attributes(props, (group,))


CUBE = '<scene version="3.0.0">\n%s\n</scene>'


@pytest.mark.parametrize("written, said", [
    ('<shape type="cub"/>', 'scene, line 2: there is no plugin of type "cub" (did you mean "cube"?).'),
    ('<shape type="cube">\n<float name="nu" value="1"/><string name="mu" value="x"/></shape>',
     'scene, line 2: cube: there is no attribute "nu" (float), "mu" (string) in a shape of this type.'),
    ('<shape type="probe"><texture type="bitmap" name="a"><string name="filename" value="no.png"/></texture></shape>',
     'scene, line 2: bitmap: cannot open "no.png": no such file or directory.'),
    ('<shape type="sphere">\n<string name="radius" value="x"/></shape>',
     "scene, line 2: sphere: radius is a string; expected float."),
    ('<shape type="sphere">\n<float name="radius" value="x"/></shape>',
     'scene, line 3: "x" is not a floating point value.'),
    ('<shape type="sphere">\n<integer name="radius" value="4.5"/></shape>',
     'scene, line 3: "4.5" is not an integer value.'),
    ('<shape type="sphere">\n<float name="radius" value="1"/><float name="radius" value="2"/></shape>',
     'scene, line 3: the value "2" cannot be set: is the attribute written twice?'),
    ('<shape type="sphere">\n<float name="radius" value="$r"/></shape>',
     'scene, line 3: the parameter "r" has no value; give one, or a <default name="r" value="..."/>.'),
    ('<shape type="sphere">\n<floot name="radius" value="1"/></shape>',
     "scene, line 3: encountered an unsupported XML element: <floot>"),
    ('<shape type="sphere"><ref id="sand"/></shape>', 'scene, line 2: no object has the id "sand".'),
    ('<shape type="sphere" id="a"/>\n<shape type="sphere" id="a"/>', 'scene, line 3: duplicate ID: "a"'),
    ('<bsdf type="cube"/>', 'scene, line 2: cube: "cube" is a shape; expected a bsdf.'),
    ('<shape type="ply"><string name="filename" value="no.ply"/></shape>',
     'scene, line 2: ply: Error while loading PLY file "no.ply": file not found!'),
    ('<shape type="probe"><spectrum name="profile" value="10:1500, 5:1500"/></shape>',
     "scene, line 2: the first numbers of a table (such as depths) must increase."),
    ('<shape type="sphere">\n', "scene, line 4: the XML is broken: Start-end tags mismatch"),
    ('<include filename="no.xml"/>', 'scene, line 2: included file "no.xml" not found'),
])
def test_mitsubas_own_errors_become_one_sentence(sentence, written, said):
    assert sentence(written, CUBE).startswith(said)


def test_unused_parameter(sentence):
    assert sentence("", foo=3).startswith("the scene has no parameter foo;")


def test_wrong_root_element(sentence):
    assert sentence("", '<shape type="cube">%s</shape>') == \
        'the root element is <shape>; expected <scene version="3.0.0">.'


def test_place_names_the_file(read, tmp_path):
    from mitsonar.scene.errors import plain
    path = tmp_path / "s (1).xml"
    path.write_text(SCENE % '<integer name="rays" value="0"/>')
    with pytest.raises(RuntimeError) as caught:
        mi.load_file(str(path))
    assert plain(caught.value) == (f'{path}, line 2: probe "bed": rays is the integer 0; '
                                   "expected an integer at least 1 and at most 4000.")
    with pytest.raises(RuntimeError) as caught:
        mi.load_file(str(tmp_path / "none.xml"))
    assert plain(caught.value) == f'there is no file "{tmp_path / "none.xml"}".'


def test_dictionary_scenes_name_the_object(read):
    from mitsonar.scene.errors import plain
    with pytest.raises(RuntimeError) as caught:
        mi.load_dict({"type": "scene", "bed": {"type": "probe", "rays": 0}})
    assert plain(caught.value).startswith('object "bed": probe "bed": rays is the integer 0;')


def test_render_errors_show_their_cause(read):
    from mitsonar.scene.errors import plain

    class Failing(mi.SamplingIntegrator):
        def render(self, *arguments, **options):
            raise ValueError("sidescan: the sonar is below\n the seabed.")

    mi.register_integrator("failing", Failing)
    scene = mi.load_dict({"type": "scene", "integrator": {"type": "failing"}, "sensor": {"type": "perspective"}})
    with pytest.raises(RuntimeError) as caught:
        mi.render(scene)
    assert plain(caught.value) == "sidescan: the sonar is below the seabed."


def test_system_errors_and_plain_ones():
    from mitsonar.scene.errors import plain
    assert plain(OSError(28, "No space left on device", "out.exr")) == "out.exr: No space left on device"
    assert plain(ValueError("a [m] b\nc")) == "a [m] b c"
