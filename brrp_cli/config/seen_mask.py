"""What an object's mask tells of where stored ones lie. Lengths are metres."""

from __future__ import annotations

from dataclasses import dataclass, field

from brrp_cli.config.ranges import between, share

# Share of a mask's pixels that have depth, below which the mask says more of an object than depth.
LITTLE_DEPTH = 0.6


@dataclass(frozen=True)
class MaskPosesConfig:
    """How a model is placed by a mask alone (registration/mask_poses.py).

    turns : about the plane's normal, of each resting pose; halved : times that the steps between
        them are halved about the best; kept : how many of the best
    directions : of the image, in which outlines are compared; points : of the model's surface;
        steps : towards the mask; edge_width : pixels from the border or another object, within
        which the mask may be cut
    """

    turns: int = 24
    halved: int = 2
    kept: int = 8
    directions: int = 16
    points: int = 100
    steps: int = 4
    edge_width: int = 2


@dataclass(frozen=True)
class SilhouetteConfig:
    """How a placed model's silhouette is held against a mask (registration/silhouette.py).

    edge : pixels at the mask's edge that count for neither side
    around : part of the mask's longer side that is looked at beside it; least_around : pixels, at
        least; rays, rays_beside : in and beside the mask, at most
    near : metres, and nodes : spacings of the model's distances, of which the larger is how near
        to a ray it covers that; touched : metres, how near it reaches into one beside the mask
    """

    edge: int = 1
    around: float = 0.4
    least_around: int = 8
    rays: int = 200
    rays_beside: int = 400
    near: float = 0.002
    nodes: float = 0.6
    touched: float = 0.0005


@dataclass(frozen=True)
class SeenMaskConfig:
    """What a mask says of placements where depth shows too little (registration/seen_mask.py).

    blind : share of its pixels that have depth, from which on it is not asked
    least_points : of an object that may be placed by its mask; shapes that are not stored need
        `ObservationConfig.min_points`
    trusted : points further than `edge_width` pixels inside it that are fully trusted; of fewer,
        what they say counts in proportion, and for the rest as alignment score `usual`
    astray : alignment score against a placement whose lowest point, of `points` of its surface, is
        `high` metres or more from the plane, where no point is trusted
    supposed : metres, standard deviation of how far away it stands, where no point is trusted
    bare, spilled : alignment scores against a placement that leaves all of it bare, and that covers
        e - 1 times as much beside it; silhouette : how that is found; by_mask : how the mask
        suggests placements
    edge_deviation : pixels, to within which a placed shape reaches as far as the mask, in the
        directions of `by_mask`; edge_width : from the mask's edge, where points are not trusted
    """

    blind: float = share(LITTLE_DEPTH)
    bare: float = 1.0
    spilled: float = 0.3
    silhouette: SilhouetteConfig = field(default_factory=SilhouetteConfig)
    by_mask: MaskPosesConfig = field(default_factory=MaskPosesConfig)
    edge_deviation: float = 2.0
    edge_width: int = 2
    trusted: int = 100
    usual: float = share(0.85)
    astray: float = 0.2
    high: float = 0.02
    points: int = 300
    supposed: float = 0.01
    least_points: int = between(1, 1, 1000)
