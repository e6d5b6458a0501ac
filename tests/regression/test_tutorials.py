"""The tutorials run, and what they assert holds; as notebooks they are what their pages are made of."""
import runpy
import tempfile
from pathlib import Path

import jupytext
import pytest

TUTORIALS = sorted((Path(__file__).resolve().parents[2] / "scenes" / "tutorials").glob("*.py"))


LONG = {"detector": "it renders and trains for minutes, with PyTorch: run it by hand",
        "ros_node": "it needs ROS; tests/io/test_ros_node.py runs it with a stand-in"}


@pytest.mark.usefixtures("two_threads")
@pytest.mark.parametrize("tutorial", TUTORIALS, ids=lambda path: path.stem)
def test_a_tutorial_holds_what_it_says(tutorial, tmp_path, monkeypatch):
    import matplotlib.pyplot as plt

    if tutorial.stem in LONG:
        compile(tutorial.read_text(encoding="utf-8"), str(tutorial), "exec")
        pytest.skip(LONG[tutorial.stem])
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))        # where they put their files
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("TUTORIAL_SCALE", raising=False)
    plt.switch_backend("Agg")
    try:
        runpy.run_path(str(tutorial), run_name="__main__")
    finally:
        plt.close("all")


@pytest.mark.parametrize("tutorial", [one for one in TUTORIALS if one.stem != "ros_node"], ids=lambda path: path.stem)
def test_a_tutorial_is_a_notebook_that_tells_and_checks(tutorial):
    """It begins with a title; no code without words before it; more than one assert; no stored results."""
    cells = jupytext.read(tutorial).cells
    assert cells[0].cell_type == "markdown" and cells[0].source.startswith("# ")
    told = [cell for cell, before in zip(cells[1:], cells) if cell.cell_type == before.cell_type == "code"]
    assert len(told) <= 1                                          # code that goes on without a word
    code = "\n".join(cell.source for cell in cells if cell.cell_type == "code")
    assert code.count("assert ") >= 5 and code.count("plt.show()") >= 3
    assert not any(cell.get("outputs") for cell in cells)
