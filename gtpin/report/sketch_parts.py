"""Common parts of drawings of machines: lines, rings, the instrument, colours and their scale."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from markupsafe import Markup, escape

from gtpin.report.camera import HEIGHT, WIDTH
from gtpin.report.words import percent, short, site_words
from gtpin.typing import Floats

SHOWN = 0.05
"""Smallest share that is written next to a part's name."""
CORNERS = {"arm": 42.0, "frame": WIDTH - 42.0}
"""Positions of sites that are not one part of the machine (all links, the instrument), pixels from the left."""


def drawn(parts: Sequence[str], site_share: Mapping[str, float]) -> Markup:
    """Parts as one drawing."""
    shares = ", ".join(f"{named(site)} {percent(share)}" for site, share in site_share.items() if share >= SHOWN)
    name = f"The machine; shares of the gap: {shares}" if shares else "The machine"
    return Markup(
        f'<svg class="drawing" viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" role="img" aria-label="{escape(name)}">'
        + "".join(parts)
        + "</svg>"
    )


def shades_of(site_share: Mapping[str, float]) -> dict[str, str]:
    """The colours of parts by their shares; none where there is no gap."""
    top = max(site_share.values(), default=0.0)
    return {site: color(share / top) for site, share in site_share.items()} if top > 0.0 else {}


def color(part: float) -> str:
    """Colour, as CSS, of a share over the largest share: from grey to red."""
    return f"color-mix(in oklab, var(--zero), var(--high) {100.0 * min(max(part, 0.0), 1.0):.0f}%)"


NONE = color(0.0)
"""Colour of parts without a share."""


def named(site: str) -> str:
    """A site as a label."""
    return short(site_words(site))


def line(a: Floats, b: Floats, shade: str, width: float, extra: str = "") -> str:
    """A line between two pixels."""
    ends = f'x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}"'
    return f'<line {ends} style="stroke:{shade};stroke-width:{width:.1f};stroke-linecap:round" {extra}/>'


def ring(x: float, y: float, radius: float) -> str:
    """The ring that marks a cause's site; centre and radius in pixels."""
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" style="fill:none;stroke:var(--accent);stroke-width:2.5"/>'


def corners(shades: Mapping[str, str], causes: Collection[str]) -> str:
    """Symbols at the lower corners: three lines for all links together, and a tripod for the instrument; empty without
    shares."""
    made = []
    for site, x in CORNERS.items():
        if site not in shades:
            continue
        y, shade = HEIGHT - 41.0, shades[site]
        spread = (10.0, 10.0) if site == "arm" else (0.0, 10.0)
        for k in (-1.0, 0.0, 1.0):
            a, b = np.array([x + k * spread[0], y - 12.0]), np.array([x + k * spread[1], y + 12.0])
            made.append(line(a, b, shade, 2.6))
        if site == "frame":
            made.append(f'<circle cx="{x}" cy="{y - 12.0}" r="6.5" style="fill:{shade}"/>')
        if site in causes:
            made.append(ring(x, y - 2.0, 23.0))
    return "".join(made)


def scale(site_share: Mapping[str, float]) -> str:
    """The colour scale at the bottom; empty without shares."""
    top = max(site_share.values(), default=0.0)
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


def with_share(site: str, share: Mapping[str, float]) -> str:
    """A site as a label, with its share where that is large enough."""
    part = share.get(site, 0.0)
    return f"{named(site)} {percent(part)}" if part >= SHOWN else named(site)
