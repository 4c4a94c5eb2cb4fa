"""A machine with rods drawn as SVG, each part in the colour of its share of the gap, with one colour scale."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from markupsafe import Markup, escape

from gtpin.report.camera import HEIGHT, WIDTH, Camera
from gtpin.report.instrument_marks import InstrumentMarks
from gtpin.report.skeleton import Skeleton
from gtpin.report.sketch_parts import CORNERS, NONE, corners, drawn, line, ring, scale, shades_of, with_share
from gtpin.report.words import percent
from gtpin.typing import Floats


def sketch(
    machine: Skeleton,
    links: Sequence[str],
    site_share: Mapping[str, float],
    rod_share: Mapping[str, float],
    causes: Collection[str] = (),
    marks: InstrumentMarks | None = None,
) -> Markup:
    """Draw a machine.

    Parameters
    ----------
    links
        Names of the rods' sites, in the machine's order.
    site_share
        Shares of the gap by site (carts, links, all links, platform, instrument), in which the parts are coloured; empty
        where there is no gap.
    rod_share
        Share of the gap by rod. It is shown as a tooltip and not as a colour: the rods' shares sum to 1 by themselves, so that
        a rod would seem to have a larger share than its cart.
    causes
        Sites of the causes, which are marked by rings.
    marks
        Instruments that are drawn under the machine.
    """
    at = Camera.of(machine, None if marks is None else marks.points)
    shades = shades_of(site_share)
    parts = [
        "" if marks is None else marks.draw(at),
        _base(machine, at),
        _tracks(machine, at, shades),
        _rods(machine, at, links, shades, rod_share, causes),
        _platform(machine, at, shades),
        _carts(machine, at, shades, causes),
        corners(shades, causes),
        _labels(machine, at, links, site_share, causes),
        scale(site_share),
    ]
    return drawn(parts, site_share)


def _base(machine: Skeleton, at: Camera) -> str:
    """The outline of the joints on the base."""
    carried = {i for site in machine.carts for i in machine.rods_of[site]}
    fixed = [i for i in range(len(machine.seats)) if i not in carried]
    if len(fixed) < 3:
        return ""
    outline = _outline(at(machine.seats[fixed]))
    return f'<polygon points="{outline}" style="fill:var(--panel);stroke:var(--line);stroke-width:2"/>'


def _outline(points: Floats) -> str:
    """Corners (m, 2) as text for SVG, in their order around their middle."""
    order = np.argsort(np.arctan2(*(points - points.mean(axis=0)).T[::-1]))
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points[order])


def _tracks(machine: Skeleton, at: Camera, shades: Mapping[str, str]) -> str:
    made = []
    for site, ends in machine.tracks.items():
        a, b = at(ends)
        made.append(line(a, b, shades.get(site, NONE), 7.0, 'opacity="0.45"'))
    for site, anchor in machine.anchors.items():
        a, b = at(np.stack([anchor, machine.carts[site]]))
        made.append(line(a, b, shades.get(site, NONE), 8.0, 'opacity="0.6"'))
    return "".join(made)


def _rods(
    machine: Skeleton,
    at: Camera,
    links: Sequence[str],
    shades: Mapping[str, str],
    landed: Mapping[str, float],
    causes: Collection[str],
) -> str:
    made = []
    for link, a, b in zip(links, at(machine.seats), at(machine.joints), strict=True):
        if link in causes or "arm" in causes:
            made.append(line(a, b, "var(--accent)", 10.0, 'opacity="0.3"'))
        title = f"{link}: {percent(landed[link])} of the gap lands on it" if link in landed else link
        rod = line(a, b, shades.get(link, NONE), 2.6)
        made.append(rod.replace("/>", f"><title>{escape(title)}</title></line>"))
    return "".join(made)


def _platform(machine: Skeleton, at: Camera, shades: Mapping[str, str]) -> str:
    x, y = at(machine.tcp[None])[0]
    fill, outline = shades.get("platform", NONE), _outline(at(machine.joints))
    look = f"fill:{fill};stroke:{fill};stroke-width:3;stroke-linejoin:round"
    return (
        f'<polygon points="{outline}" style="{look}" opacity="0.75"/>'
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" style="fill:var(--paper);stroke:var(--ink);stroke-width:1.5"/>'
    )


def _carts(machine: Skeleton, at: Camera, shades: Mapping[str, str], causes: Collection[str]) -> str:
    made = []
    for site, middle in machine.carts.items():
        (x, y), fill = at(middle[None])[0], shades.get(site, NONE)
        for i in machine.rods_of[site]:
            made.append(line(np.array([x, y]), at(machine.seats[[i]])[0], fill, 3.0))
        made.append(f'<rect x="{x - 9:.1f}" y="{y - 7:.1f}" width="18" height="14" rx="3" style="fill:{fill}"/>')
        if site in causes:
            made.append(ring(x, y, 17.0))
    return "".join(made)


def _labels(
    machine: Skeleton, at: Camera, links: Sequence[str], share: Mapping[str, float], causes: Collection[str]
) -> str:
    """Names of carts, platform, corners and rods; with shares that are large enough."""
    placed: list[tuple[float, float, str]] = []
    for site, middle in machine.carts.items():
        x, y = at(middle[None])[0]
        placed.append((x, y - (24.0 if site in causes else 13.0), site))
    tcp = at(machine.joints).max(axis=0)
    placed.append((float(at(machine.tcp[None])[0, 0]), float(tcp[1]) + 20.0, "platform"))
    placed += [(WIDTH if site == "frame" else 0.0, HEIGHT - 3.0, site) for site in CORNERS if site in share]
    made = []
    for x, y, site in placed:
        anchor = "end" if x > WIDTH - 60.0 else "start" if x < 60.0 else "middle"
        words = with_share(site, share)
        made.append(f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(words)}</text>')
    made += _rod_labels(at(machine.seats), at(machine.joints), [with_share(link, share) for link in links])
    return "".join(made)


def _rod_labels(seats: Floats, joints: Floats, names: Sequence[str]) -> list[str]:
    """The rods' names next to them, where other names are not too near."""
    made: list[str] = []
    taken: list[Floats] = []
    for a, b, name in zip(seats, joints, names, strict=True):
        spots = [a + s * (b - a) for s in (0.3, 0.4, 0.5, 0.6, 0.22)]
        spot = max(spots, key=lambda p: min([np.hypot(*(p - t)) for t in taken], default=1e9) > 26.0)
        taken.append(spot)
        made.append(f'<text class="rod" x="{spot[0] + 5:.1f}" y="{spot[1] - 3:.1f}">{escape(name)}</text>')
    return made
