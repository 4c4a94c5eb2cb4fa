"""Machines with six rods as the tests' own closures, read from URDFs with nothing but ElementTree, numpy and scipy."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from xml.etree import ElementTree

import numpy as np
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.data import InstrumentSection
from gtpin.robot.library import urdf_path

Floats = np.ndarray

NAMES = ("gantry_tau_6dof", "linear_delta", "stewart", "stewart_jugglebot", "tau")
"""The shipped machines but the Gantry-Tau."""
POSITION_SIGMA, ORIENTATION_SIGMA = 1.5e-5, 5e-5


@dataclass(frozen=True)
class Closures:
    """|T + R P - C(q)| = L(q) of one machine, whose home is T, R at the commands q.

    ``kind`` says for each rod what its actuator ``driver`` does: slide its seat along ``axis`` (``track``), turn it about
    ``axis`` through ``origin`` (``arm``), or lengthen the rod (``leg``). P, C0 (6, 3) and L0 (6,) hold at zero commands;
    ``scale`` (6,) is travel per command. ``spread`` is half the width of the commands about home that tests draw from.
    """

    name: str
    urdf: str
    kind: str
    driver: Floats
    P: Floats
    C0: Floats
    L0: Floats
    axis: Floats
    origin: Floats
    q: Floats
    T: Floats
    R: Floats
    spread: float = 0.0
    scale: Floats = field(default_factory=lambda: np.ones(6))
    rods: tuple[str, ...] = ()
    sites: tuple[str, ...] = ()
    lower: Floats | None = None
    upper: Floats | None = None
    tolerance: Mapping[str, float] = field(default_factory=dict)

    def C(self, q: Floats) -> Floats:
        """(N, 6, 3) seats at commands (N, n)."""
        travel = q[:, self.driver] * self.scale
        C = np.tile(self.C0, (len(q), 1, 1))
        if self.kind == "track":
            C += travel[..., None] * self.axis
        for i in range(6) if self.kind == "arm" else ():
            C[:, i] = self.origin[i] + Rotation.from_rotvec(travel[:, [i]] * self.axis[i]).apply(
                C[:, i] - self.origin[i]
            )
        return C

    def L(self, q: Floats) -> Floats:
        """(N, 6) lengths at commands (N, n)."""
        return self.L0 + (q[:, self.driver] * self.scale if self.kind == "leg" else np.zeros((len(q), 6)))

    def residual(self, q: Floats, T: Floats, R: Floats) -> Floats:
        """(N, 6) |T + R P - C| - L, m."""
        return np.linalg.norm(T[:, None] + self.P @ np.swapaxes(R, 1, 2) - self.C(q), axis=2) - self.L(q)

    def squares(self, q: Floats, T: Floats, R: Floats) -> Floats:
        """(N, 6) |T + R P - C|^2 - L^2, m^2."""
        d = T[:, None] + self.P @ np.swapaxes(R, 1, 2) - self.C(q)
        return np.einsum("nki,nki->nk", d, d) - self.L(q) ** 2

    def close(self, q: Floats, T: Floats, R: Floats, steps: int = 20) -> tuple[Floats, Floats]:
        """Newton's method on the closures, N poses at once, without safeguards: for small steps."""
        T, R = T.copy(), R.copy()
        C, L = self.C(q), self.L(q)
        for _ in range(steps):
            RP = self.P @ np.swapaxes(R, 1, 2)
            d = T[:, None] + RP - C
            gap = np.einsum("nki,nki->nk", d, d) - L**2
            J = 2.0 * np.concatenate([d, np.cross(RP, d)], axis=2)
            step = np.linalg.solve(J, -gap[..., None])[..., 0]
            T += step[:, :3]
            R = Rotation.from_rotvec(step[:, 3:]).as_matrix() @ R
            if np.abs(step).max() < 1e-13:
                break
        return T, R

    def follow(self, q: Floats, stride: float = 0.005) -> tuple[Floats, Floats]:
        """From home to commands q (N, n) along straight lines, in strides of at most so much a command."""
        strides = max(1, int(np.ceil(np.abs(q - self.q).max() / stride)))  # the home of a URDF is rounded
        T, R = np.tile(self.T, (len(q), 1)), np.tile(self.R, (len(q), 1, 1))
        for k in range(1, strides + 1):
            T, R = self.close(self.q + k / strides * (q - self.q), T, R)
        return T, R

    def poses(self, q: Floats) -> tuple[Floats, Floats]:
        """Positions (N, 3) and rotations (N, 3, 3) at commands q (N, n) in the part of the range where strides may be long."""
        return self.follow(q, 0.1)

    def fsolve(self, q: Floats, T: Floats, R: Floats) -> tuple[Floats, Floats, bool]:
        """One posture by scipy's fsolve on the distances, with a numerical Jacobian."""

        def distances(x: Floats) -> Floats:
            turned = Rotation.from_rotvec(x[3:]).as_matrix() @ R
            return self.residual(q[None], x[None, :3], turned[None])[0]

        x, _, code, _ = fsolve(distances, np.concatenate([T, np.zeros(3)]), xtol=1e-14, full_output=True)
        closed = bool(np.abs(distances(x)).max() < 1e-12)
        return x[:3], Rotation.from_rotvec(x[3:]).as_matrix() @ R, closed or code == 1

    def commands(self, count: int, seed: int = 0) -> Floats:
        """Commands about home."""
        return self.q + self.spread * np.random.default_rng(seed).uniform(-1.0, 1.0, (count, len(self.q)))

    def in_range(self, rng: np.random.Generator, count: int, share: float = 0.8) -> Floats:
        """Commands in the middle of the ranges that turn the platform little enough for all to be reached."""
        middle, half = (self.lower + self.upper) / 2.0, (self.upper - self.lower) / 2.0
        together = rng.uniform(-0.5, 0.5, (count, 1))
        apart = rng.uniform(-1.0, 1.0, (count, len(middle))) * (0.5 if len(middle) == 3 else 0.25)
        return middle + share * half * (together + apart)

    def off(self, deviations: Mapping[str, float]) -> "Closures":
        """The machine with parameters off by so much, m, rad and m/m."""
        P, C, L, scale, axis = self.P.copy(), self.C0.copy(), self.L0.copy(), self.scale.copy(), self.axis.copy()
        turns = np.zeros((6, 2))
        for name, value in deviations.items():
            word, owner, component = re.fullmatch(r"(\w+)\[(\w+)\]\.?(\w?)", name).groups()  # type: ignore[union-attr]
            if word == "length":
                L[self.rod(owner)] += value
            elif word == "scale":
                scale[self.rods_of(owner)] += value
            elif word in ("track_direction", "arm_axis"):
                turns[self.rods_of(owner), "ab".index(component)] += value
            else:
                (P if word == "platform_joint" else C)[self.rod(owner), "xyz".index(component)] += value
        for i in range(6):
            axis[i] = turned(axis[i], turns[i])
        return replace(self, P=P, C0=C, L0=L, scale=scale, axis=axis)

    def rods_of(self, owner: str) -> np.ndarray:
        """The rods of an actuator, or the one of this name."""
        return (
            np.flatnonzero(self.driver == self.sites.index(owner))
            if owner in self.sites
            else np.array([self.rod(owner)])
        )

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

    def measured(self, q: Floats, rng: np.random.Generator) -> gtpin.Dataset:
        """What a tracker of the usual noise reads."""
        T, R = self.follow(q, 0.02)
        noise = rng.standard_normal((len(q), 6)) * np.repeat([POSITION_SIGMA, ORIENTATION_SIGMA], 3)
        return gtpin.Dataset(
            robot=self.name,
            pose=np.array([str(i) for i in range(len(q))], dtype=object),
            q=q,
            position=T + noise[:, :3],
            orientation=(Rotation.from_rotvec(noise[:, 3:]) * Rotation.from_matrix(R)).as_quat(scalar_first=True),
            instrument=InstrumentSection(position_sigma=POSITION_SIGMA, orientation_sigma=ORIENTATION_SIGMA),
        )


