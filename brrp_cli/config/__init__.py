"""Every constant of the method, in two presets.

`paper` holds the constants of the paper and of its authors' implementation; `default` is what
`brrp` uses when nothing else is asked for. The effective configuration is saved beside every
result. Lengths are metres.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from brrp_cli.config.ranges import share
from brrp_cli.config.retrieval import RetrievalConfig
from brrp_cli.errors import BrrpError


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
class ObservationConfig:
    """Observed samples: surface, stratified rays, below the plane (paper, section IV-C).

    min_points : valid depth points that an object needs
    ray_bin : metres of a stratum along a ray, which holds one sample; ray_radius : of the ball
        around the object's middle in which rays are sampled; max_ray_samples : of them, at most
    plane_radius : metres around the scene's middle in which the support plane is looked for;
        plane_tolerance : of its inliers; plane_iterations : of RANSAC, on plane_ransac_points
        drawn points at most; plane_min_points : that a plane needs
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
    below_draws: int = 50_000
    below_radius: float = 0.2
    free_cell: float = 0.015
    surface_cell: float = 0.01


@dataclass(frozen=True)
class SensorConfig:
    """How far measured depth errs: a standard deviation of noise + noise_growth * depth^2, metres.

    wave : metres, least standard deviation of the mean depth of a patch `patch` metres wide; more
    is measured on the support plane, within `table_reach` metres of it, where `least_patches`
    patches have `patch_points` pixels
    bias : metres, standard deviation of what depth is off as a whole
    pose_turn, pose_shift : radians and metres by which a placement may be off before anything is
    seen
    sure : standard deviations in front of the measured depth from which on space is free for
    certain
    """

    noise: float = 0.0012
    noise_growth: float = 0.0015
    wave: float = 0.0005
    bias: float = 0.00035
    patch: float = 0.01
    table_reach: float = 0.015
    least_patches: int = 30
    patch_points: int = 8
    pose_turn: float = 0.05
    pose_shift: float = 0.005
    sure: float = 3.0


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
class SurfaceConfig:
    """The surface where the mean occupancy is `level`.

    A stored mesh is moved along its normals by at most `farthest` metres, and inwards or outwards
    by no more than a share `wall_share` of the wall's thickness; the level set is looked for at
    `steps` places of that way. Where more than a share `most_off` of its vertices would have to be
    moved further, and where no stored object explains what is seen, the surface comes from marching
    cubes on a grid of about `nodes` nodes, whose spacing in metres lies between `finest` and
    `spacing`.
    fidelity : metres, standard deviation of a stored mesh from its object
    keep_distance : metres; a component of the level set further from every observed point is
    hallucinated
    one_piece : whether an object is one piece; the published methods keep every part near what was
    seen, cavities included
    seen_share : of the observed points that a part near them must own to be joined to the largest,
    a tenth of it where the part has a share `volume_share` of the largest's volume; route_radius :
    metres, of what joins them, which is two nodes thick at least
    """

    level: float = share(0.5)
    spacing: float = 0.005
    finest: float = 0.002
    nodes: int = 300_000
    keep_distance: float = 0.01
    one_piece: bool = True
    seen_share: float = share(0.03)
    volume_share: float = share(0.1)
    route_radius: float = 0.003
    farthest: float = 0.004
    wall_share: float = share(0.4)
    steps: int = 17
    fidelity: float = 0.0002
    most_off: float = share(0.05)


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
class ColourConfig:
    """Which of the placements that depth cannot tell apart has the colours of the image.

    The best placement is turned about each axis of its box in `turns` steps, both ways up; of those
    whose alignment score is within `alike` of its own the one with the best colours is taken, if
    their correlation is `better` by so much. Colours are compared at `vertices` vertices, of which
    `least_seen` have to be within `near` metres of the measured depth; what differs by less than
    `plain` (of 255) is of one colour.
    """

    turns: int = 24
    alike: float = 0.03
    better: float = 0.1
    vertices: int = 1500
    least_seen: int = 40
    near: float = 0.01
    plain: float = 8.0


