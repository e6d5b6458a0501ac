"""Memory of this machine."""
import math
import os


def memory() -> float:
    """Return the physical memory [bytes] or a process's limit of it; infinite where the system does not report it."""
    try:
        physical = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return math.inf
    try:
        import resource
    except ImportError:                                # not on Windows
        return physical
    allowed = resource.getrlimit(resource.RLIMIT_AS)[0]
    return physical if allowed == resource.RLIM_INFINITY else min(physical, allowed)
