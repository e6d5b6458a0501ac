"""Scripts that run all parts of a sweep under a batch system: Slurm's job arrays and Kubernetes' indexed jobs."""
import json
import math
import os
import re
import shlex
from collections.abc import Callable

from .parts import MOST_PARTS
from .pools.local import THREADS

MARGIN = 2.0                       # times as long as estimated, before a system may end a part
SHORTEST = 1800                    # [s] that a part may take
MEMORY_MB = 2000                   # of a process that renders; a survey of 1,000 pings takes 0.8 GB
IMAGE = "IMAGE"                    # of a container, which the user has to fill in


def slurm(name: str, command: str, parts: int, seconds: float, threads: int) -> str:
    """Return the script of an array of jobs, one job a part; submit it by ``sbatch``."""
    hours, minutes = divmod(math.ceil(seconds / 60), 60)
    return f"""#!/bin/bash
#SBATCH --job-name={name}
#SBATCH --array=1-{parts}
#SBATCH --cpus-per-task={threads}
#SBATCH --mem={MEMORY_MB}M
#SBATCH --time={hours:02}:{minutes:02}:00
#SBATCH --requeue
# A part that is ended and queued again goes on where it was.
exec {command} --part "$SLURM_ARRAY_TASK_ID/{parts}"
"""


def kubernetes(name: str, command: str, parts: int, seconds: float, threads: int) -> str:
    """Return the description of an indexed job, one pod a part; start it by ``kubectl apply -f``."""
    shell = f'exec {command} --part "$((JOB_COMPLETION_INDEX + 1))/{parts}"'
    return f"""# Replace {IMAGE} by a container image with mitsonar, and add the volume of the output folder.
# A part that is ended and started again goes on where it was.
apiVersion: batch/v1
kind: Job
metadata:
  name: {name}
spec:
  completionMode: Indexed
  completions: {parts}
  parallelism: {parts}
  backoffLimitPerIndex: 3
  template:
    spec:
      restartPolicy: Never
      activeDeadlineSeconds: {math.ceil(seconds)}
      containers:
        - name: sweep
          image: {IMAGE}
          command: ["/bin/sh", "-c", {json.dumps(shell)}]
          resources:
            requests: {{cpu: "{threads}", memory: {MEMORY_MB}Mi}}
            limits: {{memory: {2 * MEMORY_MB}Mi}}
"""


SCRIPTS: dict[str, Callable[[str, str, int, float, int], str]] = {"slurm": slurm, "kubernetes": kubernetes}


def part_script(kind: str, plan: str, folder: str, *, parts: int, renders: int,
                seconds: float | None,               # of a render; None: nothing is left to render
                threads: int | None = None) -> str:
    """Return the script of all parts of a sweep."""
    if not 1 <= parts <= min(MOST_PARTS, renders):
        raise ValueError(f"{parts} parts were asked for, and the plan makes {renders} renders; give 1 to "
                         f"{min(MOST_PARTS, renders)} parts")
    threads = threads or THREADS
    name = re.sub("[^a-z0-9]+", "-", os.path.splitext(os.path.basename(plan))[0].lower()).strip("-")[:40] or "sweep"
    command = shlex.join(["python3", "-m", "mitsonar", "sweep", plan, "-o", folder, "--processes", "1", "--threads",
                          str(threads)])
    return SCRIPTS[kind](name, command, parts, max(SHORTEST, MARGIN * (seconds or 0) * math.ceil(renders / parts)),
                         threads)
