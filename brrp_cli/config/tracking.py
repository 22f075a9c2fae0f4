"""When an object of a stream is the one of the last frame, and when it has not moved."""

from __future__ import annotations

from dataclasses import dataclass, field

from brrp_cli.config.ranges import between, share


@dataclass(frozen=True)
class SharpenConfig:
    """What earlier views of an object tell of it. Lengths are metres.

    views : of an object that are kept: the newest, and those from the most different sides
    side : radians between two views from which on they err independently of each other
    rest : share of the points of one view that may lie in space which the other saw to be free,
        more than `rest_gap` in front of what it measured; rest_depth : median by which their depths
        differ at most, where both saw the object. An object for which this does not hold has moved
    agree : mean distance between a placement and the earlier one from which on the object has moved
    worse : by which the alignment score of an earlier placement may fall before its object is
        searched for again; sure : weight of an object from which on others that have lost before
        are not searched for again
    worth : nats behind the best placement, of the newest frame, from which on the other views are
        not asked
    twice, against : an object is not searched for again that `twice` views speak against, each by
        `against` nats
    samples : of free and occupied space that are kept of a view
    """

    views: int = 4
    side: float = 0.5
    rest: float = share(0.08)
    rest_gap: float = 0.012
    rest_depth: float = 0.002
    agree: float = 0.002
    worse: float = 0.1
    sure: float = share(0.9)
    worth: float = 5.0
    twice: int = 2
    against: float = 10.0
    samples: int = 3000


@dataclass(frozen=True)
class CarryConfig:
    """When a mask that was mended holds in the next frame.

    gap : metres in depth within which two frames saw the same surface
    moved : part of an object's points, of those that are not hidden, whose place is free by now, at
        most
    opening : half the width, pixels, of what is too thin to be an object; least_pixels : of one
    side, same : radians between two views, and part that two masks share, both ways, within which
    what was looked for in one mask is not looked for in the other
    """

    gap: float = 0.012
    moved: float = share(0.1)
    opening: int = between(3, 1, 64)
    least_pixels: int = 200
    side: float = 0.3
    same: float = share(0.8)


@dataclass(frozen=True)
class GlideConfig:
    """When masks and results hold in a later frame, though the camera has moved.

    side : radians between the two views of an object; near : factor by which its distance differs,
    both at most
    same : part that its two masks share, both ways, at least; depth : median of what its depth has
    changed by at most, on an object at rest: waves of real depth go with the side
    outside : part of the image that the earlier frame did not show, at most; height : metres above
    the table from which on what was hidden may be an object; beyond 1 m they grow with the square
    of depth
    """

    side: float = 0.1
    near: float = 1.1
    same: float = share(0.85)
    depth: float = 0.004
    outside: float = share(0.1)
    height: float = 0.01


@dataclass(frozen=True)
class OdometryConfig:
    """How the motion of a camera that does not tell it is found.

    reach : metres, what is farther off is not looked at
    wrong : part of what an earlier frame saw at objects that may look otherwise by then, at most
    turn, shift : radians and metres from which on another frame takes the place of the one that
    later ones are held to
    begun, steps : as many images, each of half the size, from the smallest on, with so many steps:
    small images lead far, and astray where there is little to see, so `begun` goes without them
    """

    reach: float = 3.0
    wrong: float = share(0.12)
    turn: float = 0.1
    shift: float = 0.1
    begun: tuple[int, ...] = (8, 6)
    steps: tuple[int, ...] = (20, 10, 5)


@dataclass(frozen=True)
class TrackConfig:
    """Lengths are metres, in the camera frame of the newer image.

    overlap : of an object's points, moved as the camera was, the share that must fall on a mask
        for the two to be one object
    reach : that an object's middle may have moved between two frames to be still looked for;
        colour : mean difference of its colours, of 255, at most; growth : factor by which its
        number of pixels may differ; shown : part of where it was that must be seen for it to have
        moved: from what is hidden nobody can tell
    still : median of what depth has changed by, at most, on an object that has not moved; of the
        background the median of its size; noise : median of its size on such an object, at most;
        beyond 1 m both sizes may grow with the square of depth, as noise does
    still_mask : IoU of its two masks, at least
    still_camera : metres and radians by which poses of one camera that stands may differ. Where no
    pose is given, a camera stands if both images share a share `ground` of background with depth,
    which has changed by `still` at most in the middle and `still_tail` times that in the share
    `still_most` of it, its colours by `still_colour`, of 255, and edges lie within `still_edges`
    pixels: where brightness changes by `edge`, of 255, from pixel to pixel; fewer than
    `least_edges` such pixels tell nothing
    lost : tracks that are remembered while their object is out of sight
    carry : when masks that were mended hold in the next frame
    glide : when masks and results hold before a camera that moves a little; None = never
    odometry : how the camera's motion is found where frames do not tell it; None = it is not
    sharpen : how earlier views of an object join the newest one; None = they do not
    """

    overlap: float = share(0.3)
    reach: float = 0.3
    colour: float = 40.0
    growth: float = 2.0
    shown: float = share(0.5)
    still: float = 0.002
    noise: float = 0.005
    still_mask: float = share(0.9)
    still_camera: float = 0.0005
    ground: float = share(0.2)
    still_tail: float = 5.0
    still_most: float = share(0.9)
    still_colour: float = 10.0
    still_edges: float = 0.3
    edge: float = 12.0
    least_edges: int = 200
    lost: int = between(16, 0, 1000)
    carry: CarryConfig = field(default_factory=CarryConfig)
    glide: GlideConfig | None = field(default_factory=GlideConfig)
    odometry: OdometryConfig | None = field(default_factory=OdometryConfig)
    sharpen: SharpenConfig | None = field(default_factory=SharpenConfig)
