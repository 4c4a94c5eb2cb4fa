"""The figures of docs/speed.md.

    python examples/pages/speed.py            # measures them anew: minutes on a machine that does nothing else
    python examples/pages/speed.py --check    # measures the benchmarks anew, and compares their ratios with the record

Absolute times are a machine's; what the check compares are ratios of times in one run.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

RECORD = Path(__file__).parents[2] / "docs" / "figures" / "speed.json"
ROOT = Path(__file__).parents[2]
FACTOR = 2.0
"""By which a ratio may differ from the record's."""
RATIOS = {
    "a closed posture by `fsolve` over one by Pinocchio": (
        "test_fsolve_on_the_closures",
        "test_pinocchio_one_posture_after_the_other",
    ),
    "a closed posture by `fsolve` over one in arrays": ("test_fsolve_on_the_closures", "test_arrays_of_many_postures"),
    "`least_squares` over the calibration of 61 poses": (
        "test_61_poses_with_60_parameters_by_least_squares",
        "test_61_poses_with_60_parameters",
    ),
}
ROWS = {
    "test_pinocchio_one_posture_after_the_other": "a closed posture by Pinocchio, from a neighbour within 50 mm a cart",
    "test_arrays_of_many_postures": "a closed posture among 20,000, in arrays",
    "test_fsolve_on_the_closures": "the same by `fsolve` on the six closures, from the neighbour",
    "test_61_poses_with_60_parameters": "calibration of 61 poses, 60 parameters",
    "test_61_poses_with_60_parameters_by_least_squares": "the same by `least_squares` with numerical derivatives",
    "test_200_poses": "calibration of 200 poses, 48 parameters",
    "test_a_million_rows_of_csv": "reading a million rows of CSV",
}
"""Benchmarks, and how the page calls them."""
COMMANDS = (1_000, 10_000, 100_000, 1_000_000)
"""Poses of the datasets on which whole commands are measured; a tenth is visited twice."""


def benchmarks() -> dict[str, float]:
    """Median seconds by benchmark; of one posture where it is of many."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "benchmarks.json"
        options = ["-q", "-p", "no:xdist", "-o", "addopts=", f"--benchmark-json={file}"]
        command = [sys.executable, "-m", "pytest", "benchmarks", *options]
        subprocess.run(command, check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
        found = json.loads(file.read_text(encoding="utf-8"))["benchmarks"]
    return {b["name"]: b["stats"]["median"] / b["extra_info"].get("postures", 1) for b in found}


def commands() -> list[dict[str, float]]:
    """CPU seconds and peak memory, GB, of whole commands."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for poses in COMMANDS:
            run(["simulate", "-o", f"{folder}/{poses}", "--poses", str(poses)])
            row: dict[str, float] = {"poses": poses}
            for name in ("calibrate", "diagnose"):
                row[f"{name}_s"], row[f"{name}_gb"] = run([name, f"{folder}/{poses}", "-o", f"{folder}/{name}{poses}"])
            rows.append(row)
    return rows


def run(arguments: list[str]) -> tuple[float, float]:
    """CPU seconds and peak memory, GB, of a command."""
    program = (
        "import json, resource, subprocess, sys\n"
        "subprocess.run([sys.executable, '-m', 'gtpin', *sys.argv[1:]], check=True, capture_output=True)\n"
        "used = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "print(json.dumps([used.ru_utime + used.ru_stime, used.ru_maxrss * 1024 / 1e9]))\n"
    )
    ran = subprocess.run(
        [sys.executable, "-c", program, *arguments],
        check=True,
        capture_output=True,
        text=True,
    )
    seconds, memory = json.loads(ran.stdout)
    return float(seconds), float(memory)


def ratios(times: dict[str, float]) -> dict[str, float]:
    """The ratios that the page shows, by their words."""
    return {words: times[a] / times[b] for words, (a, b) in RATIOS.items()}


def table() -> str:
    """Times and ratios, as the page has them."""
    record: dict[str, Any] = json.loads(RECORD.read_text(encoding="utf-8"))
    times = record["benchmarks"]
    lines = ["| what | time |", "|---|---|"]
    lines += [f"| {words} | {_time(times[name])} |" for name, words in ROWS.items()]
    lines += ["", "| ratio, in the same run | |", "|---|---|"]
    lines += [f"| {words} | {value:.2g} |" for words, value in ratios(times).items()]
    return "\n".join(lines)


def command_table() -> str:
    """Whole commands, as the page has them."""
    lines = ["| poses | `calibrate` | `diagnose` |", "|---|---|---|"]
    for row in json.loads(RECORD.read_text(encoding="utf-8"))["commands"]:
        cells = [f"{row[f'{name}_s']:.2g} s, {row[f'{name}_gb']:.2f} GB" for name in ("calibrate", "diagnose")]
        lines.append(f"| {row['poses']:,} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _time(seconds: float) -> str:
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds / 1e-6:.2g} us"


def check() -> None:
    """Exit with 1 where a ratio has changed."""
    recorded = ratios(json.loads(RECORD.read_text(encoding="utf-8"))["benchmarks"])
    now = ratios(benchmarks())
    off = [words for words in now if not 1.0 / FACTOR < now[words] / recorded[words] < FACTOR]
    sys.exit(f"changed by more than a factor of {FACTOR:g}: {', '.join(off)}" if off else 0)


if __name__ == "__main__":
    if "--check" in sys.argv[1:]:
        check()
    RECORD.write_text(
        json.dumps({"benchmarks": benchmarks(), "commands": commands()}, indent=1) + "\n", encoding="utf-8"
    )
