"""Prior means of hypotheses, completion, and the maps that correct them. Lengths are metres."""

from __future__ import annotations

from dataclasses import dataclass, field

from brrp_cli.config.ranges import between, share


@dataclass(frozen=True)
class InferenceConfig:
    """Hilbert map and SVGD (paper, sections III-A, III-B and IV-D)."""

    hinges_per_axis: int = 12
    hinge_half_width: float = 0.15
    feature_floor: float = 1e-7
    particles: int = 8
    learning_rate: float = 0.1
    epochs: int = 10
    observed_batch: int = 2048
    prior_batch: int = 256
    lambda_observed: float = 50.0
    lambda_prior: float = 1.0
    lambda_norm: float = 1e-6


@dataclass(frozen=True)
class FittedDepthConfig:
    """Depth of an object without the sensor's noise (brrp_cli/observation/fitted_depth.py).

    reaches : metres, radii of the neighbourhoods to which curved surfaces are fitted, which have
    `least_pixels` at least (one pixel has four neighbours, too few to tell noise from shape) and
    `most_pixels` at most
    gate : deviations from the plane before, beyond which a neighbour has no say
    fit : a surface fits if the variance about it is at most so many times that of the noise
    wave : share of the sensor's waves that counts as noise beside that of single pixels
    least_neighbours : of its six coefficients' fit, and some more to tell whether it fits;
    least_pivot : share of the neighbours' count, below which they lie in a line, or along the
    mask's outline
    """

    reaches: tuple[float, float, float] = (0.003, 0.006, 0.012)
    least_pixels: int = 3
    most_pixels: int = 12
    gate: float = 3.0
    fit: float = 2.0
    wave: float = 0.5
    least_neighbours: int = between(10, 7, 1000)
    least_pivot: float = share(0.002)


@dataclass(frozen=True)
class SlantConfig:
    """How a surface slants to the camera's sight (brrp_cli/observation/slant.py).

    blur : pixels, deviation, over which its slope is averaged, where a share `known` of the pixels
    so near has one; elsewhere the nearest such place counts
    least : metres across it for a metre along the sight, at least: steeper slopes are noise
    """

    blur: float = 2.0
    known: float = share(0.05)
    least: float = share(0.33)


@dataclass(frozen=True)
class RampConfig:
    """The logit about what was seen (brrp_cli/completion/seen_surface.py).

    width : metres behind it where the logit is `shell_logit`; it is 0 on it
    margin : radians from the mask's outline within which depth may be another thing's
    rise : waves of the sensor above the plane, under which depth may be the plane's
    nearer : waves by which the surface is nearer than measured where depth may be another thing's
    """

    width: float = 0.003
    margin: float = 0.0042
    rise: float = 4.0
    nearer: float = between(1.0, 0.0, 10.0)
    slant: SlantConfig = field(default_factory=SlantConfig)
    depth: FittedDepthConfig = field(default_factory=FittedDepthConfig)


@dataclass(frozen=True)
class RevolutionConfig:
    """Objects that are round about an axis (brrp_cli/completion/revolution.py).

    off : sine by which a normal leaves the planes through the axis where it has a quarter of its
        say in where that lies; steps : in which it is fitted
    least_points : seen, thinned; most_points : more are thinned further
    least_aside : share of them whose normals lean from the axis by a sine of `aside`; least_round :
        share of these whose normals leave the planes through it by a sine less than `meets`;
        least_covered : share of a turn, in `sectors`, in each of which there is a share
        `least_sector` of them
    most_scatter : metres within which a share `within` of the points lies of the `neighbours` that
        the turn brings beside them; `leaning` times as many count for an axis that leans
    most_oval : share of the radius by which it may be wider one way than across, over `levels` of
        the height; radii that are off by a share `strays` lose half of their say; waves along what
        is seen of a turn that have a mean square under `untold` count as none
    beside : metres from a seen point along the surface to where it tells where that lies
    patch : metres, of the half plane; points are one-sided if the mean direction from the axis, of
        those in three patches by three, is longer than `one_sided`
    turns : for the box about all of it; cell : of a ring, in spacings of the grid; free : share of
        a ring that is empty where all of it is
    """

    enabled: bool = True
    off: float = 0.2
    steps: int = 8
    least_points: int = 150
    most_points: int = 4000
    aside: float = 0.5
    least_aside: float = share(0.3)
    meets: float = 0.3
    least_round: float = share(0.82)
    sectors: int = 36
    least_sector: float = share(0.005)
    least_covered: float = share(0.33)
    most_scatter: float = 0.0026
    within: float = share(0.9)
    leaning: float = 1.1
    most_oval: float = share(0.23)
    levels: int = 24
    strays: float = share(0.05)
    untold: float = 1e-4
    neighbours: int = 12
    beside: float = 0.003
    patch: float = 0.004
    one_sided: float = share(0.97)
    turns: int = 8
    cell: float = 1.0
    free: float = share(0.15)


