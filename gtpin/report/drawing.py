"""The drawing of any machine on a report's page."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from markupsafe import Markup

from gtpin.model.model import Model
from gtpin.report.chain_skeleton import chain_skeleton
from gtpin.report.chain_sketch import chain_sketch
from gtpin.report.instrument_marks import InstrumentMarks
from gtpin.report.instrument_places import InstrumentPlaces
from gtpin.report.skeleton import skeleton
from gtpin.report.sketch import sketch
from gtpin.typing import Floats


def drawing(
    model: Model,
    q: Floats | None = None,
    site_share: Mapping[str, float] | None = None,
    rod_share: Mapping[str, float] | None = None,
    causes: Collection[str] = (),
) -> Markup | None:
    """A machine and its instruments; parts have the colours of their shares of the gap. None if the pose can't be reached.

    Parameters
    ----------
    q
        (n,) commands at which a robot without rods is drawn, by default home; a robot with rods is drawn mid-range.
    site_share, rod_share, causes
        See :func:`~gtpin.report.sketch.sketch`; by default no part has a share.
    """
    places = InstrumentPlaces.of(model.instruments)
    machine = skeleton(model)
    if machine is not None:
        marks = InstrumentMarks(places, machine.points, machine.tcp) if places else None
        return sketch(machine, model.robot.rod_sites, site_share or {}, rod_share or {}, causes, marks)
    chain = chain_skeleton(model, q)
    if chain is None:
        return None
    marks = InstrumentMarks(places, chain.points, chain.tcp) if places else None
    return chain_sketch(chain, site_share or {}, causes, marks)
