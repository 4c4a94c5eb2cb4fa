"""Damage files at random and run gtpin on them: python fuzz.py --minutes 60 --seed 1.

Every command must end with exit code 0, 1 or 2, within its time, with one line of error at most, with its input as it was and
nothing left where it failed. Whatever does not is kept in a folder, with the command that shows it again.
"""

from __future__ import annotations

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


def main(minutes: float, seed: int, kept: Path, only: str) -> None:
    commands = [command for command in COMMANDS if command.line.startswith(only)]
    counts: Counter[tuple[str, int]] = Counter()
    found = 0
    with tempfile.TemporaryDirectory() as scratch, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        sound, work = Path(scratch, "sound"), Path(scratch, "work")
        sound.mkdir()
        make(sound)
        end, number = time.monotonic() + 60.0 * minutes, 0
        while time.monotonic() < end:
            rng = Random(f"{seed} {number}")
            command = rng.choices(commands, [c.weight for c in commands])[0]
            shutil.copytree(sound, work)
            damaged = work / rng.choice(command.reads)
            mutate_file(damaged, rng)
            before = contents(work)
            ran = run(command.line, work, SECONDS)
            wrong = faults(ran, before, contents(work))
            counts[command.line.split()[0], ran.code] += 1
            if wrong:
                found += 1
                place = kept / f"{seed}-{number}"
                shutil.copytree(work, place)
                told = f"cd {place.absolute()} && gtpin {command.line}\n# {damaged.relative_to(work)}: {'; '.join(wrong)}\n"
                (place / "again.txt").write_text(told, encoding="utf-8", errors="replace")
                print(told, end="", flush=True)
            shutil.rmtree(work)
            number += 1
    for (name, code), count in sorted(counts.items()):
        print(f"{name:<12} exit {code:>3}: {count}")
    print(f"{counts.total()} damaged files, {found} faults{f', kept in {kept}' if found else ''}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").split(":")[0])
    parser.add_argument("--minutes", type=float, default=0.1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kept", type=Path, default=Path("fuzz-faults"))
    parser.add_argument("--only", default="", help="beginning of the commands to run, such as calibrate")
    told = parser.parse_args()
    main(told.minutes, told.seed, told.kept, told.only)
