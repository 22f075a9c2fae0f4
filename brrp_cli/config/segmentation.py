"""Numbers of masks that are made without a prior (brrp_cli/segmentation). Lengths are metres."""

from __future__ import annotations

from dataclasses import dataclass, field

from brrp_cli.config.mending import MendConfig, RegroupConfig
from brrp_cli.config.ranges import between, share
from brrp_cli.config.table import BinsConfig, PlatformsConfig, TableConfig


@dataclass(frozen=True)
class SmoothDepthConfig:
    """Depth averaged over one surface, and flying pixels.

    noise : deviation of inverse depth, 1 / metres: 3 mm at 1 m, the step and the deviation of the
        first Kinect and of stereo cameras at that range; floor : metres that no camera's depth is
        better than, however near
    radius : pixels to each side of the window that is averaged; rounds : times it is averaged
    flying_noise : a neighbour is at a pixel's depth within so many deviations; flying_share : a
        pixel with less than that part of its neighbours at its depth flies, and one with fewer
        than flying_least
    """

    noise: float = 0.003
    floor: float = 0.0015
    radius: int = 3
    rounds: int = 2
    flying_noise: float = 5.0
    flying_share: float = share(0.375)
    flying_least: int = 6


@dataclass(frozen=True)
class ConcaveEdgesConfig:
    """Jumps of depth and hollow creases.

    reach : pixels to each side across which a crease is looked for; normal_step : pixels of the
        difference quotients of normals
    flat, sharp : degrees between both sides' normals: no crease, and surely one
    near : metres; sides farther apart are two surfaces, whatever their normals
    steep : slope beyond which depth jumps; jump : metres that it jumps at least
    """

    reach: int = between(4, 4, 64)
    normal_step: int = 2
    flat: float = between(30.0, 0.0, 180.0)
    sharp: float = between(60.0, 0.0, 180.0)
    near: float = 0.05
    steep: float = 6.0
    jump: float = 0.008


@dataclass(frozen=True)
class ComponentsConfig:
    """Parts that boundaries enclose.

    calm : of boundary, at most, in the middle of a part; least_core : pixels of that middle
    """

    calm: float = share(0.3)
    least_core: int = 30


@dataclass(frozen=True)
class AffinitiesConfig:
    """What the network says of pixels, probabilities.

    colour : what the network says when it sees colours counts so much, and the rest what it says
        without: real prints and shadows are stranger to it than real depth
    least : that a pixel shows an object, or it is depth that bled
    alike : mean affinity of the pixels of two parts from which on they are one object: training
        counts pairs of two objects four times, so that less than a half is even
    step : metres between the depths of two pixels; with more they are not alike
    components : the parts that are joined, in pixels of the network's image
    margin : pixels of that image beside what rises that the network sees, too
    """

    colour: float = share(0.5)
    least: float = share(0.1)
    alike: float = share(0.3)
    step: float = 0.12
    components: ComponentsConfig = field(default_factory=lambda: ComponentsConfig(least_core=32))
    margin: int = 64


@dataclass(frozen=True)
class FootprintsConfig:
    """Insides that stand on one spot of the table with their outsides.

    cell : metres of the plan's grid; bled : percent of the points on each side, along each axis of
        the plan, that may have bled and are no part of a footprint
    overlap : part of the smaller footprint that both share, at least
    inward, facing : mean cosine to the middle: of an inside that shares the footprint, and of
        walls of which one is seen from within and one from without (of a round one 0.9)
    round : part of both footprints that the hull around them may hold besides
    above : metres by which an inside may rise over its outside; highest : percentile of the
        heights of one that counts as how far it rises
    """

    cell: float = 0.003
    bled: float = between(1.0, 0.0, 50.0)
    overlap: float = share(0.3)
    inward: float = between(0.3, -1.0, 1.0)
    facing: float = between(0.7, -1.0, 1.0)
    round: float = 0.45
    above: float = 0.02
    highest: float = between(95.0, 50.0, 100.0)


