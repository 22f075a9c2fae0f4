"""From a posterior to a mesh. Lengths are metres."""

from __future__ import annotations

from dataclasses import dataclass

from brrp_cli.config.ranges import share


@dataclass(frozen=True)
class SurfaceConfig:
    """The surface where the mean occupancy is `level`.

    A stored mesh is moved along its normals by at most `farthest` metres, and inwards or outwards
    by no more than a share `wall_share` of the wall's thickness; the level set is looked for at
    `steps` places of that way. Where more than a share `most_off` of its vertices would have to be
    moved further, and where no stored object explains what is seen, the surface comes from marching
    cubes on a grid of about `nodes` nodes, whose spacing in metres lies between `finest` and
    `spacing`.
    most_apart : metres; how far another hypothesis' surface counts as apart, for the uncertainty
    guessed : of the uncertainty of what is no stored object's, metres for a metre from the nearest
    observed point
    around_nodes : of the grid on which the confidence surface around a stored mesh is found, whose
    spacing is `around_finest` metres at least
    around_seen : metres by which the region that holds what is no stored object's goes beyond what
    was observed, and beyond what the posterior asks for; there `around_guessed` metres more for
    each metre that this lies from the nearest observed point, `around_most` in all at most
    fidelity : metres, standard deviation of a stored mesh from its object; pose_share : of what the
    covariance of its pose says, that counts; band_draws : of the pose, from which the width of the
    band around it follows, looked at in `band_vertices` vertices
    Placements that are as probable as the best one are turned by steps of `turn_step` radians:
    between neighbours that are turned by `neighbours` radians at most, and all around an axis that
    `free_turns` of them share to within `one_axis` radians, where any two are such neighbours; how
    far each reaches is looked at in `alike_vertices` vertices at most
    keep_distance : metres; a component of the level set further from every observed point is
    hallucinated
    one_piece : whether an object is one piece; the published methods keep every part near what was
    seen, cavities included
    seen_share : of the observed points that a part near them must own to be joined to the largest,
    a tenth of it where the part has a share `volume_share` of the largest's volume; route_radius :
    metres, of what joins them, which is two nodes thick at least; route_step : what a step from
    node to node costs a route at least, as a negative log probability: routes are short where all
    ways are as probable; route_least : no way is less probable than this share of the level;
    route_margin : nodes around the parts that a route may take; route_nodes : of the largest grid
    that is searched at once, larger ones coarsely first
    """

    level: float = share(0.5)
    spacing: float = 0.005
    finest: float = 0.002
    nodes: int = 300_000
    keep_distance: float = 0.01
    one_piece: bool = True
    seen_share: float = share(0.012)
    volume_share: float = share(0.1)
    route_radius: float = 0.003
    route_step: float = 0.1
    route_least: float = share(1e-4)
    route_margin: int = 8
    route_nodes: int = 10_000
    farthest: float = 0.004
    wall_share: float = share(0.4)
    steps: int = 17
    most_apart: float = 0.05
    guessed: float = share(0.2)
    fidelity: float = 0.00038
    pose_share: float = share(0.9)
    band_draws: int = 4_000
    band_vertices: int = 300
    around_nodes: int = 1_000_000
    around_finest: float = 0.001
    around_seen: float = 0.01
    around_guessed: float = 1.0
    around_most: float = 0.05
    free_turns: int = 3
    neighbours: float = 1.0
    turn_step: float = 0.25
    alike_vertices: int = 1_000_000
    one_axis: float = 0.25
    most_off: float = share(0.05)