@dataclass(frozen=True)
class StandingConfig:
    """Objects whose feet are hidden (brrp_cli/completion/standing.py).

    sure : how probable the most probable place of each height is at least
    least : probability that the object reaches down to the plane, as the network has it, under
        which it stands on something else
    foot : metres, height of the lowest of what is seen; gap : metres between neighbouring pixels of
        it and of another object that touches it; touched : share of its border that touches
        others, from which on it may stand on them
    """

    enabled: bool = True
    sure: float = share(0.8)
    least: float = share(0.2)
    foot: float = 0.02
    gap: float = 0.015
    touched: float = share(0.3)


@dataclass(frozen=True)
class MeanConfig:
    """Prior mean functions of hypotheses, as logits.

    A placed shape is -(signed distance) / width, limited to +-limit, with distances that are exact
    within `exact` metres of its surface; an alignment score under `sure` widens it by `doubt`
    metres for each unit. An object that none explains is completed by a network on a grid of about
    `nodes` nodes, or `minor_nodes` where that weighs less than `minor`. The network is evaluated at
    every node where the coarse ones around are not all `beyond_doubt`; about what is seen of it its
    logit is a `ramp` as steep as `shell_logit` says, for `shell` metres, or `shell_nodes` of the
    grid's spacings where these are longer, and `sunk` metres below the plane at most. Space is
    empty that lies more than `carve_depth` in front of the measured depth, or `carve_plane` below
    the plane, or less than `carve_behind` behind what is no object's and more than `carve_pixels`
    from the mask.
    """

    nodes: int = 200_000
    minor: float = share(0.1)
    minor_nodes: int = 25_000
    width: float = 0.0005
    sure: float = 0.9
    exact: float = 0.004
    doubt: float = 0.004
    limit: float = 5.0
    beyond_doubt: float = 1.5
    shell: float = 0.004
    shell_nodes: float = 1.3
    shell_logit: float = 2.0
    sunk: float = 0.002
    ramp: RampConfig = field(default_factory=RampConfig)
    revolution: RevolutionConfig = field(default_factory=RevolutionConfig)
    standing: StandingConfig = field(default_factory=StandingConfig)
    carve_depth: float = 0.006
    carve_plane: float = 0.004
    carve_behind: float = 0.01
    carve_pixels: int = 2


@dataclass(frozen=True)
class VolumeConfig:
    """The volume that the network of learned shapes looks at (brrp_cli/completion/volume.py). All
    of it belongs to the network's weights.

    side : voxels along each edge, a multiple of 8
    depth : an object counts as at least so many times as deep as wide; margin : of its largest
        extent, on each side; hidden : so much more where another object hides all of its outline;
        below : of the largest extent, under the plane
    near : voxels behind and in front of the measured depth at which the finer distance is cut off;
        full : observed points that fill a voxel
    """

    side: int = 40
    depth: float = 1.0
    margin: float = 0.1
    hidden: float = 0.3
    below: float = 0.05
    near: float = 3.0
    full: float = 2.0


