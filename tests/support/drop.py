"""Drop what was exported on a table, in both simulators."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

HEIGHT = 0.01  # metres between the table and the lowest corner at first
SECONDS = 2.0


@dataclass(frozen=True)
class Rest:
    """crept : metres in the last second (where it goes, not its speed: contacts chatter); turned :
    degrees from the first orientation; height : metres of the origin over the table; shifted :
    metres sideways; mass : kg as the simulator has it."""

    crept: float
    turned: float
    height: float
    shifted: float
    mass: float


def drop_in_pybullet(urdf: Path, lowest: float) -> Rest:
    """lowest : z of the lowest corner of the collision parts in the body's frame."""
    import pybullet

    client = pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.setGravity(0, 0, -9.81, client)
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
        pybullet.createMultiBody(0, plane, physicsClientId=client)
        start = [0, 0, HEIGHT - lowest]
        body = pybullet.loadURDF(str(urdf), start, physicsClientId=client)
        mass = pybullet.getDynamicsInfo(body, -1, client)[0]
        places = []
        for seconds in (SECONDS - 1, 1):
            for _ in range(int(240 * seconds)):
                pybullet.stepSimulation(client)
            place, turn = pybullet.getBasePositionAndOrientation(body, client)
            places.append(np.array(place))
    finally:
        pybullet.disconnect(client)
    turned = 2 * np.arccos(np.clip(abs(turn[3]), 0, 1))
    shifted = float(np.linalg.norm(place[:2]))
    crept = float(np.linalg.norm(places[1] - places[0]))
    return Rest(crept, float(np.degrees(turned)), place[2], shifted, mass)


def drop_in_mujoco(mjcf: Path, lowest: float) -> Rest:
    """The same with the MJCF, to which a floor is added."""
    import mujoco

    spec = mujoco.MjSpec.from_file(str(mjcf))
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1])
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[2] = HEIGHT - lowest
    places = []
    for end in (SECONDS - 1, SECONDS):
        while data.time < end:
            mujoco.mj_step(model, data)
        places.append(data.qpos[:3].copy())
    turned = 2 * np.arccos(np.clip(abs(data.qpos[3]), 0, 1))
    return Rest(
        float(np.linalg.norm(places[1] - places[0])),
        float(np.degrees(turned)),
        float(data.qpos[2]),
        float(np.linalg.norm(data.qpos[:2])),
        float(model.body_mass[1]),
    )


def settle_scene(mjcf: Path) -> dict[str, tuple[float, float]]:
    """How far each body of scene.xml has moved after a while, and how far in the last second of
    it, metres."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(mjcf))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    names = [model.body(i).name for i in range(1, model.nbody) if model.body(i).dofnum[0] == 6]
    places = [{name: data.body(name).xpos.copy() for name in names}]
    for end in (SECONDS - 1, SECONDS):
        while data.time < end:
            mujoco.mj_step(model, data)
        places.append({name: data.body(name).xpos.copy() for name in names})
    first, before, last = places
    return {
        name: (
            float(np.linalg.norm(last[name] - first[name])),
            float(np.linalg.norm(last[name] - before[name])),
        )
        for name in names
    }
