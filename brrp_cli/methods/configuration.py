"""What every method's configuration has."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, ClassVar, Protocol

from brrp_cli.config import SurfaceConfig


class MethodConfig(Protocol):
    """A frozen dataclass of plain values and of such dataclasses. `surface` is how meshes are
    made; its level is also the occupancy at which `brrp eval` measures shapes."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def surface(self) -> SurfaceConfig:
        """Grid and level of the surface."""


def as_record(config: MethodConfig) -> dict[str, Any]:
    """Plain values, for JSON."""
    return asdict(config)
