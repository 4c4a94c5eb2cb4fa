"""The page of a comparison of the paper's models on held-out poses."""

from __future__ import annotations

from gtpin.comparison.result import Comparison
from gtpin.data import Dataset
from gtpin.report.comparison_plots import ANGLES, angles_plot, carts_plot, errors_plot
from gtpin.report.page import Table, render
from gtpin.report.provenance import provenance
from gtpin.report.words import whole
from gtpin.robot.robot import Robot

CONTENTS = (("errors", "Errors"), ("angles", "Orientation errors"), ("provenance", "Provenance"))
MODELS = {
    1: "reduced arm, straight tracks",
    2: "reduced arm, measured tracks",
    3: "full arm, straight tracks",
    4: "full arm, measured tracks",
    5: "full arm, each link on the track that suits it",
}


def comparison_page(comparison: Comparison, dataset: Dataset, robot: Robot) -> str:
    """The whole report of a comparison as one self-contained HTML file."""
    carts = dataset.carts
    plots = {"errors": errors_plot(comparison)}
    angles = [held for held in comparison.held if held.angles is not None]
    if angles:
        plots["angles"] = angles_plot(comparison)
    if carts is not None:
        plots["carts"] = carts_plot(carts)
    headline, advice = _verdict(comparison)
    contents = [item for item in CONTENTS if item[0] != "angles" or angles]
    return render(
        "comparison.html",
        title=f"Models of {robot.name} compared",
        contents=contents if carts is None else [*contents[:-1], ("carts", "The carts' tracks"), contents[-1]],
        plots=plots,
        provenance=provenance(dataset, robot, comparison.seed),
        robot=robot.name,
        poses=len(comparison.held[0].position),
        headline=headline,
        advice=advice,
        table=_table(comparison),
        cost=comparison.cost,
        carts=carts is not None,
        turned=bool(angles),
        angle=ANGLES,
    )


def _verdict(c: Comparison) -> tuple[str, list[str]]:
    """Which model predicts best, and whether the intervals show it."""
    intervals = {held.model: ends["mean_um"] for held, ends in zip(c.held, c.intervals(), strict=True)}
    means = {held.model: float(held.position.mean() * 1e6) for held in c.held}
    order = sorted(means, key=lambda model: means[model])
    best = order[0]
    words = f"Model {best} ({MODELS[best]}) predicts best"
    if len(order) == 1:
        return f"{words}: it is the only one that these data allow.", [
            "Models 2, 4 and 5 need the carts' tracks in carts.csv."
        ]
    second = order[1]
    top, low = intervals[best], intervals[second]
    sure = top is not None and low is not None and top[1] < low[0]
    headline = (
        f"{words}: {_um(means[best])} mean error on held-out poses, against {_um(means[second])} of model {second}."
    )
    advice = [] if sure else ["Their intervals overlap: these data don't settle which of the two is better."]
    if len(order) < len(MODELS):
        advice.append("Models 2, 4 and 5 need the carts' tracks in carts.csv.")
    return headline, advice


def _um(value: float) -> str:
    return whole(f"{value:.0f} µm")


def _table(c: Comparison) -> Table:
    head = ["model", "what it is", "mean (µm)", "95 %", "rms (µm)", "largest (µm)", "orientation, rms (mrad)", "poses"]
    rows = []
    for held, ends in zip(c.held, c.intervals(), strict=True):
        f = held.figures()
        between = ends["mean_um"] or (float("nan"), float("nan"))
        turned = f["orientation_rms_mrad"]
        rows.append(
            [
                str(held.model),
                MODELS[held.model],
                f"{f['mean_um']:.0f}",
                whole(f"{between[0]:.0f} to {between[1]:.0f}"),
                f"{f['rms_um']:.0f}",
                f"{f['max_um']:.0f}",
                "" if turned is None else f"{turned:.3f}",
                str(len(held.position)),
            ]
        )
    return Table(head, rows)
