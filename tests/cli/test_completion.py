"""Completion scripts: what bash offers behind what was typed, and that both shells can read their script."""
import shutil
import subprocess

import pytest

from mitsonar.cli import main as cli


@pytest.fixture
def script(folder, capfd):
    """The script for a shell."""
    def run(shell):
        with pytest.raises(SystemExit) as caught:
            cli.main(["--print-completion", shell])
        out, err = capfd.readouterr()
        assert caught.value.code in (0, None) and err == ""
        return out
    return run


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")
@pytest.mark.parametrize("typed, offered", [
    (["mitsonar", "ren"], ["render"]),
    (["mitsonar", "s"], ["scenes", "shards", "show", "signals", "soundings", "sweep"]),
    (["mitsonar", "render", "sidescan_f"], ["sidescan_flat"]),
    (["mitsonar", "render", "sce"], ["scene.xml"]),
    (["mitsonar", "describe", "published"], ["published_figure_2", "published_figure_3"]),
    (["mitsonar", "gradient-check", "sidescan_f"], ["sidescan_flat"]),
    (["mitsonar", "fit", "sidescan_f"], ["sidescan_flat"]),
    (["mitsonar", "fit", "sidescan_flat", "a.exr", "--met"], ["--method"]),
    (["mitsonar", "render", "--prev"], ["--preview"]),
    (["mitsonar", "plot", "a.exr", "--tvg", "t"], ["target"]),
], ids=" ".join)
def test_bash_offers(script, folder, typed, offered):
    (folder / "completion.bash").write_text(script("bash"))
    words = " ".join(f"'{word}'" for word in typed)
    asked = (f"source completion.bash; COMP_WORDS=({words}); COMP_CWORD={len(typed) - 1}; "
             "$(complete -p mitsonar | sed 's/.*-F \\([^ ]*\\).*/\\1/'); printf '%s\\n' \"${COMPREPLY[@]}\"")
    done = subprocess.run(["bash", "--norc", "-c", asked], cwd=folder, capture_output=True, text=True, check=False)
    assert sorted({line.strip() for line in done.stdout.splitlines()}) == offered, done.stderr


def test_zsh_has_a_script_of_its_own(script, folder):
    text = script("zsh")
    assert text.startswith("#compdef mitsonar") and "sidescan_flat" in text
    if shutil.which("zsh"):
        (folder / "completion.zsh").write_text(text)
        subprocess.run(["zsh", "-n", "completion.zsh"], cwd=folder, check=True)


def test_other_shells_are_refused(refusal):
    assert "invalid choice: 'fish'" in refusal("--print-completion", "fish")
