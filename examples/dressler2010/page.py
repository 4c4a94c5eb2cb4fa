# ruff: noqa: E501 (a page of prose)
"""Makes docs/paper.md: every number of Tables I to III and the stated ranges next to gtpin's. Every number on the page is computed here.

python examples/dressler2010/page.py docs/paper.md            # the page (some minutes: 24 draws of the twin)
python examples/dressler2010/page.py docs/paper.md figures/   # and figures in the spirit of the paper's 4, 5, 6, 8, 9, 10
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from measure import measure
from paper_blocks import Block, compare_frame_angles, compare_table1, compare_table3
from paper_figures import (
    along_and_across,
    cost_and_position,
    linearity,
    orientation_along_grid,
    orientation_change,
    orientation_errors,
)
from paper_grid import RECOVERED, Grid, recover_grid
from paper_steps import drawn_measurements, step_change
from paper_tables import tables
from seeds import EVERY, PAIRS, Draws, draw, every_draw, markdown, order, printed_rods, turning_alone

import gtpin
from gtpin.comparison.compare import compare

DRAWS = 24
"""Draws of the twin's errors, seeds 0 to 23."""

TABLE3_FILE = "figures/paper_table3.md"

INTRODUCTION = """# The paper, reproduced

Dressler, Brogårdh and Robertsson, *A Kinematic Error Model for a Parallel Gantry-Tau Manipulator*, ICRA 2010, beside what gtpin computes. `python examples/dressler2010/page.py docs/paper.md figures/` makes this page, and figures like the paper's; `tests/paper` checks the numbers.

*Computed*: from the paper's Table II and gtpin's kinematics. *Simulated*: with a virtual machine, the *twin* (`examples/dressler2010/`). A cell is: printed / gtpin's number ± standard deviation. Only the limits of the measurement grid were fitted to the paper. The sizes of the twin's errors were chosen by hand, close to Table II's costs by link.
"""

GRID = """## The measurement grid, from Table III

The limits of the paper's grid are not printed. Centre and half widths of six layers of 6 x 5 points were fitted to {numbers} numbers of S_pos and S_rot (rows L, P and C of all links, track directions of links 1, 3a, 3b and 3c) and to the {kept} of {of} poses that the paper kept. Relative to the home TCP, along the tracks, across them and upwards: centre ({c[0]:.3f}, {c[1]:.3f}, {c[2]:.3f}) m, half widths
({h[0]:.3f}, {h[1]:.3f}, {h[2]:.3f}) m. {inside} of its 180 poses lie within the actuator range.
"""

TABLE1 = """## Table I from Table II

Gaussian closure residuals with the variance of Table II's final costs, propagated through the inverse closure Jacobian over the grid (computed): expected mean and largest error of 61 poses, ± the standard deviation between sets of 61 poses. Model 2 has the track directions of model 1, because its own are printed in another frame.

{near} of the ten printed numbers lie within two standard deviations. The largest difference is that of {farthest}: {most:.1f} standard deviations.
"""

TABLE3 = """## Table III

S_pos, S_rot and S_cost are sums over 61 poses, and over both signs of a step of 5e-5 of one parameter (m, rad, or without unit for track directions), of the change of position, of orientation (the absolute changes of the three ZYZ angles) and of a link's squared closure residual (its expectation over Gaussian residuals with the variance of Table II); without linearisation, as 61 times the mean over the grid. The Euler angles (ZYX) are of the transformation between two tracker frames. Deviations of gtpin's numbers from the printed ones, which have one or two digits ([all numbers](figures/paper_table3.md)):
"""

TWIN = """## A twin of the experiment

The twin simulates the machine, its grid of 176 poses, measured in one direction and back, and the measurements of the carts (assumptions: `examples/dressler2010/README.md`). `gtpin compare` fits models 1 to 5 to each half of the {poses} poses within the actuator range and predicts the other half; the paper had 122 poses. *Grid of Table III*: the same machines at the {recovered} poses of the grid above. The random errors are drawn {draws} times (seeds 0 to {last}).

- The errors have the size of Table I, and its order except for models 2 and 3. Of {draws} draws, the mean error of the first model is larger: 1 > 2 in {o[0]}, 2 > 3 in {o[1]}, 3 > 4 in {o[2]}, 4 > 5 in {o[3]}.
- Models 2 and 3: the rotation of the plate adds {asked:.0f} micrometres of rod length to the residual of link 1 by Table II's costs, {given:.0f} by its geometry.
- The mean errors of models 3 to 5 are larger than printed, by {low:.0f} to {high:.0f} % over the draws: errors of a cart's links are correlated, and the poses are left out of the fit.
- Models 4 and 5 are {gap:.1f} um apart in the mean on the twin's grid and {other_gap:.1f} um on that of Table III, where 4 > 5 in {other} draws. The paper prints 10 um; its own Table II gives {from_table2:.1f} um.
"""

TABLE3_HEAD = """# Table III, number by number

[The paper, reproduced](../paper.md) says what is computed. A cell is: printed / gtpin's number.
"""

COSTS = """## The two costs

The paper minimises squared closure residuals, for each link separately (*closure cost*, `examples/dressler2010/paper_closures.py`). The noise of the measured orientation then biases the estimated joint positions: by about 0.8 mm at 1 mrad, with tolerances of 1 mm (`tests/paper_models`). gtpin minimises the difference between predicted and measured poses in units of their noise, with the tolerances as priors (*pose cost*); no bias is found.
"""


