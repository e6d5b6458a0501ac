from .amplitudes import read_amplitudes as read_amplitudes
from .xtf import XtfWritten as XtfWritten, write as write
