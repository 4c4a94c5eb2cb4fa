"""A robot without rods drawn as SVG: links from joint to joint, each part in the colour of its share of the gap."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
from markupsafe import Markup, escape

from gtpin.report.camera import HEIGHT, WIDTH, Camera
from gtpin.report.chain_skeleton import ChainSkeleton
from gtpin.report.instrument_marks import InstrumentMarks
from gtpin.report.sketch_parts import CORNERS, NONE, SHOWN, corners, drawn, line, ring, scale, shades_of, with_share
from gtpin.typing import Floats

AXIS = 15.0
"""Half the length of a joint's axis as drawn, pixels."""
APART = 14.0
"""Smallest vertical distance of two labels, pixels."""


def chain_sketch(
    machine: ChainSkeleton,
    site_share: Mapping[str, float],
    causes: Collection[str] = (),
    marks: InstrumentMarks | None = None,
) -> Markup:
    """Draw a robot without rods.

    Parameters
    ----------
    site_share
        Shares of the gap by site (joints, links, all links, platform, instrument), in which the parts are coloured;
        empty where there is no gap.
    causes
        Sites of the causes; joints are marked by a ring, links by a wide edge.
    marks
        Instruments that are drawn under the machine.
    """
    at = Camera.of(machine, None if marks is None else marks.points)
    shades = shades_of(site_share)
    parts = [
        "" if marks is None else marks.draw(at),
        *(line(a, b, NONE, 4.0) for a, b in map(at, machine.fixed)),
        *_links(machine, at, shades, causes),
        *_joints(machine, at, shades, causes),
        _tcp(machine, at, shades, causes),
        corners(shades, causes),
        *_labels(machine, at, site_share, causes),
        scale(site_share),
    ]
    return drawn(parts, site_share)


def _links(machine: ChainSkeleton, at: Camera, shades: Mapping[str, str], causes: Collection[str]) -> list[str]:
    made = []
    for site, ends in machine.links.items():
        a, b = at(ends)
        if site in causes or "arm" in causes:
            made.append(line(a, b, "var(--accent)", 15.0, 'opacity="0.3"'))
        link = line(a, b, shades.get(site, NONE), 7.0)
        made.append(link.replace("/>", f"><title>{escape(site)}</title></line>"))
    return made


def _joints(machine: ChainSkeleton, at: Camera, shades: Mapping[str, str], causes: Collection[str]) -> list[str]:
    """Each joint as a dot, with a line along its axis."""
    made = []
    for site, origin in machine.joints.items():
        (x, y), fill = at(origin[None])[0], shades.get(site, NONE)
        reach = AXIS / at.scale * machine.axes[site]
        a, b = at(np.stack([origin - reach, origin + reach]))
        made.append(line(a, b, "var(--ink)", 1.4))
        look = f"fill:{fill};stroke:var(--ink);stroke-width:1.2"
        made.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="8" style="{look}"><title>{escape(site)}</title></circle>')
        if site in causes:
            made.append(ring(x, y, 14.0))
    return made


def _tcp(machine: ChainSkeleton, at: Camera, shades: Mapping[str, str], causes: Collection[str]) -> str:
    x, y = at(machine.tcp[None])[0]
    look = f"fill:{shades.get('platform', 'var(--paper)')};stroke:var(--ink);stroke-width:1.5"
    dot = f'<rect x="{x - 4.5:.1f}" y="{y - 4.5:.1f}" width="9" height="9" style="{look}"/>'
    return dot + (ring(float(x), float(y), 14.0) if "platform" in causes else "")


def _labels(machine: ChainSkeleton, at: Camera, share: Mapping[str, float], causes: Collection[str]) -> list[str]:
    """Names of all joints, of the platform and corners, and of links that have a large enough share or a cause."""
    spots = {site: at(origin[None])[0] for site, origin in machine.joints.items()}
    spots |= {
        site: at(ends.mean(axis=0)[None])[0]
        for site, ends in machine.links.items()
        if site in causes or share.get(site, 0.0) >= SHOWN
    }
    spots["platform"] = at(machine.tcp[None])[0]
    made, taken = [], list[Floats]()
    for site, spot in spots.items():
        right = spot[0] < WIDTH / 2.0
        x, y = spot[0] + (17.0 if right else -17.0), spot[1] + 4.0
        while any(abs(y - t[1]) < APART and abs(x - t[0]) < WIDTH / 3.0 for t in taken):
            y += APART
        taken.append(np.array([x, y]))
        made.append(_text(site, float(x), float(y), "start" if right else "end", share))
    for site, x in CORNERS.items():
        if site in share:
            edge = WIDTH if x > WIDTH / 2.0 else 0.0
            made.append(_text(site, edge, HEIGHT - 3.0, "end" if edge else "start", share))
    return made


def _text(site: str, x: float, y: float, anchor: str, share: Mapping[str, float]) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(with_share(site, share))}</text>'
