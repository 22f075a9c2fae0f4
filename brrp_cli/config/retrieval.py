"""Numbers of retrieval by appearance (brrp_cli/retrieval). Lengths are metres."""

from __future__ import annotations

from dataclasses import dataclass, field

from brrp_cli.config.ranges import between, share
from brrp_cli.config.registration import SearchConfig
from brrp_cli.config.seen_mask import LITTLE_DEPTH, MaskPosesConfig, SilhouetteConfig


@dataclass(frozen=True)
class ObservedAppearanceConfig:
    """What a frame shows of one object.

    above_plane : what lies lower above the plane may be the plane's: masks from depth take some of
        it along; left : part of a mask's points that has to be left when those are taken away
    inner : part of a mask's pixels that has to be left without the outermost, whose colours are
        mixed
    height_quantile, width_share : of the points, of which stray ones do not count for the size
    normal_radius, normal_neighbours : of the points that a normal is fitted to
    in_front : what stands in front of a silhouette by more hides something; reach : pixels within
        which a silhouette is compared with others
    """

    above_plane: float = 0.004
    left: float = share(0.5)
    inner: float = share(0.4)
    height_quantile: float = share(0.995)
    width_share: float = share(0.986)
    normal_radius: float = 0.015
    normal_neighbours: int = 30
    in_front: float = 0.01
    reach: int = 2
    sparse: float = share(LITTLE_DEPTH)


@dataclass(frozen=True)
class IlluminantsConfig:
    """Lights that an image may have been taken in, as gains of its red, green and blue.

    darkest, brightest : gains, between which `brightness` of them are tried, evenly in logarithms
    warmth : red over blue; tint : green over the middle of red and blue
    brightness_spread, warmth_spread : how far they lie from 1 before they are seen, standard
        deviations of logarithms
    local_brightness_spread, local_warmth_spread : how much the light on one object differs from
        that on the scene: what faces the lamp, stands in a shadow or reflects a neighbour
    """

    darkest: float = 0.5
    brightest: float = 2.2
    brightness: int = 9
    warmth: tuple[float, ...] = (0.8, 0.9, 1.0, 1.11, 1.25)
    tint: tuple[float, ...] = (0.95, 1.0, 1.06)
    brightness_spread: float = 0.5
    warmth_spread: float = 0.3
    local_brightness_spread: float = 0.2
    local_warmth_spread: float = 0.08


@dataclass(frozen=True)
class SimilarityConfig:
    """How alike a seen object is to stored ones.

    neutral_colour, neutral_pairs : likeness where it cannot be judged, as in a frame without
        colours: about what an object that is rightly found has; plain_colour : that of a mesh
        without colours, less, since any colour might have been seen of it
    without_hue : likeness that is taken off where an image has no hue, and lightness alone is
        compared: many objects are as light. Set on made scenes in grey, between two values of about
        the same loss
    size_spread : height and both sides of the footprint differ by so much without meaning
        anything; size_share : and by that part of the stored one
    blur : share of each colour that counts to either of the neighbouring bins of a* and b*: a plain
        colour fills one bin, and the light tried may lie beside the true one
    least_pairs : likeness of point pairs that a lower one counts as: the normals of what is flat or
        thin are noise
    smaller : weight of being smaller than the stored object, against being larger: a footprint is
        seen from one side; size_limit : squared spreads beyond which nothing more speaks against
        it; size_most : what speaks against all three at most, since an object that leans on
        others, or lies on them, stands in no resting pose on the plane
    """

    neutral_colour: float = share(0.93)
    without_hue: float = share(0.08)
    plain_colour: float = share(0.9)
    neutral_pairs: float = share(0.97)
    blur: float = share(0.2)
    least_pairs: float = share(0.8)
    size_spread: tuple[float, float, float] = (0.006, 0.008, 0.008)
    size_share: float = 0.06
    smaller: tuple[float, float, float] = (1.0, 0.15, 0.15)
    size_limit: float = 16.0
    size_most: float = 6.0