@dataclass(frozen=True)
class SearchConfig:
    """Hypotheses about one stored object's pose.

    Initial poses are `matchings` feature matchings and every resting pose turned `turns` times. The
    best `coarse` of them are refined `coarse_steps` steps with `coarse_points` observed points,
    which reach the surface from `coarse_distance`; the best `middle` of those, and then the best
    `fine`, are refined again, each with more points. A stored object has its stored size. That it
    is something of the kind, of another size, is a hypothesis of its own, with a size that is
    refined with the pose: the best `rescaled` placements begin it at `sizes` times the true size,
    observed points pull from `size_distance` metres, and sizes whose logarithm is within
    `least_size_change` of 0 or beyond `most_size` are dropped. Its alignment score falls by
    size_cost, which over `sharpness` (see WeighConfig) is the log odds against another size, and by
    size_spread_cost * ln(size)^2. No other size is tried where the score reaches `settled`, and
    nothing is refined further where none of the placements reaches `hopeless` or all stay `beaten`
    behind another model's. Of placements whose surfaces lie within `distinct` metres the best is
    kept, `kept` in all.
    """

    turns: int = 24
    model_points: int = 300
    least_facing: int = 6
    stray: float = share(0.02)
    box_points: int = 600
    hidden: float = 0.015
    first_share: int = 3
    first_factor: int = 2
    matchings: int = 4
    matching: RegistrationConfig = field(
        default_factory=lambda: RegistrationConfig(iterations=5_000)
    )
    coarse: int = 96
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
    seen_points: int = 150
    sizes: tuple[float, ...] = (0.85, 1.18)
    rescaled: int = 2
    size_distance: float = 0.015
    size_cost: float = 0.1
    size_spread_cost: float = 0.6
    least_size_change: float = 0.04
    most_size: float = 0.5
    hopeless: float = 0.1
    beaten: float = 0.3
    settled: float = 0.9
    distinct: float = 0.0015
    kept: int = 6
    alignment_score: VerificationConfig = field(default_factory=VerificationConfig)
    colour: ColourConfig = field(default_factory=ColourConfig)


@dataclass(frozen=True)
class WeighConfig:
    """Weights of hypotheses: P(c|R) exp(sharpness * alignment score).

    The hypothesis that the object is none of the stored ones has the score
    `unknown_score` and a probability within [least_unknown, most_unknown]; no hypothesis counts as
    less probable than `least_share`, since a retriever may be wrong.
    """

    sharpness: float = 40.0
    unknown_score: float = 0.7
    least_unknown: float = share(0.1)
    most_unknown: float = share(0.9)
    least_share: float = share(1e-3)


@dataclass(frozen=True)
class MeanConfig:
    """Prior mean functions of hypotheses, as logits.

    A placed shape is -(signed distance) / width, limited to +-limit; an alignment score under
    `sure` widens it by `doubt` metres for each unit. An object that none explains is completed on a
    grid of about `nodes` nodes by a network, which is evaluated at every node where the coarse ones
    around are not all `beyond_doubt`; its logit is `shell_logit` at least for `shell` metres behind
    what is seen of it, or `shell_nodes` of the grid's spacings where these are longer, and
    `shell_before` metres in front. Space is empty that lies more than `carve_depth` in front of the
    measured depth, or `carve_plane` below the plane, or less than `carve_behind` behind what is no
    object's and more than `carve_pixels` from the mask.
    """

    nodes: int = 200_000
    width: float = 0.0005
    sure: float = 0.9
    doubt: float = 0.01
    limit: float = 5.0
    beyond_doubt: float = 1.5
    shell: float = 0.004
    shell_nodes: float = 1.3
    shell_logit: float = 2.0
    shell_before: float = 0.001
    carve_depth: float = 0.006
    carve_plane: float = 0.004
    carve_behind: float = 0.01
    carve_pixels: int = 2


@dataclass(frozen=True)
class CompletionConfig:
    """The shape of an object that no stored one explains (brrp_cli/completion).

    cell : metres, of grids in which observed points are merged; closing : gaps of fewer cells are
    closed

    The rest belongs to the network's weights: it was trained with these numbers.
    least : metres; smaller extents are as noisy as depth is; most : shares of the seen points
        between which an object's size is taken: strays do not count
    neighbours : seen points whose spread gives a normal
    thickness : metres, standard deviation by which points in one plane, which have no hull, move
    radii : of discs by which local thickness is measured
    far, ratio : lengths, metres, and ratios beyond these tell nothing more; thin : metres, added
        to what a length is divided by that may be 0
    """

    cell: float = 0.004
    closing: int = 7
    least: float = 0.005
    most: tuple[float, float] = (0.02, 0.98)
    neighbours: int = 12
    thickness: float = 0.0005
    radii: int = 12
    far: float = 0.2
    ratio: float = 4.0
    thin: float = 0.002


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


