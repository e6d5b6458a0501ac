"""An interferometric sidescan: its plan, the signals of its rows, what it measures of them, and its picture."""
