"""The command sweep: many renders from a plan."""
import datetime
import os

from .arguments import Commands, number, whole
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
    sweep.add_argument("--rate-core-hour", type=number, metavar="PRICE",
                       help="price of an hour of a core, for --dry-run")
    sweep.add_argument("--rate-gb-month", type=number, metavar="PRICE",
                       help="price of a GB of storage for a month, for --dry-run")
    sweep.add_argument("--currency", default="", metavar="TEXT", help="currency of these prices")
    sweep.add_argument("--verify", action="store_true",
                       help="check the existing images, and render damaged or changed ones again")
    sweep.add_argument("--processes", type=whole, metavar="N",
                       help="processes on this machine; default: one for each core and GB of memory")
    sweep.add_argument("--threads", type=whole, metavar="N",
                       help="threads of each process; default: the cores shared out")
    sweep.add_argument("--workers", type=whole, metavar="N", help="start a Dask cluster of N workers here instead")
    sweep.add_argument("--scheduler", metavar="ADDRESS",
                       help="use a running Dask cluster instead; it can run any code as you")
    sweep.add_argument("--part", metavar="K/N",
                       help="make part K of N alone, here or on another machine; other parts may run at the same time")
    sweep.add_argument("--merge", nargs="+", metavar="FOLDER",
                       help="check the parts in these folders and join them in the folder of -o")
    sweep.add_argument("--only", type=whole, metavar="INDEX",
                       help="make render INDEX of the plan alone, as the EXR of -o, whatever the plan's product")
    sweep.add_argument("--part-script", choices=("slurm", "kubernetes"),
                       help="print a script that runs --parts parts under a batch system")
    sweep.add_argument("--parts", type=whole, metavar="N", help="number of parts of --part-script")
    sweep.set_defaults(run=_sweep)


def _sweep(arguments):
    from mitsonar.sweep.execute import run
    from mitsonar.sweep.parts import WHOLE, Part
    from mitsonar.sweep.plan import load_plan
    from mitsonar.sweep.pools.local import shares

    _check_alone(arguments)
    part = Part.of(arguments.part) if arguments.part else WHOLE
    plan = load_plan(arguments.plan)
    if arguments.merge:
        return _merge(plan, arguments)
    if arguments.only is not None:
        return _only(plan, arguments)
    if arguments.part_script:
        return _print_script(plan, arguments)
    if arguments.dry_run:
        return _print_estimate(plan, part, arguments)
    at_once = arguments.workers or shares(arguments.processes, arguments.threads)[0]
    with Progress("renders", warm_up=at_once) as progress:
        outcome = run(plan, arguments.output, processes=arguments.processes, threads=arguments.threads,
                      workers=arguments.workers, scheduler=arguments.scheduler, verify=arguments.verify,
                      part=part, progress=progress, say=warn)
    took = datetime.timedelta(seconds=round(outcome.seconds))
    parts = [f"{outcome.done} rendered in {took}" if outcome.done or outcome.failed else "nothing to do",
             *([f"{outcome.kept} already there"] if outcome.kept else []),
             *([f"{outcome.redrawn} drawn again"] if outcome.redrawn else []),
             *([f"{outcome.failed} failed"] if outcome.failed else [])]
    of = "" if part.whole else f"part {part}, "
    announce(f"{of}{_count(outcome.total, 'render')}: {', '.join(parts)}")
    for output, error in outcome.failures[:SHOWN]:
        warn(f"{output} failed: {error}")
    if outcome.failed > SHOWN:
        warn(f"and {outcome.failed - SHOWN} more; see the lines of the manifest with \"failed\"")
    _print_balance(plan, outcome.labelled, outcome.kept + outcome.done)
    announce(outcome.manifest)
    return 1 if outcome.failed else 0


def _check_alone(arguments):
    """Raise `ValueError` for options that make no sense together."""
    given = [option for option, value in (
        ("--dry-run", arguments.dry_run), ("--part", arguments.part), ("--merge", arguments.merge),
        ("--only", arguments.only is not None), ("--part-script", arguments.part_script)) if value]
    if len(given) > 1 and given != ["--dry-run", "--part"]:
        raise ValueError(f"{given[0]} and {given[1]} were given together; leave one out.")
    rates = arguments.rate_core_hour, arguments.rate_gb_month
    if rates != (None, None) and not arguments.dry_run:
        raise ValueError("rates are given, but no dry run, which states prices; add --dry-run or leave them out.")
    if rates == (None, None) and arguments.currency:
        raise ValueError("a currency is given, but no rate; add --rate-core-hour or --rate-gb-month, or leave it out.")
    if (arguments.part_script is None) != (arguments.parts is None):
        raise ValueError("--part-script needs the number of parts, and --parts is for it; give both, such as "
                         "--part-script slurm --parts 200.")


