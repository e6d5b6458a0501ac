"""Lines of a text file in any encoding, in bounded memory."""
from pathlib import Path

MOST_BYTES, MOST_LINES, LONGEST = 32 * 2**20, 1_000_000, 10_000  # hours at 24 samples a second; characters of a line


def read_lines(path: Path) -> list[str] | None:
    """Read the lines of a text file, or return None if it is binary.

    UTF-8, UTF-16 with its mark, or else Windows-1252, in which every byte is a character: wrong degree signs of older
    software do not matter, as the numbers are right.
    """
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise ValueError(f"it has {size / 2**20:.0f} MiB, and no cast has more than {MOST_BYTES / 2**20:.0f}; "
                         "give the file of one cast.")
    text = _decoded(path.read_bytes())
    if text is None or "\0" in text:
        return None
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if text.count("\n") > MOST_LINES:
        raise ValueError(f"it has {text.count(chr(10))} lines, and no cast has more than {MOST_LINES}; give the file "
                         "of one cast.")
    lines = text.split("\n")
    longest = max(range(len(lines)), key=lambda k: len(lines[k]))
    if len(lines[longest]) > LONGEST:
        raise ValueError(f"line {longest + 1} has {len(lines[longest])} characters; a cast has a line for each sample.")
    return lines


def _decoded(data):
    try:
        if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
            return data.decode("utf-16")
    except UnicodeDecodeError:
        return None
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")
