"""The figures of docs/speed.md.

    python examples/pages/speed.py            # measures them anew: a quarter of an hour of CPU time
    python examples/pages/speed.py --only benchmarks   # or arms, commands: the others stay as they are
    python examples/pages/speed.py --check    # measures the benchmarks anew, and compares their ratios with the record

All times are of CPU. They are a machine's; what the check compares are ratios of times in one run.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Collection, Sequence
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
    "a closed posture by `fsolve` over one of many in one call": (
        "test_fsolve_on_the_closures",
        "test_arrays_of_many_postures",
    ),
    "`least_squares` over the calibration of 61 poses": (
        "test_61_poses_with_60_parameters_by_least_squares",
        "test_61_poses_with_60_parameters",
    ),
}
ARM_RATIOS = {
    "`least_squares` over the calibration of 200 poses of an arm": (
        "test_an_arm_s_200_poses_by_least_squares",
        "test_an_arm_s_200_poses",
    ),
    "Pinocchio's regressor of 200 poses of an arm, pose by pose, over gtpin's derivative": (
        "test_an_arm_s_derivative_by_a_loop_of_pinocchio",
        "test_an_arm_s_derivative_by_its_placements",
    ),
}
ROWS = {
    "test_pinocchio_one_posture_after_the_other": "a closed posture by Pinocchio, from a neighbour within 50 mm a cart",
    "test_arrays_of_many_postures": "a closed posture among 20,000, in one call",
    "test_fsolve_on_the_closures": "the same by `fsolve` on the six closures, from the neighbour",
    "test_61_poses_with_60_parameters": "calibration of 61 poses, 60 parameters",
    "test_61_poses_with_60_parameters_by_least_squares": "the same by `least_squares` with numerical derivatives",
    "test_200_poses": "calibration of 200 poses, 48 parameters",
    "test_a_million_rows_of_csv": "reading a million rows of CSV",
    "test_the_version": "`gtpin --version`",
    "test_the_help": "`gtpin --help`",
}
"""Benchmarks, and how the page calls them."""
ARM_ROWS = {
    "test_an_arm_s_derivative_by_its_placements": "derivative of 200 poses by 42 parameters",
    "test_an_arm_s_derivative_by_a_loop_of_pinocchio": "the same pose by pose, by Pinocchio's regressor, 36 parameters",
    "test_an_arm_s_200_poses": "calibration of 200 poses, 42 parameters",
    "test_an_arm_s_200_poses_by_least_squares": "the same by `least_squares` with numerical derivatives",
    "test_an_arm_s_diagnosis_of_200_poses": "diagnosis of 200 poses",
    "test_an_arm_s_diagnosis_of_440_poses": "diagnosis of 440 poses of an arm on a telescope; something stays unknown",
    "test_an_arm_s_16_800_poses": "calibration of 16,800 poses",
    "test_an_arm_s_diagnosis_of_16_800_poses": "diagnosis of 16,800 poses",
}
"""The same of an arm."""
ARM_POSES = (200, 16_800)
"""Poses of the datasets of an arm; a tenth is visited twice."""
HARD = """robot = "ur5"
effect = [
    {id = "rack_periodic", site = "shoulder_lift_joint", amplitude = 1.0},
    {id = "rack_periodic", site = "wrist_1_joint", amplitude = 1.0},
    {id = "joint_compliance", site = "shoulder_lift_joint", amplitude = 1.0},
    {id = "backlash", site = "elbow_joint", amplitude = 1.0},
    {id = "encoder_scale", site = "wrist_2_joint", amplitude = 1.0},
]
noise = {tails = 5.0, gross = 0.005, declared = false, free = true, free_target = true}
covariates = {payloads = [0.0, 1.0, 2.0], sessions = 2}
seed = 5
"""
"""An arm that has much to find, in all columns: five causes, frame, target and noise unknown."""
COMMANDS = (1_000, 10_000, 100_000)
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


def commands(sizes: Sequence[int] = COMMANDS, scenario: str = "") -> list[dict[str, float]]:
    """CPU seconds and peak memory, GB, of whole commands, on data of a scenario file's text."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scenario.toml"
        file.write_text(scenario, encoding="utf-8")
        machine = ["--scenario", str(file)] if scenario else []
        for poses in sizes:
            run(["simulate", "-o", f"{folder}/{poses}", "--poses", str(poses), *machine])
            row: dict[str, float] = {"poses": poses}
            for name in ("calibrate", "diagnose"):
                row[f"{name}_s"], row[f"{name}_gb"] = run([name, f"{folder}/{poses}", "-o", f"{folder}/{name}{poses}"])
            rows.append(row)
    return rows


