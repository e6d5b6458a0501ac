"""The command that renders many: sweep."""
import datetime
import os

from .arguments import Commands, whole
from .completion import FILES, complete_with
from .progress import Progress
from .words import announce, warn

SHOWN = 5                          # failures told at the end


def add(commands: Commands) -> None:
    """Add the command to the parser's."""
    sweep = commands.add_parser("sweep", help="render all that a plan asks for and is not there yet")
    plan = sweep.add_argument("plan", metavar="PLAN.toml", help="or the name of a plan that comes with mitsonar")
    complete_with(plan, FILES)
    sweep.add_argument("-o", "--output", metavar="FOLDER", help="default: the plan's name without .toml, beside it")
    sweep.add_argument("--dry-run", action="store_true", help="say how many renders, how long and how large, and end")
    sweep.add_argument("--verify", action="store_true",
                       help="read the images that are there, and make those anew that are not as they were written")
    sweep.add_argument("--processes", type=whole, metavar="N", help="on this machine; default: one for two cores")
    sweep.add_argument("--threads", type=whole, metavar="N",
                       help="of each process, at least 2; default: the cores shared out")
    sweep.add_argument("--workers", type=whole, metavar="N", help="start a Dask cluster of N workers here instead")
    sweep.add_argument("--scheduler", metavar="ADDRESS",
                       help="use a running Dask cluster instead; it can run any code as you")
    sweep.set_defaults(run=_sweep)


def _sweep(arguments):
    from mitsonar.sweep.execute import run
    from mitsonar.sweep.local import shares
    from mitsonar.sweep.plan import load_plan

    plan = load_plan(arguments.plan)
    if arguments.dry_run:
        return _tell(plan, arguments)
    at_once = arguments.workers or shares(arguments.processes, arguments.threads)[0]
    with Progress("renders", warm_up=at_once) as progress:
        outcome = run(plan, arguments.output, processes=arguments.processes, threads=arguments.threads,
                      workers=arguments.workers, scheduler=arguments.scheduler, verify=arguments.verify,
                      progress=progress, say=warn)
    took = datetime.timedelta(seconds=round(outcome.seconds))
    parts = [f"{outcome.done} rendered in {took}" if outcome.done or outcome.failed else "nothing to do",
             *([f"{outcome.kept} were there"] if outcome.kept else []),
             *([f"{outcome.redrawn} drawn again"] if outcome.redrawn else []),
             *([f"{outcome.failed} failed"] if outcome.failed else [])]
    announce(f"{_count(outcome.total, 'render')}: {', '.join(parts)}")
    for output, error in outcome.failures[:SHOWN]:
        warn(f"{output} failed: {error}")
    if outcome.failed > SHOWN:
        warn(f"and {outcome.failed - SHOWN} more; see the lines of the manifest that say \"failed\"")
    announce(os.path.join(outcome.folder, "manifest.jsonl"))
    return 1 if outcome.failed else 0


def _tell(plan, arguments):
    from mitsonar.sweep.estimate import estimate
    from mitsonar.sweep.execute import unplanned_said

    if arguments.scheduler is not None:
        raise ValueError("--dry-run estimates for this machine, not for the cluster of --scheduler; leave one out")
    found = estimate(plan, arguments.output, processes=arguments.workers or arguments.processes,
                     threads=arguments.threads, verify=arguments.verify, say=warn)
    there = f"{found.total - found.missing} of them there" if found.missing < found.total else "none of them there yet"
    announce(f"{_count(found.total, 'render')} into {found.folder}, {there}"
             + (f", {found.changed + found.damaged} to be made anew" if found.changed + found.damaged else ""))
    if found.unplanned:
        warn(unplanned_said(found.unplanned, found.folder))
    if found.seconds is not None and found.bytes is not None and found.duration is not None:
        how = f"tried {found.trials}" if found.trials else "as those there took"
        length = datetime.timedelta(seconds=round(found.duration))
        announce(f"time: about {length}, {found.seconds:.2g} s each ({how}), by "
                 f"{_count(found.processes, 'process')} of {found.threads} threads"
                 + (f", of which the cores bear {found.at_once} at once" if found.at_once < found.processes else ""))
        announce(f"disk: about {_size(found.bytes * found.missing)}, and {_size(found.free)} are free")
    return 0


def _count(number, what):
    return f"{number} {what}" if number == 1 else f"{number} {what}{'es' if what.endswith('s') else 's'}"


def _size(count):
    for unit in ("bytes", "kB", "MB", "GB"):           # noqa: B007  the last one is read after the loop
        if count < 1000:
            break
        count /= 1000
    else:
        unit = "TB"
    return f"{count:.3g} {unit}"
