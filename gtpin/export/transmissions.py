"""Drive scales in a URDF, as transmissions: software that reads only the kinematics ignores them, ros2_control reads them."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree.ElementTree import Element, SubElement

from gtpin.export.text import numbers, xml_text
from gtpin.robot.description import parse_xml
from gtpin.robot.robot import Robot

SIMPLE = "transmission_interface/SimpleTransmission"
"""The transmission whose joint moves by the actuator's travel over ``mechanicalReduction``."""


def with_transmissions(urdf: str, robot: Robot, scales: Mapping[str, float]) -> str:
    """The URDF with a transmission for each drive whose travel per command is not 1: its reduction is divided by this scale.

    A ``<mimic>`` is not used: it needs an additional joint, which other software would treat as another driven joint.
    """
    odd = [
        (actuator, scales[site])
        for actuator, site in zip(robot.actuators, robot.sites, strict=True)
        if scales[site] != 1.0
    ]
    if not odd:
        return urdf
    root = parse_xml(urdf, f"the URDF of {robot.name}")
    own = {joint.get("name"): t for t in root.findall("transmission") for joint in t.findall("joint")}
    for actuator, scale in odd:
        reduction = _reduction(root, own.get(actuator.joint), actuator.joint)
        try:
            before = float(reduction.text or 1.0)
        except ValueError:
            continue  # not a number: no reader knows what it means
        reduction.text = numbers(before / scale)
    return xml_text(root)


def _reduction(root: Element, transmission: Element | None, joint: str) -> Element:
    """The element with a joint's reduction; added if there is none."""
    if transmission is None:
        transmission = SubElement(root, "transmission", name=f"{joint}_scale")
        SubElement(transmission, "type").text = SIMPLE
        SubElement(transmission, "joint", name=joint)
    motor = transmission.find("actuator")
    motor = SubElement(transmission, "actuator", name=f"{joint}_drive") if motor is None else motor
    found = next(transmission.iter("mechanicalReduction"), None)
    return SubElement(motor, "mechanicalReduction") if found is None else found
