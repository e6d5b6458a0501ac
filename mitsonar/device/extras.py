"""Report packages that are not installed because few need them: the extras of ``pyproject.toml``.

In a checkout, the command line installs the extra and begins again (`cli.setup.bootstrap.add_extra`).
"""


class MissingExtra(ValueError):
    """Report that a package of one of mitsonar's extras is not installed."""

    def __init__(self, problem: str, extra: str, instead: str = ""):
        super().__init__(problem, extra, instead)      # with which a copy is made in another process
        self.extra = extra

    def __str__(self):
        problem, extra, instead = self.args
        return f"{problem}; run pip install 'mitsonar[{extra}]'{instead and f', or {instead}'}."
