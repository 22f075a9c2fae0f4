"""The table of a frame without masks, bins and platforms on it. Lengths are metres."""

from __future__ import annotations

from dataclasses import dataclass, field

from brrp_cli.config.observation import HeapConfig, SupportConfig, WallConfig
from brrp_cli.config.ranges import between, share


@dataclass(frozen=True)
class BareConfig:
    """How far a table goes on where it has no depth (segmentation/standing_beside.py).

    rises, high : metres above the plane between which something is a thing, or part of it; jump :
        metres of depth between two of them; pixels : of one, at least; bled : percentiles of its
        plan at both ends that may have bled
    foot : metres to which it reaches down, but for its `lowest` percent; partly : or as a part of
        it, what stands within the hull; inside : part of one that asks for no more table
    bare : part of what lies between it and the hull, as the image shows it, that has no depth, at
        least; through : as a part of that, what is seen more than `off` metres behind the plane
    """

    rises: float = 0.012
    high: float = 0.5
    jump: float = 0.03
    pixels: int = 150
    bled: float = between(2.0, 0.0, 25.0)
    foot: float = 0.03
    lowest: float = between(5.0, 0.0, 50.0)
    partly: float = share(0.25)
    inside: float = share(0.98)
    bare: float = share(0.3)
    off: float = 0.02
    through: float = share(0.1)


@dataclass(frozen=True)
class TableConfig:
    """The table's plane and its extent.

    points : so many are drawn, and of those ransac_points for RANSAC; iterations : of it;
    tolerance : metres of its inliers; min_points : of them, at least
    least : part of the points that the largest plane holds
    parallel : degrees between the table and a floor; height : metres of the table above a floor;
    of_floor : points of the table, as a part of the floor's
    cell : metres of the grid on which the plane's points hang together
    beyond : metres that the table goes on beyond the image's border, where it reaches it; blind :
        part of the image along its border that may be without depth; edge : pixels, the last ones
        before that, which are not trusted; step : pixels over which the way out of it is read
    support : which plane is the table; heap : when a plane is none; wall : what shuts it off;
    bare : where it has no depth; lacking : part of its pixels without depth from which on that
        tells nothing of its things
    """

    points: int = 40_000
    ransac_points: int = 2_000
    min_points: int = 100
    iterations: int = 500
    tolerance: float = 0.01
    least: float = share(0.05)
    parallel: float = between(10.0, 0.0, 90.0)
    height: float = 0.2
    of_floor: float = share(0.25)
    cell: float = 0.02
    beyond: float = 0.2
    blind: float = share(0.16)
    edge: int = between(2, 0, 64)
    step: int = between(12, 1, 64)
    support: SupportConfig = field(default_factory=SupportConfig)
    wall: WallConfig = field(default_factory=WallConfig)
    heap: HeapConfig = field(default_factory=HeapConfig)
    bare: BareConfig = field(default_factory=BareConfig)
    lacking: float = between(0.3, 0.0, 0.99)


@dataclass(frozen=True)
class BinsConfig:
    """Bins, totes and trays: walls of one height around a floor. Lengths are metres.

    points : about so many are looked at, at least; widest : on a larger table none is looked for
    cell : of the plan's grid; step : of the heights of rims that are tried, from `least_height` to
    `most_height` above the table; band : what is that far above or below may be of the same rim;
    uneven : how far a rim may be above or below its own median
    gap : cells; twice as many may be missing in a rim; least_rim : metres squared of it
    complete : part of the outline, as far as the image shows it, that is rim; shown : part of the
    outline that the image shows; hollow : part of what it encloses that is lower
    area : that it encloses, metres squared: more than large bowls and pans do; rectangle : the same
    of a rectangle; corners : part of it that the hull of the rim's cells fills; turn : radians
    between the directions in which sides of rectangles are looked for; sides : coordinates that are
    tried in each, `apart` metres or more from one another
    low : what rises less may be floor; floor_seen : part of what it encloses that the hull of the
    floor makes up, or a heap hides it and the floor is taken to reach `wall` metres from the rim;
    least_floor : metres squared that tell how high the floor is
    lies : what rises more over the floor lies in it; filled : metres squared of that, or the bin is
    empty, and a thing itself
    beside : how far beside the seen table a bin may reach; bled : how far depth bleeds beside its
    walls; thick : how far within the rim they are seen at its height; lean : sine by which they do
    over : what rises so far over the rim is an object; masked : part of what is seen of the walls
    that has a mask, from which on the bin is an object itself
    board : thickness of walls that are made solid
    """

    points: int = 100_000
    widest: float = 4.0
    cell: float = 0.01
    step: float = 0.02
    least_height: float = 0.04
    most_height: float = 0.5
    band: float = 0.02
    uneven: float = 0.01
    gap: int = between(2, 1, 16)
    least_rim: float = 0.003
    complete: float = share(0.75)
    shown: float = share(0.5)
    hollow: float = share(0.5)
    area: float = 0.08
    rectangle: float = 0.05
    corners: float = share(0.93)
    turn: float = 0.035
    sides: int = between(4, 2, 16)
    apart: float = 0.04
    low: float = 0.03
    floor_seen: float = share(0.6)
    wall: float = 0.02
    least_floor: float = 0.002
    lies: float = 0.012
    filled: float = 0.0004
    beside: float = 0.1
    bled: float = 0.01
    thick: float = 0.03
    lean: float = 0.14
    over: float = 0.015
    masked: float = share(0.5)
    board: float = 0.01


@dataclass(frozen=True)
class PlatformsConfig:
    """Low platforms on which things lie: level regions a little above the table.

    least_height, most_height, step : of the heights above the table that are tried; band : what is
    that far above or below may be of the same one
    area : of one, metres squared: more than boxes and plates have; shown : part of it that is
    level; piece : part of it that hangs together, at least; below : part of it that is lower, at
    most; uneven : what is higher but does not lie on it, at most, as a part of what is level;
    rectangle : part of the one around it that is filled, from which on it is one; gap : cells
    by which what is level is joined
    lies : what rises more over it lies on it; filled : metres squared of that, or the platform is
    empty, and a thing itself; sides : into which its edge is parted, each of which rises where
    `rises` of it does; walled : part of them that do, from which on it is a tray
    ring : part of what lies around it that is seen, at least; table : part of that which is table
    around : metres beside it that may be its edge; rounds : times that the table's plane is fitted
    to what lies beside it
    """

    least_height: float = 0.004
    most_height: float = 0.045
    step: float = 0.003
    band: float = 0.004
    area: float = 0.045
    shown: float = share(0.3)
    piece: float = share(0.15)
    below: float = share(0.1)
    uneven: float = share(0.25)
    rectangle: float = share(0.8)
    gap: int = between(2, 1, 16)
    lies: float = 0.012
    filled: float = 0.0004
    sides: int = between(12, 3, 64)
    rises: float = share(0.15)
    walled: float = share(0.7)
    ring: float = share(0.3)
    table: float = share(0.6)
    around: float = 0.01
    rounds: int = between(3, 0, 10)