def block(b: Block) -> str:
    """A block as a Markdown table: printed / gtpin's, with its spread where it has one."""
    lines = [f"**{b.name}** ({b.unit}); relative deviations {100 * b.rms:.1f} % RMS, largest {100 * b.worst:.1f} %", ""]
    lines += ["| | " + " | ".join(b.columns) + " |", "|---" * (len(b.columns) + 1) + "|"]
    spreads = np.zeros_like(b.ours) if b.spread is None else b.spread
    for name, printed, ours, spread in zip(b.rows, b.printed, b.ours, spreads, strict=True):
        about = [f" ± {s:.2g}" if s else "" for s in spread]
        cells = (f"{p:.3g}/{o:.3g}{s}" for p, o, s in zip(printed, ours, about, strict=True))
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def table3(blocks: Sequence[Block]) -> str:
    """All numbers of Table III, a file of its own."""
    return "\n".join([TABLE3_HEAD, *map(block, blocks)])


def deviations(blocks: Sequence[Block]) -> str:
    """How far each part of Table III is from the printed one."""
    lines = ["| | RMS, % | largest, % |", "|---|---|---|"]
    lines += [f"| {b.name} | {100 * b.rms:.1f} | {100 * b.worst:.1f} |" for b in blocks]
    return "\n".join(lines) + "\n"


def of_table3(model: gtpin.Model, grid: Grid) -> tuple[Block, ...]:
    """The blocks of Table III."""
    return (*compare_table3(model, grid), *compare_frame_angles(model, grid))


def twin(draws: Draws, from_table2: float) -> str:
    """The twin's Tables I and II of many draws."""
    told = tables()
    excess = 100.0 * (draws.pose[:, 2:, 0].mean(axis=0) / told.mean_um[2:] - 1.0)
    reduced, full = (printed_rods(model)[0] for model in (1, 3))
    gap, other_gap = (float((e[:, 3, 0] - e[:, 4, 0]).mean()) for e in (draws.pose, draws.recovered))
    text = TWIN.format(
        poses=draws.poses,
        recovered=draws.recovered_poses,
        draws=len(draws),
        last=len(draws) - 1,
        o=order(draws.pose),
        asked=np.sqrt(reduced**2 - full**2),
        given=turning_alone()[0],
        low=excess.min(),
        high=excess.max(),
        gap=gap,
        other_gap=other_gap,
        other=order(draws.recovered)[PAIRS.index((3, 4))],
        from_table2=from_table2,
    )
    return "\n".join([text, markdown(draws)])


def recovered() -> Grid:
    """The grid out of Table III, to the millimetre."""
    grid = recover_grid(nominal())
    return Grid(grid.center.round(3), grid.half_width.round(3))


def grid_section(grid: Grid, model: gtpin.Model) -> str:
    """What was recovered of the grid."""
    told = tables()
    own = sum(source == 3 for source in told.source)
    return GRID.format(
        c=grid.center,
        h=grid.half_width,
        inside=len(grid.commands(model)),
        numbers=2 * (7 * len(told.links) + 3 * own),
        kept=2 * told.measurement.calibration_poses,
        of=told.measurement.tcp_poses,
    )


def table1_section(blocks: tuple[Block, ...]) -> str:
    """Table I, with how far the printed numbers lie from the expected ones."""
    off = np.concatenate([((b.printed - b.ours) / b.spread)[0] for b in blocks if b.spread is not None])
    names = [f"the {what} of model {number}" for what in ("mean", "largest error") for number in blocks[0].columns]
    worst = int(np.argmax(np.abs(off)))
    text = TABLE1.format(near=np.count_nonzero(np.abs(off) <= 2.0), farthest=names[worst], most=abs(off[worst]))
    return "\n".join([text, *map(block, blocks)])


def nominal() -> gtpin.Model:
    """The nominal Gantry-Tau."""
    return gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau")))


def page(draws: Draws, grid: Grid) -> str:
    """The page.

    Parameters
    ----------
    draws
        Of the twin.
    grid
        The paper's, as :func:`recovered` gives it.
    """
    model = nominal()
    table1 = compare_table1(model, grid)
    parts = [
        INTRODUCTION,
        grid_section(grid, model),
        table1_section(table1),
        TABLE3,
        deviations(of_table3(model, grid)),
        twin(draws, table1[0].ours[0, 3] - table1[0].ours[0, 4]),
        COSTS,
    ]
    return "\n".join(parts)


def figures(folder: Path) -> None:
    """Figures in the spirit of the paper's: 4, 9 and 10 of Table II's geometry and costs, 5, 6 and 8 of the twin."""
    folder.mkdir(parents=True, exist_ok=True)
    model = nominal()
    everywhere, poses = RECOVERED.all_commands(model)
    q = everywhere[np.linspace(0, len(everywhere) - 1, tables().measurement.calibration_poses).astype(int)]
    drawn = drawn_measurements(model, q, tables().closure_sigmas(5))
    dataset, roaming = measure()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        comparison = compare(dataset)
    made = {
        "figure4": orientation_along_grid(poses, 6),
        "figure5": linearity(dataset.carts),
        "figure6": along_and_across(dataset.carts, roaming),
        "figure8": orientation_errors(comparison),
        "figure9": cost_and_position(step_change(model, q, drawn, "L", "1"), tables().links),
        "figure10": orientation_change(step_change(model, q, drawn, "Px", "3a")),
    }
    for name, figure in made.items():
        figure.savefig(folder / f"{name}.png")


if __name__ == "__main__":
    written, drawn = Path(sys.argv[1] if len(sys.argv) > 1 else "paper.md"), draw(DRAWS)
    grid = recovered()
    written.write_text(page(drawn, grid), encoding="utf-8")
    (written.parent / TABLE3_FILE).write_text(table3(of_table3(nominal(), grid)), encoding="utf-8")
    (written.parent / EVERY).write_text(every_draw(drawn), encoding="utf-8")
    if len(sys.argv) > 2:
        figures(Path(sys.argv[2]))
