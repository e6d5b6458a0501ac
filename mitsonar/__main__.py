"""Run ``python3 -m mitsonar COMMAND``; in a checkout, set up what is missing first.

This file uses only the standard library and syntax of any Python 3, so that an old Python can print a clear error.
"""
import sys


def main(argv: "list[str] | None" = None) -> int:
    """Run one command and return its exit code: 2 after an error that the user can mend, 130 after Ctrl-C."""
    argv = sys.argv[1:] if argv is None else list(argv)
    if sys.version_info < (3, 10):
        print("mitsonar needs Python 3.10 or newer, and this is {}.{}.".format(*sys.version_info), file=sys.stderr)
        return 2
    from mitsonar.cli.setup import bootstrap
    from mitsonar.device import llvm
    from mitsonar.device.extras import MissingExtra

    try:
        try:
            return _run(argv, bootstrap, llvm)
        except MissingExtra as error:
            bootstrap.add_extra(error.extra, argv)
            print(f"mitsonar: {error}", file=sys.stderr)
            return 2
    except (bootstrap.SetupError, llvm.BackendError) as error:
        print(f"mitsonar: {error}", file=sys.stderr)
        return 2
    except ImportError as error:
        if (error.name or "").partition(".")[0] == "mitsonar":
            raise
        print(f"mitsonar: {bootstrap.about_import(error)}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("mitsonar: interrupted", file=sys.stderr)
        return 130


def _run(argv, bootstrap, llvm):
    from mitsonar.device.lazy import begin_command

    bootstrap.enter(argv)
    if argv[:1] == ["test"]:
        return bootstrap.run_tests(argv[1:])
    if argv[:1] == ["llvm"]:
        print(llvm.locate() or llvm.provide(bootstrap.say))
        return 0
    begin_command()
    from mitsonar.cli.main import main as run_command

    return run_command(argv)


if __name__ == "__main__":
    sys.exit(main())