def turned(v: Floats, turn: Floats) -> Floats:
    """A direction turned by a about the base axis least aligned with it (less its part along it) and by b about v x a."""
    least = np.eye(3)[np.argmin(np.abs(v))]
    a = least - (least @ v) * v
    a /= np.linalg.norm(a)
    return Rotation.from_rotvec(turn[0] * a + turn[1] * np.cross(v, a)).apply(v)


@cache
def nominal(name: str) -> Closures:
    """A shipped machine's closures."""
    return read(urdf_path(name).read_text(encoding="utf-8"), 0.65 if name == "gantry_tau" else 0.0)


def read(urdf: str, spread: float = 0.0) -> Closures:
    """The closures of a URDF in which the platform's frame is the TCP's, and carriers hang on the base."""
    root = ElementTree.fromstring(urdf)
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
        drive = drives[rods[i] if carrier == "base" else carrier]
        kind = "leg" if carrier == "base" else {"prismatic": "track", "revolute": "arm"}[drive.get("type")]
        driver[i] = sites.index(rods[i] if carrier == "base" else carrier)
        P[i] = numbers(joints[f"{rods[i]}_pitch"].find("origin"), "xyz")
        placed = None if kind == "leg" else drive.find("origin")
        origin[i] = 0.0 if placed is None else numbers(placed, "xyz")
        turn = Rotation.from_euler("xyz", np.zeros(3) if placed is None else numbers(placed, "rpy"))
        C[i] = origin[i] + turn.apply(numbers(seat, "xyz"))
        L[i] = numbers(tip, "xyz")
        axis[i] = turn.apply(numbers(drive.find("axis"), "xyz"))
    limits = np.array(
        [[float(drive.find("limit").get(end)) for end in ("lower", "upper")] for drive in drives.values()]
    )
    home = own.find("home")
    return Closures(
        root.get("name", ""),
        urdf,
        kind,
        driver,
        P,
        C,
        np.linalg.norm(L, axis=1),
        axis / np.linalg.norm(axis, axis=1)[:, None],
        origin,
        numbers(home, "q"),
        numbers(home, "tcp_xyz"),
        Rotation.from_rotvec(numbers(home, "tcp_rotvec")).as_matrix(),
        spread,
        rods=tuple(rods),
        sites=tuple(sites),
        lower=limits[:, 0],
        upper=limits[:, 1],
        tolerance={key: float(value) for key, value in own.find("tolerance").attrib.items()},
    )


def numbers(element: ElementTree.Element, key: str) -> Floats:
    return np.array([float(word) for word in element.get(key, "").split()])
