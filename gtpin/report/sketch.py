"""The machine drawn as SVG, each part in the colour of its share of the gap."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from markupsafe import Markup, escape

from gtpin.report.skeleton import Skeleton
from gtpin.report.words import percent

Floats = npt.NDArray[np.float64]

WIDTH, HEIGHT, MARGIN = 560.0, 400.0, 46.0
ELEVATION = np.deg2rad(24.0)
SHOWN = 0.05
"""Share from which a part's share stands beside its name."""


@dataclass(frozen=True)
class Camera:
    """Looks at points in space: to pixels, x to the right and y down."""

    axes: Floats
    centre: Floats
    scale: float

    @staticmethod
    def of(machine: Skeleton) -> Camera:
        """From a little above, from the side where the rods hide each other the least."""
        best = max(
            (_axes(machine.up, a) for a in np.deg2rad(np.arange(0.0, 360.0, 10.0))), key=lambda v: _open(machine, v)
        )
        flat = machine.points @ best.T
        size = np.ptp(flat, axis=0)
        room = np.array([WIDTH - 2.0 * MARGIN, HEIGHT - 2.0 * MARGIN])
        return Camera(best, (flat.max(axis=0) + flat.min(axis=0)) / 2.0, float((room / np.maximum(size, 1e-9)).min()))

    def __call__(self, points: Floats) -> Floats:
        """(m, 2) pixels of points (m, 3)."""
        flat = (np.atleast_2d(points) @ self.axes.T - self.centre) * self.scale
        return np.asarray(flat * [1.0, -1.0] + [WIDTH / 2.0, HEIGHT / 2.0])


def _axes(up: Floats, azimuth: float) -> Floats:
    """(2, 3) right and up of a picture taken from an azimuth about the vertical."""
    side = np.cross(up, np.eye(3)[int(np.argmin(np.abs(up)))])
    side /= np.linalg.norm(side)
    right = np.cos(azimuth) * side + np.sin(azimuth) * np.cross(up, side)
    into = np.cross(up, right)
    return np.array([right, np.cos(ELEVATION) * up + np.sin(ELEVATION) * into])


