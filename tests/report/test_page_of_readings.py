"""The page and the figures of a calibration by a ball bar and wires."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from browsers import Opened, launched
from known_readings import MIDDLE, NOMINAL, RADIUS, commands_to, way, write_table

import gtpin
from gtpin.calibration.result import Calibration
from gtpin.data import Dataset
from gtpin.errors import DatasetError, GtpinError
from gtpin.report.calibration import CalibrationPresentation
from gtpin.report.figure import has_plotly

UP = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
STATIONS = {
    "A": np.add(MIDDLE, [0.8, 0.8, 0.3]),
    "B": np.add(MIDDLE, [-0.8, 0.8, 0.0]),
    "C": np.add(MIDDLE, [0.1, -0.9, 0.4]),
}
NOISE = 1e-5


def write(folder: Path) -> None:
    """Circles in two planes and both directions, and wires from three stations at 50 places, with noise."""
    rng = np.random.default_rng(8)
    declared = ", ".join(f"{key} = {at.tolist()}" for key, at in STATIONS.items())
    (folder / "dataset.toml").write_text(
        'schema = "gtpin-dataset/2"\nrobot = "gantry_tau"\n'
        f'[[instrument]]\nname = "bar"\nkind = "range"\nsigma = {NOISE}\nstations = {{C = {MIDDLE.tolist()}}}\n'
        f'station_sigma = 1e-3\n[[instrument]]\nname = "wire"\nkind = "range"\nsigma = {NOISE}\n'
        f"stations = {{{declared}}}\nstation_sigma = 1e-3\n",
        encoding="utf-8",
    )
    T = np.vstack([way(plane, angle) for plane in ("XY", "ZX") for angle in (UP, UP[::-1])])
    ranges = np.linalg.norm(T - MIDDLE, axis=1) + NOISE * rng.standard_normal(len(T))
    rows = [[f"b{i}", *q, value, i] for i, (q, value) in enumerate(zip(commands_to(T), ranges, strict=True))]
    write_table(folder / "bar.csv", "pose,q1,q2,q3,range,time", rows)
    rows = []
    for i, q in enumerate(rng.uniform(-0.3, 0.3, (50, 3))):
        at = NOMINAL.kinematics.forward(q[None]).T[0]
        for key, station in STATIONS.items():
            value = float(np.linalg.norm(at - station)) + NOISE * rng.standard_normal()
            rows.append([f"w{i}", *q, key, value, 1000 + i])
    write_table(folder / "wire.csv", "pose,q1,q2,q3,station,range,time", rows)


@pytest.fixture(scope="module")
def calibration(tmp_path_factory: pytest.TempPathFactory) -> Calibration:
    folder = tmp_path_factory.mktemp("readings")
    write(folder)
    return gtpin.calibrate(Dataset.read(folder))


@pytest.fixture(scope="module")
def page(calibration: Calibration) -> str:
    return CalibrationPresentation(calibration).page()


def test_every_entry_of_the_contents_leads_to_a_section(page: str) -> None:
    links = re.findall(r'href="#([\w-]+)"', page)
    assert {"instruments", "maps", "covariates", "parameters"} <= set(links)
    for link in links:
        assert f'id="{link}"' in page


def test_the_page_draws_stations_and_wires(page: str) -> None:
    (picture,) = re.findall(r'<svg class="drawing".*?</svg>', page, flags=re.DOTALL)
    for name in ("bar", "wire A", "wire B", "wire C"):
        assert f">{name}</text>" in picture
    assert picture.count("stroke-dasharray") == 4


@pytest.mark.skipif(not has_plotly(), reason="plotly is not installed")
def test_the_page_has_a_polar_plot_of_each_circle_as_measured_and_as_left(page: str) -> None:
    assert 'id="circles"' in page
    for number in range(2):
        for layer in ("measured", "before"):
            assert f'id="plot-circle-{number}-{layer}"' in page
    assert "plot-circle-2" not in page
    assert "-after" not in "".join(re.findall(r'id="(plot-circle[^"]*)"', page))
    radius = f"radius {1e3 * RADIUS:.0f}"
    assert re.search(rf"bar XY, {radius}", page.replace("\u00a0", " "))
    assert "Counterclockwise: G" in page


@pytest.mark.skipif(not has_plotly(), reason="plotly is not installed")
def test_a_circle_of_a_sound_machine_deviates_by_noise_alone(calibration: Calibration) -> None:
    made = calibration.plot_ball_bar(1)
    lines = [trace for trace in made.data if trace.name]
    assert len(lines) == 4
    for line in lines:
        assert 2.0 < np.ptp(line.r) < 8.0 * 1e6 * NOISE


@pytest.mark.skipif(not has_plotly(), reason="plotly is not installed")
def test_readings_over_the_workspace_are_where_the_tcp_was_in_sigmas(calibration: Calibration) -> None:
    (points,) = calibration.plot_workspace("xz").data
    assert len(points.x) == 96 + 150
    assert points.x.min() > MIDDLE[0] - 0.7
    assert points.x.max() < MIDDLE[0] + 0.7
    assert float(np.sqrt((points.marker.color**2).mean())) == pytest.approx(1.0, abs=0.3)
    assert points.text[0] == "b0, bar"
    with pytest.raises(GtpinError, match="there is no view"):
        calibration.plot_workspace("zz")


@pytest.mark.skipif(not has_plotly(), reason="plotly is not installed")
def test_each_instrument_can_be_chosen(page: str, calibration: Calibration) -> None:
    assert '<select data-choice="instrument">' in page
    assert re.search(r'<option value="wire">wire \(', page)
    assert len(calibration.plot_residuals("time", "wire").data[0].x) == 150
    assert len(calibration.plot_residuals("time").data[0].x) == 96
    with pytest.raises(DatasetError, match="bar, wire"):
        calibration.plot_residuals("time", "range")


@pytest.mark.skipif(not has_plotly(), reason="plotly is not installed")
def test_circles_are_drawn_in_a_browser_and_follow_the_choice_of_an_instrument(page: str, tmp_path: Path) -> None:
    with launched() as browser:
        opened = Opened(browser, tmp_path / "report.html", page)
        kinds = "document.getElementById('plot-circle-0-measured')._fullData.map((trace) => trace.type)"
        assert opened.run(kinds) == ["scatterpolar"] * 3
        shown = "document.getElementById('plot-map-xy')._fullData[0]._length"
        assert opened.run(shown) == 96 + 150
        opened.tab.select_option("select[data-choice=instrument]", "wire")
        assert opened.run(shown) == 150
        opened.is_whole()
