"""The command sweep: many renders from a plan."""
import datetime
import os

from .arguments import Commands, whole
from .completion import add_file
from .progress import Progress
from .words import announce, warn

SHOWN = 5                          # failures printed at the end


def add(commands: Commands) -> None:
    """Add the command to the parser's."""
    sweep = commands.add_parser("sweep", help="render all images, or sound all lines, of a plan that are missing")
    add_file(sweep, "plan", metavar="PLAN.toml", help="plan, or the name of a plan that comes with mitsonar")
    sweep.add_argument("-o", "--output", metavar="FOLDER", help="default: the plan's name without .toml, beside it")
    sweep.add_argument("--dry-run", action="store_true", help="estimate number, time and disk space, and end")
    sweep.add_argument("--verify", action="store_true",
                       help="check the existing images, and render damaged or changed ones again")
    sweep.add_argument("--processes", type=whole, metavar="N",
                       help="processes on this machine; default: one for two cores")
    sweep.add_argument("--threads", type=whole, metavar="N",
                       help="threads of each process, at least 2; default: the cores shared out")
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
        return _print_estimate(plan, arguments)
    at_once = arguments.workers or shares(arguments.processes, arguments.threads)[0]
    with Progress("renders", warm_up=at_once) as progress:
        outcome = run(plan, arguments.output, processes=arguments.processes, threads=arguments.threads,
                      workers=arguments.workers, scheduler=arguments.scheduler, verify=arguments.verify,
                      progress=progress, say=warn)
    took = datetime.timedelta(seconds=round(outcome.seconds))
    parts = [f"{outcome.done} rendered in {took}" if outcome.done or outcome.failed else "nothing to do",
             *([f"{outcome.kept} already there"] if outcome.kept else []),
             *([f"{outcome.redrawn} drawn again"] if outcome.redrawn else []),
             *([f"{outcome.failed} failed"] if outcome.failed else [])]
    announce(f"{_count(outcome.total, 'render')}: {', '.join(parts)}")
    for output, error in outcome.failures[:SHOWN]:
        warn(f"{output} failed: {error}")
    if outcome.failed > SHOWN:
        warn(f"and {outcome.failed - SHOWN} more; see the lines of the manifest with \"failed\"")
    announce(os.path.join(outcome.folder, "manifest.jsonl"))
    return 1 if outcome.failed else 0


def _print_estimate(plan, arguments):
    from mitsonar.sweep.estimate import estimate
    from mitsonar.sweep.execute import unplanned_said

    if arguments.scheduler is not None:
        raise ValueError("--dry-run estimates for this machine, not for the cluster of --scheduler; leave one out")
    cost = estimate(plan, arguments.output, processes=arguments.workers or arguments.processes,
                    threads=arguments.threads, verify=arguments.verify, say=warn)
    there = f"{cost.total - cost.missing} of them there" if cost.missing < cost.total else "none of them there yet"
    announce(f"{_count(cost.total, 'render')} into {cost.folder}, {there}"
             + (f", {cost.changed + cost.damaged} to be rendered again" if cost.changed + cost.damaged else ""))
    if cost.unplanned:
        warn(unplanned_said(cost.unplanned, cost.folder))
    if cost.seconds is not None and cost.bytes is not None and cost.duration is not None:
        how = f"tried {cost.trials}" if cost.trials else "as the existing ones took"
        length = datetime.timedelta(seconds=round(cost.duration))
        each = f"{cost.seconds:.2g}" if cost.seconds < 100 else f"{cost.seconds:.0f}"
        announce(f"time: about {length}, {each} s each ({how}), by "
                 f"{_count(cost.processes, 'process')} of {cost.threads} threads"
                 + (f", of which the cores run {cost.at_once} at once" if cost.at_once < cost.processes else ""))
        announce(f"disk: about {size_said(cost.bytes * cost.missing)}, and {size_said(cost.free)} are free")
    return 0


def _count(number, what):
    return f"{number} {what}" if number == 1 else f"{number} {what}{'es' if what.endswith('s') else 's'}"


def size_said(count: float) -> str:
    """Return a number of bytes with its unit."""
    for unit in ("bytes", "kB", "MB", "GB"):           # noqa: B007  the last one is read after the loop
        if count < 1000:
            break
        count /= 1000
    else:
        unit = "TB"
    return f"{count:.3g} {unit}"
