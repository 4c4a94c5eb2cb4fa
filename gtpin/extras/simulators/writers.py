"""The formats ``sdf`` and ``mjcf`` of ``gtpin export``."""

from __future__ import annotations

from pathlib import Path

from gtpin.export.export import calibrated_chain
from gtpin.export.loss import left_out, notes_of_robots, with_remainders
from gtpin.export.writer import Export, TablesFor, Writer
from gtpin.extras.simulators.carts import with_cart_springs, with_guideways
from gtpin.extras.simulators.drives import with_drives
from gtpin.extras.simulators.mechanism import mechanism
from gtpin.extras.simulators.mjcf import to_mjcf
from gtpin.extras.simulators.sdf import to_sdf
from gtpin.extras.simulators.springs import with_joint_springs, with_link_springs
from gtpin.model.model import Model


def _sdf(model: Model, file: Path, session: str | None, tables: TablesFor) -> Export:
    robot, stands, model = calibrated_chain(model), notes_of_robots(model), model.of_tool()
    machine, shown = with_link_springs(mechanism(robot), model, robot)
    return Export({file.name: to_sdf(machine)}, left_out(model, shown), stands, inexact=with_remainders(model, shown))


def _mjcf(model: Model, file: Path, session: str | None, tables: TablesFor) -> Export:
    robot, stands, model = calibrated_chain(model), notes_of_robots(model), model.of_tool()
    plain = mechanism(robot)
    machine, shown = with_guideways(plain, model, robot)
    for parts in (with_cart_springs, with_link_springs):
        machine, more = parts(machine, model, robot)
        shown |= more
    machine, by_joints = with_joint_springs(machine, model)
    machine, by_drives = with_drives(machine, model, session)
    shown |= by_joints | by_drives
    missing = left_out(model, {*shown, "drive scales"})
    inexact = with_remainders(model, shown, session)
    return Export({file.name: to_mjcf(machine, plain)}, missing, stands, inexact=inexact)


SDF = Writer(_sdf, ".sdf")
MJCF = Writer(_mjcf, ".xml")
