"""One trial: damage a file of a sound folder, run a command on it, and keep what is wrong."""

import shutil
from pathlib import Path
from random import Random

from fuzzing.judged import contents, faults, run
from fuzzing.material import COMMANDS
from fuzzing.mutations import mutate_file

SECONDS = 120
"""CPU seconds after which a command on a small file counts as hung."""


def trial(name: str, sound: Path, work: Path, kept: Path) -> tuple[tuple[str, int], bool]:
    """Run the trial of a name: the command with its exit code, and whether anything was wrong; then the case is in ``kept``."""
    rng = Random(name)
    command = rng.choices(COMMANDS, [c.weight for c in COMMANDS])[0]
    shutil.copytree(sound, work)
    damaged = work / rng.choice(command.reads)
    mutate_file(damaged, rng)
    before = contents(work)
    ran = run(command.line, work, SECONDS)
    wrong = faults(ran, before, contents(work))
    if wrong:
        place = kept.absolute() / name.replace(" ", "-")
        shutil.copytree(work, place)
        print(f"cd {place} && gtpin {command.line}  # {damaged.name}: {'; '.join(wrong)}", flush=True)
    shutil.rmtree(work)
    return (command.line.split()[0], ran.code), bool(wrong)