@dataclass(frozen=True)
class HypothesesConfig:
    """What takes the place of the scale scan and of the fixed grid of hinge points."""

    search: SearchConfig = field(default_factory=SearchConfig)
    weigh: WeighConfig = field(default_factory=WeighConfig)
    mean: MeanConfig = field(default_factory=MeanConfig)
    completion: CompletionConfig = field(default_factory=CompletionConfig)
    map: FittedMapConfig = field(default_factory=FittedMapConfig)
    sensor: SensorConfig = field(default_factory=SensorConfig)


@dataclass(frozen=True)
class Config:
    """The whole method. `preset` names where the values came from.

    hypotheses : None is the paper's way, `registration` and `inference`, which mean nothing
    otherwise
    """

    preset: str = "default"
    k: int = 3
    features: FeatureConfig = field(default_factory=FeatureConfig)
    registration: RegistrationConfig = field(default_factory=RegistrationConfig)
    observation: ObservationConfig = field(default_factory=ObservationConfig)
    inference: InferenceConfig = field(default_factory=InferenceConfig)
    retrieval: RetrievalConfig = field(default_factory=RetrievalConfig)
    surface: SurfaceConfig = field(default_factory=SurfaceConfig)
    hypotheses: HypothesesConfig | None = field(default_factory=HypothesesConfig)

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON and HDF5."""
        return asdict(self)


PRESETS = {
    "default": Config(preset="default"),
    "paper": Config(
        preset="paper", surface=SurfaceConfig(level=0.5, one_piece=False), hypotheses=None
    ),
}


def preset(name: str) -> Config:
    """The configuration of that name."""
    if name not in PRESETS:
        raise BrrpError("No such preset", found=name, expected=", ".join(PRESETS))
    return PRESETS[name]


def _vprism_observation() -> ObservationConfig:
    return ObservationConfig(
        ray_bin=0.1, ray_radius=0.25, plane_radius=0.4, below_draws=1000, below_radius=0.25
    )


@dataclass(frozen=True)
class CoarseToFineConfig:
    """A grid is evaluated at every `step`-th node first, and at all nodes only where one of the
    corners around is likelier than `empty` to be occupied."""

    step: int = 3
    empty: float = share(0.02)


@dataclass(frozen=True)
class PointSDFConfig:
    """The PointSDF baseline: what is asked of a trained network.

    surface : its level is the paper's; observation : only what finds the support plane
    half_width : of the box around the middle of what was seen outside of which occupancy is 0
    largest_deviation : metres; no surface is less certain than this; difference_step : metres, of
    difference quotients across the surface
    """

    surface: SurfaceConfig = SurfaceConfig(level=0.3, one_piece=False)
    observation: ObservationConfig = field(default_factory=ObservationConfig)
    min_points: int = 16
    half_width: float = 0.2
    grid: CoarseToFineConfig = field(default_factory=CoarseToFineConfig)
    largest_deviation: float = 0.05
    difference_step: float = 0.001


@dataclass(frozen=True)
class VPrismConfig:
    """The V-PRISM baseline (Wright et al. 2024, arXiv 2403.08106), as its authors ran it.

    `gamma` is of the kernel exp(-gamma |x - h|^2), 1 / m^2. Two values are not theirs:
    `feature_floor`, under which a feature counts as 0, and `half_width` of the box around an
    object's centre outside of which its occupancy is 0.
    """

    observation: ObservationConfig = field(default_factory=_vprism_observation)
    surface: SurfaceConfig = SurfaceConfig(level=0.5, one_piece=False)
    hinge_spacing: float = 0.05
    hinge_radius: float = 0.15
    surface_hinges: int = 32
    gamma: float = 1000.0
    feature_floor: float = 1e-7
    prior_variance: float = 1e4
    iterations: int = 3
    max_update_points: int = 20_000
    half_width: float = 0.2
    grid: CoarseToFineConfig = field(default_factory=CoarseToFineConfig)
