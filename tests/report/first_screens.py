"""What the first screen says in twelve cases, terminal and report: texts that a reader can compare.

    PYTHONPATH=tests/report python tests/report/first_screens.py [NAME ...]

writes ``tests/report/first_screens/NAME.txt`` again. The machines are virtual: scenarios of ``gtpin simulate`` with few poses.
"""

from __future__ import annotations

import html
import re
import sys
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

import gtpin
from gtpin.bench.simulator.case import simulate_scenario
from gtpin.commands.terminal import rendered
from gtpin.data import Dataset
from gtpin.diagnosis.result import Diagnosis, HealthCheck, Member, Undecided
from gtpin.output.shown import present

FOLDER = Path(__file__).with_suffix("")
FIVE_BAR = Path(__file__).parents[2] / "examples" / "loops" / "five_bar.urdf"
NUMBER = re.compile(r"\d+(?:\.\d+)?")
BEDS = """schema = "gtpin-dataset/2"
robot = "linear_delta"
[[instrument]]
name = "probe"
kind = "plane"
sigma = 1e-5
[instrument.planes]
A = {point = [0, 0, 0], normal = [0, 0, 1]}
B = {point = [0, 0, 0], normal = [1, 0, 0]}
C = {point = [0, 0, 0], normal = [0, 1, 0]}
"""
"""Dial gauges against three planes."""


@cache
def simulated(robot: str, effects: tuple[tuple[str, str, float], ...] = (), poses: int = 80, more: str = "") -> Dataset:
    """A dataset of a virtual machine; ``effects``: id, site and energy; ``more``: further lines of the scenario."""
    lines = [f'robot = "{robot}"', f"poses = {poses}", "seed = 5", "held_out = 1", "background = false"]
    for effect, site, energy in effects:
        lines += ["[[effect]]", f'id = "{effect}"', f'site = "{site}"', f"energy = {energy}"]
    with tempfile.TemporaryDirectory() as made:
        file = Path(made) / "scenario.toml"
        file.write_text("\n".join([*lines, more]) + "\n", encoding="utf-8")
        return simulate_scenario(file).dataset


def diagnosed(*given: object) -> Diagnosis:
    """The diagnosis of a virtual machine."""
    return gtpin.diagnose(simulated(*given))  # type: ignore[arg-type]


@cache
def one() -> Diagnosis:
    """A backlash."""
    return diagnosed("gantry_tau", (("backlash", "cart1", 2000.0),))


def weak() -> Diagnosis:
    """A cause, and something small beside it that is undecided."""
    small = Undecided("cart3", 4.2e-6, (Member("linearity", "cart3", 0.3), Member("straightness", "cart3", 0.2)))
    return replace(one(), also=(small,))


def touch() -> Diagnosis:
    """A linear delta whose first drive errs by 80 µm each 40 mm, read by dial gauges against three planes."""
    robot = gtpin.load_robot("linear_delta")
    model, rng = gtpin.Model(gtpin.Geometry.nominal(robot)), np.random.default_rng(3)
    q = robot.home_q + rng.uniform(-0.1, 0.1, (120, 3))
    at = model.kinematics.forward(q + 8e-5 * np.cos(2.0 * np.pi * q / 0.04) * [1.0, 0.0, 0.0]).T
    with tempfile.TemporaryDirectory() as made:
        rows = ["pose,q1,q2,q3,plane,height"]
        for i, (command, place) in enumerate(zip(q, at, strict=True)):
            name, value = "BCA"[i % 3], place[i % 3] + 1e-5 * rng.standard_normal()
            rows.append(",".join([f"p{i}", *(f"{v:.9f}" for v in command), name, f"{value:.9f}"]))
        (Path(made) / "dataset.toml").write_text(BEDS, encoding="utf-8")
        (Path(made) / "probe.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
        return gtpin.diagnose(Dataset.read(made))


def health() -> HealthCheck:
    """The zero of a drive, 0.1 mm from where it was."""
    data = simulated("gantry_tau")
    some = data.take(np.arange(15))
    return gtpin.diagnose(replace(some, q=some.q - [1e-4, 0.0, 0.0]), against=gtpin.calibrate(data).model)


PAYLOADS = "[covariates]\npayloads = [0.0, 2.5, 5.0]"
CASES: dict[str, Callable[[], Diagnosis | HealthCheck]] = {
    "none": lambda: diagnosed("gantry_tau"),
    "one_cause": one,
    "two_causes": lambda: diagnosed("gantry_tau", (("rack_periodic", "cart2", 2000.0), ("backlash", "cart1", 900.0))),
    "ambiguous": lambda: diagnosed("ur5", (("joint_compliance", "shoulder_lift_joint", 500.0),), 60, PAYLOADS),
    "unknown": lambda: diagnosed("gantry_tau", (("hose_drag", "platform", 3000.0),), 120),
    "weak": weak,
    "arm": lambda: diagnosed("ur5", (("rack_periodic", "elbow_joint", 3000.0),), 80),
    "rods": lambda: diagnosed("stewart", (("encoder_scale", "leg2", 3000.0),), 80),
    "five_bar": lambda: diagnosed(str(FIVE_BAR), (("backlash", "drive_left", 3000.0),), 60),
    "delta": lambda: diagnosed("linear_delta", (("rack_periodic", "cart1", 3000.0),), 80),
    "touch": touch,
    "health": health,
}


def first_screens(name: str) -> str:
    """Both texts of a case: what a terminal prints, and the words of the report from its title to its contents."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = CASES[name]()
    terminal, page = rendered(present(found).terminal()), present(found).page()
    screen = page[page.index("<main") : page.index("<nav")]
    screen = re.sub(r"<(svg|script|style).*?</\1>", "", screen, flags=re.DOTALL).replace("\n", " ")
    lines = re.sub(r"</(?:p|h1|li|tr|figcaption|span)>", "\n", re.sub(r"</t[dh]>", " | ", screen))
    words = [" ".join(line.split()) for line in html.unescape(re.sub(r"<[^>]+>", " ", lines)).splitlines()]
    return "\n".join(["TERMINAL", terminal, "", "REPORT", *filter(None, words)]).replace("\u00a0", " ") + "\n"


def alike(text: str, stored: str) -> bool:
    """Whether two texts have the same words and, within 2 % or a unit of the last digit, the same numbers."""
    if re.sub(r"\s+", " ", NUMBER.sub("#", text)) != re.sub(r"\s+", " ", NUMBER.sub("#", stored)):
        return False
    pairs = zip(NUMBER.findall(text), NUMBER.findall(stored), strict=True)
    last = (0.1 ** len(b.partition(".")[2]) for b in NUMBER.findall(stored))
    return all(
        abs(float(a) - float(b)) <= max(0.02 * float(b), 1.001 * d) for (a, b), d in zip(pairs, last, strict=True)
    )


if __name__ == "__main__":
    for case in sys.argv[1:] or CASES:
        (FOLDER / f"{case}.txt").write_text(first_screens(case), encoding="utf-8", newline="\n")
