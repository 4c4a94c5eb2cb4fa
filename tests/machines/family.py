"""The shipped machines as the tests' own closures: read from their URDFs with nothing but ElementTree and numpy."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.data import Instrument
from gtpin.robot.library import urdf_path

Floats = np.ndarray

NAMES = ("gantry_tau_6dof", "linear_delta", "stewart", "stewart_jugglebot", "tau")
POSITION_SIGMA, ORIENTATION_SIGMA = 1.5e-5, 5e-5


@dataclass(frozen=True)
class Closures:
    """|T + R P - C(q)| = L(q) of one machine.

    ``kind`` says for each rod what its actuator ``driver`` does: slide its seat along ``axis``, turn it about ``axis`` through
    ``origin``, or lengthen the rod. P, C (6, 3) and L (6,) hold at zero commands; ``scale`` (6,) is travel per command.
    """

    name: str
    rods: tuple[str, ...]
    sites: tuple[str, ...]
    kind: str
    driver: Floats
    P: Floats
    C: Floats
    L: Floats
    axis: Floats
    origin: Floats
    scale: Floats
    home: tuple[Floats, Floats, Floats]
    lower: Floats
    upper: Floats
    tolerance: Mapping[str, float]

    def ends(self, q: Floats) -> tuple[Floats, Floats]:
        """Seats (N, 6, 3) and lengths (N, 6) at commands (N, n)."""
        travel = q[:, self.driver] * self.scale
        C, L = np.tile(self.C, (len(q), 1, 1)), np.tile(self.L, (len(q), 1))
        if self.kind == "leg":
            return C, L + travel
        if self.kind == "track":
            return C + travel[..., None] * self.axis, L
        for i in range(6):
            turn = Rotation.from_rotvec(travel[:, [i]] * self.axis[i])
            C[:, i] = self.origin[i] + turn.apply(self.C[i] - self.origin[i])
        return C, L

    def gap(self, q: Floats, T: Floats, R: Floats) -> Floats:
        """(N, 6) |T + R P - C| - L, m."""
        C, L = self.ends(q)
        return np.linalg.norm(T[:, None] + self.P @ np.swapaxes(R, 1, 2) - C, axis=2) - L

    def forward(self, q: Floats, strides: int = 24) -> tuple[Floats, Floats]:
        """Positions (N, 3) and rotations (N, 3, 3) at commands (N, n), followed from home by Newton's method."""
        q0, T0, rotvec = self.home
        T, R = np.tile(T0, (len(q), 1)), np.tile(Rotation.from_rotvec(rotvec).as_matrix(), (len(q), 1, 1))
        for fraction in np.linspace(0.0, 1.0, strides):
            C, L = self.ends(q0 + fraction * (q - q0))
            for _ in range(12 if fraction in (0.0, 1.0) else 3):
                RP = self.P @ np.swapaxes(R, 1, 2)
                d = T[:, None] + RP - C
                gap = (np.einsum("nki,nki->nk", d, d) - L**2) / 2.0
                step = np.linalg.solve(np.concatenate([d, np.cross(RP, d)], axis=2), -gap[..., None])[..., 0]
                T, R = T + step[:, :3], Rotation.from_rotvec(step[:, 3:]).as_matrix() @ R
        assert np.abs(step).max() < 1e-11
        return T, R

    def off(self, deviations: Mapping[str, float]) -> "Closures":
        """The machine with parameters off by so much, m, rad and m/m."""
        P, C, L, scale, axis = self.P.copy(), self.C.copy(), self.L.copy(), self.scale.copy(), self.axis.copy()
        turns = np.zeros((len(self.sites), 2))
        for name, value in deviations.items():
            word, owner, component = re.fullmatch(r"(\w+)\[(\w+)\]\.?(\w?)", name).groups()  # type: ignore[union-attr]
            if word == "length":
                L[self.rod(owner)] += value
            elif word == "scale":
                scale[self.driver == self.sites.index(owner)] += value
            elif word in ("track_direction", "arm_axis"):
                turns[self.sites.index(owner), "ab".index(component)] += value
            else:
                (P if word == "platform_joint" else C)[self.rod(owner), "xyz".index(component)] += value
        for i in range(6):
            axis[i] = turned(axis[i], turns[self.driver[i]])
        return replace(self, P=P, C=C, L=L, scale=scale, axis=axis)

    def rod(self, owner: str) -> int:
        return self.rods.index(owner) if owner in self.rods else self.rods.index(f"link{owner}")

    def parameters(self) -> dict[str, float]:
        """The default set of parameters and their tolerances."""
        found = {}
        seat = {"leg": "base_joint", "track": "cart_joint", "arm": "arm_joint"}[self.kind]
        labels = [rod.removeprefix("link") for rod in self.rods]
        for label in labels:
            found[f"length[{label}]"] = self.tolerance["link_length"]
        for word in ("platform_joint", seat):
            for label in labels:
                for axis in "xyz":
                    found[f"{word}[{label}].{axis}"] = self.tolerance.get(f"{word}_{axis}", self.tolerance[word])
        word = {"track": "track_direction", "arm": "arm_axis"}.get(self.kind)
        for site in self.sites if word else ():
            found |= {f"{word}[{site}].{c}": self.tolerance[str(word)] for c in "ab"}
        if self.name == "stewart_jugglebot":
            found |= {f"scale[{site}]": self.tolerance["scale"] for site in self.sites}
        return found

    def commands(self, rng: np.random.Generator, count: int, share: float = 0.8) -> Floats:
        """Commands in the middle of the ranges that turn the platform little enough for all to be reached."""
        middle, half = (self.lower + self.upper) / 2.0, (self.upper - self.lower) / 2.0
        together = rng.uniform(-0.5, 0.5, (count, 1))
        apart = rng.uniform(-1.0, 1.0, (count, len(middle))) * (0.5 if len(middle) == 3 else 0.25)
        return middle + share * half * (together + apart)

    def measured(self, q: Floats, rng: np.random.Generator) -> gtpin.Dataset:
        """What a tracker of the usual noise reads."""
        T, R = self.forward(q)
        noise = rng.standard_normal((len(q), 6)) * np.repeat([POSITION_SIGMA, ORIENTATION_SIGMA], 3)
        return gtpin.Dataset(
            robot=self.name,
            pose=np.array([str(i) for i in range(len(q))], dtype=object),
            q=q,
            position=T + noise[:, :3],
            orientation=(Rotation.from_rotvec(noise[:, 3:]) * Rotation.from_matrix(R)).as_quat(scalar_first=True),
            instrument=Instrument(position_sigma=POSITION_SIGMA, orientation_sigma=ORIENTATION_SIGMA),
        )