@dataclass(frozen=True)
class AlignmentConfig:
    """Stored objects are laid over what is seen, which tells what colours and sizes cannot.

    tried : objects that are laid over what is seen in each of the first rounds, so many of those
        with colours and of those without, the most probable by their likenesses; margin : nats by
        which their likeness may be less than the best one's
    glanced : share of either, the most probable after a glance at all, in each of the rounds after
        those, and least : so many at least; blindly : the shares where depth shows too little for
        a glance to tell much (see `blind`); first : weight, in nats, of the score that they reach
        at a glance, or in the first few steps
    most : objects whose placements are refined, the best by likenesses and first score; where none
        of them is `certain`, so are the next `more`
    certain : nats that alignment, silhouette, point pairs and size may say against an object that
        is right for all that, and at_once : in the first round, before much was tried beside it;
        distinct : its share among those that were tried, at least. The rounds end with such a one,
        or where none of those left could become the most probable
    last : objects that are refined once more in the end, the best by likeness and score; the more
        points, the better shapes that are nearly alike are told apart
    least_points : of the object that have to be seen
    neutral : alignment score where nothing can be aligned: about what an object that is rightly
        found has; unaligned : that of objects that were not among those; lowest : a lower score
        counts as that one
    search : how they are placed (registration/quick_alignment.py); glance : how they are placed at
        a glance (registration/glance.py); finest : its `fine` steps in the end; silhouette : how
        their silhouettes are held against the mask
    blind : share of a mask's pixels that have depth, below which the mask tells too where objects
        may lie, as `by_mask` says (registration/mask_poses.py)
    """

    tried: tuple[int, ...] = (8, 16)
    glanced: tuple[float, ...] = (0.08, 0.1)
    blindly: tuple[float, ...] = (0.25, 0.3)
    least: int = 8
    certain: float = between(5.5, 0.0, 1000.0)
    at_once: float = between(4.0, 0.0, 1000.0)
    distinct: float = share(0.5)
    margin: float = 12.0
    first: float = 30.0
    most: int = 24
    more: int = 40
    last: int = 14
    least_points: int = 20
    neutral: float = 0.85
    unaligned: float = 0.3
    lowest: float = 0.3
    search: SearchConfig = field(
        default_factory=lambda: SearchConfig(
            turns=12,
            box_points=200,
            model_points=100,
            seen_points=100,
            first_share=2,
            begun=1_000,
            sifted=0.5,
            sifting_share=5,
            begun_steps=2,
            coarse=24,
            coarse_points=60,
            coarse_steps=10,
            beaten=0.25,
            fine=6,
            fine_points=250,
            fine_steps=6,
        )
    )
    glance: SearchConfig = field(
        default_factory=lambda: SearchConfig(
            turns=16,
            rotations=0,
            box_points=200,
            model_points=100,
            seen_points=100,
            first_share=2,
            begun=10_000,
            sifted=0.34,
            sifting_share=10,
            begun_steps=3,
            coarse=1,
        )
    )
    finest: SearchConfig = field(
        default_factory=lambda: SearchConfig(fine=2, fine_points=800, fine_steps=8)
    )
    silhouette: SilhouetteConfig = field(default_factory=SilhouetteConfig)
    blind: float = share(LITTLE_DEPTH)
    by_mask: MaskPosesConfig = field(default_factory=MaskPosesConfig)


@dataclass(frozen=True)
class FusionConfig:
    r"""Inverse temperatures of the likenesses and of the alignment score, and the offset of the log
    odds, which falls by `crowding` with the logarithm of the prior's size; at `points` observed
    points the alignment score counts half: see brrp_cli/retrieval/score_fusion.py. `alignment` is
    of how far an object stays behind the best one, `fit` of how far that one is above or below the
    `usual` score of a right one; where depth has waves of more than `wave` metres it counts less,
    since they lower the scores of all. `bare` and `spilled` are nats for a placement that leaves
    the whole mask bare, up to the share `most_bare`, or covers e - 1 times as much beside it;
    they, too, count less in waves, since the cameras that have them blur silhouettes. In priors of
    more than `few` objects all of it counts for more, by the power `sharper` of how many times
    `few` they are, up to `many`, beyond which nothing was fitted: a thousand that are a little
    alike would together outweigh the one that is it.

    Of least loss, as tools/fit_appearance.py counts it, on made scenes of YCB and household objects
    and of their variants, structured light and the other three sensors, masks given and from depth,
    and priors of 50 to 1,196 objects. docs/retrieval.md tells which.
    """

    colour: float = 35.0
    pairs: float = 12.7
    size: float = 0.3
    alignment: float = between(17.5, 0.0, 1000.0)
    offset: float = between(10.5, -100.0, 100.0)
    crowding: float = between(0.63, 0.0, 10.0)
    few: int = 270
    many: int = 1_200
    sharper: float = between(0.4, 0.0, 1.0)
    points: float = between(150.0, 1.0, 1e6)
    bare: float = between(41.0, 0.0, 1000.0)
    spilled: float = between(5.3, 0.0, 1000.0)
    most_bare: float = between(0.4, 0.0, 1000.0)
    fit: float = between(19.6, 0.0, 1000.0)
    usual: float = share(0.9)
    wave: float = between(0.0008, 1e-6, 1.0)


@dataclass(frozen=True)
class ShortlistConfig:
    """Which objects of a large prior are looked at closely.

    closely : so many of those with colours and of those without, and all of a prior of that size or
    less; roughly : so many are kept by colour and shape, of which `closely` are kept by size too;
    light_step : of every so many-th light
    """

    closely: int = 1_024
    roughly: int = 2_000
    light_step: int = 8


@dataclass(frozen=True)
class RetrievalConfig:
    """P(c|R) by appearance. likeness : by looks alone, which decides which objects are aligned
    first; steering : with what alignment finds, which decides how many more are; fusion : P(c|R).
    """

    observed: ObservedAppearanceConfig = field(default_factory=ObservedAppearanceConfig)
    illuminants: IlluminantsConfig = field(default_factory=IlluminantsConfig)
    similarity: SimilarityConfig = field(default_factory=SimilarityConfig)
    likeness: FusionConfig = field(
        default_factory=lambda: FusionConfig(
            colour=24.26,
            pairs=25.27,
            size=0.44,
            alignment=0.0,
            fit=0.0,
            offset=9.88,
            crowding=1.0,
            sharper=0.0,
        )
    )
    steering: FusionConfig = field(
        default_factory=lambda: FusionConfig(
            colour=40.0,
            pairs=9.0,
            size=0.15,
            alignment=45.0,
            offset=9.15,
            crowding=0.4,
            sharper=0.0,
            bare=16.0,
            spilled=5.0,
            fit=30.0,
        )
    )
    fusion: FusionConfig = field(default_factory=FusionConfig)
    alignment: AlignmentConfig = field(default_factory=AlignmentConfig)
    shortlist: ShortlistConfig = field(default_factory=ShortlistConfig)
