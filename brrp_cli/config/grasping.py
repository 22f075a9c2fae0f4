"""Candidates for grasps, and what they are scored by. Lengths are metres, angles degrees."""

from __future__ import annotations

from dataclasses import dataclass, field

from brrp_cli.config.ranges import between, share
from brrp_cli.physics import DENSITY


@dataclass(frozen=True)
class SurroundingsConfig:
    """Observed points of no object that a hand keeps out of, such as those of a bin's walls.

    rises : what is lower over the table is the table; reach : of what is farther from all objects a
    hand cannot get to; beside : what is nearer to an object may be depth that bled from it; cell :
    of the grid that they are thinned on
    arms : whether a hand keeps out of what reaches in through the air as well, which is an arm that
    moves, the robot's own as often as not
    angle : tangent between cells of the image in which they hide what is behind; behind : metres
    along z from them to there; across, along : points of a part of a hand from side to side, and
    along its fingers, that are held against that
    """

    rises: float = 0.02
    reach: float = 0.25
    beside: float = 0.02
    cell: float = 0.008
    arms: bool = False
    angle: float = 0.015
    behind: float = 0.02
    across: int = between(3, 2, 100)
    along: int = between(10, 2, 100)


@dataclass(frozen=True)
class GraspConfig:
    """Grasps of a parallel-jaw hand.

    Candidates
    points : on each surface from which the opposite one is looked for; about a share
    `sampled_share` of them on `sampled` surfaces of the posterior, the rest on the mesh
    thinnest : pairs that are closer are none
    pairs : of antipodal points that are kept of an object; angles : approaches around the axis of
    each pair; reaches : how far the fingertips reach beyond the pair, one after the other
    steepest : an approach that goes up from the table by more than this angle is left out;
    top_down, cone : largest angle between an approach and straight down where one of these is asked
    for
    candidates : poses of an object that are scored at most

    The hand
    clearance : the hand comes in open so much further than the pair is apart, on each side, where
    its opening allows it
    approach : straight way in, from the pre-grasp
    table_gap : least height over the table, some standard deviations of where the hand gets to;
    inset : by which the boxes of the hand are smaller
    where they are held against neighbours, which were measured with noise; grazes : by which they
    are where they are held against the object itself, which they push aside by so much

    Score
    draws : of the object's surface from its posterior, and of where the hand gets to; as many as
    `surfaces` of them are level sets, which are taken in turn
    accuracy : standard deviation of the hand's place along each axis; accuracy_angle : of its
    orientation about each axis
    nodes : of the grid of a drawn surface, whose spacing lies between `finest` and `coarsest`;
    around : the grid goes so far beyond the mesh
    pad_rows, pad_columns : rays from each finger along and across it, which find what it meets
    yields : what lies so far behind the first contact of a finger still touches it
    confidence : collision shapes of neighbours hold them with this probability; 0: their meshes
    neighbour_nodes : of the grid on which those of recognised objects are found; one of
    `SurfaceConfig.around_nodes` takes six times as long and lies 0.03 mm further out on average;
    neighbour_vertices : in place of `SurfaceConfig.alike_vertices`
    loose : observed points of objects without a mesh, and of the `surroundings`, that the hand
    keeps out of, at most
    friction : Coulomb's coefficient between fingers and object; askew : how probably a contact
    holds that a finger meets edge on, as far outside of the friction cone as can be
    density, lightest : kg / m3 of the mesh's volume, and kg: what an object is taken to weigh;
    torque : newton metres of its weight about the closing axis, over which the probability that
    friction holds it falls to a third
    lever : distance of the closing axis from the object's centre over which a grasp's quality falls
    to a third; taste : power of the quality beside the score in what grasps are ranked by
    apart, apart_angle : of two grasps with the same object one is left out that is nearer
    """

    points: int = 400
    sampled_share: float = share(0.5)
    sampled: int = 4
    pairs: int = 64
    angles: int = 12
    reaches: tuple[float, ...] = (0.03, 0.015)
    least_reach: float = 0.003
    steepest: float = between(10.0, 0.0, 90.0)
    top_down: float = between(15.0, 0.0, 90.0)
    cone: float = between(45.0, 0.0, 90.0)
    thinnest: float = 0.001
    candidates: int = 250
    clearance: float = 0.015
    approach: float = 0.1
    table_gap: float = 0.003
    inset: float = 0.0005
    grazes: float = 0.0025
    draws: int = 24
    surfaces: int = 12
    accuracy: float = 0.001
    accuracy_angle: float = between(0.5, 0.0, 90.0)
    nodes: int = 25_000
    finest: float = 0.002
    coarsest: float = 0.006
    around: float = 0.03
    pad_rows: int = 5
    pad_columns: int = 3
    yields: float = 0.005
    confidence: float = share(0.9)
    neighbour_nodes: int = 150_000
    neighbour_vertices: int = 2_000
    loose: int = 2_000
    surroundings: SurroundingsConfig = field(default_factory=SurroundingsConfig)
    friction: float = 0.5
    askew: float = share(0.5)
    density: float = DENSITY
    lightest: float = 0.1
    torque: float = 0.6
    lever: float = 0.05
    taste: float = 0.1
    apart: float = 0.01
    apart_angle: float = between(20.0, 0.0, 180.0)
