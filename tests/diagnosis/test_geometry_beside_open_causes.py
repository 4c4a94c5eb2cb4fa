"""The geometry that a diagnosis states where a class is open: that of its model, with sigmas that hold for every member."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import closures
import numpy as np
import pytest
from diagnosed import quietly

import gtpin
from gtpin.data import Dataset, InstrumentSection
from gtpin.diagnosis.result import Diagnosis
from gtpin.model.departures import departures
from gtpin.model.model_folder import write_model

pytestmark = pytest.mark.slow
SIGMA, SCALE, SHARE, SEED = 1.3e-5, 6e-4, 0.25, 2
"""Noise, m; deviation of a drive's scale; and of the geometry, in tolerances; seed of the machine."""


@cache
def delta(seed: int) -> tuple[Dataset, dict[str, float]]:
    """Positions of a delta with a wrong drive scale, and its deviations."""
    machine, rng = closures.nominal("linear_delta"), np.random.default_rng(seed)
    off = {name: SHARE * size * rng.standard_normal() for name, size in machine.parameters().items()}
    q = machine.in_range(rng, 120)
    real = machine.off(off | {"scale[cart2]": SCALE})
    T = real.follow(q, 0.02)[0] + SIGMA * rng.standard_normal((len(q), 3))
    section = InstrumentSection(position_sigma=SIGMA, frame="free")
    return replace(real.measured(q, rng), position=T, orientation=None, instrument=section), off


@cache
def said(seed: int, *exclude: str) -> Diagnosis:
    """The diagnosis of a delta."""
    return quietly(lambda: gtpin.diagnose(delta(seed)[0], exclude=exclude))


def test_the_stated_geometry_is_the_true_one_and_that_of_the_exported_model(tmp_path: Path) -> None:
    """The geometry alone takes up the scale of the drive: two lengths are off by more than three sigmas."""
    (dataset, off), found = delta(SEED), said(SEED)
    assert [(c.effect, c.site, c.probability < 0.95) for c in found.causes] == [("encoder_scale", "cart2", True)]
    write_model(found.model, tmp_path)
    exported = {one.name: one for one in departures(gtpin.read_model(tmp_path), dataset.q)}
    stated = found.to_json()["where"]["geometry"]
    assert {one["parameter"] for one in stated} == {*exported}
    for one in stated:
        values = (exported[one["parameter"]].value, exported[one["parameter"]].sigma)
        assert (one["value"], one["sigma"]) == pytest.approx(values, rel=1e-6, abs=1e-12)
        assert abs(one["value"] - off.get(one["parameter"], one["value"])) < 3.0 * one["sigma"]


def test_sigmas_contain_what_another_member_of_the_class_makes_of_the_geometry() -> None:
    dataset, found = delta(SEED)[0], said(SEED)
    (cause,) = found.causes
    second = cause.members[1]
    other = said(SEED, f"{cause.effect}@{cause.site}")
    assert (other.causes[0].effect, other.causes[0].site) == (second.effect, second.site)
    own, instead = ({one.name: one for one in departures(d.model, dataset.q)} for d in (found, other))
    far = max(own, key=lambda name: abs(instead[name].value - own[name].value) / own[name].sigma)
    k = found.model.geometry.names.index(far)
    between = own[far].sigma ** 2 - found.model.joint_covariance[k, k]
    assert between == pytest.approx(second.probability * (instead[far].value - own[far].value) ** 2, rel=0.3)
