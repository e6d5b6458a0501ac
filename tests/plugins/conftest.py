"""Plugins made of dictionaries, and the sentences about dictionaries that must be refused."""
import pytest


@pytest.fixture
def make(variant):
    """Make an object of its type and attributes."""
    import mitsuba as mi

    return lambda kind, **attributes: mi.load_dict({"type": kind, **attributes})


@pytest.fixture
def refusal(make):
    """Return the sentence about attributes that must be refused; it names the plugin."""
    from mitsonar.scene.errors import plain

    def run(kind, **attributes):
        with pytest.raises(RuntimeError) as caught:
            make(kind, **attributes)
        said = plain(caught.value).removeprefix('object "root": ')
        assert said.startswith(kind) and "\n" not in said
        return said
    return run
