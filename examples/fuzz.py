"""Damage files at random and run gtpin on them: python fuzz.py --minutes 60 --seed 1.

Every command must end with exit code 0, 1 or 2, in its time, with one line of error at most, its input as it was and nothing
left where it failed. What does not is kept in a folder, with the command that shows it again.
"""

import argparse
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path

from fuzzing.material import make
from fuzzing.trial import trial

EVERY = 300
"""Seconds between two lines of progress."""


def main(minutes: float, seed: int, kept: Path) -> None:
    counts, found, reported = Counter[tuple[str, int]](), 0, time.monotonic()
    with tempfile.TemporaryDirectory() as scratch, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        sound, work = Path(scratch, "sound"), Path(scratch, "work")
        sound.mkdir()
        make(sound)
        end = time.monotonic() + 60.0 * minutes
        while time.monotonic() < end:
            ended, wrong = trial(f"{seed} {counts.total()}", sound, work, kept)
            counts[ended] += 1
            found += wrong
            if time.monotonic() > reported + EVERY:
                reported = time.monotonic()
                left = (end - reported) / 60
                print(f"{left:.0f} minutes left: {counts.total()} damaged files, {found} faults", flush=True)
    for (name, code), count in sorted(counts.items()):
        print(f"{name:<12} exit {code:>3}: {count}")
    print(f"{counts.total()} damaged files, {found} faults")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=0.1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kept", type=Path, default=Path("fuzz-faults"))
    chosen = parser.parse_args()
    main(chosen.minutes, chosen.seed, chosen.kept)