@dataclass(frozen=True)
class CompletionConfig:
    """The shape of an object that no stored one explains (brrp_cli/completion).

    learned : by the network that has learned shapes, which sees the object's surroundings as a
        `volume`; otherwise by a smaller one that sees lengths at a point alone
    bias : nats added to its log odds: a network that is right at each point on average makes thin
        things, whose place is in doubt, thinner than they are
    largest : metres, diagonal of the seen points' box; a larger object is looked at as one of this
        size that looks the same (completion/usual_size.py)
    cell : metres, of grids in which observed points are merged; closing : gaps of fewer cells are
    closed

    The rest belongs to the network's weights: it was trained with these numbers.
    least : metres; smaller extents are as noisy as depth is; most : shares of the seen points
        between which an object's size is taken: strays do not count
    neighbours : seen points whose spread gives a normal
    thickness : metres, standard deviation by which points in one plane, which have no hull, move
    radii : of discs by which local thickness is measured; thickness_side : pixels along the longer
        side of the image that it is measured in: a handle of a large one is many pixels wide
    turns : of the rectangle about a footprint, over a quarter of a circle, each tried with about
        `turned_points`; rectangle_most : shares of the points between which it lies; least_side :
        metres, of it
    levels : of the radial profile
    pairs : of seen points between which free space is looked for; free : metres in front of the
        measured depth at which it begins
    higher, aside : steps to where free space is looked for beside a point, in the object's sizes
    far, ratio : lengths, metres, and ratios beyond these tell nothing more; thin : metres, added
        to what a length is divided by that may be 0
    """

    learned: bool = True
    bias: float = between(0.2, -5.0, 5.0)
    largest: float = 0.2
    cell: float = 0.004
    closing: int = 7
    least: float = 0.005
    most: tuple[float, float] = (0.02, 0.98)
    neighbours: int = 12
    thickness: float = 0.0005
    radii: int = 12
    thickness_side: int = 100
    turns: int = 24
    turned_points: int = 800
    rectangle_most: tuple[float, float] = (0.01, 0.99)
    least_side: float = 0.004
    levels: int = 24
    pairs: int = 1000
    free: float = 0.006
    higher: float = 0.3
    aside: float = 0.2
    far: float = 0.2
    ratio: float = 4.0
    thin: float = 0.002
    volume: VolumeConfig = field(default_factory=VolumeConfig)


@dataclass(frozen=True)
class SpreadConfig:
    """How uncertain a surface's place is, from how steeply occupancy falls across it. Metres.

    steep : up to here the deviation is what the steepness says. Beyond, occupancy has to reach 0
    and 1 within the size of an object, and falls faster elsewhere than where it is 0.5: the
    deviation grows with the power `growth` of what the steepness says, fitted to 208 objects of
    made scenes (docs/sensors.md)
    most : no surface is less certain than this
    step : half of the difference quotients' step
    """

    steep: float = 0.005
    growth: float = share(0.6)
    most: float = 0.02
    step: float = 0.001


@dataclass(frozen=True)
class FittedMapConfig:
    """A Hilbert map whose hinge points fill the box of what was seen and of the hypotheses.

    hinges : about so many, no closer than `least_spacing`; margin : of the box, metres
    behind : metres behind and in front of the seen surface where it is sampled
    start : standard deviation of the particles' first weights
    stiffness : lambda_norm is so many times as large for a placed shape, which is known better than
    a completed one; contradiction : a sample that a placed shape cannot explain by the noise counts
    so many times, for there are few of them among all that was seen to be free around it;
    least_weight : hypotheses that weigh less are left out
    spread : what its steepness says of a surface's place
    """

    hinges: int = 1000
    least_spacing: float = 0.01
    margin: float = 0.02
    feature_floor: float = 1e-7
    particles: int = 8
    steps: int = 40
    learning_rate: float = 0.1
    batch: int = 512
    start: float = 0.3
    behind: float = 0.004
    lambda_observed: float = 50.0
    lambda_norm: float = 0.5
    stiffness: float = 8.0
    contradiction: float = 1000.0
    least_weight: float = share(0.01)
    spread: SpreadConfig = field(default_factory=SpreadConfig)
