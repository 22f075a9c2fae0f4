"""Poses of stored objects: features, initial poses, search, verification, weights. Lengths are
metres."""

from __future__ import annotations

from dataclasses import dataclass, field

from brrp_cli.config.ranges import between, share
from brrp_cli.config.turns import ColourConfig, PrintConfig, TurnConfig


@dataclass(frozen=True)
class FeatureConfig:
    """Clouds and FPFH features, of stored and of observed objects alike (paper, section IV-A).

    Stored objects are normalised (largest half-extent 1) and multiplied by `base_scale * scale`
    for each scale of the scan.
    """

    base_scale: float = 0.12
    scales: tuple[float, ...] = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.22, 1.34)
    voxel: float = 0.01
    normal_radius: float = 0.02
    normal_neighbours: int = 30
    fpfh_radius: float = 0.05
    fpfh_neighbours: int = 100


@dataclass(frozen=True)
class RegistrationConfig:
    """RANSAC on FPFH matches over the scale scan (paper, section IV-A)."""

    draw: int = 3
    correspondence_distance: float = 0.0075
    edge_length: float = share(0.9)
    iterations: int = 100_000
    confidence: float = share(0.99)


@dataclass(frozen=True)
class VerificationConfig:
    """What a frame says of a placement: shares of observed points and of model surface.

    near : standard deviation of the Gaussian of observed points' distances to the model; far : an
    observed point further away counts as this far; distance : weight of those distances
    contradiction : weight of model surface in free space and below the plane, which counts from
    `tolerance` on and fully from `tolerance + slope`
    """

    near: float = 0.004
    far: float = 0.02
    distance: float = 0.5
    contradiction: float = 1.5
    tolerance: float = 0.003
    slope: float = 0.012


@dataclass(frozen=True)
class SearchConfig:
    """Hypotheses about one stored object's pose.

    Initial poses are `matchings` feature matchings, every resting pose turned `turns` times and
    raised to the top of what is seen, and the model in `rotations` evenly spread turns and along
    the principal axes of what is seen. The best `begun` of them, and no more than the part `sifted`
    of them, by one of `sifting_share` points, are brought nearer in `begun_steps` steps with
    `begun_points` observed points; the best `coarse` of those, by one of `first_share` points, are
    refined `coarse_steps` steps with `coarse_points`, which reach the surface from
    `coarse_distance`; the best `middle` of those, and then the best `fine`, are refined again, each
    with more points, without those within `same_turn` radians and `same_shift` metres of a better
    one. A stored object has its stored size. That it is something of the kind, of another size, is
    a hypothesis of its own, with a size that is refined with the pose: the best `rescaled`
    placements begin it at `sizes` times the true size, observed points pull from `size_distance`
    metres, and sizes whose logarithm is within `least_size_change` of 0 or beyond `most_size` are
    dropped. Its alignment score falls by size_cost + size_spread_cost * ln(size)^2. No other size
    is tried where the score reaches `settled`, and nothing is refined further where none of the
    placements reaches `unpromising` after the first steps, or `hopeless` later, or all stay
    `beaten` behind another model's. Of placements whose surfaces lie within `distinct` metres the
    best is kept, `kept` in all. An object is not placed at all where another one, with a score of
    `explained`, explains what is seen, and P(c|R) is less than a share `unlikely` of that one's.
    `near` and `tolerance` of `alignment_score` are no less than `waves` standard deviations of the
    waves that the frame's depth has (observation/sensor_noise.py). How far what is seen reaches
    along its plane is measured in `directions` directions, over half a turn.
    """

    turns: int = 24
    rotations: int = between(200, 0, 100_000)
    model_points: int = 300
    least_facing: int = 6
    stray: float = share(0.02)
    box_points: int = 600
    directions: int = 180
    hidden: float = 0.015
    first_share: int = 3
    matchings: int = 4
    matching: RegistrationConfig = field(
        default_factory=lambda: RegistrationConfig(iterations=5_000)
    )
    begun: int = 400
    sifted: float = share(1.0)
    sifting_share: int = 3
    begun_points: int = 20
    begun_steps: int = 3
    coarse: int = 48
    coarse_distance: float = 0.03
    coarse_points: int = 150
    coarse_steps: int = 6
    middle: int = 32
    middle_points: int = 400
    middle_steps: int = 8
    fine: int = 16
    fine_distance: float = 0.01
    fine_points: int = 1000
    fine_steps: int = 10
    same_turn: float = 0.02
    same_shift: float = 0.001
    seen_points: int = 150
    sizes: tuple[float, ...] = (0.85, 1.18)
    rescaled: int = 2
    size_distance: float = 0.015
    size_cost: float = 0.1
    size_spread_cost: float = 0.6
    least_size_change: float = 0.04
    most_size: float = 0.5
    unpromising: float = -0.1
    hopeless: float = 0.1
    beaten: float = 0.3
    settled: float = 0.9
    distinct: float = 0.0015
    kept: int = 6
    explained: float = 0.85
    unlikely: float = share(0.05)
    waves: float = 2.0
    alignment_score: VerificationConfig = field(default_factory=VerificationConfig)
    colour: ColourConfig = field(default_factory=ColourConfig)
    about_itself: TurnConfig = field(default_factory=TurnConfig)
    by_print: PrintConfig = field(default_factory=PrintConfig)


