"""A film strip: a row for each grasp, a picture at the end of each phase, by ray casting."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrp_cli.files import atomic_path
from brrp_cli.geometry import normalise
from brrp_cli.reconstruction import Surface
from brrp_cli.rendering.render import PinholeView, render
from grasp_trial.trial import CLOSED, HELD, IN, LIFTED, PRE_GRASP, SHAKEN
from grasp_trial.world import TABLE_NAME

Picture = NDArray[np.uint8]
PHASES = (PRE_GRASP, IN, CLOSED, LIFTED, SHAKEN)
HEIGHT, WIDTH, FOCAL = 230, 190, 330.0  # pixels
CAPTION = 22  # pixels
AWAY = 0.75  # metres from the camera to what it looks at
LOOKS_AT = 0.15  # metres over the place of the grasp: between where it lies and where it is lifted
TABLE_EDGE = 0.3  # metres around the grasp that the table is drawn
TARGET, OTHERS, HAND, TABLE = (224, 130, 50), (150, 170, 200), (90, 95, 105), (222, 214, 200)
SIDES = 8
INK = (30, 30, 30)


@dataclass
class Film:
    """Keeps pictures of the first grasps of each outcome: `held` that held, `failed` of each way to
    fail."""

    held: int = 2
    failed: int = 1
    rows: list[tuple[str, list[Picture | None]]] = field(default_factory=list)
    taken: Counter[str] = field(default_factory=Counter)

    def wants(self, result: str) -> bool:
        """Whether a grasp that ended like this is still to be shown."""
        return self.taken[result] < (self.held if result == HELD else self.failed)

    def add(self, label: str, result: str, take: Take) -> None:
        """Draw what was watched of one grasp."""
        self.taken[result] += 1
        side = take.clearest(take.states[PRE_GRASP])
        pictures = [
            take.picture(take.states[phase], side) if phase in take.states else None
            for phase in PHASES
        ]
        self.rows.append((f"{label}: {result}", pictures))

    def save(self, path: Path) -> None:
        """All rows, those that held first. Errors: OutputError."""
        from PIL import Image

        if not self.rows:
            return
        rows = sorted(self.rows, key=lambda row: not row[0].endswith(HELD))
        with atomic_path(path) as partial:
            Image.fromarray(_strip(rows)).save(partial, format="PNG")


@dataclass
class Take:
    """What is watched of one attempt: the state of the simulation at the end of each phase.

    target : name of the body that is grasped; at : (3,) where, world
    """

    model: Any
    target: str
    at: NDArray[np.float64]
    states: dict[str, NDArray[np.float64]] = field(default_factory=dict)

    def __call__(self, phase: str, data: Any) -> None:
        """Remember where everything is."""
        self.states[phase] = np.array(data.qpos)

    def clearest(self, qpos: NDArray[np.float64]) -> float:
        """The side, radians about the vertical, from which most of the object is seen."""
        sides = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)
        seen = [int(is_target(self.picture(qpos, side, 1 / 4)).sum()) for side in sides]
        return float(sides[int(np.argmax(seen))])

    def picture(self, qpos: NDArray[np.float64], side: float, scale: float = 1.0) -> Picture:
        """(HEIGHT, WIDTH, 3) times `scale`, from a side."""
        import mujoco

        data = mujoco.MjData(self.model)
        data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, data)
        surfaces, colours = [], []
        for geom in range(self.model.ngeom):
            vertices, faces = self._shape(geom)
            R, t = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
            # The mesh of a plane is drawn around what the camera looks at.
            shift = np.array([*self.at[:2], 0.0]) if self._is_table(geom) else np.zeros(3)
            placed = np.asarray(vertices @ R.T + t + shift, dtype=np.float64)
            surfaces.append(Surface(placed, faces, np.zeros(len(placed), "f4"), ""))
            colours.append(np.tile(np.uint8([*self._colour(geom), 255]), (len(placed), 1)))
        return np.asarray(render(surfaces, colours, self._view(side, scale)), dtype=np.uint8)

    def _shape(self, geom: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        import trimesh

        model = self.model
        mesh = int(model.geom_dataid[geom])
        if mesh >= 0:
            first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
            start, faces = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
            return (
                np.asarray(model.mesh_vert[first : first + count], dtype=np.float64),
                np.asarray(model.mesh_face[start : start + faces], dtype=np.int64),
            )
        size = 2 * model.geom_size[geom]
        if self._is_table(geom):
            size = np.array([2 * TABLE_EDGE, 2 * TABLE_EDGE, 1e-4])
        box = trimesh.creation.box(size)
        return np.asarray(box.vertices), np.asarray(box.faces, dtype=np.int64)

    def _is_table(self, geom: int) -> bool:
        return str(self.model.geom(geom).name) == TABLE_NAME

    def _colour(self, geom: int) -> tuple[int, int, int]:
        body = str(self.model.body(self.model.geom_bodyid[geom]).name)
        if self._is_table(geom):
            return TABLE
        if body == self.target:
            return TARGET
        return OTHERS if body.startswith("object") else HAND

    def _view(self, side: float, scale: float) -> PinholeView:
        """From a side and a little above, the same for all phases."""
        middle = np.array([*self.at[:2], LOOKS_AT])
        back = normalise(np.array([np.cos(side), np.sin(side), 0.35]))
        x = normalise(np.cross(np.array([0.0, 0.0, 1.0]), back))
        axes = np.stack([x, np.cross(-back, x), -back])
        T = np.eye(4)
        T[:3, :3] = axes
        T[:3, 3] = -axes @ (middle + AWAY * back)
        K = np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1]])
        K[:2] *= scale
        return PinholeView(K, T, (round(HEIGHT * scale), round(WIDTH * scale)))


def is_target(picture: Picture) -> NDArray[np.bool_]:
    """(H, W), pixels of the object that is grasped: its colour, however lit."""
    colour = picture.astype(np.float64)
    lit = colour / np.maximum(colour.max(axis=-1, keepdims=True), 1)
    return np.asarray((np.abs(lit - np.array(TARGET) / max(TARGET)) < 0.08).all(axis=-1))


def _strip(rows: list[tuple[str, list[Picture | None]]]) -> Picture:
    from PIL import Image, ImageDraw

    size = (WIDTH * len(PHASES), CAPTION + (HEIGHT + CAPTION) * len(rows))
    sheet = Image.new("RGB", size, (255, 255, 255))
    draw = ImageDraw.Draw(sheet)
    for i, phase in enumerate(PHASES):
        draw.text((WIDTH * i + 6, 5), phase, fill=INK)
    for k, (label, pictures) in enumerate(rows):
        top = CAPTION + (HEIGHT + CAPTION) * k
        draw.text((6, top + 5), label, fill=INK)
        for i, picture in enumerate(pictures):
            if picture is not None:
                sheet.paste(Image.fromarray(picture), (WIDTH * i, top + CAPTION))
    return np.asarray(sheet)
