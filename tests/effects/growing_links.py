"""Robots whose links are longer in their URDF: what heat does, without an effect."""

from xml.etree import ElementTree

from urdfs import joint, loop, own, urdf

Box = tuple[float, float]


def longer(text: str, by: float, link: str = "arm") -> str:
    """The URDF with all that a moving link carries farther from the link's joint by a factor; ``arm``: with all moving links.

    A link is a body: what is fixed to it belongs to it.
    """
    root = ElementTree.fromstring(text)
    body = {"base": "base"}
    joints = root.findall("joint")
    for one in joints:  # written from the base outwards
        parent, child = (one.find(end).get("link") for end in ("parent", "child"))
        body[child] = body[parent] if one.get("type") == "fixed" else child

    def grows(name: str) -> bool:
        return body[name] != "base" and link in ("arm", body[name])

    places = [(one.find("parent").get("link"), one.find("origin")) for one in joints]
    places += [(end.get("link"), end) for one in root.findall("loop_joint") for end in one]
    for name, place in places:
        if grows(name):
            place.set("xyz", " ".join(repr(float(x) * (1.0 + by)) for x in place.get("xyz").split()))
    return ElementTree.tostring(root, encoding="unicode")


def five_bar() -> str:
    """The tool is on the left far link, beyond the pin."""
    parts = [
        joint("drive_left", "base", "left", "-0.06 0 0", rpy="0 0 2.18"),
        joint("elbow_left", "left", "left_far", "0.15 0 0", rpy="0 0 -1.43"),
        joint("drive_right", "base", "right", "0.06 0 0", rpy="0 0 0.96"),
        joint("elbow_right", "right", "right_far", "0.15 0 0", rpy="0 0 1.43"),
        joint("flange", "left_far", "tool", "0.23 0.01 0.02", kind="fixed"),
    ]
    return urdf(
        "five_bar",
        *parts,
        loop("left_far", "0.2 0 0", "right_far", "0.2 0 0"),
        own(["drive_left", "drive_right"], "tool"),
    )


def spatial() -> str:
    """A crank and a rocker about skew axes, and a coupler between them that turns about two axes, one after the other."""
    parts = [
        joint("drive", "base", "crank", "0 0 0", "0 0 1"),
        joint("yaw", "crank", "fork", "0.2 0 0.05", "0 0 1"),
        joint("pitch", "fork", "coupler", "0 0 0", "0 1 0"),
        joint("swing", "base", "rocker", "0.5 0.15 0", "0 1 0"),
        joint("flange", "rocker", "tool", "0.05 0.1 0.4", kind="fixed"),
    ]
    ends = loop("coupler", "0.3 0.15 0.25", "rocker", "0 0 0.3")
    return urdf("spatial", *parts, ends, own(["drive"], "tool"))


def stages() -> str:
    """A lift of two stages, of which the second follows the first, and an arm on it."""
    follows = '<mimic joint="lift" multiplier="0.5"/>'
    parts = [
        joint("lift", "base", "outer", "0 0 0.2", kind="prismatic"),
        joint("second", "outer", "inner", "0.02 0 0.5", kind="prismatic", inside=follows),
        joint("turn", "inner", "arm_1", "0.1 0 0.3", "0 1 0"),
        joint("wrist", "arm_1", "arm_2", "0.4 0 0", "0 1 0"),
        joint("flange", "arm_2", "tool", "0.2 0 0.1", kind="fixed"),
    ]
    return urdf("stages", *parts, own(["lift", "turn", "wrist"], "tool"))


def parallelogram(size: float = 1.0) -> str:
    """A column that turns; on it a parallelogram that keeps its plate level; all ``size`` times as large."""
    hinges = (
        ("waist", "base", "column", "0 0 0", "0 0 1", "0 0.05 0.2"),
        ("shoulder", "column", "crank", "0.1 0 0.3", "0 1 0", "0 0.02 0.25"),
        ("follow", "column", "rocker", "-0.1 0 0.3", "0 1 0", "0 0 0.25"),
        ("top", "crank", "plate", "0 0 0.5", "0 1 0", "0.1 0 0.05"),
    )
    inertia = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'

    def sized(xyz: str) -> str:
        return " ".join(str(size * float(word)) for word in xyz.split())

    def heavy(centre: str) -> str:
        return f'<inertial><origin xyz="{sized(centre)}"/><mass value="{3.0 * size**3}"/>{inertia}</inertial>'

    parts = [joint(*names, sized(xyz), axis, body=heavy(centre)) for *names, xyz, axis, centre in hinges]
    flange = joint("flange", "plate", "tool0", sized("0.3 0 0.1"), kind="fixed")
    pin_ = loop("plate", sized("-0.2 0 0"), "rocker", sized("0 0 0.5"))
    return urdf("parallelogram", *parts, flange, pin_, own(["waist", "shoulder"], "tool0"))


MACHINES = {"five_bar": five_bar(), "spatial": spatial(), "stages": stages(), "parallelogram": parallelogram()}
"""URDFs by name."""
SITES = {
    "five_bar": ("left", "right", "left_far", "right_far"),
    "spatial": ("crank", "coupler", "rocker"),
    "stages": ("outer", "inner", "arm_1", "arm_2"),
    "parallelogram": ("column", "crank", "rocker", "plate"),
}
"""By machine, the links that have a length."""
