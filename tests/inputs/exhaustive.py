"""Sets of parameters that a test visits in part: all of them where pytest is asked for -m exhaustive as well."""
import pytest


def thinned(values, *kept):
    """Return the parameters of a test, all but `kept` marked exhaustive; one that is a tuple is several arguments."""
    kept = [*kept]
    return [value if value in kept else pytest.param(*(value if isinstance(value, tuple) else (value,)),
                                                     marks=pytest.mark.exhaustive) for value in values]
