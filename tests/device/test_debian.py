"""Debian's packages without root: which are fetched, and that unpacking is all or nothing."""
import pytest

from mitsonar.device import debian

DEPENDS = """libllvm19
  Depends: libc6
  Depends: libgcc-s1
  Depends: libxml2
 |Depends: libz3-4
  Depends: <virtual-thing>
libc6
  Depends: libgcc-s1
  PreDepends: debconf
debconf
  Depends: perl-base
libxml2
  Depends: libicu72
libatomic1
  Depends: libc6
"""


@pytest.fixture
def packages(monkeypatch, tmp_path):
    """Packages of a machine whose apt-get brings two; the file ``broken`` names one that cannot be unpacked."""
    tools = tmp_path / "tools"
    tools.mkdir()
    scripts = {
        "apt-get": 'for word; do :; done; [ "$word" = update ] || touch one.deb two.deb',
        "apt-cache": f"cat <<'END'\n{DEPENDS}END",
        "dpkg-deb": f'[ "$2" != "$(cat {tmp_path}/broken)" ] || {{ echo "dpkg-deb: error: bad" >&2; exit 2; }}\n'
                    'mkdir -p "$3" && touch "$3/$2"',
    }
    for name, script in scripts.items():
        (tools / name).write_text(f"#!/bin/sh\nPATH=/usr/bin:/bin\n{script}\n")
        (tools / name).chmod(0o755)
    (tmp_path / "broken").write_text("none")
    monkeypatch.setenv("PATH", str(tools))
    return debian.Packages(say=lambda line: None)


def test_the_closure_leaves_the_runtimes_and_what_only_they_need_to_the_system(packages):
    found = packages.closure(["libllvm19", "libatomic1"])
    assert found == ["libatomic1", "libicu72", "libllvm19", "libxml2", "libz3-4"]


def test_unpacking_replaces_the_folder(packages, tmp_path):
    (tmp_path / "cache/llvm").mkdir(parents=True)
    (tmp_path / "cache/llvm/old").touch()
    packages.unpack(["one", "two"], str(tmp_path / "cache/llvm"))
    assert sorted(path.name for path in (tmp_path / "cache/llvm").iterdir()) == ["one.deb", "two.deb"]
    assert [path.name for path in (tmp_path / "cache").iterdir()] == ["llvm"]


def test_a_broken_package_leaves_nothing(packages, tmp_path):
    (tmp_path / "broken").write_text("two.deb")
    with pytest.raises(debian.Unavailable, match="dpkg-deb says: bad"):
        packages.unpack(["one", "two"], str(tmp_path / "cache/llvm"))
    assert list((tmp_path / "cache").iterdir()) == []


def test_a_machine_without_apt_says_so(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(debian.Unavailable, match="no apt-get"):
        debian.Packages()