def _merge(plan, arguments):
    from mitsonar.sweep.merging import merge

    with Progress("renders") as progress:
        merged = merge(plan, arguments.merge, arguments.output, progress=lambda done, total: progress(done, total, 0))
    announce(f"{merged.joined} of {_count(merged.total, 'render')} joined")
    if merged.missing:
        warn(f"{_count(len(merged.missing), 'render')} missing: {_numbers(merged.missing)}")
    for fault, numbers in _by_fault(merged.wrong).items():
        warn(f"{_count(len(numbers), 'render')} left out, {fault}: {_numbers(numbers)}")
    if merged.twice:
        warn(f"{_count(len(merged.twice), 'render')} made twice with different bytes, of which the first is taken: "
             f"{_numbers(merged.twice)}")
    if len(merged.instruction_sets) > 1:
        warn(f"the parts were made on machines of several instruction sets ({', '.join(merged.instruction_sets)}); on "
             "one of them some bytes would differ, levels by rounding only")
    _print_balance(plan, merged.labelled, merged.joined)
    announce(os.path.join(merged.folder, "manifest.jsonl"))
    return 0 if merged.joined == merged.total else 1


def _print_balance(plan, tally, made):
    """Print the numbers of labelled pictures, and warn of wishes of the plan that are not met."""
    from mitsonar.sweep.balance import missed_said, tally_said, verdicts

    if tally is None or not tally.pictures:
        return
    announce(tally_said(tally))
    for verdict in verdicts(plan.balance or {}, tally, made / len(plan)):
        if not verdict.met:
            warn(missed_said(verdict, made, len(plan)))


def _only(plan, arguments):
    from mitsonar.device.files import check_writable, checked_suffix
    from mitsonar.sweep.execute import only

    if not 0 <= arguments.only < len(plan):
        raise ValueError(f"--only is {arguments.only}, and the plan makes {_count(len(plan), 'render')}; give a number "
                         f"from 0 to {len(plan) - 1}.")
    output = arguments.output or f"{arguments.only:06}.exr"
    checked_suffix(output, (".exr",))
    check_writable(output)
    only(plan, arguments.only, output, threads=arguments.threads)
    announce(output)
    return 0


def _by_fault(wrong):
    """Return the numbers of renders by what is wrong with them."""
    faults = {}
    for index, fault in wrong:
        faults.setdefault(fault, []).append(index)
    return faults


def _numbers(numbers):
    """Return the first numbers of renders as text."""
    return ", ".join(map(str, numbers[:SHOWN])) + (", ..." if len(numbers) > SHOWN else "")


def _print_script(plan, arguments):
    from mitsonar.sweep.estimate import estimate
    from mitsonar.sweep.part_scripts import part_script

    cost = estimate(plan, arguments.output, processes=1, threads=arguments.threads, say=warn)
    announce(part_script(arguments.part_script, plan.path, cost.folder, parts=arguments.parts, renders=len(plan),
                         seconds=cost.seconds, threads=arguments.threads).rstrip("\n"))
    return 0


def _print_estimate(plan, part, arguments):
    from mitsonar.sweep.estimate import estimate
    from mitsonar.sweep.execute import unplanned_said
    from mitsonar.sweep.prices import MANY, Rates, costs

    rates = Rates(core_hour=arguments.rate_core_hour, gb_month=arguments.rate_gb_month, currency=arguments.currency)
    if arguments.scheduler is not None:
        raise ValueError("--dry-run estimates for this machine, not for the cluster of --scheduler; leave one out")
    cost = estimate(plan, arguments.output, processes=arguments.workers or arguments.processes,
                    threads=arguments.threads, verify=arguments.verify, part=part, say=warn)
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
                 f"{_count(cost.processes, 'process')} of {_count(cost.threads, 'thread')}"
                 + (f", of which the cores run {cost.at_once} at once" if cost.at_once < cost.processes else ""))
        for scene in cost.scenes if len(cost.scenes) > 1 else ():
            hours, _, price = costs(scene, cost.threads, rates, MANY)
            announce(f"  {scene.name}: {_count(scene.missing, 'render')}, {scene.seconds:.2g} s and "
                     f"{size_said(scene.bytes)} each; per {MANY:,} renders {hours:.3g} core hours"
                     + f", {price}" * bool(price))
        announce(f"disk: about {size_said(cost.bytes * cost.missing)}, and {size_said(cost.free)} are free")
        for count, said in ((cost.missing, "in all"), (MANY, f"per {MANY:,} renders")):
            hours, size, price = costs(cost, cost.threads, rates, count)
            announce(f"{said}: {hours:.3g} core hours and {size_said(size)}" + f", {price}" * bool(price))
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
