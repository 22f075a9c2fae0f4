"""URDF of one body."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from brrp_cli.config.planning import RestConfig
from brrp_cli.planning.body import Body
from brrp_cli.planning.mjcf import Files
from brrp_cli.planning.numbers import spell


def urdf(body: Body, files: Files, config: RestConfig) -> str:
    """A robot of one link, whose origin is the body's; files are named beside the URDF. Friction
    stands where PyBullet reads it; other readers of URDF pass over it."""
    robot = ET.Element("robot", name=body.name)
    link = ET.SubElement(robot, "link", name=body.name)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz="0 0 0", rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=spell([body.mass]))
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = body.inertia
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    values = (xx, xy, xz, yy, yz, zz)
    ET.SubElement(inertial, "inertia", {n: spell([v]) for n, v in zip(names, values, strict=True)})
    contact = ET.SubElement(link, "contact")
    ET.SubElement(contact, "lateral_friction", value=spell([config.friction]))
    ET.SubElement(contact, "spinning_friction", value=spell([config.torsion]))
    ET.SubElement(contact, "rolling_friction", value=spell([config.rolling]))
    visual = _with_mesh(link, "visual", files.mesh)
    material = ET.SubElement(visual, "material", name=f"{body.name}_colour")
    ET.SubElement(material, "color", rgba=spell([*body.colour, 1.0]))
    for file in files.parts:
        _with_mesh(link, "collision", file)
    ET.indent(robot)
    return '<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode") + "\n"


def _with_mesh(link: ET.Element, kind: str, file: str) -> ET.Element:
    element = ET.SubElement(link, kind)
    ET.SubElement(element, "origin", xyz="0 0 0", rpy="0 0 0")
    ET.SubElement(ET.SubElement(element, "geometry"), "mesh", filename=file)
    return element
