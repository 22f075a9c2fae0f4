"""The scene and a floating hand as MuJoCo has them. World frame: z up, the table's top at z = 0."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.grasping import GraspConfig
from brrp_cli.geometry import similarity
from brrp_cli.grasping.gripper import Gripper
from brrp_cli.physics import DENSITY
from brrp_cli.planning.body import mass_and_inertia
from brrp_cli.planning.numbers import quaternion_wxyz, spell
from grasp_trial.bodies import TrueBody

STEP = 0.001  # seconds
TABLE_NAME = "table"
# Contacts yield by force / mass x this time squared: what weighs little is crushed otherwise.
CONTACT_TIME = 0.002  # seconds
FORCE = 40.0  # newtons, at most: nobody closes on a ball with all that a hand has
HAND_MASS, FINGER_MASS = 1.0, 0.05  # kg
FINGER_DAMPING = 20.0  # N s / m
STIFFNESS = 3000.0  # N / m of what drives a finger, up to the hand's force
# Metres, friction against turning and rolling: of a soft pad, and so that balls lie still.
TORSION, ROLLING = 0.005, 0.001


def world_xml(bodies: Sequence[TrueBody], gripper: Gripper, friction: float) -> str:
    """A model: `table`, `object_ID`, and `hand`, with two driven fingers, which
    follows the mocap body `lead`."""
    model = ET.Element("mujoco", model="grasp")
    ET.SubElement(model, "compiler", angle="radian")
    option = ET.SubElement(
        model,
        "option",
        timestep=str(STEP),
        integrator="implicitfast",
        cone="elliptic",
        impratio="10",
        noslip_iterations="3",
    )
    # What lies still and is not touched takes no time.
    ET.SubElement(option, "flag", sleep="enable")
    default = ET.SubElement(model, "default")
    ET.SubElement(
        default,
        "geom",
        friction=spell([friction, TORSION, ROLLING]),
        condim="6",
        solref=spell([CONTACT_TIME, 1]),
    )
    assets = ET.SubElement(model, "asset")
    world = ET.SubElement(model, "worldbody")
    ET.SubElement(world, "light", pos="0 0 2", dir="0 0 -1", directional="true")
    ET.SubElement(
        world, "geom", name=TABLE_NAME, type="plane", size="2 2 0.1", rgba="0.7 0.66 0.6 1"
    )
    for i, body in enumerate(bodies):
        _add_object(assets, world, body, i)
    _add_hand(model, world, gripper)
    return ET.tostring(model, encoding="unicode")


def _add_object(assets: ET.Element, world: ET.Element, body: TrueBody, number: int) -> None:
    colour = ["0.86 0.5 0.2 1", "0.25 0.5 0.8 1", "0.4 0.65 0.35 1", "0.7 0.35 0.6 1"][number % 4]
    name = f"object_{body.object_id}"
    T = body.T_world_object
    place = {"pos": spell(T[:3, 3]), "quat": spell(quaternion_wxyz(T[:3, :3]))}
    element = ET.SubElement(world, "body", {"name": name, **place})
    ET.SubElement(element, "freejoint", name=name)
    mass, inertia = mass_and_inertia(body.mesh, DENSITY)
    heavier = max(1.0, GraspConfig.lightest / mass)
    mass, inertia = mass * heavier, inertia * heavier
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia
    ET.SubElement(
        element,
        "inertial",
        pos=spell(np.asarray(body.mesh.center_mass)),
        mass=spell([mass]),
        fullinertia=spell([xx, yy, zz, xy, xz, yz]),
    )
    for i, part in enumerate(body.parts):
        mesh = f"{name}_{i}"
        ET.SubElement(assets, "mesh", name=mesh, vertex=spell(part.ravel()))
        ET.SubElement(element, "geom", name=mesh, type="mesh", mesh=mesh, rgba=colour)


def _add_hand(model: ET.Element, world: ET.Element, hand: Gripper) -> None:
    # A mocap body has no velocity, so that its friction drags nothing along: it leads the hand.
    ET.SubElement(world, "body", name="lead", mocap="true", pos="0 0 2")
    base = ET.SubElement(world, "body", name="hand", pos="0 0 2", gravcomp="1")
    ET.SubElement(base, "freejoint", name="hand")
    half = np.array([hand.palm_width, hand.palm_depth, hand.palm_length]) / 2
    mass, force = str(HAND_MASS), min(hand.force, FORCE)
    grey = "0.55 0.57 0.6 1"
    ET.SubElement(
        base,
        "geom",
        name="palm",
        type="box",
        size=spell(half),
        pos=spell([0, 0, half[2]]),
        mass=mass,
        rgba=grey,
    )
    size = np.array([hand.finger_thickness, hand.finger_width, hand.finger_length]) / 2
    actuators = ET.SubElement(model, "actuator")
    for name, sign in (("left", -1.0), ("right", 1.0)):
        x = sign * (hand.opening / 2 + size[0])
        place = spell([x, 0, hand.tip - size[2]])
        body = ET.SubElement(base, "body", name=name, pos=place, gravcomp="1")
        ET.SubElement(
            body,
            "joint",
            name=name,
            type="slide",
            axis=spell([-sign, 0, 0]),
            range=spell([0, hand.opening / 2]),
            limited="true",
            damping=str(FINGER_DAMPING),
        )
        ET.SubElement(
            body, "geom", name=name, type="box", size=spell(size), mass=str(FINGER_MASS), rgba=grey
        )
        ET.SubElement(
            actuators,
            "position",
            name=name,
            joint=name,
            kp=str(STIFFNESS),
            forcerange=spell([-force, force]),
            forcelimited="true",
        )
    equality = ET.SubElement(model, "equality")
    ET.SubElement(equality, "joint", joint1="left", joint2="right", polycoef="0 1 0 0 0")
    ET.SubElement(
        equality, "weld", body1="lead", body2="hand", solref="0.01 1", solimp="0.95 0.99 0.001"
    )
    contact = ET.SubElement(model, "contact")
    for first, second in (("hand", "left"), ("hand", "right"), ("left", "right")):
        ET.SubElement(contact, "exclude", body1=first, body2=second)


def back_along(T: NDArray[np.float64], distance: float) -> NDArray[np.float64]:
    """A hand's pose T (4, 4), `distance` metres back along its approach."""
    return T @ similarity(translation=np.array([0, 0, -distance]))
