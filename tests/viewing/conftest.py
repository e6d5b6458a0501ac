"""Fixture of the tests of pages."""
import pytest
from read_view import entities

import mitsonar


@pytest.fixture
def shown(tmp_path):
    """Record what a page would show, and return its entities."""
    def record(*what, **options):
        mitsonar.view(*what, save=tmp_path / "run.rrd", **options)
        return entities(tmp_path / "run.rrd")
    return record
