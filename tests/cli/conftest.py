"""The command line, run within the test in an empty folder."""
import pytest
from kept_processes import kept_processes
from small_scene import TEXT


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder that is the current one, with the small scene in it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.xml").write_text(TEXT, encoding="utf-8")
    return tmp_path


@pytest.fixture
def refusal(folder, capfd):
    """Run a command that must be refused, and give what it says: one line, exit code 2, no file more than before."""
    from mitsonar.cli import main as cli

    def run(*arguments):
        before = sorted(folder.rglob("*"))
        capfd.readouterr()
        assert cli.main([str(argument) for argument in arguments]) == 2
        out, err = capfd.readouterr()
        assert out == ""
        assert err.startswith("mitsonar: ") and err.count("\n") == 1 and err.endswith("\n")
        assert "Traceback" not in err and ".cpp" not in err
        assert sorted(folder.rglob("*")) == before
        return err
    return run


@pytest.fixture
def kept():
    """Pools of processes in the test's own process begin with those of the pool before."""
    with kept_processes():
        yield


@pytest.fixture
def interrupted(monkeypatch):
    """Run a command that makes soundings so that it ends after two pings.

    A ping is written before it is counted. So an exception between two pings leaves the same files as `kill -9`, but
    for the hidden one of the output's last write.
    """
    from mitsonar.cli import main as cli, progress

    def interrupt(self, done, total, failed=0):
        if done == 2:
            raise KeyboardInterrupt

    def end(*words):
        with monkeypatch.context() as context:
            context.setattr(progress.Progress, "__call__", interrupt)
            assert cli.main(list(words)) == 130

    return end
