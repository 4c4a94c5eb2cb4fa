"""Mistakes that people make with measurements: each takes the files of a good dataset and spoils them.

A mistake is a function of the table of poses, the content of ``dataset.toml`` and a random generator. It changes the table
and the content in place, or returns a new table. Nothing here uses gtpin: the mistakes are made in the files.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

Toml = dict[str, Any]
Spoil = Callable[[pd.DataFrame, Toml, np.random.Generator], pd.DataFrame | None]

XYZ = ["x", "y", "z"]
WXYZ = ["qw", "qx", "qy", "qz"]


@dataclass(frozen=True)
class Mistake:
    """A mistake.

    Parameters
    ----------
    name
        As the table in the docs has it.
    spoil
        Makes the mistake.
    words
        Regular expression that a message which names the mistake matches, whatever the case.
    effect
        (id, site) of the effect that the machine has when it has one; each machine has its own where None.
    right
        Effects that describe this mistake, and are no wrong causes.
    noise
        1 sigma per axis of the positions, m, with the mistake in them.
    """

    name: str
    spoil: Spoil
    words: str
    effect: tuple[str, str] | None = None
    right: tuple[str, ...] = ()
    noise: float = 1.5e-5


def _rotations(table: pd.DataFrame) -> Rotation:
    return Rotation.from_quat(table[WXYZ].to_numpy(), scalar_first=True)


def _set_rotations(table: pd.DataFrame, rotations: Rotation) -> None:
    table[WXYZ] = rotations.as_quat(scalar_first=True)


def _sigma(factor: float) -> Spoil:
    def spoil(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
        toml["instrument"]["position_sigma"] *= factor
        toml["instrument"]["orientation_sigma"] *= factor

    return spoil


def _position_sigma(factor: float) -> Spoil:
    def spoil(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
        toml["instrument"]["position_sigma"] *= factor

    return spoil


def _scaled(columns: tuple[str, ...], factor: float) -> Spoil:
    def spoil(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
        for name in columns:
            table[name] = table[name] * factor

    return spoil


def _starting(prefix: str, change: Callable[[pd.Series], pd.Series]) -> Spoil:
    def spoil(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
        for name in [c for c in table.columns if c.startswith(prefix)]:
            table[name] = change(table[name])

    return spoil


def _beside_the_base(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    way = rng.standard_normal(3)
    table[XYZ] += rng.uniform(1e-3, 5e-3) * way / np.linalg.norm(way)


def _elsewhere(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    turn = Rotation.from_euler("zyx", [rng.uniform(-3.0, 3.0), *rng.normal(0.0, 0.02, 2)])
    table[XYZ] = turn.apply(table[XYZ].to_numpy()) + rng.uniform(-4.0, 4.0, 3)
    _set_rotations(table, turn * _rotations(table))


def _conjugated(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    table[WXYZ[1:]] *= -1.0


def _scalar_last(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    table[WXYZ] = table[["qx", "qy", "qz", "qw"]].to_numpy()


def _euler_as_vector(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    angles = _rotations(table).as_euler("xyz")
    _set_rotations(table, Rotation.from_rotvec(angles))


def _vector_as_euler(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    _set_rotations(table, Rotation.from_euler("xyz", _rotations(table).as_rotvec()))


def _other_euler_order(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    _set_rotations(table, Rotation.from_euler("XYZ", _rotations(table).as_euler("xyz")))


def _orientation_constant(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    table[WXYZ] = [1.0, 0.0, 0.0, 0.0]


def _left_handed(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    table["y"] *= -1.0
    mirror = np.diag([1.0, -1.0, 1.0])
    _set_rotations(table, Rotation.from_matrix(mirror @ _rotations(table).as_matrix() @ mirror))


def _swapped(a: str, b: str) -> Spoil:
    def spoil(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
        table[[a, b]] = table[[b, a]].to_numpy()

    return spoil


def _commands(table: pd.DataFrame) -> list[str]:
    return [c for c in table.columns if c.startswith("q") and c[1:].isdigit()]


def _ids_of_their_own(table: pd.DataFrame) -> None:
    """A table whose commands are off has no repeated visits that a reader could check."""
    table["pose"] = [f"p{i}" for i in range(len(table))]


def _one_row_off(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    names = _commands(table)
    table[names] = np.roll(table[names].to_numpy(), 1, axis=0)
    _ids_of_their_own(table)


def _one_row_off_from_the_middle(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    names, middle = _commands(table), len(table) // 2
    q = table[names].to_numpy()
    q[middle:] = q[middle - 1 : -1]
    table[names] = q
    _ids_of_their_own(table)


def _commands_shuffled(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    names = _commands(table)
    table[names] = table[names].to_numpy()[rng.permutation(len(table))]
    _ids_of_their_own(table)


def _commands_in_millimetres(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    table[_commands(table)] *= 1000.0


def _reversed_in_the_second_half(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    middle = len(table) // 2
    q = table["q2"].to_numpy(copy=True)
    q[middle:] = q[middle:][::-1]
    table["q2"] = q
    _ids_of_their_own(table)


def _inches_in_the_second_half(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    table.loc[table.index[len(table) // 2 :], XYZ] /= 0.0254


def _approach_by_sign_of_command(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    for name in _commands(table):
        table[f"approach{name[1:]}"] = np.where(table[name] > 0.0, 1, -1)


def _of_other_rows(prefix: str) -> Spoil:
    def spoil(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
        names = [c for c in table.columns if c.startswith(prefix)]
        table[names] = table[names].to_numpy()[rng.permutation(len(table))]

    return spoil


def _cut_off(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    for name in _commands(table):
        table[name] = np.trunc(table[name] / 1e-4) * 1e-4


def _temperatures_late(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    order = np.argsort(table["time"].to_numpy())
    time = table["time"].to_numpy()[order]
    for name in [c for c in table.columns if c.startswith("temp")]:
        table.loc[table.index, name] = np.interp(table["time"] - 3000.0, time, table[name].to_numpy()[order])


def _bumped(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    middle = len(table) // 2
    table.loc[table.index[middle:], XYZ] += rng.choice([-1.0, 1.0], 3) * rng.uniform(2e-4, 8e-4, 3)


def _zero_off(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    name = rng.choice(_commands(table))
    table[name] += 0.05


def _sentinels(value: float, share: float) -> Spoil:
    def spoil(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
        rows = rng.random(len(table)) < share
        rows[: max(1, int(0.5 * share * len(table)))] = True
        table.loc[rows, [c for c in table.columns if c.startswith("temp")]] = value

    return spoil


def _power_up(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    first = table["time"].rank() <= 4
    table.loc[first, [c for c in table.columns if c.startswith("temp")]] = 85.0


def _repeated(times: int) -> Spoil:
    def spoil(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> pd.DataFrame:
        return table.loc[table.index.repeat(times)].reset_index(drop=True)

    return spoil


def _clock_from_zero_each_session(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    table["time"] -= table.groupby("session")["time"].transform("min")


def _two_machines(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    half = rng.permutation(len(table))[: len(table) // 2]
    turn = Rotation.from_rotvec(2e-3 * rng.standard_normal(3))
    table.loc[half, XYZ] = turn.apply(table.loc[half, XYZ].to_numpy()) + 1e-3 * rng.standard_normal(3)


def _rounded(step: float) -> Spoil:
    def spoil(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
        table[XYZ] = (table[XYZ] / step).round() * step

    return spoil


def _stuck(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    first, last = len(table) // 3, len(table) // 3 + len(table) // 6
    table.loc[first:last, [*XYZ, *WXYZ]] = table.loc[first, [*XYZ, *WXYZ]].to_numpy(dtype=float)


def _tool(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    table[XYZ] += _rotations(table).apply([0.0, 0.0, -0.1])


def _typo(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    table.loc[int(rng.integers(len(table))), "x"] += 0.1


def _wrong_robot(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    toml["robot"] = "tau"


def _one_session(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    table["session"] = "1"


def _temperatures_swapped(table: pd.DataFrame, toml: Toml, rng: np.random.Generator) -> None:
    table[["temp_frame", "temp_link"]] = table[["temp_link", "temp_frame"]].to_numpy()


HEAT = ("thermal_links", "arm")

MISTAKES = (
    Mistake("noise declared a thousand times too large", _sigma(1e3), "show a noise of|times the noise|rounded"),
    Mistake("position noise declared in micrometres", _position_sigma(1e6), "micromet|show a noise of"),
    Mistake("noise declared 100 times too large", _sigma(100.0), "show a noise of|times the noise|rounded"),
    Mistake("noise declared 10 times too large", _sigma(10.0), "show a noise of|times the noise|rounded"),
    Mistake("noise declared 100 times too small", _sigma(0.01), "show a noise of|times the noise|rounded"),
    Mistake("noise declared 10 times too small", _sigma(0.1), "show a noise of|times the noise|rounded"),
    Mistake("frame 1 to 5 mm off the base frame, declared `robot`", _beside_the_base, "free"),
    Mistake("instrument in another place, declared `robot`", _elsewhere, "free"),
    Mistake("quaternions conjugated", _conjugated, "conjugat|inverse"),
    Mistake("quaternions xyzw", _scalar_last, "xyzw"),
    Mistake("Euler angles read as rotation vectors", _euler_as_vector, "euler|rotation vector|convention"),
    Mistake("rotation vectors read as Euler angles", _vector_as_euler, "euler|rotation vector|convention"),
    Mistake("Euler angles in another order", _other_euler_order, "euler|convention"),
    Mistake("orientation constant", _orientation_constant, "orientation.*(constant|same|not measured)"),
    Mistake("left-handed frame", _left_handed, "left-handed|mirror|reversed|sign"),
    Mistake("y reversed", _scaled(("y",), -1.0), "left-handed|mirror|reversed|sign"),
    Mistake("x and y swapped", _swapped("x", "y"), "swap|exchang|order"),
    Mistake("centimetres", _scaled(("x", "y", "z"), 100.0), "centimet"),
    Mistake("inches", _scaled(("x", "y", "z"), 1.0 / 0.0254), "inch"),
    Mistake("millimetres", _scaled(("x", "y", "z"), 1000.0), "millimet"),
    Mistake("z alone in millimetres", _scaled(("z",), 1000.0), "millimet"),
    Mistake("commands in millimetres", _commands_in_millimetres, "millimet"),
    Mistake("q1 and q2 swapped", _swapped("q1", "q2"), "swap|exchang|order"),
    Mistake("q3 reversed", _scaled(("q3",), -1.0), "sign|reversed"),
    Mistake("commands shifted by one row", _one_row_off, "row"),
    Mistake("commands shifted by one row, in the second half", _one_row_off_from_the_middle, "row"),
    Mistake("commands shuffled", _commands_shuffled, "row|order|commands"),
    Mistake("q2 in reverse order in the second half", _reversed_in_the_second_half, "rows?"),
    Mistake("inches in the second half", _inches_in_the_second_half, "rows?|inch"),
    Mistake("commands truncated to 0.1 mm", _cut_off, "commands have steps"),
    Mistake("tracker moved by a bump in the middle", _bumped, "row|bump", right=("frame_shift", "tracker_drift")),
    Mistake("a cart's zero off by 50 mm", _zero_off, "tolerances|zero|nominal", right=("zero_shift",)),
    Mistake("temperatures in kelvin", _starting("temp", lambda t: t + 273.15), "kelvin", HEAT),
    Mistake("temperatures in Fahrenheit", _starting("temp", lambda t: 1.8 * t + 32.0), "fahrenheit", HEAT),
    Mistake("-999 in 5 % of the temperatures", _sentinels(-999.0, 0.05), "-999|temp", HEAT),
    Mistake("65535 in 30 % of the temperatures", _sentinels(65535.0, 0.3), "65535|temp", HEAT),
    Mistake("85 degC in the first temperatures, as some sensors give at power-up", _power_up, "85|temp", HEAT),
    Mistake("0 K in 5 % of the temperatures", _sentinels(-273.15, 0.05), "-273|temp", HEAT),
    Mistake("every row twice", _repeated(2), "copies"),
    Mistake("every row ten times", _repeated(10), "copies"),
    Mistake("approach +1 everywhere", _starting("approach", lambda a: a * 0 + 1), "approach", ("backlash", "cart1")),
    Mistake("approach reversed", _starting("approach", lambda a: -a), "backlash|approach|sign", ("backlash", "cart1")),
    Mistake(
        "approach recorded as the sign of the command", _approach_by_sign_of_command, "approach", ("backlash", "cart1")
    ),
    Mistake("approach of other rows", _of_other_rows("approach"), "approach", ("backlash", "cart1")),
    Mistake("speeds of other rows", _of_other_rows("speed"), "speed", ("servo_lag", "cart2")),
    Mistake("sessions of other rows", _of_other_rows("session"), "session", ("frame_shift", "frame")),
    Mistake("temperatures recorded 50 minutes late", _temperatures_late, "temp", HEAT),
    Mistake("speeds in mm/s", _starting("speed", lambda v: 1e3 * v), "speed", ("servo_lag", "cart2")),
    Mistake("payload in grams", _starting("payload", lambda p: 1e3 * p), "payload", ("link_compliance", "arm")),
    Mistake("forces reversed", _starting("f", lambda f: -f), "force|sign", ("link_compliance", "arm")),
    Mistake("time in ms", _starting("time", lambda t: 1e3 * t), "time", ("tracker_drift", "frame")),
    Mistake(
        "clock restarted at zero in each session", _clock_from_zero_each_session, "time", ("tracker_drift", "frame")
    ),
    Mistake("two sessions with one name", _one_session, "session", ("zero_shift", "cart2"), ("frame_shift",)),
    Mistake("temp_frame and temp_link swapped", _temperatures_swapped, "temp", HEAT),
    Mistake("two machines in one table", _two_machines, "two (groups|machines)", right=("frame_shift",)),
    Mistake("positions rounded to 0.1 mm", _rounded(1e-4), "rounded", noise=3.3e-5),
    Mistake("positions rounded to 1 mm", _rounded(1e-3), "rounded", noise=1e-3 / 12**0.5),
    Mistake("a sixth of the readings, in successive rows, all equal", _stuck, "copies|do not fit the others|gross"),
    Mistake("a tool of 100 mm that was not declared", _tool, "target|tool|tcp|tolerances", right=("target_offset",)),
    Mistake("one number mistyped by 100 mm", _typo, "gross|set aside"),
    Mistake("wrong robot in dataset.toml", _wrong_robot, "robot|nominal|reach|calibration leaves"),
    Mistake("no mistake", lambda table, toml, rng: None, "(?!)"),
)
