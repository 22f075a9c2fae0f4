"""Numbers of masks that are mended by what is recognised (brrp_cli/mending). Lengths are metres."""

from __future__ import annotations

from dataclasses import dataclass, field

from brrp_cli.config.ranges import between, share
from brrp_cli.config.registration import TrialConfig


@dataclass(frozen=True)
class MendConfig:
    """Masks mended by recognised objects.

    rounds : times that masks are mended and changed objects are reconstructed again; 0 = never
    least_weight : of a recognised object that may change masks; own : part of its own mask that it
        explains at least
    noise, noise_growth : standard deviation of depth, noise + noise_growth * depth^2 metres; within
        `sigmas` of it, and of `pose` metres by which a right placement may be off, rendered depth
        explains measured depth; beyond `sure` times that a pixel is something else's
    claimed : explained part of a mask that is taken over
    silhouette : pixels beside the rendered silhouette that may still be the object's
    opening : half the width, pixels, of what is too thin to be a group
    least_pixels, least_part : pixels of a group that is given back, and their part of the mask
    table : metres; a group no higher is background
    """

    rounds: int = between(1, 0, 2)
    least_weight: float = share(0.8)
    own: float = share(0.5)
    noise: float = 0.002
    noise_growth: float = 0.003
    sigmas: float = 3.0
    pose: float = 0.002
    sure: float = 1.5
    claimed: float = share(0.7)
    silhouette: int = between(4, 0, 64)
    opening: int = between(3, 1, 64)
    least_pixels: int = 200
    least_part: float = share(0.05)
    table: float = 0.012


@dataclass(frozen=True)
class RegroupConfig:
    """Masks regrouped: of what was not recognised, neighbours are tried as one object, parts as
    objects of their own, and so is what was left out.

    rounds : times that this is done at most, of what the last one changed; 0 = never
    most : tries in a round at most
    least_weight : of a stored object in a mask that is not regrouped, and of all of them together
        in one that is not cut
    sure : of a stored object in a part of a mask, to be taken, and in a union with a mask in which
        one is recognised; whole : in another union of masks, or in one that was left out, and in
        any from which a mask is grown; half : in each of two parts that make up `both` of a mask
    explained : part of a tried mask that the object explains as it was placed, at least, and of
        each mask of a union with one in which an object is recognised; within : part of what it
        explains of all masks that lies in that one
    grown : masks made of what an object explains that are tried in a round at most; closing :
        pixels, half the width of gaps in them that are closed; least_share : of such a mask, that
        it takes from another one at least
    reach, gap : pixels and metres in depth within which masks are neighbours; apart, alike : pixels
        and L*a*b* within which masks of the same colours may be pieces of one thing
    least_pixels : with depth, of a mask that is tried; least_cut : of one that is cut
    colours : numbers of groups of pixels that are alike in colour and place; places : what a pixel
        of distance counts against a unit of L*a*b*, of each of these groupings; lightness : of a
        unit of L*; blur : pixels, deviation; samples : pixels from which groups are found; differs
        : L*a*b*, of a group from the rest of its mask, at least
    same : a part that differs by less than that share from another one is not tried again
    trial : how a stored object is looked for in it
    """

    rounds: int = between(3, 0, 10)
    most: int = between(60, 0, 10_000)
    least_weight: float = share(0.8)
    sure: float = share(0.95)
    whole: float = share(0.8)
    half: float = share(0.5)
    both: float = share(0.85)
    explained: float = share(0.6)
    within: float = share(0.5)
    grown: int = between(8, 0, 1000)
    closing: int = between(2, 1, 64)
    least_share: float = share(0.02)
    reach: int = between(3, 1, 64)
    gap: float = 0.1
    apart: int = between(40, 0, 1000)
    alike: float = 15.0
    least_pixels: int = 300
    least_cut: int = 1000
    colours: tuple[int, ...] = (2, 4)
    places: tuple[float, ...] = (0.32,)
    lightness: float = 0.5
    blur: float = 1.5
    samples: int = between(2000, 10, 1_000_000)
    differs: float = 10.0
    same: float = share(0.1)
    trial: TrialConfig = field(default_factory=TrialConfig)
