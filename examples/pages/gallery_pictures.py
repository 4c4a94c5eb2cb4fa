"""The pictures of docs/python.md, each drawn from the variables that its example leaves; the docstring is the caption."""

from __future__ import annotations

import re
import warnings
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import gtpin

Found = dict[str, Any]
GREY, BLUE, RED = "0.6", "tab:blue", "tab:red"


def _axes(x: str, y: str, **settings: Any) -> tuple[Figure, Any]:
    figure = Figure(figsize=(4.8, 3.0), layout="constrained")
    axes = figure.add_subplot()
    axes.set(xlabel=x, ylabel=y, **settings)
    axes.grid(alpha=0.3)
    return figure, axes


def _bars(values: dict[str, float], label: str, **settings: Any) -> Figure:
    figure, axes = _axes(label, "", **settings)
    axes.barh(list(values), list(values.values()), color=BLUE)
    axes.invert_yaxis()
    for row, value in enumerate(values.values()):
        axes.annotate(f" {value:.3g}", (value, row), va="center")
    axes.margins(x=0.2)
    return figure


def _from_plotly(plotly: Any) -> Figure:
    """Lines, bands and markers of a figure of gtpin's reports."""
    figure, axes = _axes(plotly.layout.xaxis.title.text or "", plotly.layout.yaxis.title.text or "")
    named: set[str | None] = {None}
    before = None
    for trace in plotly.data:
        x, y = np.asarray(trace.x, dtype=float), np.asarray(trace.y, dtype=float)
        label = None if trace.name in named else trace.name
        if trace.fill == "tonexty" and before is not None:
            axes.fill_between(x, before, y, color=GREY, alpha=0.4, linewidth=0.0)
        if trace.mode == "markers":
            axes.plot(x, y, ".", color="0.3", markersize=4.0, label=label)
        elif trace.line.width != 0:
            axes.plot(x, y, marker="o" if "markers" in (trace.mode or "") else None, label=label)
        named.add(trace.name)
        before = y
    axes.legend(fontsize="small")
    return figure


def _rms(vectors: np.ndarray) -> float:
    return 1e6 * float(np.sqrt((vectors**2).sum(axis=1).mean()))


def load_and_move(found: Found) -> Figure:
    """The Gantry-Tau at home: three carts on tracks, six rods, one platform."""
    from gtpin.extras.view.still import still

    figure = still(gtpin.Model(gtpin.Geometry.nominal(found["robot"])))
    figure.set_size_inches(6.0, 4.6)
    return figure


def jacobians_and_accuracy(found: Found) -> Figure:
    """The expected error of a machine that is made to its tolerances, at poses that fill the workspace."""
    figure, axes = _axes("x, m", "z, m", aspect="equal")
    T = found["model"].predict(found["q"]).T
    dots = axes.scatter(T[:, 0], T[:, 2], c=1e3 * found["error"].position.at, s=22.0)
    figure.colorbar(dots, label="expected error, mm")
    return figure


def calibrate(found: Found) -> Figure:
    """True errors at poses that were not fitted, of the nominal and of the calibrated geometry."""
    machine = found["machine"]
    figure, axes = _axes("true position error, µm", "poses", xscale="log")
    for name, model in (("nominal", found["nominal"]), ("calibrated", found["calibration"].model)):
        off = 1e6 * np.linalg.norm(model.predict(machine.commands.q).T - machine.truth.T, axis=1)
        axes.hist(off, bins=np.geomspace(3.0, 3e4, 33), alpha=0.7, label=name)
    axes.legend()
    return figure


def compare_models(found: Found) -> Figure:
    """Mean errors of the paper's models on the half of the poses that was not fitted, with 95 % intervals."""
    comparison = found["comparison"]
    table, ends = comparison.table(), np.array([one["mean_um"] for one in comparison.intervals()])
    figure, axes = _axes("model of the paper", "mean position error, µm")
    means = table["mean_um"].to_numpy()
    axes.bar(table["model"].astype(str), means, yerr=np.abs(ends.T - means), color=BLUE, capsize=4.0)
    return figure


def diagnose(found: Found) -> Figure:
    """True errors at new poses: of a machine with backlash, and of one with nothing but noise, for which no cause is named."""
    values = {}
    for name, case in found["MACHINES"].items():
        diagnosis = gtpin.diagnose(case.dataset)
        short = name.removeprefix("a machine with ").replace(", and noise", "")
        for what, model in (("geometry alone", diagnosis.baseline.model), ("with causes", diagnosis.model)):
            off = model.predict(case.commands.q, case.commands.covariates).T - case.truth.T
            values[f"{short}:\n{what}"] = _rms(off)
    return _bars(values, "true position error, RMS, µm")


