"""Errors in one sentence, as people read them and manifests keep them."""

__all__ = ["sentence"]


def sentence(error):
    """Put an error the user can mend into one sentence.

    Parameters
    ----------
    error : Exception

    Returns
    -------
    str
        One line, without the error's type.
    """
    if isinstance(error, MemoryError):
        return f"out of memory: {error or 'nothing more is known'}; take fewer pings, rays or bins"
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return " ".join(str(error).split())
