"""The wheel carries the package, the plugins, the scenes and the licence, and works away from the checkout."""
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# pictures of the manual, and the scripts that draw them
LEFT_OUT = re.compile(r"mitsonar/(scenes/((?!sediments)\w+\.(png|gif)|make_\w+\.py|(published|manual)/.*)|changes/.*)$")


def run(arguments, folder):
    """Run Python with `arguments` in `folder`, with the packages there before all others."""
    return subprocess.run([sys.executable, *arguments], cwd=folder, env={**os.environ, "PYTHONPATH": str(folder)},
                          capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The built wheel, by the tools already here: no network."""
    folder = tmp_path_factory.mktemp("wheel")
    child = run(["-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(ROOT)], folder)
    assert child.returncode == 0, child.stdout + child.stderr
    return next(folder.glob("mitsonar-*.whl"))


def test_every_file_is_in_it(wheel):
    expected = {(Path("mitsonar") / path.relative_to(base)).as_posix()
                for base, top in ((ROOT / "mitsonar", "."), (ROOT, "plugins"), (ROOT, "scenes"))
                for path in (base / top).rglob("*") if path.is_file() and "__pycache__" not in path.parts}
    expected.remove("mitsonar/plugins.pyi")        # which stands for the folder where that lies outside
    expected = {name for name in expected if not LEFT_OUT.match(name)}
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert names == expected


def test_every_file_that_a_scene_names_is_in_it(wheel):
    archive = zipfile.ZipFile(wheel)
    files = [(scene, name) for scene in archive.namelist() if re.fullmatch(r"mitsonar/scenes/\w+\.xml", scene)
             for name in re.findall(r'(?:name="filename"|<default name="\w+") value="([\w/]+\.\w+)"',
                                    archive.read(scene).decode()) if (ROOT / "scenes" / name).is_file()]
    assert ("mitsonar/scenes/sidescan_harbour.xml", "sediments.png") in files and len(files) > 10
    assert not [pair for pair in files if f"mitsonar/scenes/{pair[1]}" not in archive.namelist()]


def test_it_states_licence_command_and_python(wheel):
    archive = zipfile.ZipFile(wheel)
    information = {name.partition(".dist-info/")[2]: name for name in archive.namelist() if ".dist-info/" in name}
    assert archive.read(information["licenses/LICENSE"]).startswith(b"BSD 3-Clause License")
    assert b"mitsonar = mitsonar.__main__:main" in archive.read(information["entry_points.txt"])
    metadata = archive.read(information["METADATA"]).decode()
    assert "License-Expression: BSD-3-Clause" in metadata
    assert "Requires-Python: >=3.10" in metadata
    assert "Requires-Dist: mitsuba==3.9.1" in metadata


def test_it_works_away_from_the_checkout(wheel, tmp_path):
    zipfile.ZipFile(wheel).extractall(tmp_path)
    child = run(["-c", """
import importlib.resources, mitsonar, mitsuba
mitsuba.set_variant("llvm_ad_mono")
print(mitsonar.__file__, mitsonar.plugins.__file__)
print(*(path.name for path in importlib.resources.files("mitsonar.scenes").iterdir()))"""], tmp_path)
    assert child.returncode == 0, child.stderr
    files, scenes = child.stdout.splitlines()
    assert all(file.startswith(str(tmp_path / "mitsonar")) for file in files.split())
    assert any(name.endswith(".xml") for name in scenes.split())
    child = run(["-m", "mitsonar", "describe", "impedance"], tmp_path)        # whose words are README's
    assert "of what lies behind the surface" in child.stdout, child.stderr


def test_its_command_needs_no_checkout(wheel, tmp_path):
    """It never sets an environment up, and says that the tests are not in it."""
    zipfile.ZipFile(wheel).extractall(tmp_path)
    child = run(["-m", "mitsonar", "test"], tmp_path)
    assert child.returncode == 2
    assert child.stderr.startswith("mitsonar: The tests are part of the source checkout")


def test_the_published_results_are_said_to_be_in_the_checkout(wheel, tmp_path):
    zipfile.ZipFile(wheel).extractall(tmp_path)
    child = run(["-m", "mitsonar", "published", "table_1"], tmp_path)
    assert (child.returncode, child.stdout) == (2, "")
    assert "scripts of the source checkout, scenes/published" in child.stderr and child.stderr.count("\n") == 1
