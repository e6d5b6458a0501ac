"""Write errors as one sentence."""
import re

LONGEST_WORD, LONGEST = 300, 3000  # characters of a word and of a sentence; paths and lists of names are shorter
CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")         # and direction of text


def sentence(error: BaseException) -> str:
    """Return an error that the user can mend as one sentence."""
    if isinstance(error, MemoryError):
        return f"out of memory: {error or 'nothing more is known'}; take fewer pings, rays or bins"
    if isinstance(error, OSError) and error.strerror:
        return CONTROL.sub("?", f"{error.filename}: {error.strerror}" if error.filename else error.strerror)
    return shortened(" ".join(str(error).split()))


def shortened(text: str) -> str:
    """Return a text without the middle of very long words, or of a very long text, and without control characters."""
    text = CONTROL.sub("?", text)
    text = re.sub(rf"\S{{{LONGEST_WORD + 1},}}", lambda word: f"{word[0][:60]}...{word[0][-30:]}", text)
    return text if len(text) <= LONGEST else f"{text[:300]} ... {text[-300:]}"
