"""The commands of virtual machines: demo, simulate, blind and benchmark."""

from gtpin.commands.entry import CommandEntry

DEMO = CommandEntry(
    "demo",
    "gtpin.bench.commands.demo:demo",
    "The complete workflow on a virtual machine with hidden effects: simulate, calibrate, diagnose, report.",
    ("gtpin demo -o first-try",),
    place=10,
)
SIMULATE = CommandEntry(
    "simulate",
    "gtpin.bench.commands.simulate:simulate",
    "Write a dataset of a virtual machine: a robot drawn from its tolerances, measured by a noisy tracker.",
    (
        "gtpin lab simulate -o virtual --poses 150 --seed 3",
        "gtpin lab simulate -o virtual --scenario examples/scenarios/backlash.toml",
    ),
    place=75,
    hidden=True,
    lab=True,
)
BLIND = CommandEntry(
    "blind",
    "gtpin.bench.commands.blind:blind",
    "Make machines with hidden effects, seal the truth, diagnose the data, open the seals, and score.",
    ("gtpin lab blind -o check --cases 100", "gtpin lab blind -o check --from cases"),
    place=120,
    hidden=True,
    lab=True,
)
BENCHMARK = CommandEntry(
    "benchmark",
    "gtpin.bench.commands.benchmark:benchmark_app",
    "Make the public set of cases, and score the answers of any solver.",
    place=140,
    hidden=True,
    lab=True,
)