@dataclass(frozen=True)
class ConcavitiesConfig:
    """What an object's walls stand around.

    cell : metres of the plan's grid; sectors : directions that are looked into; around : those of
    them that hold the object; wall : metres that an inside keeps from the hull of the walls
    object : probability that the network gives a pixel to show an object, at least, for it to be
        an inside
    """

    cell: float = 0.004
    sectors: int = 12
    around: int = 8
    wall: float = 0.008
    object: float = share(0.7)


@dataclass(frozen=True)
class StacksConfig:
    """Things of plain colour stacked flush.

    lightness : weight of CIE L* beside a* and b*: shading changes it
    step : metres of the heights at which a cut is looked for, without `strays` percent of them at
        either end; least_height : metres on both sides
    apart : distance of both sides' colours; plain : part of the variance of colour that lies
        between both sides at least
    beside : metres on both sides of the seam in which their widths are compared; width : the
        narrower one's, as part of the wider one's
    """

    lightness: float = 0.5
    step: float = 0.004
    strays: float = between(2.0, 0.0, 49.0)
    least_height: float = 0.025
    apart: float = 20.0
    plain: float = share(0.75)
    beside: float = 0.012
    width: float = share(0.6)


@dataclass(frozen=True)
class BordersConfig:
    """Borders of masks, moved to where colour changes.

    inner, outer : pixels on both sides of a border that are uncertain; ring : pixels around a mask
    in which the background's colours are taken
    levels : of each channel; blur : levels, deviation, by which histograms are smoothed; floor : of
    the share of any colour
    depth : log odds with which depth's own answer counts
    least : pixels that tell the colours of one side, or borders stay
    """

    inner: float = 8.0
    outer: float = 8.0
    ring: int = between(40, 1, 1000)
    levels: int = between(16, 2, 256)
    blur: float = 1.0
    floor: float = share(0.001)
    depth: float = 0.5
    least: int = 50


@dataclass(frozen=True)
class PromptConfig:
    """Masks of what a prompt names.

    threshold : least score of a box (the detector's published default)
    overlap : boxes that share more of their union are one
    same : of two masks of which the smaller lies in the larger by that part, and which are of about
        one size, one is dropped
    largest : boxes that cover more of the image are the scene, not an object
    table : masks of which that part lies on the table, `height` metres, are the table
    min_pixels : with depth
    piece : a piece of a mask that is no smaller than that part of its largest one stays
    """

    threshold: float = share(0.3)
    overlap: float = share(0.7)
    same: float = share(0.8)
    largest: float = share(0.5)
    table: float = share(0.7)
    height: float = 0.006
    min_pixels: int = 50
    piece: float = share(0.2)


@dataclass(frozen=True)
class LeftOutConfig:
    """Masks of what is cut by the image's border or stands nowhere on the support surface.

    cut : part of a mask's outline on the image's border from which on it is left out; tell : pixels
        with depth of such a mask from which on a stored object may be recognised in it
    lowest : percentile of its heights that counts as its lower end; stands : metres; what ends no
        higher stands on the table, and so does what ends no higher than `round` times its top, but
        `round_stands` metres at most: the lower half of a ball. `over_stands` metres if more than
        `over` of the mask lies over the table
    foot : percentile of its outline's heights up to which the outline is its foot; reach : pixels
        from the foot that are looked at; touch : metres in depth of what touches it; held : part of
        them that are nearer, or another object that touches it, in which case it may stand
    hides : part of what lies straight below it that a mask hides itself, from which on it may stand
        if `partly_over` of it lies over the table
    edge : metres; what is no higher than `edge_height` metres, and has nothing or what is so far
        behind it in `edge_share` of the pixels around it, is depth smeared over the table's edge
    """

    cut: float = share(0.08)
    tell: int = between(1000, 0, 1_000_000)
    lowest: float = between(5.0, 0.0, 100.0)
    stands: float = 0.04
    round: float = share(0.6)
    round_stands: float = 0.06
    over_stands: float = 0.1
    over: float = share(0.5)
    foot: float = between(25.0, 0.0, 100.0)
    reach: int = between(6, 1, 64)
    touch: float = 0.02
    held: float = share(0.25)
    hides: float = share(0.8)
    partly_over: float = share(0.3)
    edge: float = 0.1
    edge_share: float = share(0.4)
    edge_height: float = 0.03


