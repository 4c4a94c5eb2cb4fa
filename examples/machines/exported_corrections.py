"""Whether exported corrections tell the machine's error: said and realised on simulated machines of a linear delta.

Each machine is drawn from the tolerances. Its printer probes a mesh of 7 x 7, or a tracker measures 40 poses; the correction of
the calibrated model is then used on the machine, whose error is exact here. From touches, a shift or turn on the
bed is no error.

    python examples/machines/exported_corrections.py [MACHINES]

writes a row for each controller to exported_corrections.csv beside it.
"""

import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np
import pandas as pd

import gtpin
from gtpin.compensation.compensate import compensate
from gtpin.compensation.machine import CompensatedMachine, machine_at
from gtpin.data import InstrumentSection
from gtpin.export import Box
from gtpin.extras.controllers.controller import controller_of
from gtpin.extras.controllers.grid_table import grid_table
from gtpin.extras.controllers.machine_error import motions_of_no_error, open_directions
from gtpin.extras.controllers.tables import printer_correction
from gtpin.extras.controllers.towers import Drives, drives_of
from gtpin.extras.importers.touches import Touches, write_touches
from gtpin.extras.importers.towers import Towers
from gtpin.model.place import without_place

BOX = Box.of((-0.15, 0.15, -0.12, 0.12, 0.0, 0.2), (0.0, 0.0, 0.3))
TOWERS = Towers(0.52425, np.full(3, 0.999), np.radians([210.0, 330.0, 90.0]), np.full(3, 0.9), np.ones(3))
TOUCH, TRACKER = 1e-5, 1.5e-5  # one sigma, m
NOMINAL = gtpin.read_model("linear_delta")


def drawn(rng: np.random.Generator) -> gtpin.Model:
    """A machine from the tolerances."""
    geometry = NOMINAL.geometry
    return gtpin.Model(
        geometry.with_values(geometry.values + geometry.tolerance * rng.standard_normal(len(geometry.names)))
    )


def touched(truth: gtpin.Model, per_side: int, rng: np.random.Generator, folder: str) -> gtpin.Dataset:
    """The touches of a mesh on a flat bed, as a printer with the nominal dimensions reports them."""
    x, y = np.meshgrid(np.linspace(-0.3, 0.3, per_side), np.linspace(-0.3, 0.3, per_side))
    xyz = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    firmware = controller_of(NOMINAL, BOX.origin)
    for _ in range(5):
        xyz[:, 2] -= truth.predict(firmware(xyz)).T[:, 2] - BOX.origin[2]
    xyz[:, 2] += TOUCH * rng.standard_normal(len(xyz))
    rows = np.arange(1, len(xyz) + 1)
    touches = Touches(Path("mesh"), rows, rows.astype(str).astype(object), position=xyz, bed=True)
    write_touches(touches, folder, "linear_delta", origin=BOX.origin.tolist(), sigma=TOUCH)
    return gtpin.Dataset.read(folder)


def measured(truth: gtpin.Model, rng: np.random.Generator) -> gtpin.Dataset:
    """Positions of the TCP by a tracker in the base frame, at commands of poses around the box."""
    q = controller_of(NOMINAL, BOX.origin)(rng.uniform(1.5 * BOX.low, 1.5 * BOX.high, (40, 3)))
    ids = np.arange(len(q)).astype(str).astype(object)
    T = truth.predict(q).T + TRACKER * rng.standard_normal((len(q), 3))
    return gtpin.Dataset("linear_delta", ids, q, T, None, {}, InstrumentSection(position_sigma=TRACKER))


def of_printer(truth: gtpin.Model, model: gtpin.Model, drives: Drives | None) -> tuple[float, ...]:
    """Said (expected, low, high, and relative to the model) and realised error in the box, m."""
    machine, _ = machine_at(model)
    found = printer_correction(model, [machine], NOMINAL, BOX, drives)
    points = BOX.fill(512)
    left = found.left[0]
    errors = truth.predict(found.controller(found.tables[0].applied(points))).T - BOX.origin - points
    errors = without_place(errors, points + BOX.origin, motions_of_no_error(model))
    return *left.doubt.rms(left.after), rms(left.after), rms(errors)


def of_commands(truth: gtpin.Model, model: gtpin.Model, *, grid: bool) -> tuple[float, ...]:
    """The same of corrected commands, or of a table over commands."""
    machine: CompensatedMachine = machine_at(model)[0]
    q = controller_of(NOMINAL, BOX.origin)(BOX.fill(256))
    wanted = NOMINAL.predict(q).T
    new = grid_table(machine, NOMINAL).applied(q, 0) if grid else compensate(model, wanted, start=q)
    left, doubt = machine.goes_to(new) - wanted, open_directions(machine, model, q)
    return (*doubt.rms(left), rms(left), rms(truth.predict(new).T - wanted))


def rms(errors: np.ndarray) -> float:
    return float(np.sqrt((errors**2).sum(axis=1).mean()))


def machine(seed: int) -> dict[str, tuple[float, ...]]:
    """The errors of one machine, by controller."""
    rng = np.random.default_rng(seed)
    truth = drawn(rng)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        probed = gtpin.calibrate(touched(truth, 7, rng, folder)).model
        tracked = gtpin.calibrate(measured(truth, rng)).model
        return {
            "Klipper, RepRapFirmware: touches, dimensions": of_printer(truth, probed, drives_of(TOWERS, NOMINAL, BOX)),
            "Klipper, RepRapFirmware: touches, tables only": of_printer(truth, probed, None),
            "table over commands: tracker": of_commands(truth, tracked, grid=True),
            "corrected commands: tracker": of_commands(truth, tracked, grid=False),
        }


def table(machines: int) -> pd.DataFrame:
    """A row for each controller: medians, um, and the share of machines inside the 95 % interval."""
    found = [machine(seed) for seed in range(machines)]
    rows = []
    for name in found[0]:
        said, low, high, file, real = np.array([one[name] for one in found]).T
        medians = [round(1e6 * float(np.median(values)), 1) for values in (said, file, real)]
        rows.append((name, *medians, round(float(np.mean((low <= real) & (real <= high))), 2), machines))
    return pd.DataFrame(rows, columns=["controller", "said_um", "file_alone_um", "realised_um", "covered", "machines"])


if __name__ == "__main__":
    made = table(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
    made.to_csv(Path(__file__).with_suffix(".csv"), index=False, lineterminator="\n")
    print(made.to_string(index=False))
