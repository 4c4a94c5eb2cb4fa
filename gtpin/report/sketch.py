"""The machine drawn as SVG, each part in the colour of its share of the gap: one scale for all of them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
import numpy.typing as npt
from markupsafe import Markup, escape

from gtpin.report.camera import HEIGHT, WIDTH, Camera
from gtpin.report.skeleton import Skeleton
from gtpin.report.words import percent, short, site_words

Floats = npt.NDArray[np.float64]

SHOWN = 0.05
"""Smallest share that is written next to a part's name."""
CORNERS = {"arm": 42.0, "frame": WIDTH - 42.0}
"""Positions of sites that are not one part of the machine (all links, the instrument), pixels from the left."""


def sketch(
    machine: Skeleton,
    links: Sequence[str],
    site_share: Mapping[str, float],
    rod_share: Mapping[str, float],
    causes: Collection[str] = (),
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
        Share of the gap by rod. Shown as a tooltip, not as a colour: these shares add up to one by themselves, so
        that a rod would look worse than the cart that moves it.
    causes
        Sites of the causes, which are ringed.
    """
    at = Camera.of(machine)
    top = max(site_share.values(), default=0.0)
    shades = {site: color(share / top) for site, share in site_share.items()} if top > 0.0 else {}
    parts = [
        _base(machine, at),
        _tracks(machine, at, shades),
        _rods(machine, at, links, shades, rod_share, causes),
        _platform(machine, at, shades),
        _carts(machine, at, shades, causes),
        _corners(shades, causes),
        _labels(machine, at, links, site_share, causes),
        _scale(top),
    ]
    shares = ", ".join(f"{_name(site)} {percent(share)}" for site, share in site_share.items() if share >= SHOWN)
    name = f"The machine; shares of the gap: {shares}" if shares else "The machine"
    return Markup(
        f'<svg class="drawing" viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" role="img" aria-label="{escape(name)}">'
        + "".join(parts)
        + "</svg>"
    )


def color(part: float) -> str:
    """CSS of a share over the largest: from grey to red."""
    return f"color-mix(in oklab, var(--zero), var(--high) {100.0 * min(max(part, 0.0), 1.0):.0f}%)"


NONE = color(0.0)
"""Colour of parts without a share."""


def _name(site: str) -> str:
    return short(site_words(site))


def _line(a: Floats, b: Floats, shade: str, width: float, extra: str = "") -> str:
    ends = f'x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}"'
    return f'<line {ends} style="stroke:{shade};stroke-width:{width:.1f};stroke-linecap:round" {extra}/>'


def _base(machine: Skeleton, at: Camera) -> str:
    """The outline of the joints on the base."""
    carried = {i for site in machine.carts for i in machine.rods_of[site]}
    fixed = [i for i in range(len(machine.seats)) if i not in carried]
    if len(fixed) < 3:
        return ""
    outline = _outline(at(machine.seats[fixed]))
    return f'<polygon points="{outline}" style="fill:var(--panel);stroke:var(--line);stroke-width:2"/>'


def _outline(corners: Floats) -> str:
    """Corners in their order around their middle."""
    order = np.argsort(np.arctan2(*(corners - corners.mean(axis=0)).T[::-1]))
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in corners[order])


def _tracks(machine: Skeleton, at: Camera, shades: Mapping[str, str]) -> str:
    drawn = []
    for site, ends in machine.tracks.items():
        a, b = at(ends)
        drawn.append(_line(a, b, shades.get(site, NONE), 7.0, 'opacity="0.45"'))
    for site, anchor in machine.anchors.items():
        a, b = at(np.stack([anchor, machine.carts[site]]))
        drawn.append(_line(a, b, shades.get(site, NONE), 8.0, 'opacity="0.6"'))
    return "".join(drawn)


def _rods(
    machine: Skeleton,
    at: Camera,
    links: Sequence[str],
    shades: Mapping[str, str],
    landed: Mapping[str, float],
    causes: Collection[str],
) -> str:
    drawn = []
    for link, a, b in zip(links, at(machine.seats), at(machine.joints), strict=True):
        if link in causes or "arm" in causes:
            drawn.append(_line(a, b, "var(--accent)", 10.0, 'opacity="0.3"'))
        title = f"{link}: {percent(landed[link])} of the gap lands on it" if link in landed else link
        rod = _line(a, b, shades.get(link, NONE), 2.6)
        drawn.append(rod.replace("/>", f"><title>{escape(title)}</title></line>"))
    return "".join(drawn)


def _platform(machine: Skeleton, at: Camera, shades: Mapping[str, str]) -> str:
    x, y = at(machine.tcp[None])[0]
    fill, outline = shades.get("platform", NONE), _outline(at(machine.joints))
    look = f"fill:{fill};stroke:{fill};stroke-width:3;stroke-linejoin:round"
    return (
        f'<polygon points="{outline}" style="{look}" opacity="0.75"/>'
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" style="fill:var(--paper);stroke:var(--ink);stroke-width:1.5"/>'
    )


def _carts(machine: Skeleton, at: Camera, shades: Mapping[str, str], causes: Collection[str]) -> str:
    drawn = []
    for site, middle in machine.carts.items():
        (x, y), fill = at(middle[None])[0], shades.get(site, NONE)
        for i in machine.rods_of[site]:
            drawn.append(_line(np.array([x, y]), at(machine.seats[[i]])[0], fill, 3.0))
        drawn.append(f'<rect x="{x - 9:.1f}" y="{y - 7:.1f}" width="18" height="14" rx="3" style="fill:{fill}"/>')
        if site in causes:
            drawn.append(_ring(x, y, 17.0))
    return "".join(drawn)


def _ring(x: float, y: float, radius: float) -> str:
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" style="fill:none;stroke:var(--accent);stroke-width:2.5"/>'


def _corners(shades: Mapping[str, str], causes: Collection[str]) -> str:
    """All links together as three of them, and the instrument as a tripod, wherever it stands; none without shares."""
    drawn = []
    for site, x in CORNERS.items():
        if site not in shades:
            continue
        y, shade = HEIGHT - 41.0, shades[site]
        spread = (10.0, 10.0) if site == "arm" else (0.0, 10.0)
        for k in (-1.0, 0.0, 1.0):
            a, b = np.array([x + k * spread[0], y - 12.0]), np.array([x + k * spread[1], y + 12.0])
            drawn.append(_line(a, b, shade, 2.6))
        if site == "frame":
            drawn.append(f'<circle cx="{x}" cy="{y - 12.0}" r="6.5" style="fill:{shade}"/>')
        if site in causes:
            drawn.append(_ring(x, y - 2.0, 23.0))
    return "".join(drawn)


def _scale(top: float) -> str:
    """What the colours mean, at the bottom; nothing without shares."""
    if top <= 0.0:
        return ""
    x, y, steps = WIDTH / 2.0 - 95.0, HEIGHT - 14.0, 8
    boxes = "".join(
        f'<rect x="{x + 8.0 * k:.0f}" y="{y}" width="8.5" height="9" style="fill:{color(k / (steps - 1))}"/>'
        for k in range(steps)
    )
    words = (
        f'<text class="rod" x="{x - 5.0}" y="{y + 9.0}" text-anchor="end">0</text>',
        f'<text class="rod" x="{x + 8.0 * steps + 5.0}" y="{y + 9.0}">{percent(top)} of the gap</text>',
    )
    return boxes + "".join(words)


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
    drawn = []
    for x, y, site in placed:
        anchor = "end" if x > WIDTH - 60.0 else "start" if x < 60.0 else "middle"
        words = _with_share(site, share)
        drawn.append(f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(words)}</text>')
    drawn += _rod_labels(at(machine.seats), at(machine.joints), [_with_share(link, share) for link in links])
    return "".join(drawn)


def _with_share(site: str, share: Mapping[str, float]) -> str:
    part = share.get(site, 0.0)
    return f"{_name(site)} {percent(part)}" if part >= SHOWN else _name(site)


def _rod_labels(seats: Floats, joints: Floats, names: Sequence[str]) -> list[str]:
    """The rods' names along them, where there is the most room."""
    drawn: list[str] = []
    taken: list[Floats] = []
    for a, b, name in zip(seats, joints, names, strict=True):
        spots = [a + s * (b - a) for s in (0.3, 0.4, 0.5, 0.6, 0.22)]
        spot = max(spots, key=lambda p: min([np.hypot(*(p - t)) for t in taken], default=1e9) > 26.0)
        taken.append(spot)
        drawn.append(f'<text class="rod" x="{spot[0] + 5:.1f}" y="{spot[1] - 3:.1f}">{escape(name)}</text>')
    return drawn