@dataclass(frozen=True)
class ReachingInConfig:
    """What reaches in over the table through the air, as an arm does.

    pixels : that it has at least, `cut` of them within `border` pixels of the image's border
    over : part of it that lies over the table, at least
    lowest : percentile of its heights that counts as its lower end, which is `clear` metres or more
        above the table; hidden : part of that end that may lie within `foot` pixels of the border
    hides : part of what lies straight below it that it hides itself, from which on it may stand
    near : metres to parts of it that are seen apart from it, `part` pixels at least; every : of its
        points one in so many is looked at for that
    rim : pixels beside it, where depth jumps, that are taken for a part of it
    """

    pixels: int = between(500, 1, 1_000_000)
    border: int = between(4, 1, 64)
    cut: int = between(20, 1, 10_000)
    over: float = share(0.1)
    lowest: float = between(5.0, 0.0, 100.0)
    clear: float = 0.03
    foot: int = between(15, 1, 256)
    hidden: float = share(0.1)
    hides: float = share(0.5)
    near: float = 0.05
    part: int = between(30, 1, 1_000_000)
    every: int = between(4, 1, 1000)
    rim: int = between(3, 1, 64)


@dataclass(frozen=True)
class SegmentConfig:
    """Masks of what stands on the table, and in `prompt` those by a prompt, which use smooth_depth
    and table.

    min_height, max_height : what rises less above the table is the table. Between the two it is
        `sigmas` deviations of the table's own height, which grow with the square of the distance;
        beyond `far` metres, max_height grows so, too
    rim : pixels that rise that part of it join an object within `reach`
    least_depth : part of the image that must have depth which neighbours agree on
    steep : degrees between the line of sight and the table's normal, under which no side of the
        image is its upper one
    margin : how far beside the seen table an object may stand
    min_area : objects that show less of themselves are dropped, metres squared; sure_part : that
        part of it is enough of what the network takes for an object with a probability of `sure`,
        on average
    """

    least_depth: float = share(0.01)
    steep: float = between(15.0, 0.0, 90.0)
    min_height: float = 0.004
    max_height: float = 0.015
    far: float = 1.2
    sigmas: float = 3.5
    rim: float = share(0.7)
    reach: float = 0.008
    margin: float = 0.03
    min_area: float = 0.0007
    sure_part: float = share(0.57)
    sure: float = share(0.7)
    smooth_depth: SmoothDepthConfig = field(default_factory=SmoothDepthConfig)
    table: TableConfig = field(default_factory=TableConfig)
    bins: BinsConfig = field(default_factory=BinsConfig)
    platforms: PlatformsConfig = field(default_factory=PlatformsConfig)
    concave_edges: ConcaveEdgesConfig = field(default_factory=ConcaveEdgesConfig)
    components: ComponentsConfig = field(default_factory=ComponentsConfig)
    affinities: AffinitiesConfig = field(default_factory=AffinitiesConfig)
    reaching_in: ReachingInConfig = field(default_factory=ReachingInConfig)
    insides: FootprintsConfig = field(default_factory=FootprintsConfig)
    concavities: ConcavitiesConfig = field(default_factory=ConcavitiesConfig)
    stacks: StacksConfig = field(default_factory=StacksConfig)
    borders: BordersConfig = field(default_factory=BordersConfig)
    left_out: LeftOutConfig = field(default_factory=LeftOutConfig)
    mend: MendConfig = field(default_factory=MendConfig)
    regroup: RegroupConfig = field(default_factory=RegroupConfig)
    prompt: PromptConfig = field(default_factory=PromptConfig)