def turned(v: Floats, turn: Floats) -> Floats:
    """A direction turned by a about the base axis least aligned with it (less its part along it) and by b about v x a."""
    least = np.eye(3)[np.argmin(np.abs(v))]
    a = least - (least @ v) * v
    a /= np.linalg.norm(a)
    return Rotation.from_rotvec(turn[0] * a + turn[1] * np.cross(v, a)).apply(v)


@cache
def nominal(name: str) -> "Closures":
    """A shipped machine's closures."""
    root = ElementTree.parse(urdf_path(name)).getroot()
    joints = {joint.get("name"): joint for joint in root.findall("joint")}
    loops = {loop.get("name"): loop for loop in root.findall("loop_joint")}
    own = root.find("gtpin")
    rods = [rod.get("site", "") for rod in own.findall("rod")]
    drives = {e.get("site", ""): joints[e.get("joint")] for e in own.findall("actuator")}
    sites, driver, kind = list(drives), np.zeros(6, dtype=int), ""
    P, C, L, axis, origin = (np.zeros((6, 3)) for _ in range(5))
    for i, rod in enumerate(own.findall("rod")):
        loop = loops[rod.get("loop")]
        tip, seat = loop.find("link1"), loop.find("link2")
        carrier = seat.get("link")
        site = rods[i] if carrier == "base" else carrier
        drive = drives[site]
        kind = "leg" if carrier == "base" else {"prismatic": "track", "revolute": "arm"}[drive.get("type")]
        driver[i] = sites.index(site)
        P[i] = numbers(joints[f"{rods[i]}_pitch"].find("origin"), "xyz")
        origin[i] = 0.0 if kind == "leg" else numbers(drive.find("origin"), "xyz")
        C[i] = origin[i] + numbers(seat, "xyz")
        L[i] = numbers(tip, "xyz")
        axis[i] = numbers(drive.find("axis"), "xyz")
    limits = [(float(d.find("limit").get("lower")), float(d.find("limit").get("upper"))) for d in drives.values()]
    home = own.find("home")
    return Closures(
        name,
        tuple(rods),
        tuple(sites),
        kind,
        driver,
        P,
        C,
        np.linalg.norm(L, axis=1),
        axis / np.linalg.norm(axis, axis=1)[:, None],
        origin,
        np.ones(6),
        (numbers(home, "q"), numbers(home, "tcp_xyz"), numbers(home, "tcp_rotvec")),
        np.array(limits)[:, 0],
        np.array(limits)[:, 1],
        {key: float(value) for key, value in own.find("tolerance").attrib.items()},
    )


def numbers(element: ElementTree.Element, key: str) -> Floats:
    return np.array([float(word) for word in element.get(key, "").split()])


def three_spheres(centres: Floats, radii: Floats, near: Floats) -> Floats:
    """The point (N, 3) at three distances (N, 3) from three centres (N, 3, 3), of the two the one nearer to a point."""
    a, b, c = centres[:, 0], centres[:, 1] - centres[:, 0], centres[:, 2] - centres[:, 0]
    d = np.linalg.norm(b, axis=1)
    ex = b / d[:, None]
    i = np.einsum("ni,ni->n", ex, c)
    ey = c - i[:, None] * ex
    j = np.linalg.norm(ey, axis=1)
    ey /= j[:, None]
    r = radii.T**2
    x = (r[0] - r[1] + d**2) / (2.0 * d)
    y = (r[0] - r[2] + i**2 + j**2 - 2.0 * i * x) / (2.0 * j)
    z = np.sqrt(r[0] - x**2 - y**2)
    foot, up = a + x[:, None] * ex + y[:, None] * ey, z[:, None] * np.cross(ex, ey)
    both = np.stack([foot + up, foot - up])
    return both[np.linalg.norm(both - near, axis=2).argmin(axis=0), np.arange(len(a))]
