"""How scenes are exported and put to rest. Lengths are metres, angles degrees, times seconds."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PartsConfig:
    """Convex parts of an object (brrp_cli/planning/parts.py).

    concavity : hollows shallower than this are filled, which is what CoACD calls concavity
    iterations : of CoACD's Monte Carlo tree search; its own 150 take twice as long for the same
    number of parts
    """

    concavity: float = 0.01
    iterations: int = 60


@dataclass(frozen=True)
class TableBoxConfig:
    """The box that is made of the support plane.

    margin : by which it goes beyond all that stands on it; thickness : of it
    """

    margin: float = 0.25
    thickness: float = 0.02


@dataclass(frozen=True)
class RestConfig:
    """Simulated contacts, and the steps that bring a scene to rest (brrp_cli/planning/rest.py).

    Contacts, also of the files for simulators
    friction : Coulomb's coefficient between two surfaces, a guess
    torsion, rolling : metres, friction against turning on the spot and against rolling; without
    it a can on its side rolls on the faces of its mesh for ever
    clearance : between the table and what is put on it where nothing is put to rest
    contact_time : seconds in which MuJoCo's contacts push out what is inside; with its own 0.02 a
    plate sinks by 5 mm

    Steps, each so many seconds long
    apart : overlaps push apart, without weight, turning or friction; drop : down to what carries
    it, without turning, at most, until nothing is faster than `lands`, metres per second, at one
    of every `look` steps; lean : with turning; free : without damping; left_alone : the check
    apart_time : `contact_time` of `apart`, longer than `slow`, so that nothing is thrown
    slow : of `apart` and `drop`, gentle : of `lean`: a body loses its speed in this time

    Feet
    feet : an object that leaves its place gets what lies less than this above its lowest point
    drawn down to it, one after the other until it stays; leaves, leaves_angle : by more than this
    in `lean` and `free`; stays, stays_angle : less than this in `left_alone`
    plate : radius of the disc under the centre of mass that an object gets at last, with what
    lies within the highest of `feet`; plate_thickness : of it
    """

    friction: float = 1.0
    torsion: float = 0.005
    rolling: float = 0.001
    clearance: float = 0.0005
    contact_time: float = 0.005
    apart: float = 0.6
    apart_time: float = 0.02
    drop: float = 5.0
    lands: float = 0.001
    look: int = 50
    lean: float = 1.0
    free: float = 1.0
    left_alone: float = 3.0
    slow: float = 0.01
    gentle: float = 0.1
    feet: tuple[float, ...] = (0.001, 0.003, 0.01)
    leaves: float = 0.005
    leaves_angle: float = 3.0
    stays: float = 0.002
    stays_angle: float = 2.0
    plate: float = 0.01
    plate_thickness: float = 0.002
