"""Directions of parallel tracks, of which a free frame hides the common part: data of the tests' own closures."""

import closures
import numpy as np

import gtpin
from gtpin.data import InstrumentSection
from gtpin.model.departures import track_differences
from gtpin.output.shown import present

LEAN, SIGMA = 1.5e-3, 1.3e-5


def test_a_track_that_leans_is_named_by_its_differences_from_the_others() -> None:
    """A tower leans by 1.5 mrad; no direction is determined by itself."""
    machine, rng = closures.nominal("linear_delta"), np.random.default_rng(4)
    off = {name: 0.2 * size * rng.standard_normal() for name, size in machine.parameters().items()}
    off["track_direction[cart1].a"] -= LEAN
    q = machine.in_range(rng, 120)
    T = machine.off(off).follow(q, 0.1)[0] + SIGMA * rng.standard_normal((120, 3))
    section = InstrumentSection(position_sigma=SIGMA, frame="free")
    found = gtpin.calibrate(gtpin.Dataset("linear_delta", [str(i) for i in range(120)], q, T, instrument=section))
    apart = track_differences(found.model)
    assert len(apart) == 6
    for one in apart:
        assert abs(one.value - (off[one.first] - off[one.second])) < 4.0 * one.sigma
        assert one.sigma < 0.3 * min(found[one.first].sigma, found[one.second].sigma)
    said = present(found).lead.headline
    assert "track_direction[cart1].a less track_direction[cart" in said
