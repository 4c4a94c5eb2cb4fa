"""An SDF as a graph of links and joints, and the closures of its loops."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
from closures import Closures
from placed import Placed
from scipy.spatial.transform import Rotation

import gtpin


class Graph:
    """The links and joints of an SDF at the poses in the file."""

    def __init__(self, file: Path) -> None:
        model = ElementTree.parse(file).getroot().find("model")
        assert model is not None
        self.links = {link.get("name", ""): Placed.of(told(link, "pose")) for link in model.findall("link")}
        self.joints = {joint.get("name", ""): joint for joint in model.findall("joint")}
        self.mass = sum(float(mass.text or "") for mass in model.iter("mass"))
        for frame in model.findall("frame"):
            self.links[frame.get("name", "")] = self.links[frame.get("attached_to", "")] @ Placed.of(
                told(frame, "pose")
            )

    def place(self, joint: Element) -> Placed:
        return self.links[told(joint, "child")] @ Placed.of(told(joint, "pose"))

    def closures(self, robot: gtpin.Robot) -> Closures:
        """A rod for each ball joint, by following joints from its links to the platform and to the base; travel from home."""
        drives, platform = [a.joint for a in robot.actuators], robot.description.platform
        kind, rods = "", []
        for ball in self.joints.values():
            if ball.get("type") != "ball":
                continue
            one, other = (list(self.chain(told(ball, end))) for end in ("child", "parent"))
            rod, carried = (one, other) if one and told(one[-1], "parent") == platform else (other, one)
            (moved,) = (joint for joint in (*rod, *carried) if joint.get("name") in drives)
            kind = "leg" if moved in rod else "track" if moved.get("type") == "prismatic" else "arm"
            place, axis = self.place(moved), np.array([float(word) for word in told(moved, "axis/xyz").split()])
            ends = self.place(rod[-1]).T, self.place(ball).T
            rods.append((drives.index(moved.get("name", "")), *ends, place.R @ axis, place.T))
        driver, hangs, seats, axes, origins = (np.array(values) for values in zip(*rods, strict=True))
        tcp, lengths = self.links[robot.tcp_frame], np.linalg.norm(hangs - seats, axis=1)
        own, still = (hangs - tcp.T) @ tcp.R, np.zeros(len(drives))
        return Closures("", "", kind, driver, own, seats, lengths, axes, origins, still, tcp.T, tcp.R)

    def arm(self, robot: gtpin.Robot, q: np.ndarray) -> np.ndarray:
        """(N, 3) the TCP of an open chain of turning joints at commands (N, n): each turns what it carries about its axis."""
        places = [self.place(self.joints[actuator.joint]) for actuator in robot.actuators]
        axes = [np.array([float(x) for x in told(self.joints[a.joint], "axis/xyz").split()]) for a in robot.actuators]
        T = np.tile(self.links[robot.tcp_frame].T, (len(q), 1))
        for k in reversed(range(len(places))):
            turn = Rotation.from_rotvec((q[:, [k]] - robot.home_q[k]) * (places[k].R @ axes[k]))
            T = turn.apply(T - places[k].T) + places[k].T
        return T

    def chain(self, link: str) -> Iterator[Element]:
        """The joints that carry a link, up to the base or the platform."""
        for joint in self.joints.values():
            if told(joint, "child") == link and joint.get("type") not in ("ball", "fixed"):
                yield joint
                yield from self.chain(told(joint, "parent"))


def told(element: Element, path: str) -> str:
    text = element.findtext(path)
    assert text is not None
    return text
