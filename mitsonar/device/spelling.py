"""Suggest the known name that is closest to an unknown one."""
import difflib
from collections.abc import Iterable

LONGEST = 100                      # letters that are compared


def meant(name: str, known: Iterable[str]) -> str:
    """Return a suggestion of the known name that is most like this one, or an empty text.

    Examples
    --------
    >>> meant("ping", ["pings", "rays"])
    ' (did you mean "pings"?)'
    >>> meant("colour", ["pings", "rays"])
    ''
    """
    by_lower = {candidate.lower(): candidate for candidate in known}
    match = difflib.get_close_matches(str(name)[:LONGEST].lower(), by_lower, n=1)
    return f' (did you mean "{by_lower[match[0]]}"?)' if match else ""
