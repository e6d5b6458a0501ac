"""Messages that Mitsuba raises while it loads or renders, turned into one sentence for users.

Mitsuba wraps the cause in tags of its source files, places, plugin names and Python tracebacks. `plain` keeps
``file, line: plugin: sentence``. A message of unknown form is joined to one line and kept.
"""
import re

from mitsonar.device.sentences import shortened
from mitsonar.device.spelling import meant

from .registration import PLUGINS as OURS

# mitsonar's own, and those of Mitsuba that are useful in a sonar scene
PLUGINS = (*(name.rpartition(".")[2] for name in OURS), "bitmap", "checkerboard", "cube", "cylinder", "diffuse",
           "disk", "instance", "mesh_attribute", "obj", "ply", "rectangle", "shapegroup", "sphere", "twosided")
_TAG = re.compile(r"\s*\[(?:\w+\.cpp:\d+|[A-Z]\w*)\] ")
_PLACE = r"(?:(?P<file>\S.*?) \(line (?P<line>\d+), col \d+\)|dictionary node \"(?P<node>[^\"]*)\")"
_PLUGIN = r"(?:failed to instantiate (?P<kind>\S+) plugin of type \"(?P<plugin>[^\"]*)\": )?"
_WRAPPERS = (
    re.compile(rf"(?:At|While loading|Error while loading) {_PLACE}: {_PLUGIN}", re.DOTALL),
    re.compile(r"Error while loading XML file \"(?P<file>.*?)\": (?P<plugin>)"),
    re.compile(r"while processing <include>:\s*"),
)
_SYNTAX = re.compile(r"(?:Parsing of XML file \"(?P<file>.*?)\"|XML parsing) failed: (?P<what>.*?) "
                     r"\(line (?P<line>\d+), col \d+\)")
_RAISED = re.compile(r"^(?P<kind>[A-Za-z_][\w.]*?)(?:: (?P<what>.*))?$", re.DOTALL)
WANTED = {"integrator": "sonar_path", "film": "sonar_film"}        # the only types that sonars work with
_USER_ERRORS = ("ValueError", "RuntimeError")


def plain(error: BaseException) -> str:
    """Return one sentence for users about an exception raised by loading or rendering a scene."""
    while error.__cause__ is not None and "(see above)" in str(error):
        error = error.__cause__  # Dr.Jit hides what a plugin raised behind its own message
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    # bytes that Mitsuba quotes of a damaged file may not be text
    text = error.object.decode(errors="replace") if isinstance(error, UnicodeDecodeError) else str(error)
    text, place, plugin = _TAG.sub("", text, count=1) if _TAG.match(text) else text, "", ""
    if match := _SYNTAX.match(text):
        return f"{_at(match['file'] or 'scene', match['line'])}: the XML is broken: {match['what']}"
    while match := next(filter(None, (wrapper.match(text) for wrapper in _WRAPPERS)), None):
        groups = match.groupdict()
        if groups.get("line"):
            place = _at(groups["file"], groups["line"])
        elif groups.get("node"):
            place = f'object "{groups["node"]}"'
        elif groups.get("file"):
            place = groups["file"]
        plugin = groups.get("plugin") or plugin
        text = _strip_tag(text[match.end():])
    sentence = _sentence(text)
    if plugin and not re.match(rf"{re.escape(plugin)}[ :]", sentence) and not sentence.startswith("there is no plugin"):
        sentence = f"{plugin}: {sentence}"
    return shortened(f"{place}: {sentence}" if place else sentence)


def as_exception(error: BaseException) -> ValueError | KeyboardInterrupt:
    """Return the exception to raise in place of one from Mitsuba: a `ValueError`, or the Ctrl-C that it wraps."""
    sentence, cause = plain(error), error
    while cause is not None and not isinstance(cause, KeyboardInterrupt):
        cause = cause.__cause__
    interrupted = cause is not None or re.search(r"\bKeyboardInterrupt\b", sentence)
    return KeyboardInterrupt() if interrupted else ValueError(sentence)


def _at(file, line):
    return f"{'scene' if file == 'string' else file}, line {line}"


def _strip_tag(text):
    match = _TAG.match(text)
    return text[match.end():] if match else text


def _sentence(text):
    if text.startswith("Traceback (most recent call last)"):
        return _sentence(_strip_tag(_raised(text)))
    for pattern, write in _SENTENCES:
        if match := pattern.match(text):
            return write(match)
    return " ".join(text.split())


def _raised(traceback):
    # Frames are indented; the exception is everything after the last indented line.
    lines = traceback.splitlines()
    last = max(index for index, line in enumerate(lines) if line.startswith(" ") or index == 0)
    match = _RAISED.match("\n".join(lines[last + 1:]))
    if not match:
        return lines[-1]
    kind, what = match["kind"], match["what"] or ""
    return what if kind in _USER_ERRORS and what else f"{kind}: {what}"