def arms() -> dict[str, list[dict[str, float]]]:
    """Whole commands on data of an arm: without effects, and of one that has much to find."""
    return {"plain": commands(ARM_POSES, 'robot = "ur5"\n'), "hard": commands(ARM_POSES, HARD)}


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
    pairs = {**RATIOS, **ARM_RATIOS}.items()
    return {words: times[a] / times[b] for words, (a, b) in pairs if a in times and b in times}


def table() -> str:
    """Times and ratios, as the page has them."""
    return _times(ROWS, RATIOS)


def arm_table() -> str:
    """The same of an arm."""
    return _times(ARM_ROWS, ARM_RATIOS)


def _times(rows: dict[str, str], shown: Collection[str]) -> str:
    times = _record()["benchmarks"]
    lines = ["| what | time |", "|---|---|"]
    lines += [f"| {words} | {_time(times[name])} |" for name, words in rows.items()]
    lines += ["", "| ratio, in the same run | |", "|---|---|"]
    lines += [f"| {words} | {value:.2g} |" for words, value in ratios(times).items() if words in shown]
    return "\n".join(lines)


def command_table() -> str:
    """Whole commands, as the page has them."""
    lines = ["| poses | `calibrate` | `diagnose` |", "|---|---|---|"]
    return "\n".join(lines + [f"| {row['poses']:,} | {_cells(row)} |" for row in _record()["commands"]])


def arm_command_table() -> str:
    """The same of an arm."""
    words = {"plain": "no cause; all columns", "hard": "five causes; frame, target and noise unknown; all columns"}
    lines = ["| poses | machine | `calibrate` | `diagnose` |", "|---|---|---|---|"]
    found = _record()["arm_commands"]
    return "\n".join(
        lines
        + [f"| {row['poses']:,} | {said} | {_cells(row)} |" for kind, said in words.items() for row in found[kind]]
    )


def _cells(row: dict[str, float]) -> str:
    names = ("calibrate", "diagnose")
    return " | ".join(f"{_two_digits(row[f'{name}_s'])} s, {row[f'{name}_gb']:.2f} GB" for name in names)


def _record() -> dict[str, Any]:
    return dict(json.loads(RECORD.read_text(encoding="utf-8")))


def _time(seconds: float) -> str:
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{_two_digits(seconds / size)} {unit}"
    return f"{_two_digits(seconds / 1e-6)} us"


def _two_digits(value: float) -> str:
    return f"{float(f'{value:.2g}'):g}"


def check() -> None:
    """Exit with 1 where a ratio has changed."""
    recorded, now = ratios(_record()["benchmarks"]), ratios(benchmarks())
    off = [words for words in now if not 1.0 / FACTOR < now[words] / recorded[words] < FACTOR]
    sys.exit(f"changed by more than a factor of {FACTOR:g}: {', '.join(off)}" if off else 0)


PARTS = ("benchmarks", "arms", "commands")


def measure(parts: Collection[str] = PARTS) -> None:
    """Write what was measured into the record; parts that are not named stay as they are."""
    record = _record()
    if "benchmarks" in parts:
        record["benchmarks"] |= benchmarks()
    if "arms" in parts:
        record["arm_commands"] = arms()
    if "commands" in parts:
        record["commands"] = commands()
    RECORD.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    if "--check" in sys.argv[1:]:
        check()
    else:
        measure([part for part in PARTS if part in sys.argv[1:]] or PARTS)
