"""A method that brrp does not know: a ball around each object. Run as a script, it is `brrp` with
that method registered, in this process and in the workers that it starts."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import ClassVar

import numpy as np

from brrp_cli.config import SurfaceConfig
from brrp_cli.geometry import transform_points
from brrp_cli.methods.base import Method, Setup
from brrp_cli.methods.configuration import as_record
from brrp_cli.methods.each_object import with_surface
from brrp_cli.methods.registry import METHODS
from brrp_cli.observation.ray_samples import box_center
from brrp_cli.reconstruction import METRES, OK, ObjectReconstruction, Reconstruction


@dataclass(frozen=True)
class SphereConfig:
    """width : metres over which occupancy falls; the ball reaches `share` of the way from the
    middle of what was seen to its farthest point. Its mesh is coarse: the smallest box around a
    fine ball takes longer than all the rest."""

    surface: SurfaceConfig = field(
        default_factory=lambda: SurfaceConfig(keep_distance=0.1, spacing=0.01, nodes=20_000)
    )
    width: float = 0.004
    share: float = 1.0


@dataclass(frozen=True)
class Sphere:
    """Occupancy sigmoid((radius - |x - center|) / width); `width` is the same for a whole frame."""

    kind: ClassVar[str] = "sphere"

    center: np.ndarray
    radius: float
    width: np.ndarray

    @property
    def bounds(self):
        reach = self.radius + 10 * float(self.width)
        return np.stack([self.center - reach, self.center + reach])

    def moved(self, T_target_cam):
        return replace(self, center=transform_points(T_target_cam, self.center))

    def probability(self, points):
        way = self.radius - np.linalg.norm(np.asarray(points) - self.center, axis=-1)
        return (1 / (1 + np.exp(-way / float(self.width)))).astype(np.float32)

    def probability_volume(self, axes):
        return self.probability(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1))

    @property
    def surface_unit(self):
        return METRES

    def uncertainty(self, points):
        p = self.probability(points)
        return p * (1 - p)

    def surface_uncertainty(self, vertices):
        return np.full(len(vertices), self.width, np.float32)

    def write(self, group, shared):
        group.attrs["center"] = self.center
        group.attrs["radius"] = self.radius
        group.attrs["width"] = shared.write("width", self.width, _write_width)

    @classmethod
    def read(cls, group, shared):
        width = shared.read(group.attrs["width"], lambda part: part["metres"][()])
        return Sphere(group.attrs["center"], float(group.attrs["radius"]), width)


def _write_width(group, width):
    group.create_dataset("metres", data=width)


def run(frame, setup: Setup) -> Reconstruction:
    width = np.asarray(setup.config.width)

    def infer(object_id):
        points = frame.object_points(object_id)
        center = box_center(points)
        radius = np.linalg.norm(points - center, axis=1).max() * setup.config.share
        return ObjectReconstruction(
            object_id,
            OK,
            n_points=len(points),
            center=center,
            observed=points,
            posterior=Sphere(center, float(radius), width),
        )

    return Reconstruction(
        frame=frame,
        objects=[
            with_surface(i, partial(infer, i), setup.config.surface) for i in frame.object_ids
        ],
        plane=None,
        method="sphere",
        retriever=None,
        prior_path=None,
        prior_digest=None,
        configuration=as_record(setup.config),
        seed=setup.seed,
        device="cpu",
    )


METHOD = Method(
    name="sphere",
    summary="a ball around each object",
    presets={"tight": SphereConfig(), "half": SphereConfig(share=0.5)},
    run=run,
    posteriors=lambda: (Sphere,),
)

if __name__ in ("__main__", "__mp_main__"):
    METHODS[METHOD.name] = METHOD

if __name__ == "__main__":
    from brrp_cli.cli import main

    main(prog_name="brrp")
