"""What a frame says of space, and how far its sensor errs. Lengths are metres."""

from __future__ import annotations

from dataclasses import dataclass, field

from brrp_cli.config.ranges import between, share


@dataclass(frozen=True)
class ScatteredHolesConfig:
    """Pixels without depth among others that have it (frames/scattered_holes.py).

    A pixel has measured ones on both sides in its row or its column, no more than `reach` pixels
    away, and these may lie on one surface that the line of sight meets at `grazing` degrees or
    less from its normal. `passes` times, each with what was filled before.
    least : part of the measured pixels, at least, that these holes are, and `least_pixels` of them;
    fewer stay as they are, since every camera loses some
    """

    reach: int = between(3, 1, 100)
    grazing: float = between(80.0, 0.0, 89.0)
    passes: int = between(2, 1, 10)
    least: float = share(0.06)
    least_pixels: int = 1000


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
    """Walls behind a table, and the sides and boards of a shelf about it (observation/walls.py).

    square : degrees by which their angles may differ from right ones; near : metres from a plane of
    its own points; in_front : part of the table's points that lies on one side of a wall
    cell : metres of the grid along it; spans : part of the table's length that a wall goes along,
    without `strays` percent of its points at either end
    border : part of the image's border, `border_width` pixels of it, that a wall fills which does
    not go along so much
    board_above : metres above the table of a board over it, at least; covers : part of the table
    that it covers; board : from the upper face of it down to where no object reaches
    thick : of walls and boards that are made solid
    """

    square: float = between(20.0, 0.0, 90.0)
    near: float = 0.012
    in_front: float = between(0.9, 0.5, 1.0)
    cell: float = 0.02
    spans: float = share(0.5)
    strays: float = between(1.0, 0.0, 49.0)
    border: float = share(0.1)
    border_width: int = between(16, 1, 1000)
    board_above: float = 0.12
    covers: float = share(0.6)
    board: float = 0.03
    thick: float = 0.01


@dataclass(frozen=True)
class HeapConfig:
    """When a plane goes through a heap of things, and is lowered (observation/lowered.py).

    beneath : points that lie from `off` to `deep` metres beneath it, as a part of its own, from
        which on it does
    turn : degrees by which what bears the heap is turned against it, at most; rounds : times that a
        lower one is looked for, and times that it is fitted to the lowest points over each `cell`
        metres of it
    """

    beneath: float = between(0.4, 0.0, 100.0)
    off: float = 0.02
    deep: float = 0.12
    turn: float = between(30.0, 0.0, 90.0)
    rounds: int = between(3, 1, 10)
    cell: float = 0.02


@dataclass(frozen=True)
class SupportConfig:
    """Which of a frame's large planes bears its things (observation/borne.py).

    points : of the background and of the objects that are looked at, at most
    candidates : planes that are looked for; least : part of the points that a plane holds;
    of_largest : of the largest plane's points, as a part, that another one has, at least
    patch : metres of the grid on which a plane's points hang together; piece : of such points, as a
        part of the largest piece's, that belong to it, too, where things hide what lies between
    through : points seen behind a patch, as a part of its own, at most; off : metres from it and
    from its outline at which they are, and at which something is no part of it
    across : metres from end to end of one that is no face of a thing, at least; turn : degrees by
    which it is parallel or square to the usual one; apart : metres from that where it is parallel
    cell : metres of its plan's grid; low : metres within which the lowest point over a cell stands
    on it; high : metres up to which something belongs to what stands there
    fewest : such cells of a plane that is not the usual one; times : of the cells, and of the
    points there, of the usual one; beneath : the same where it lies beneath the usual one
    up : by how much both count for more on what faces up in the image
    """

    points: int = 40_000
    candidates: int = between(10, 1, 32)
    least: float = share(0.02)
    of_largest: float = share(0.1)
    patch: float = 0.02
    piece: float = share(0.05)
    through: float = share(0.1)
    off: float = 0.02
    across: float = 0.35
    turn: float = between(6.0, 0.0, 45.0)
    apart: float = 0.12
    cell: float = 0.02
    low: float = 0.03
    high: float = 0.5
    fewest: int = 6
    times: float = 1.1
    beneath: float = 3.0
    up: float = 0.5


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
    support : which of the large planes bears the objects; None: the largest
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
    support: SupportConfig | None = field(default_factory=SupportConfig)
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
class LentPixelsConfig:
    """Pixels at the edge of a mask that show another object (observation/lent_pixels.py).

    edge : pixels from the edge, within which they lie; alike : metres from the depth of the nearest
    pixel of another object, at most; apart : from that of the nearest one further inside, at least;
    reach : pixels to either, at most
    """

    edge: float = 3.0
    alike: float = 0.01
    apart: float = 0.02
    reach: int = 8


@dataclass(frozen=True)
class StrayConfig:
    """Pixels of a mask that are not its object's (observation/strays.py).

    link : metres between the depths of neighbouring pixels of one piece, and of scraps from the
        object; reach : metres in depth between the object and its other pieces; share : of the
        pixels of the largest piece, which one that is no scrap has; bled : ramps at its upper edge;
        lent : what shows another object; told : part of a mask's pixels with depth, from which on a
        message tells that they are left out
    """

    link: float = 0.02
    reach: float = 0.1
    told: float = share(0.02)
    share: float = share(0.02)
    bled: BledEdgeConfig = field(default_factory=BledEdgeConfig)
    lent: LentPixelsConfig = field(default_factory=LentPixelsConfig)


@dataclass(frozen=True)
class FlatteningConfig:
    """Low things that a camera mixes with the table (observation/flattened.py).

    low : metres over the plane, less than which the share `top` of a thing's pixels lie that is
        mixed with it; table : metres from the plane, of the table's pixels
    widths : pixels, standard deviations that are tried
    around : pixels from a thing, of the table that shows whether it rises; beside : from and to
        which its level is taken; clear : pixels from another thing that hides it
    least_pixels : of a thing, and of the table around it and beside it
    least_rise : share of a thing's height to which the table rises around it, where it may smooth
    most_left : part of the table's rise that smoothing leaves unexplained, at most
    least_share : of its pixels' values that a thing is taken to make, at least
    """

    low: float = 0.03
    top: float = share(0.95)
    table: float = 0.02
    widths: tuple[float, ...] = (3.0, 4.0, 5.0, 6.0, 8.0)
    around: int = 10
    beside: tuple[int, int] = (14, 26)
    clear: int = 16
    least_pixels: int = 50
    least_rise: float = share(0.05)
    most_left: float = share(0.8)
    least_share: float = share(0.25)


@dataclass(frozen=True)
class MixedEdgesConfig:
    """Outlines at which a camera mixes the depths of both sides (observation/mixed_edges.py).

    jump : metres of depth behind which it does, at least; far : the same of the background that
        shows whether it does
    most : pixels over which it may mix, at most: what lies further within is the object's own;
        reach : pixels from what is told to what tells it
    flying : share of the way to what is behind, from which on depth is between the two, if it is
        more than `slope` times as deep as pixels are wide, as no face is that is well seen
    share : of the pixels at one distance from outlines that are flying where the camera mixes, and
        of those next to half of the objects' sides
    least_pixels : well within an object; least_side : next to the outline on one of its sides;
        least_sides : that have as many
    """

    jump: float = 0.02
    far: float = 0.03
    most: int = between(3, 1, 20)
    reach: int = 12
    flying: float = share(0.2)
    slope: float = 4.0
    share: float = share(0.08)
    least_side: int = 8
    least_sides: int = 3
    least_pixels: int = 50


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
