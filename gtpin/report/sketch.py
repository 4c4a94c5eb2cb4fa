"""A machine drawn as SVG, each part in the colour of how well a motion of this part alone explains the errors."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from markupsafe import Markup, escape

from gtpin.model.model import Model
from gtpin.report.instrument_places import InstrumentPlaces, patch
from gtpin.report.skeleton import HEIGHT, WIDTH, Camera, Kind, Skeleton, skeleton
from gtpin.report.words import short, site_words
from gtpin.typing import Floats

SHOWN = 0.05
"""Smallest share from which a link is labelled."""
CORNERS = {"arm": 42.0, "frame": WIDTH - 42.0}
"""Positions of sites that are not one part of the machine (all links, the instrument), pixels from the left."""
LOOKS: dict[Kind, tuple[float, str]] = {
    "track": (7.0, 'opacity="0.45"'),
    "arm": (8.0, 'opacity="0.6"'),
    "fixed": (4.0, ""),
    "rod": (2.6, ""),
    "link": (7.0, ""),
}
"""Width of a line, pixels, and further attributes, by kind."""
EDGES = {"rod": 10.0, "link": 15.0}
"""Width of the edge, pixels, that marks the site of a cause."""
PATCH = 0.12
"""Half the side of a plane's patch, over the machine's size."""
THIN = "stroke:var(--accent);stroke-width:1.2"
LETTER, LINE = 8.6, 19.0
"""Width of a letter and height of a line, pixels: between those of a wide and of a narrow page, whose letters are larger."""
COVERED, JOINT, CROSSED = 1e3, 12.0, 0.35
"""Costs of a label on another one, on a joint, and on a twentieth of a line; the cost of a pixel of distance is a tenth."""
ROUND = ((1, 0), (-1, 0), (0, -1), (0, 1), *((side, row) for row in (-1, 1, -2, 2, -3, 3, -4, 4) for side in (1, -1)))
"""Places about a spot, the first is the best: side (0: centred) and row."""


def drawing(
    model: Model,
    q: Floats | None = None,
    site_share: Mapping[str, float] | None = None,
    causes: Collection[str] = (),
) -> Markup | None:
    """A machine and its instruments; parts have the colours of their shares. None if the pose can't be reached.

    ``q``: (n,) commands at which a robot without rods is drawn, by default home; a robot with rods is drawn mid-range.
    ``site_share``, ``causes``: see :func:`sketch`; by default no part has a share.
    """
    machine = skeleton(model, None if model.robot.rod_sites else q)
    if machine is None:
        return None
    places = InstrumentPlaces.of(model.instruments).near(machine.points)
    return sketch(machine, site_share or {}, causes, places)


def sketch(
    machine: Skeleton,
    site_share: Mapping[str, float],
    causes: Collection[str] = (),
    places: InstrumentPlaces | None = None,
) -> Markup:
    """Draw a machine.

    ``site_share``: :attr:`~gtpin.diagnosis.result.Where.site`, in which the parts (carts, joints, links, all links,
    platform, instrument) are coloured, relative to the largest; empty where there is no gap. They are shares of log evidence,
    which are not shares of the gap, so that the picture has no numbers. ``causes``: sites of the causes, which are marked by
    rings, links by a wide edge. ``places``: instruments that are drawn under the machine.
    """
    places = places or InstrumentPlaces()
    patches = {name: patch(*plane, PATCH * machine.size) for name, plane in places.planes.items()}
    at = Camera.of(machine, np.vstack([places.fixed, *patches.values()]))
    top = max(site_share.values(), default=0.0)
    shades = {site: color(share / top) for site, share in site_share.items()} if top > 0.0 else {}
    parts = [
        *_instruments(machine, at, places, patches),
        _outline(at(machine.base), "fill:var(--panel);stroke:var(--line);stroke-width:2")
        if len(machine.base) > 2
        else "",
        *_lines(machine, at, shades, causes),
        *_spots(machine, at, shades, causes),
        _tcp(machine, at, shades, causes),
        *_corners(shades, causes),
        *_labels(machine, at, site_share, causes),
    ]
    order = sorted(site_share, key=lambda site: -site_share[site])
    first = ", ".join(_named(site) for site in order if site_share[site] >= SHOWN)
    name = escape(f"The machine; the reddest parts first: {first}" if first else "The machine")
    head = f'<svg class="drawing" viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" role="img" aria-label="{name}">'
    return Markup("".join([head, *parts, "</svg>"]))


def color(part: float) -> str:
    """Colour, as CSS, of a share over the largest share: from grey to red."""
    return f"color-mix(in oklab, var(--zero), var(--high) {100.0 * min(max(part, 0.0), 1.0):.0f}%)"


NONE = color(0.0)
"""Colour of parts without a share."""


def _instruments(
    machine: Skeleton, at: Camera, places: InstrumentPlaces, patches: Mapping[str, Floats]
) -> Iterator[str]:
    for name, (point, normal) in places.planes.items():
        (x, y), (u, v) = at(np.stack([point, point + 0.7 * PATCH * machine.size * normal]))
        yield _polygon(at(patches[name]), f"fill:var(--accent);fill-opacity:.12;{THIN}")
        yield f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{u:.1f}" y2="{v:.1f}" style="{THIN}"/>{_small(u, v - 3.0, name)}'
    wires = [(place, machine.tcp) for place in places.stations.values()]
    for ends in wires + [(places.sockets[a], places.sockets[b]) for a, b, _ in places.distances]:
        (x, y), (u, v) = at(np.stack(ends))
        look = f"{THIN};stroke-dasharray:4 3;opacity:.6"
        yield f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{u:.1f}" y2="{v:.1f}" style="{look}"/>'
    for name, place in places.stations.items():
        x, y = at(place)[0]
        corners = np.array([[x, y - 7.0], [x + 6.0, y + 5.0], [x - 6.0, y + 5.0]])
        yield _polygon(corners, "fill:var(--accent)") + _small(x, y + 17.0, name)
    for name, place in places.sockets.items():  # they are too close together for names
        x, y = at(place)[0]
        title = f"<title>{escape(name)}</title>"
        yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" style="fill:var(--paper);{THIN}">{title}</circle>'


def _small(x: float, y: float, words: str) -> str:
    return f'<text class="rod" x="{x:.1f}" y="{y:.1f}" text-anchor="middle">{escape(words)}</text>'


def _lines(machine: Skeleton, at: Camera, shades: Mapping[str, str], causes: Collection[str]) -> Iterator[str]:
    for one in machine.of(*LOOKS):
        ends, (width, extra) = at(one.ends), LOOKS[one.kind]
        if one.kind in EDGES and (one.site in causes or "arm" in causes):
            yield _line(ends, "var(--accent)", EDGES[one.kind], 'opacity="0.3"')
        drawn = _line(ends, shades.get(one.site, NONE), width, extra)
        if one.kind in EDGES:
            drawn = drawn.replace("/>", f"><title>{escape(one.site)}</title></line>")
        yield drawn
    if len(machine.platform) > 2:
        fill = shades.get("platform", NONE)
        look = f"fill:{fill};stroke:{fill};stroke-width:3;stroke-linejoin:round"
        yield _outline(at(machine.platform), look, 'opacity="0.75"')


def _spots(machine: Skeleton, at: Camera, shades: Mapping[str, str], causes: Collection[str]) -> Iterator[str]:
    for spot in machine.spots:
        (x, y), fill = at(spot.at)[0], shades.get(spot.site, NONE)
        if spot.axis is None:
            for one in machine.of("bracket"):
                if one.site == spot.site:
                    yield _line(at(one.ends), fill, 3.0)
            yield f'<rect x="{x - 9:.1f}" y="{y - 7:.1f}" width="18" height="14" rx="3" style="fill:{fill}"/>'
        else:
            reach = 15.0 / at.scale * spot.axis  # pixels
            yield _line(at(np.stack([spot.at - reach, spot.at + reach])), "var(--ink)", 1.4)
            look = f"fill:{fill};stroke:var(--ink);stroke-width:1.2"
            title = f"<title>{escape(spot.site)}</title>"
            yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="8" style="{look}">{title}</circle>'
        if spot.site in causes:
            yield _ring(x, y, 17.0 if spot.axis is None else 14.0)


def _tcp(machine: Skeleton, at: Camera, shades: Mapping[str, str], causes: Collection[str]) -> str:
    (x, y), look = at(machine.tcp)[0], "stroke:var(--ink);stroke-width:1.5"
    ring = _ring(x, y, 14.0) if "platform" in causes else ""
    if len(machine.platform) > 2:
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" style="fill:var(--paper);{look}"/>{ring}'
    fill = shades.get("platform", "var(--paper)")
    return f'<rect x="{x - 4.5:.1f}" y="{y - 4.5:.1f}" width="9" height="9" style="fill:{fill};{look}"/>{ring}'


def _corners(shades: Mapping[str, str], causes: Collection[str]) -> Iterator[str]:
    """Symbols at the lower corners: three lines for all links together, and a tripod for the instrument; empty without
    shares."""
    for site in [site for site in CORNERS if site in shades]:
        x, y, shade, spread = CORNERS[site], HEIGHT - 41.0, shades[site], 10.0 if site == "arm" else 0.0
        for k in (-1.0, 0.0, 1.0):
            ends = np.array([[x + k * spread, y - 12.0], [x + k * 10.0, y + 12.0]])
            yield _line(ends, shade, 2.6)
        if site == "frame":
            yield f'<circle cx="{x}" cy="{y - 12.0}" r="6.5" style="fill:{shade}"/>'
        if site in causes:
            yield _ring(x, y - 2.0, 23.0)


def _labels(machine: Skeleton, at: Camera, share: Mapping[str, float], causes: Collection[str]) -> Iterator[str]:
    """Names of all actuators, of the platform, of rods and corners, and of links that have a large enough share or a cause."""

    spots = {spot.site: at(spot.at)[0] for spot in machine.spots} | {"platform": at(machine.tcp)[0]}
    links = (one for one in machine.of("link") if one.site in causes or share.get(one.site, 0.0) >= SHOWN)
    beside = spots | {one.site: at(one.ends.mean(axis=0))[0] for one in links}
    along = np.linspace(0.0, 1.0, 20)[:, None]
    lines = [a + along * (b - a) for a, b in (at(one.ends) for one in machine.lines)]
    places = Labels(np.array(list(spots.values())), np.vstack([np.empty((0, 2)), *lines]))
    for site in CORNERS:
        if site in share:
            x, y = (WIDTH if site == "frame" else 0.0), HEIGHT - 3.0
            yield f'<text x="{x}" y="{y}" text-anchor="{"end" if x else "start"}">{escape(_named(site))}</text>'
            places.place(_named(site), np.array([x, y - 6.0]), 0.0)
    for site, spot in beside.items():
        place, end = places.place(_named(site), spot, 19.0 if site in causes else 13.0)
        if end is not None:
            yield _line(np.stack([spot, end]), "var(--line)", 1.0)
        yield f"<text {place}>{escape(_named(site))}</text>"
    for one in machine.of("rod"):
        a, b = at(one.ends)
        free = [a + s * (b - a) for s in (0.3, 0.4, 0.5, 0.6, 0.22)]
        taken = np.reshape([box[:2] for box in places.taken], (-1, 2))
        spot = max(free, key=lambda p: bool((np.hypot(*(p - taken).T) > 26.0).all()))
        yield f'<text class="rod" {places.place(_named(one.site), spot, 4.0, 0.8)[0]}>{escape(_named(one.site))}</text>'


def _named(site: str) -> str:
    return short(site_words(site))


def _line(ends: Floats, shade: str, width: float, extra: str = "") -> str:
    (a, b), (c, d) = ends
    look = f"stroke:{shade};stroke-width:{width:.1f};stroke-linecap:round"
    return f'<line x1="{a:.1f}" y1="{b:.1f}" x2="{c:.1f}" y2="{d:.1f}" style="{look}" {extra}/>'


def _ring(x: float, y: float, radius: float) -> str:
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" style="fill:none;stroke:var(--accent);stroke-width:2.5"/>'


def _outline(points: Floats, look: str, extra: str = "") -> str:
    """A polygon through corners (m, 2), in their order around their middle."""
    order = np.argsort(np.arctan2(*(points - points.mean(axis=0)).T[::-1]))
    return _polygon(points[order], look, f" {extra}")


def _polygon(corners: Floats, look: str, extra: str = "") -> str:
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in corners)
    return f'<polygon points="{points}" style="{look}"{extra}/>'


@dataclass
class Labels:
    """Places labels one after the other: none hides another or leaves the picture, and few hide a joint or a line.

    ``marks``: (m, 2) joints, pixels; ``lines``: (k, 2) points on the lines."""

    marks: Floats
    lines: Floats
    taken: list[tuple[float, float, float, float]] = field(default_factory=list)

    def place(self, words: str, spot: Floats, gap: float = 15.0, size: float = 1.0) -> tuple[str, Floats | None]:
        """SVG attributes that place a label about a spot (2,), pixels, and the end of a line to it where it is far from there.

        ``gap``: distance from the spot, pixels; ``size``: that of the letters, relative to normal ones.
        """
        wide, high = size * LETTER * len(words), size * LINE
        best, anchor, cost = (0.0, 0.0, wide, high), "", np.inf
        for rank, (side, row) in enumerate(ROUND):
            x = spot[0] + (gap if side > 0 else -gap - wide if side < 0 else -wide / 2.0)
            y = spot[1] - high / 2.0 + row * (high if side else high / 2.0 + gap)
            x, y = np.clip(x, 2.0, WIDTH - wide - 2.0), np.clip(y, 2.0, HEIGHT - high - 2.0)
            box = (float(x), float(y), float(x) + wide, float(y) + high)
            over = [box[0] < o[2] and o[0] < box[2] and box[1] < o[3] and o[1] < box[3] for o in self.taken]
            price = COVERED * sum(over) + 0.01 * rank
            price += JOINT * _inside(self.marks, box, 6.0) + CROSSED * _inside(self.lines, box, 0.0)
            price += 0.1 * _distance(spot, box)
            if price < cost:
                best, cost, anchor = box, price, "start" if side > 0 else "end" if side else "middle"
        self.taken.append(best)
        x = {"start": best[0], "end": best[2], "middle": (best[0] + best[2]) / 2.0}[anchor]
        end = np.clip(spot, best[:2], best[2:]) if _distance(spot, best) > 24.0 else None
        return f'x="{x:.1f}" y="{best[3] - 0.28 * high:.1f}" text-anchor="{anchor}"', end


def _inside(points: Floats, box: tuple[float, float, float, float], margin: float) -> int:
    low, high = np.array(box[:2]) - margin, np.array(box[2:]) + margin
    return int(((points > low) & (points < high)).all(axis=1).sum())


def _distance(spot: Floats, box: tuple[float, float, float, float]) -> float:
    return float(np.hypot(*(spot - np.clip(spot, box[:2], box[2:]))))
