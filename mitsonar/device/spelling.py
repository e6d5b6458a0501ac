"""What somebody may have meant who wrote a name that is unknown."""
import difflib
from collections.abc import Iterable

LONGEST = 100                      # letters that are compared


def meant(name: str, known: Iterable[str]) -> str:
    """Say which of the known names is most like this one.

    Examples
    --------
    >>> meant("ping", ["pings", "rays"])
    ' (did you mean "pings"?)'
    >>> meant("colour", ["pings", "rays"])
    ''
    """
    by_lower = {one.lower(): one for one in known}
    match = difflib.get_close_matches(str(name)[:LONGEST].lower(), by_lower, n=1)
    return f' (did you mean "{by_lower[match[0]]}"?)' if match else ""
