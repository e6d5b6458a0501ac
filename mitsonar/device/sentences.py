"""Errors in one sentence, as people read them and manifests keep them."""
import re

LONGEST_WORD = 300                 # characters; paths are seldom longer
LONGEST = 3000                     # characters of a sentence; lists of known names are shorter


def sentence(error: BaseException) -> str:
    """Put an error the user can mend into one sentence."""
    if isinstance(error, MemoryError):
        return f"out of memory: {error or 'nothing more is known'}; take fewer pings, rays or bins"
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return shortened(" ".join(str(error).split()))


def shortened(text: str) -> str:
    """Leave out the middle of long words, such as a number of thousands of digits, and of a text that is still long."""
    text = re.sub(rf"\S{{{LONGEST_WORD + 1},}}", lambda word: f"{word[0][:60]}...{word[0][-30:]}", text)
    return text if len(text) <= LONGEST else f"{text[:300]} ... {text[-300:]}"
