"""Fitted kin: stored shapes, stretched, for objects that the prior does not hold. Lengths are
metres."""

from __future__ import annotations

from dataclasses import dataclass

from brrp_cli.config.ranges import share


@dataclass(frozen=True)
class KinConfig:
    """Stored shapes with a scale of their own on each axis, stretched onto what was seen of an
    object that may be none of the stored ones (brrp_cli/kin).

    enabled : whether it is done; least_unknown : weight of "none of the stored objects" from which
    on it is done
    usual : metres, diagonal of what was seen up to which the lengths of fits hold as they stand
        below; they grow with larger objects (kin/lengths.py)

    The shapes: of `objects` objects at most, evenly over the prior's names, in their `poses` most
    probable resting poses with a probability of `least_pose` or more. Coarse distances are kept at
    `nodes` nodes along each axis of the box, which they reach over by the factor `reach`;
    `surface_points` of the surface stand for it. Its footprint's smallest rectangle is looked for
    in `box_turns` steps of a quarter turn. Its share of hollow space is that of points halfway
    between two of the surface which lie further outside than `hollow_clear`, over half its longest
    side.
    What was seen: points in cells of `dense_cell` metres that hold a share `least_dense` of what
    the cell of a median point holds; `seen_points` of them at most, merged in cells of `cell`
    metres, and `free_points` of free space, from `free_gap` metres in front of the measured depth
    on, a share `free_beside` of them in a ring of pixels about the silhouette, from the first of
    `ring` to the second. Nearer to it a pixel may be anyone's. A share `at_edge` of those lies as
    deep as the silhouette's next pixel, with a standard deviation of `edge` times the size. The
    surface stands in free space where all pixels within `blur` pixels say so.
    First tries: every pose in `turns` turns. Sizes follow from the extents of what was seen,
    between the shares `most` of the points, `least_half` at least; sizes whose mean logarithm is
    beyond `most_size`, or of which one is off the mean by more than `most_stretch`, are left out.
    They are held against `coarse_seen` observed and `coarse_free` free points: a Gaussian of
    `coarse_near` metres, less `coarse_far_weight` times the distances, which end at `coarse_far`
    times that, and `coarse_pull` times the prior. The best `starts` of them, at first `starts_each`
    of one object at most, take `steps` Gauss-Newton steps with `step_seen` and `step_free` points,
    of which they are judged by too: the best `middle` after `first_steps` of them go on. Steps are
    damped by a share `damping`, of at most `step_turn` radians, `step_shift` metres, `step_size` of
    a logarithm and `step_taper`; the taper, 1 of a cone to its tip, stays under `most_taper`.
    `sigma`, `free_sigma` : metres, standard deviations of the distances of seen points and of free
    ones inside of the shape, which count `free_pull` times; `robust` : metres, from which on points
    pull less (Geman and McClure); `pull` : weight of the prior, by which logarithms of sizes have
    the standard deviation `size_deviation`, their differences `stretch_deviation`, the taper
    `taper_deviation`, and the underside `lift_deviation` metres about the plane.
    Scores: `near` : metres, with the sensor's noise the standard deviation of the Gaussian of
    observed points' distances; `far` : one further away counts as this far; `violation_weight` : of
    the share of the surface that stands in free space or below the plane, from `tolerance` metres
    on and fully from `tolerance + slope`; `free_weight` : of free points within; `lost_weight` : of
    observed points further than `lost` metres away. All points move the best `kept` fits once more.
    Bends (kin/bend.py, kin/bending.py): the hypotheses take `bend_steps` damped steps (a share
    `bend_damping` at first), over a cubic bend too, with `bend_points` points of their surface. A
    seen point pulls at the nearest of those that face the camera, along its normal, or straight
    where it lies beyond its edge by `bend_beyond` metres. The surface is pushed out of free space,
    beyond `tolerance`, with `out_pull` in place of `free_pull`; ways aside are tried in
    `aside_directions`, in `aside_steps` lengths between those of `aside`, metres. Coefficients have
    standard deviations, in halves of the box: `bend_round` where what is round stays round,
    `bend_even` where two sides that are alike stay alike, `bend_any` of all others; `bend_lean` :
    radians; `bend_steepest` : of the bend's slopes, so that space does not fold. One of which a
    share over the first of `most_through` still stands `through` metres before what was measured is
    left out; of a hollow shape that the camera looks into and that costs no more than the second of
    `most_cost`, over the second where the camera mixes depths (`mixed_edges`): it misses rims.
    Hypotheses: of the best `kept` fits the best `hypotheses` that lie `distinct` metres apart, at
    every `distinct_step`-th point. Their weight is a logistic function of the best score, a half at
    `convincing`, with the slope `sharpness`. Of a hollow shape, whose share of hollow space reaches
    from the first to the second of `hollow`, it is a half at a score up to `hollow_bonus` lower; up
    to `opening_bonus` lower where the camera looks into the object: where a share `opening_share`
    of what was seen reaches from the first to the second of `opening`, over its longest extent,
    behind the near side of its convex hull. A solid shape weighs `solid_most` at most: of solids
    the completion is as good, and their mean is better than either. Once bent, they keep that
    weight where the best one costs little, half of it at `most_cost` (of a solid, of a hollow
    shape, and of one that the camera looks into), with the slope `cost_sharpness` over the cost's
    logarithm, and share it by `sharpness` times their costs. All weigh less where fewer than
    `many_seen` cells were seen, nothing below `least_seen`; what weighs less than `least_share` is
    left out.
    The logit is the distance over `width` metres,
    which grows by `doubt` for each unit that the mean Gaussian falls short of `sure`, and of hollow
    shapes is exact to `exact` metres; distances are kept on `field_nodes` nodes up to `margin`
    metres around.
    """

    enabled: bool = True
    least_unknown: float = share(0.05)
    objects: int = 400
    usual: float = 0.15
    poses: int = 4
    least_pose: float = share(0.04)
    nodes: int = 16
    reach: float = 1.3
    surface_points: int = 400
    dense_cell: float = 0.008
    least_dense: float = share(0.2)
    cell: float = 0.004
    seen_points: int = 400
    free_points: int = 1200
    free_gap: float = 0.008
    free_beside: float = share(0.6)
    ring: tuple[int, int] = (3, 14)
    at_edge: float = share(0.7)
    edge: float = 0.05
    blur: int = 2
    turns: int = 8
    box_turns: int = 90
    most: tuple[float, float] = (0.01, 0.99)
    least_half: float = 0.002
    most_size: float = 1.2
    most_stretch: float = 0.9
    coarse_seen: int = 80
    coarse_free: int = 60
    coarse_near: float = 0.006
    coarse_far: float = 4.0
    coarse_far_weight: float = 0.5
    coarse_pull: float = share(0.25)
    starts: int = 48
    starts_each: int = 3
    steps: int = 8
    first_steps: int = 4
    middle: int = 20
    step_seen: int = 160
    step_free: int = 240
    damping: float = 0.02
    step_turn: float = 0.35
    step_shift: float = 0.03
    step_size: float = 0.3
    step_taper: float = 0.15
    most_taper: float = share(0.6)
    sigma: float = 0.003
    robust: float = 0.009
    free_sigma: float = 0.003
    free_pull: float = 5.0
    pull: float = 0.03
    size_deviation: float = 0.35
    stretch_deviation: float = 0.25
    taper_deviation: float = 0.15
    lift_deviation: float = 0.004
    bend_steps: int = 10
    bend_points: int = 1500
    bend_damping: float = 0.02
    bend_beyond: float = 0.006
    bend_round: float = 0.2
    bend_even: float = 0.08
    bend_any: float = 0.03
    bend_lean: float = 0.1
    bend_steepest: float = share(0.6)
    through: float = 0.01
    most_through: tuple[float, float] = (0.05, 0.1)
    out_pull: float = 5.0
    aside: tuple[float, float] = (0.001, 0.06)
    aside_steps: int = 14
    aside_directions: int = 16
    near: float = 0.002
    far: float = 0.015
    violation_weight: float = 3.0
    tolerance: float = 0.004
    slope: float = 0.008
    free_weight: float = 1.0
    lost: float = 0.008
    lost_weight: float = 1.0
    kept: int = 8
    hypotheses: int = 3
    distinct: float = 0.0015
    distinct_step: int = 4
    convincing: float = 0.42
    sharpness: float = 16.0
    hollow_clear: float = 0.03
    hollow: tuple[float, float] = (0.5, 0.58)
    hollow_bonus: float = 0.05
    opening_share: float = share(0.9)
    opening: tuple[float, float] = (0.15, 0.19)
    opening_bonus: float = 0.7
    solid_most: float = share(0.45)
    most_cost: tuple[float, float, float] = (0.2, 0.45, 2.0)
    cost_sharpness: float = 8.0
    many_seen: int = 250
    least_seen: int = 40
    least_share: float = share(0.15)
    width: float = 0.001
    doubt: float = 0.015
    sure: float = share(0.95)
    exact: float = 0.002
    margin: float = 0.015
    field_nodes: int = 24_000
