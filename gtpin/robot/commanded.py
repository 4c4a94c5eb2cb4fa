"""A description with other actuators: those that a dataset or a caller picks, in the order of its commands."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree.ElementTree import Element, tostring

from gtpin.errors import RobotError
from gtpin.robot.description import Description, parse_xml


def with_actuators(description: Description, names: Sequence[str]) -> Description:
    """The description with these joints as actuators, in this order; without names, the description itself.

    The ``<actuator>`` elements of its text are replaced, so that files that are written from it have them too. Actuators that
    stay keep their sites and scales. Joints that are left out and in no loop stay at Pinocchio's neutral configuration.

    Raises
    ------
    RobotError
        If a name is not that of a joint that can be commanded, or comes twice.
    """
    if not names or tuple(names) == tuple(actuator.joint for actuator in description.actuators):
        return description
    follows = {mimic.joint: mimic.master for mimic in description.tree.mimics}
    for number, name in enumerate(names):
        if name in follows:
            raise _error(f"{name} follows {follows[name]} by <mimic>", f"name {follows[name]} in its place")
        if name not in description.tree.moving:
            known = ", ".join(description.tree.moving[:12]) + (" ..." if len(description.tree.moving) > 12 else "")
            raise _error(f"{description.name} has no moving joint {name!r}", f"moving joints are {known or 'none'}")
        if name in names[:number]:
            raise _error(f"{name} comes twice", "name each joint once")
    root = parse_xml(description.xml, description.source)
    own = root.find("gtpin")
    if own is None:
        own = Element("gtpin")
        root.append(own)
    before = {element.get("joint"): element for element in own.findall("actuator")}
    for element in before.values():
        own.remove(element)
    home = own.find("home")
    if home is not None and description.home is not None:
        q = dict(zip(before, description.home.q, strict=False))
        home.set("q", " ".join(repr(q.get(name, 0.0)) for name in names))
    for place, name in enumerate(names):
        own.insert(place, before.get(name, Element("actuator", joint=name)))
    return Description.parse(tostring(root, encoding="unicode"), description.source, description.kind)


def _error(what: str, hint: str) -> RobotError:
    return RobotError(what, column="actuators", hint=hint)
