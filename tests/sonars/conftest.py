"""Every test of a sonar runs in the variants of --variants."""
import pytest


@pytest.fixture(autouse=True)
def _in_variant(variant):
    return variant