@dataclass(frozen=True)
class TrialConfig:
    """A trial: does a stored object lie in this mask? It ends early where none does.

    most_missing : P(not in the prior) beyond which nothing is placed; objects : stored ones that
    are tried, the most probable, of which the others have `likely` times the P(c|R) of the first;
    unpromising, hopeless : in the place of those of `SearchConfig`
    """

    most_missing: float = share(0.9)
    objects: int = between(2, 1, 1000)
    likely: float = share(0.1)
    unpromising: float = between(0.1, -1.0, 1.0)
    hopeless: float = between(0.35, -1.0, 1.0)


@dataclass(frozen=True)
class RayRefinementConfig:
    """The last step of a placement, by casting the rays of `points` observed points into the mesh.

    `steps` steps of Gauss-Newton at most, fewer where one turns and moves by less than `still`, or
    where `patience` of them, one after the other, gain less than `gain` nats.
    Residuals beyond `outlier` standard deviations do not pull; of the others a share `independent`
    counts, since neighbouring pixels err together. turn, shift : radians and metres by which a
    placement is off before that step; standing : metres, standard deviation of the height at which
    an object stands on the plane
    most_shift, most_turn : a motion beyond is none of a last step, and is not made
    """

    points: int = 1000
    steps: int = 12
    still: float = 2e-5
    gain: float = 0.05
    patience: int = 2
    outlier: float = 3.0
    independent: float = share(0.05)
    turn: float = 0.05
    shift: float = 0.002
    standing: float = 0.0007
    most_shift: float = 0.01
    most_turn: float = 0.2


@dataclass(frozen=True)
class LikelihoodConfig:
    """Log likelihood ratio of a placement against none of the stored objects
    (registration/likelihood.py), nats.

    rays_across_patch : rays along the side of a patch (`SensorConfig.patch`); least_share : of its
    rays that have to be compared
    stored_off : metres, standard deviation of stored meshes and poses; most_deviations, reach :
    larger residuals count as this large, in the sensor's deviations and in metres
    strays : share of patches that are off by anything within `reach`; other_shape : metres,
    standard deviation by which another shape is off where it was fitted, other_strays : and its
    strays
    free : metres behind the rendered depth from which on a measured one says that it is not there;
    nearer, it may be the object's;
    on_table : metres, own pixels no higher may be the table's: none of them is missed
    tolerance, slope : metres below the table from which model surface counts, and on which it comes
    to count fully; surface_points : of the model that are asked
    colours : pixels of the object, and around it, whose colours unmasked pixels are compared with;
    colour_spread : L*a*b*, by which those of one thing differ
    depth, misfit, missed, covered, free_space, unmasked, below, colour : nats for a nat of depth
    residuals, a standard deviation of misfit, a vote of missed, covered, free or unmasked pixels,
    all of the surface below the table, full correlation of what is printed; known_depth : in
    place of `depth` where P(c|R) follows from how stored objects lie over the measured depth, too
    most_votes : that all votes can come to; base : nats of any placement
    other_size : nats against a placement at another size than the stored one
    within : placements whose alignment score is less than the best by more have no weight, nor have
        those with less than `least_alignment`
    refined_from : nats; where the best placement of a stored object reaches them, it is refined by
        rays and judged again
    """

    rays_across_patch: float = 3.0
    least_share: float = share(0.3)
    stored_off: float = 0.0005
    most_deviations: float = 6.0
    reach: float = 0.03
    strays: float = share(0.1)
    other_shape: float = 0.0033
    other_strays: float = share(0.28)
    free: float = 0.008
    on_table: float = 0.005
    tolerance: float = 0.003
    slope: float = 0.012
    surface_points: int = 600
    colours: int = 150
    colour_spread: float = 6.0
    depth: float = 2.7
    known_depth: float = 0.7
    misfit: float = 3.2
    missed: float = 34.0
    covered: float = 0.95
    free_space: float = 20.7
    unmasked: float = 6.7
    below: float = 49.0
    colour: float = 6.0
    most_votes: float = 1.03
    base: float = between(1.25, -50.0, 50.0)
    other_size: float = 3.6
    within: float = 0.5
    least_alignment: float = between(0.25, -1.0, 1.0)
    refined_from: float = between(-6.0, -1000.0, 1000.0)


@dataclass(frozen=True)
class WeighConfig:
    """Weights of hypotheses: P(c|R) exp(log likelihood ratio).

    The hypothesis that the object is none of the stored ones has a ratio of 1 and a probability
    within [least_unknown, most_unknown]; no hypothesis counts as less probable than `least_share`,
    since a retriever may be wrong.
    small : pixels of a mask that brrp made, below which it may be a piece of something: the ratio
    of "none" grows by `doubt` nats for each factor of e that it has less
    """

    least_unknown: float = share(0.1)
    most_unknown: float = share(0.97)
    least_share: float = share(1e-3)
    small: int = between(600, 1, 1_000_000)
    doubt: float = between(4.0, 0.0, 100.0)