def _open(machine: Skeleton, axes: Floats) -> float:
    """How far apart the rods' ends and middles are in a picture, over its size."""
    seats, joints = machine.seats @ axes.T, machine.joints @ axes.T
    flat = np.vstack([seats, (seats + joints) / 2.0])
    apart = np.linalg.norm(flat[:, None] - flat[None, :], axis=2)[np.triu_indices(len(flat), 1)]
    size = np.ptp(machine.points @ axes.T, axis=0)
    return float(np.log(apart / np.linalg.norm(size) + 0.01).mean() + np.log(size.min() / size.max() + 0.1))


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
    site_share, rod_share
        Shares of the gap by site (carts, platform, frame) and by rod; empty where there is no gap.
    causes
        Sites of the causes, which are ringed.
    """
    at = Camera.of(machine)
    parts = [
        _base(machine, at),
        _tracks(machine, at, site_share),
        _rods(machine, at, links, rod_share, causes),
        _platform(machine, at, site_share),
    ]
    parts += [
        _carts(machine, at, site_share, causes),
        _instrument(site_share, causes),
        _labels(machine, at, links, site_share, causes),
    ]
    told = ", ".join(f"{site} {percent(share)}" for site, share in site_share.items() if share >= SHOWN)
    name = f"The machine; shares of the gap: {told}" if told else "The machine"
    return Markup(
        f'<svg class="drawing" viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" role="img" aria-label="{escape(name)}">'
        + "".join(parts)
        + "</svg>"
    )


def color(share: float) -> str:
    """CSS of a share: from grey to red, which half of the gap reaches."""
    return f"color-mix(in oklab, var(--zero), var(--high) {100.0 * min(2.0 * max(share, 0.0), 1.0):.0f}%)"


def _line(a: Floats, b: Floats, share: float, width: float, extra: str = "") -> str:
    ends = f'x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}"'
    return f'<line {ends} style="stroke:{color(share)};stroke-width:{width:.1f};stroke-linecap:round" {extra}/>'


def _base(machine: Skeleton, at: Camera) -> str:
    """The outline of the joints that nothing moves."""
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


def _tracks(machine: Skeleton, at: Camera, share: Mapping[str, float]) -> str:
    drawn = []
    for site, ends in machine.tracks.items():
        a, b = at(ends)
        drawn.append(_line(a, b, share.get(site, 0.0), 7.0, 'opacity="0.45"'))
    for site, anchor in machine.anchors.items():
        a, b = at(np.stack([anchor, machine.carts[site]]))
        drawn.append(_line(a, b, share.get(site, 0.0), 8.0, 'opacity="0.6"'))
    return "".join(drawn)


def _rods(
    machine: Skeleton, at: Camera, links: Sequence[str], share: Mapping[str, float], causes: Collection[str]
) -> str:
    drawn = []
    for i, (a, b) in enumerate(zip(at(machine.seats), at(machine.joints), strict=True)):
        part = share.get(links[i], 0.0)
        if links[i] in causes or "arm" in causes:
            drawn.append(
                f'<line x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}" '
                'style="stroke:var(--fit);stroke-width:9;stroke-linecap:round" opacity="0.3"/>'
            )
        title = f"<title>{escape(links[i])}: {percent(part)} of the gap</title>"
        drawn.append(_line(a, b, part, 2.0 + 2.5 * part).replace("/>", f">{title}</line>"))
    return "".join(drawn)


def _platform(machine: Skeleton, at: Camera, share: Mapping[str, float]) -> str:
    x, y = at(machine.tcp[None])[0]
    fill, outline = color(share.get("platform", 0.0)), _outline(at(machine.joints))
    look = f"fill:{fill};stroke:{fill};stroke-width:3;stroke-linejoin:round"
    return (
        f'<polygon points="{outline}" style="{look}" opacity="0.75"/>'
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" style="fill:var(--paper);stroke:var(--ink);stroke-width:1.5"/>'
    )


def _carts(machine: Skeleton, at: Camera, share: Mapping[str, float], causes: Collection[str]) -> str:
    drawn = []
    for site, middle in machine.carts.items():
        x, y = at(middle[None])[0]
        for i in machine.rods_of[site]:
            drawn.append(_line(np.array([x, y]), at(machine.seats[[i]])[0], share.get(site, 0.0), 3.0))
        fill = color(share.get(site, 0.0))
        drawn.append(f'<rect x="{x - 9:.1f}" y="{y - 7:.1f}" width="18" height="14" rx="3" style="fill:{fill}"/>')
        if site in causes:
            drawn.append(_ring(x, y, 17.0))
    return "".join(drawn)


def _ring(x: float, y: float, radius: float) -> str:
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" style="fill:none;stroke:var(--fit);stroke-width:2.5"/>'


def _instrument(share: Mapping[str, float], causes: Collection[str]) -> str:
    """The measuring instrument, as a tripod in the corner: where it stands does not matter here. None without shares."""
    if not share:
        return ""
    x, y, part = WIDTH - 34.0, HEIGHT - 34.0, share.get("frame", 0.0)
    legs = "".join(_line(np.array([x, y - 8.0]), np.array([x + dx, y + 14.0]), part, 2.5) for dx in (-10.0, 0.0, 10.0))
    head = f'<circle cx="{x}" cy="{y - 12.0}" r="6.5" style="fill:{color(part)}"/>'
    return legs + head + (_ring(x, y - 2.0, 23.0) if "frame" in causes else "")


def _labels(
    machine: Skeleton, at: Camera, links: Sequence[str], share: Mapping[str, float], causes: Collection[str]
) -> str:
    """Names of carts, platform, instrument and rods; shares beside them where they are worth it."""
    placed: list[tuple[float, float, str]] = []
    for site, middle in machine.carts.items():
        x, y = at(middle[None])[0]
        placed.append((x, y - (24.0 if site in causes else 13.0), site))
    tcp = at(machine.joints).max(axis=0)
    placed.append((float(at(machine.tcp[None])[0, 0]), float(tcp[1]) + 20.0, "platform"))
    if share:
        placed.append((WIDTH - 34.0, HEIGHT - 3.0, "frame"))
    drawn = []
    for x, y, site in placed:
        part = share.get(site, 0.0)
        words = f"{site} {percent(part)}" if part >= SHOWN else site
        anchor = "end" if x > WIDTH - 60.0 else "start" if x < 60.0 else "middle"
        drawn.append(f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(words)}</text>')
    drawn += _rod_labels(at(machine.seats), at(machine.joints), links)
    return "".join(drawn)


def _rod_labels(seats: Floats, joints: Floats, links: Sequence[str]) -> list[str]:
    """The rods' names along them, where there is the most room."""
    drawn: list[str] = []
    taken: list[Floats] = []
    for a, b, name in zip(seats, joints, links, strict=True):
        spots = [a + s * (b - a) for s in (0.3, 0.4, 0.5, 0.6, 0.22)]
        spot = max(spots, key=lambda p: min([np.hypot(*(p - t)) for t in taken], default=1e9) > 26.0)
        taken.append(spot)
        drawn.append(f'<text class="rod" x="{spot[0] + 5:.1f}" y="{spot[1] - 3:.1f}">{escape(name)}</text>')
    return drawn
