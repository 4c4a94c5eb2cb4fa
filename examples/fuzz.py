"""Damage files at random and run gtpin on them: python fuzz.py --minutes 60 --seed 1.

Every command must end with exit code 0, 1 or 2, in its time, with one line of error at most, its input as it was and nothing
left where it failed. What does not is kept in a folder, with the command that shows it again.
"""

import argparse
import shutil
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path
from random import Random

from fuzzing.judged import contents, faults, run
from fuzzing.material import COMMANDS, make
from fuzzing.mutations import mutate_file

SECONDS = 120
"""CPU seconds after which a command on a small file counts as hung."""

SPOKEN = 300
"""Seconds between two lines that say how far the run is."""


def main(minutes: float, seed: int, kept: Path) -> None:
    counts, found, said = Counter[tuple[str, int]](), 0, time.monotonic()
    with tempfile.TemporaryDirectory() as scratch, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        sound, work = Path(scratch, "sound"), Path(scratch, "work")
        sound.mkdir()
        make(sound)
        end = time.monotonic() + 60.0 * minutes
        while time.monotonic() < end:
            rng = Random(f"{seed} {counts.total()}")
            command = rng.choices(COMMANDS, [c.weight for c in COMMANDS])[0]
            shutil.copytree(sound, work)
            damaged = work / rng.choice(command.reads)
            mutate_file(damaged, rng)
            before = contents(work)
            ran = run(command.line, work, SECONDS)
            wrong = faults(ran, before, contents(work))
            if wrong:
                found += 1
                place = kept.absolute() / f"{seed}-{counts.total()}"
                shutil.copytree(work, place)
                print(f"cd {place} && gtpin {command.line}  # {damaged.name}: {'; '.join(wrong)}", flush=True)
            counts[command.line.split()[0], ran.code] += 1
            shutil.rmtree(work)
            if time.monotonic() > said + SPOKEN:
                said = time.monotonic()
                print(
                    f"{(end - said) / 60:.0f} minutes left: {counts.total()} damaged files, {found} faults", flush=True
                )
    for (name, code), count in sorted(counts.items()):
        print(f"{name:<12} exit {code:>3}: {count}")
    print(f"{counts.total()} damaged files, {found} faults")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=0.1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kept", type=Path, default=Path("fuzz-faults"))
    told = parser.parse_args()
    main(told.minutes, told.seed, told.kept)