def _unreferenced(match):
    names = re.findall(r"^  - (\w+) \"(.*?)\"", match["list"], re.MULTILINE)
    if all(name.startswith("_arg_") for _, name in names):                 # nested without a name
        return f"{match['plugin']}: something is nested that a {match['kind']} of this type does not take."
    listed = ", ".join(f'"{name}" ({kind})' for kind, name in names)
    wanted = WANTED.get(match["kind"], match["plugin"])
    if match["plugin"] != wanted:
        return f'{match["plugin"]}: sonars need <{match["kind"]} type="{wanted}">, which takes {listed}.'
    article = "an" if match["kind"][0] in "aeiou" else "a"
    return f"{match['plugin']}: there is no attribute {listed} in {article} {match['kind']} of this type."


def _unused(match):
    names = re.findall(r"\$(\w+)=", match["list"])
    return f"the scene has no parameter {', '.join(names)}; parameters are its <default name=...> entries."


def _spectrum(match):
    """Return the message about a table file, without Mitsuba's quotes from it: the file may be a private one."""
    what = match["what"]
    if line := re.search(r" in line (\d+) of spectrum file", what):
        return (f'the file "{match["file"]}", line {line[1]}, is not a table; expected two numbers a line, such as 10 '
                '1490.5.')
    if "increasing order" in what or "at least two" in what:
        return f'the file "{match["file"]}": {_sentence(_strip_tag(what))}'
    return f'the file "{match["file"]}" cannot be read as a table; expected two numbers a line, such as 10 1490.5.'


def _unparsable(match):
    kind, value = match["kind"], match["value"]
    try:
        float(value)
    except ValueError:
        return f'"{value}" is not {"an" if kind[0] in "aeiou" else "a"} {kind} value.'
    if kind.startswith("integer") and not re.fullmatch(r"\s*[+-]?\d+\s*", value):
        return f'"{value}" is not an integer value.'
    # Python refuses to read thousands of digits
    if kind.startswith("integer") and (len(value.strip(" +-0")) > 100 or abs(int(value)) >= 1 << 63):
        return f'"{value}" is too large for an integer.'
    return f'the value "{value}" cannot be set: is the attribute written twice?'  # Mitsuba's message for a repetition


def _not_pairs(match):
    return f'the table holds "{match[1]}"; expected pairs with a colon, such as depth:speed in 0:1490.5, 10:1485.'


_SENTENCES = [(re.compile(pattern, re.DOTALL), write) for pattern, write in (
    (r"Found \d+ unreferenced propert\w+ in (?P<kind>\S+) plugin of type \"(?P<plugin>.*?)\":\n(?P<list>.*)",
     _unreferenced),
    (r"Found unused parameters:\n(?P<list>.*)", _unused),
    (r"(?:\[PluginManager\] )?Plugin \"(.*?)\" not found!",
     lambda m: f'there is no plugin of type "{m[1]}"{meant(m[1], PLUGINS)}.'),
    (r"Type mismatch: the instantiated plugin \"(.*?)\" is of type \"(.*?)\", which does not match the expected type "
     r"\"(.*?)\"", lambda m: f'"{m[1]}" is a {m[2]}; expected a {m[3]}.'),
    (r"undefined parameter: \$(\w+)",
     lambda m: f'the parameter "{m[1]}" has no value; give one, or a <default name="{m[1]}" value="..."/>.'),
    (r"failed to load spectrum from file \"(?P<file>.*?)\": (?P<what>.*)", _spectrum),
    (r"could not parse (?P<kind>[\w -]+?) value \"(?P<value>.*?)\"", _unparsable),
    (r"unresolved reference to \"(.*?)\"", lambda m: f'no object has the id "{m[1]}".'),
    (r"The property \"(.*?)\" has the wrong type \(expected (.*?), got (.*?)\)",
     lambda m: f"{m[1]} is a {m[3]}; expected {m[2]}."),
    (r"Property \"(.*?)\" cannot be found!", lambda m: f"attribute {m[1]} is missing."),
    (r"Property \"(.*?)\" was specified multiple times", lambda m: f"attribute {m[1]} is written twice."),
    (r"Invalid spectrum value \"(.*?)\" \(expected", _not_pairs),
    (r"Wavelengths must be specified in increasing order",
     lambda m: "the first numbers of a table (such as depths) must increase."),
    (r"Spectrum must have at least two entries", lambda m: "a table needs at least two entries."),
    (r"\"(.*?)\": I/O error while attempting to open file: (.*)", lambda m: f'cannot open "{m[1]}": {m[2].lower()}.'),
    (r"(?:Bitmap: Unknown file format|Fatal lib\w+ error|\"[^\"]*\": I/O error while attempting to read)",
     lambda m: "the file is cut short, or no picture or mesh of its kind."),
    (r"\"(.*?)\": file does not exist!", lambda m: f'there is no file "{m[1]}".'),
    (r"Could not parse wavelength:value pair \"(.*?)\"", _not_pairs),
    (r"Error while loading (\w+) file \"(.*?)\": .*I/O error while attempting to read",
     lambda m: f'the file "{m[2]}" is cut short, or no {m[1]} file.'),
    (r"[Mm]issing version attribute in root element <scene>",
     lambda m: 'the file must begin with <scene version="3.0.0">.'),
    (r"[Mm]issing version attribute in root element <(.*?)>",
     lambda m: f'the root element is <{m[1]}>; expected <scene version="3.0.0">.'),
)]