def export_to_mujoco(found: Found) -> Figure:
    """The calibrated machine at rest in MuJoCo: its rods and carts, and where gtpin predicts the TCP."""
    model, data = found["model"], found["data"]
    figure, axes = _axes("y, m", "z, m", aspect="equal")
    for k in range(model.neq):
        rod, cart = model.eq_obj1id[k], model.eq_obj2id[k]
        end = data.xpos[rod] + data.xmat[rod].reshape(3, 3) @ model.eq_data[k, :3]
        axes.plot(*np.stack([data.xpos[rod], end])[:, 1:].T, "o-", color=GREY, markersize=3.0)
        axes.plot(*data.xpos[cart][1:], "s", color=BLUE, markersize=7.0)
    axes.plot(*found["expected"][1:], "x", color=RED, markersize=9.0, label="TCP, predicted")
    axes.legend(loc="lower right")
    return figure


def fuzz(found: Found) -> Figure:
    """How commands ended on damaged files: 0 done, 1 not converged, 2 refused with one line. Nothing else may happen."""
    figure, axes = _axes("damaged files", "")
    ended = re.findall(r"^(\w+)\s+exit\s+(\d+): (\d+)$", found["printed"], re.MULTILINE)
    names = sorted({name for name, _, _ in ended})
    left = dict.fromkeys(names, 0)
    for code in sorted({code for _, code, _ in ended}):
        counts = {name: int(count) for name, own, count in ended if own == code}
        axes.barh(list(counts), list(counts.values()), left=[left[name] for name in counts], label=f"exit {code}")
        left |= {name: left[name] + count for name, count in counts.items()}
    axes.legend()
    return figure


def machine_in_mujoco(found: Found) -> Figure:
    """By how much the commands for the nominal robot differ from those of the machine, along a path."""
    figure, axes = _axes("command", "change of the command, µm")
    changes = 1e6 * (found["given"].q - found["q"])
    axes.plot(np.arange(1, len(changes) + 1), changes, "o-", label=found["nominal"].robot.sites)
    axes.legend()
    return figure


def machines_for_learning(found: Found) -> Figure:
    """The TCP of fifty machines that the data of a diagnosis allow, at one command, about that of their mean."""
    figure, axes = _axes("x, µm", "z, µm", aspect="equal")
    q, around = found["case"].commands.q[:1], found["case"].commands.covariates
    around = {name: column[:1] for name, column in around.items()}
    sampled = found["diagnosed"].sample(50, np.random.default_rng(0))
    T = 1e6 * np.array([one.predict(q, around).T[0] for one in sampled])
    axes.plot(*(T - T.mean(axis=0))[:, [0, 2]].T, "o", color=BLUE, markersize=4.0)
    return figure


def own_effect(found: Found) -> Figure:
    """What a cable chain does to the TCP, with and without a payload."""
    figure, axes = _axes("q2, m", "motion of the TCP, µm")
    for payload in np.unique(found["payload"]):
        some = found["payload"] == payload
        axes.plot(found["q"][some, 1], found["moved"][some], "o", markersize=4.0, label=f"{payload:.0f} kg")
    axes.legend()
    return figure


def plan_measurement(found: Found) -> Figure:
    """The 25 poses that determine the geometry best, among 180."""
    figure, axes = _axes("x, m", "z, m", aspect="equal")
    T = found["model"].predict(found["q"]).T
    axes.plot(T[:, 0], T[:, 2], "o", color=GREY, markersize=3.0, label="candidates")
    chosen = T[found["plan"].rows]
    axes.plot(chosen[:, 0], chosen[:, 2], "o", color=RED, markersize=6.0, label="chosen")
    axes.legend()
    return figure


def stewart_tolerances(found: Found) -> Figure:
    """Errors of a Stewart platform within its tolerances: 1,000 drawn machines against the prediction by the Jacobian."""
    figure, axes = _axes("Monte Carlo, mm", "Jacobian, mm", aspect="equal")
    drawn, predicted = 1e3 * found["drawn"][:, 0], 1e3 * found["predicted"][:, 0]
    ends = [min(drawn.min(), predicted.min()), max(drawn.max(), predicted.max())]
    axes.plot(ends, ends, color=GREY)
    axes.plot(drawn, predicted, ".", color=BLUE)
    return figure


def arm_notebook(found: Found) -> Figure:
    """The periodic error of the first joint of a virtual UR5, with its 95 % interval."""
    return _from_plotly(found["diagnosis"].plot_effect())


def calibrate_and_diagnose_notebook(found: Found) -> Figure:
    """Backlash of a cart: the deviation on both sides of a command."""
    return _from_plotly(found["diagnosis"].plot_effect())


def delta_with_probe_notebook(found: Found) -> Figure:
    """A delta calibrated by touches: small residuals, large true errors."""
    kinds = ("residual of the touches, µm", "true error, µm")
    values = {f"{name}:\n{kind[:-4]}": row[kind] for name, row in found["rows"].items() for kind in kinds}
    return _bars(values, "µm", xscale="log")


def diagnosis_to_mujoco_notebook(found: Found) -> Figure:
    """The jump of the TCP with the direction of approach: of the machine, and in MuJoCo by a file and by commands."""
    return _from_plotly(found["figure"])


def own_effect_notebook(found: Found) -> Figure:
    """The pull of a cable chain on its cart, as the diagnosis with that effect finds it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return _from_plotly(found["diagnosis"].plot_effect())
