"""What a user decides about collision shapes."""

from __future__ import annotations

from dataclasses import dataclass

from brrp_cli.physics import DENSITY
from brrp_cli.planning.parts import COACD


@dataclass(frozen=True)
class PlanOptions:
    """collision : "coacd" or "hull"; confidence : that the object lies inside of its collision
    shape, None: the shape is of the mesh; margin : metres by which the shape is grown beyond that
    into space that was not seen to be empty; density : kg / m^3, of the solid mesh; moveit : id of
    the frame of MoveIt's planning scene, "" for that of the results, None: none is written;
    rest : whether objects are put where they rest, which those with a `confidence` never are."""

    collision: str = COACD
    confidence: float | None = None
    margin: float = 0.0
    density: float = DENSITY
    seed: int = 0
    moveit: str | None = None
    rest: bool = True

    @property
    def rests(self) -> bool:
        """Shapes that hold an object with some probability hold it where it was measured."""
        return self.rest and self.confidence is None
