"""The starter set: which household objects there are, their names, colours and sizes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from brrp_cli.shapes import kinds, solids

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class Shape:
    """One household object.

    name : unique in its list; description : short phrase for CLIP
    mesh : closed and outward, metres, z up, resting on z = 0; color : RGB, 0 to 255
    """

    name: str
    description: str
    mesh: trimesh.Trimesh
    color: tuple[int, int, int]


def household_shapes() -> list[Shape]:
    """The objects of the starter prior, in sizes that shops sell."""
    return [
        Shape("cereal_box", "a cereal box", solids.box(0.190, 0.060, 0.270), (214, 60, 50)),
        Shape("sugar_box", "a yellow sugar box", solids.box(0.090, 0.040, 0.175), (240, 200, 70)),
        Shape("wood_block", "a wooden block", solids.box(0.085, 0.085, 0.200), (176, 130, 84)),
        Shape("soup_can", "a soup can", solids.cylinder(0.034, 0.102), (200, 40, 60)),
        Shape("coffee_can", "a blue coffee can", solids.cylinder(0.051, 0.140), (40, 70, 160)),
        Shape(
            "mustard_bottle",
            "a yellow mustard bottle",
            solids.squeezed(kinds.bottle(0.048, 0.190, 0.012, 0.030, 0.045), 0.65),
            (250, 210, 30),
        ),
        Shape(
            "water_bottle",
            "a plastic water bottle",
            kinds.bottle(0.033, 0.220, 0.013, 0.025, 0.055),
            (120, 180, 220),
        ),
        Shape(
            "spray_bottle",
            "a spray bottle of glass cleaner",
            kinds.spray_bottle(0.045, 0.250, 0.65),
            (70, 130, 210),
        ),
        Shape(
            "bowl", "a red bowl", solids.spherical_bowl(0.035, 0.080, 0.055, 0.005), (190, 40, 40)
        ),
        Shape("mug", "a coffee mug", kinds.mug(0.042, 0.095, 0.005, 0.035), (230, 230, 225)),
        Shape("plate", "a dinner plate", kinds.plate(0.120, 0.025, 0.006, 0.075), (235, 235, 240)),
        Shape(
            "plastic_cup",
            "a plastic cup",
            solids.beaker(0.030, 0.042, 0.110, 0.003),
            (60, 160, 90),
        ),
        Shape("tennis_ball", "a tennis ball", solids.ball(0.033), (200, 225, 60)),
        Shape("apple", "a red apple", kinds.apple(0.039), (190, 30, 30)),
        Shape("banana", "a banana", kinds.banana(0.180, 0.018), (245, 220, 80)),
        Shape(
            "screwdriver",
            "a screwdriver with a red handle",
            kinds.screwdriver(0.215, 0.105, 0.016),
            (200, 50, 40),
        ),
        Shape("hammer", "a hammer", kinds.hammer(0.300, 0.120, 0.014), (60, 60, 66)),
    ]


def household_variations() -> list[Shape]:
    """Objects of the same kinds in sizes that the starter prior does not hold."""
    return [
        Shape("cracker_box", "a cracker box", solids.box(0.160, 0.070, 0.215), (220, 120, 40)),
        Shape("paint_can", "a paint can", solids.cylinder(0.060, 0.120), (90, 90, 100)),
        Shape(
            "shampoo_bottle",
            "a shampoo bottle",
            solids.squeezed(kinds.bottle(0.042, 0.215, 0.016, 0.030, 0.030), 0.75),
            (150, 90, 180),
        ),
        Shape("wide_mug", "a wide mug", kinds.mug(0.052, 0.088, 0.006, 0.032), (50, 110, 140)),
        Shape(
            "deep_bowl",
            "a deep bowl",
            solids.spherical_bowl(0.035, 0.070, 0.075, 0.006),
            (80, 140, 80),
        ),
    ]
