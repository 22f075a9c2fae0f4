"""How a placed object is turned about itself: by depth, and by what is printed on it. Lengths are
metres."""

from __future__ import annotations

from dataclasses import dataclass, field

from brrp_cli.config.ranges import between, share


@dataclass(frozen=True)
class MainAxesConfig:
    """The principal axes of a stored object, about which it is turned beside those of its box.

    alike : lengths of axes whose ratio is less: about none of them is a turn by itself
    askew : radians, an axis that is turned from the box's by less is the box's
    """

    alike: float = 1.05
    askew: float = 0.05


@dataclass(frozen=True)
class ColourConfig:
    """Which of the placements that depth cannot tell apart has the colours of the image.

    The best placement is turned about each axis of its box and of its own (`main_axes`) in `turns`
    steps, both ways up; the best are placed again, first those that are turned by `apart` radians
    from all better ones. Of those whose alignment score is within `alike` of its own the one with
    the best sum of alignment score and `worth` times the correlation of what is printed is taken,
    if that gains `gain`: a box that one buys is not quite the one that was scanned. It counts in
    full from a standard deviation of `printed` (of 255) on, and not at all under `unprinted`.
    Colours are means over cells of `cell` metres, of at most `vertices` vertices, of which
    `least_seen` have to be within `near` metres of the measured depth. Their logarithms are
    compared, of 255; what is under `dark` is noise for the most part. asked : whether any of this
    is done
    """

    asked: bool = True
    turns: int = 24
    apart: float = 0.5
    alike: float = 0.07
    worth: float = 0.8
    gain: float = 0.05
    printed: float = 20.0
    unprinted: float = 5.0
    dark: float = 16.0
    cell: float = 0.012
    vertices: int = 4000
    least_seen: int = 40
    near: float = 0.01
    main_axes: MainAxesConfig = field(default_factory=MainAxesConfig)


@dataclass(frozen=True)
class TurnConfig:
    """Placements of an object that looks almost alike when it is turned (registration/turned.py).

    Tried are `turns` turns about each axis of its box and of its own (`main_axes`), both ways up,
    and `any_turns` of any kind, each followed by `onto_itself_steps` steps that bring
    `surface_points` of its surface onto itself from `onto_itself` metres, under which their mean
    distance from it is less than `itself`, metres; of those within `same_turn` radians and
    `same_shift` metres of another one is enough. The `count` best of them by `coarse_points`
    observed points, first those that are `apart` radians from all better ones, are refined, and the
    best `judged` held against `points` observed ones, without those whose mean distance on the
    coarse field is longer than the best one's by `worse` metres; distances beyond `far` metres
    count as that. Mean distances are known to `exact` metres, however many points there are. One
    takes the place of the first if it is better by `gain` standard errors. Those
    that are worse by no more than `undecided` standard errors, in alignment score by no more than
    `alike`, and in the likelihood of the frame by no more than `nats`, are as probable; of those
    that are worse by `refined_nats` more at most, the best `refined` are refined first, as the
    first one was. The most probable of all takes the place of the first; in a later frame of a
    stream only if it is more probable by `steady` nats: otherwise the earlier pose holds.
    """

    turns: int = 36
    any_turns: int = 200
    surface_points: int = 150
    onto_itself: float = 0.01
    onto_itself_steps: int = 4
    same_turn: float = 0.08
    same_shift: float = 0.002
    itself: float = 0.003
    count: int = 16
    judged: int = 8
    worse: float = 0.0005
    apart: float = 0.25
    coarse_points: int = 300
    points: int = 2000
    far: float = 0.005
    exact: float = 0.00001
    gain: float = 2.0
    undecided: float = 3.0
    nats: float = 2.0
    refined_nats: float = 6.0
    refined: int = 3
    steady: float = between(2.0, 0.0, 1000.0)
    alike: float = 0.1
    main_axes: MainAxesConfig = field(default_factory=MainAxesConfig)


@dataclass(frozen=True)
class PrintConfig:
    """How a placed object is turned as its print lies in the image (registration/by_print.py).

    Colours are means over cells of `cell` metres, of at most `vertices` vertices, of which a share
    `independent` counts as votes, with a correlation of `most_alike` at most. A direction is open
    where depth leaves a standard deviation of `open` metres on the surface or more; `turn` and
    `shift`, radians and metres, are the deviations before anything was seen. Steps along them
    begin with `first_step` metres and end under `last_step`. Of the turns that bring the object
    onto itself (`TurnConfig`) those `tried` are looked at of which the print says most, `behind`
    nats less than of the first at most, first those that are `apart` radians from all better ones;
    of those that gain `least` nats by what is printed one is taken that gains `gain` nats by all.
    asked : whether any of this is done
    """

    asked: bool = True
    cell: float = 0.005
    vertices: int = 4000
    independent: float = share(0.12)
    most_alike: float = share(0.999)
    open: float = 0.0005
    turn: float = 0.3
    shift: float = 0.003
    first_step: float = 0.004
    last_step: float = 0.0002
    tried: int = between(3, 0, 1000)
    apart: float = 0.4
    behind: float = between(3.0, 0.0, 1000.0)
    least: float = between(0.5, 0.0, 1000.0)
    gain: float = between(1.0, 0.0, 1000.0)
