"""What a frame says of space, and how far its sensor errs. Lengths are metres."""

from __future__ import annotations

from dataclasses import dataclass, field

from brrp_cli.config.ranges import between, share


@dataclass(frozen=True)
class FloorConfig:
    """What lies around the objects, where that is not the largest plane: a bin's floor, a tray.

    cell : metres of the plan's grid; reach : cells around the objects that are looked at; band :
    metres above and below the largest plane; least_points : of background there
    rounds : times the median of what is within `spread` metres of the last one is taken
    apart : metres; nearer to the largest plane, it is the same
    """

    cell: float = 0.01
    reach: int = between(6, 1, 100)
    band: float = 0.03
    least_points: int = 200
    rounds: int = 3
    spread: float = 0.005
    apart: float = 0.002


@dataclass(frozen=True)
class WallConfig:
    """A wall behind the table, where it is the larger plane (observation/walls.py).

    square : degrees by which their angle may differ from a right one; of_wall : points of the table
    as a part of the wall's, at least; in_front : part of each one's points, those nearer to it than
    `near` metres, that lie in front of the other
    cell : metres of a plane's grid; low : metres within which what lies over a cell touches it;
    clear : metres from both planes from which on something is a thing; more : part of its cells by
    which the table is touched more
    border : part of the image's border, `border_width` pixels of it, that it fills, from which on
    no mask is looked for there
    """

    square: float = between(20.0, 0.0, 90.0)
    of_wall: float = share(0.2)
    in_front: float = share(0.9)
    near: float = 0.012
    cell: float = 0.02
    low: float = 0.03
    clear: float = 0.02
    more: float = share(0.1)
    border: float = share(0.1)
    border_width: int = between(16, 1, 1000)


@dataclass(frozen=True)
class ObservationConfig:
    """Observed samples: surface, stratified rays, below the plane (paper, section IV-C).

    min_points : valid depth points that an object needs
    ray_bin : metres of a stratum along a ray, which holds one sample; ray_radius : of the ball
        around the object's middle in which rays are sampled; max_ray_samples : of them, at most
    plane_radius : metres around the scene's middle in which the support plane is looked for;
        plane_tolerance : of its inliers; plane_iterations : of RANSAC, on plane_ransac_points
        drawn points at most; plane_min_points : that a plane needs
    floor : where the plane around the objects is another one; None: it is never
    wall : where the largest plane is a wall; None: it is never
    below_draws : samples below the plane within `below_radius`, metres, of the object's middle
    free_cell, surface_cell : metres, of grids in which samples of one label are thinned
    """

    min_points: int = 16
    ray_bin: float = 0.2
    ray_radius: float = 0.2
    max_ray_samples: int = 1_000_000
    plane_radius: float = 0.6
    plane_tolerance: float = 0.01
    plane_iterations: int = 1000
    plane_ransac_points: int = 4_000
    plane_min_points: int = 100
    floor: FloorConfig | None = field(default_factory=FloorConfig)
    wall: WallConfig | None = field(default_factory=WallConfig)
    below_draws: int = 50_000
    below_radius: float = 0.2
    free_cell: float = 0.015
    surface_cell: float = 0.01


@dataclass(frozen=True)
class BledEdgeConfig:
    """Ramps at an object's upper edge (observation/bled_edges.py).

    steps : of the depth from pixel to pixel, one after the other, at least, each of which is more
    than `slope` times as long as the pixel is wide there, and less than `jump` metres; border :
    pixels of the object above them, at most
    """

    steps: int = 3
    slope: float = 4.0
    jump: float = 0.03
    border: int = 3


@dataclass(frozen=True)
class StrayConfig:
    """Pixels of a mask that are not its object's (observation/strays.py).

    link : metres between the depths of neighbouring pixels of one piece, and of scraps from the
        object; reach : metres in depth between the object and its other pieces; share : of the
        pixels of the largest piece, which one that is no scrap has; bled : ramps at its upper edge
    """

    link: float = 0.02
    reach: float = 0.1
    share: float = share(0.02)
    bled: BledEdgeConfig = field(default_factory=BledEdgeConfig)


@dataclass(frozen=True)
class SensorConfig:
    """How far measured depth errs: a standard deviation of noise + noise_growth * depth^2, metres.

    wave : metres, least standard deviation of the mean depth of a patch `patch` metres wide; more
    is measured on the support plane, within `table_reach` metres of it, where `least_patches`
    patches have `patch_points` pixels
    bias : metres, standard deviation of what depth is off as a whole
    pose_turn, pose_shift : radians and metres by which a placement may be off before anything is
    seen
    fine_window : pixels over which a pixel's own noise is averaged
    jump : metres between neighbouring pixels, which is no noise; bleed : radians over which sensors
    mix the two sides of one
    table_margin : radians from what is not the table in which its waves are not looked for
    wave_window : metres; what is smooth over more is taken along by a placement
    least_correlation : of two patches that counts; untold_wave : metres, of patches 1 metre away,
    and patches_per_vote : that err as one, where no table tells
    sure : standard deviations in front of the measured depth from which on space is free for
    certain
    """

    noise: float = 0.0012
    noise_growth: float = 0.0015
    wave: float = 0.0005
    bias: float = 0.0003
    patch: float = 0.01
    table_reach: float = 0.015
    least_patches: int = 30
    patch_points: int = 8
    pose_turn: float = 0.05
    pose_shift: float = 0.005
    fine_window: int = 7
    jump: float = 0.02
    bleed: float = 0.0042
    table_margin: float = 0.01
    wave_window: float = 0.12
    least_correlation: float = share(0.1)
    untold_wave: float = 0.002
    patches_per_vote: float = 10.0
    sure: float = 3.0
