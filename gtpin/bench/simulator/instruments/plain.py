"""A robot drawn from its tolerances, without effects, measured by some instruments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gtpin.bench.simulator.build import ids
from gtpin.bench.simulator.instruments.build import POOL
from gtpin.bench.simulator.instruments.case import InstrumentCase
from gtpin.bench.simulator.instruments.choice import (
    BAR,
    TOUCHED,
    checked,
    errors,
    held_readings,
    noises,
    reading,
    reads,
    stream,
)
from gtpin.bench.simulator.instruments.circles import circles
from gtpin.bench.simulator.instruments.gauge import Gauge
from gtpin.bench.simulator.instruments.layout import Layout
from gtpin.bench.simulator.instruments.range import Range
from gtpin.bench.simulator.instruments.tables import Read, Tables
from gtpin.bench.simulator.instruments.touch import begun, felt
from gtpin.bench.simulator.instruments.tracker import Tracker
from gtpin.bench.simulator.instruments.way import PlainWay
from gtpin.bench.simulator.simulate import REPEATED, draw_commands, draw_machine
from gtpin.bench.simulator.tracker import Noise
from gtpin.bench.simulator.true_robot import OnRods, true_robot
from gtpin.data import Commands
from gtpin.errors import GtpinError
from gtpin.robot.geometry import Geometry
from gtpin.robot.robot import Robot


def simulate_measured(
    robot: Robot,
    reference: str,
    instruments: Sequence[str],
    *,
    poses: int = 200,
    seed: int = 0,
    held_out: int = 120,
    tcp: str | None = None,
) -> InstrumentCase:
    """Draw a machine, command it, and measure it by some instruments.

    Parameters
    ----------
    robot
        The nominal robot.
    reference, tcp
        Name of the robot and of its TCP frame in the dataset.
    instruments
        Kinds of instruments: see :data:`~gtpin.bench.simulator.instruments.choice.KINDS`.
    poses
        Number of poses at which the reading instruments read (a tenth of them twice), and number of touches of each touched
        one.
    seed
        Seed of the random numbers. The same seed gives the same bytes.
    held_out
        Number of further commands, which are not measured and whose truth is given.

    Raises
    ------
    GtpinError
        If an instrument is not known, the robot hardly reaches its range or can't make the touches, or there is nothing to
        measure.
    """
    kinds, noise = checked(instruments), Noise()
    if not kinds or poses < 1 or held_out < 1:
        what = f"{len(kinds)} instruments, {poses} poses and {held_out} held out"
        raise GtpinError(what, hint="ask for at least one of each")
    rng = np.random.default_rng(seed)
    machine = draw_machine(robot, rng)
    if "encoder" in kinds and isinstance(machine, OnRods):
        machine = replace(machine, read=True)
    pool = draw_commands(machine, POOL, rng)
    layout = Layout.of(machine.predict(pool), np.array(robot.description.gravity), robot.n_actuators)
    pose, q = np.zeros(0, dtype=int), np.zeros((0, robot.n_actuators))
    if reads(kinds):
        again = rng.choice(poses, size=int(REPEATED * poses), replace=False)
        pose = rng.permutation(np.concatenate([np.arange(poses), again]))
        q = draw_commands(machine, poses, rng)[pose]
    stops, there, gauges = np.arange(len(q)), machine.predict(q), list[Gauge]()
    for kind in kinds:
        own = stream(seed, kind)
        if kind in TOUCHED:
            gauge = TOUCHED[kind](layout, np.arange(poses), True, own)
            gauges.append(replace(gauge, stop=len(q) + np.arange(poses)))
            pose = np.concatenate([pose, (pose.max() + 1 if len(pose) else 0) + np.arange(poses)])
            q = np.vstack([q, begun(gauge, machine, pool, (robot.lower, robot.upper), own)])
        elif kind == BAR:
            nominal = true_robot(Geometry.nominal(robot))
            round_, _ = circles(nominal, layout, pool, (robot.lower, robot.upper), poses)
            gauges.append(Range.bar(layout, len(q) + np.arange(len(round_)), True, own))
            pose = np.concatenate([pose, (pose.max() + 1 if len(pose) else 0) + np.arange(len(round_))])
            q = np.vstack([q, round_])
        else:
            gauges.append(reading(kind, layout, there, stops, noise, own))
    missed = [errors(gauge, noise, part) for gauge, part in zip(gauges, noises(seed, gauges), strict=True)]
    touching = [i for i, gauge in enumerate(gauges) if gauge.touches]
    way, _ = felt(PlainWay(machine, q), [gauges[i] for i in touching], [missed[i] for i in touching])
    held = draw_commands(machine, held_out, rng)
    truth = machine.predict(held)
    for gauge in gauges:
        if isinstance(gauge, Tracker):
            truth = gauge.seen(truth, gauge.truth)
    geometry = machine.geometry
    return InstrumentCase(
        name=f"case{seed:05d}",
        dataset=Tables(
            robot=reference,
            tcp=tcp,
            reference_temperature=20.0,
            pose=ids(pose),
            q=way.q,
            covariates={},
            read=tuple(
                Read(gauge.described(), gauge.stop, gauge.columns(way.poses[gauge.stop], error))
                for gauge, error in zip(gauges, missed, strict=True)
            ),
        ),
        commands=Commands(ids(np.arange(held_out)), held),
        truth=truth,
        effects=(),
        gauges=tuple(gauges),
        true=way.poses,
        steady=way.poses,  # a machine without effects returns exactly
        geometry=dict(zip(geometry.names, geometry.deviation.tolist(), strict=True)),
        machine=machine,
        held=held_readings(gauges, machine.predict(held)),
    )
