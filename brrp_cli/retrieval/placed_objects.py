"""What became of the stored objects that were laid over one seen object."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.retrieval import AlignmentConfig
from brrp_cli.retrieval.aligned import Against, SeenPart

Rows = NDArray[np.int64]


class PlacedObjects:
    """Stored objects (m,), and how well those that were placed agree with what is seen.

    alignment : (m,) scores; bare, spilled : (m,) shares of the mask (registration/silhouette.py);
    agreed : (m,) alignment scores less what the silhouettes say against them, as `against` has it
    """

    def __init__(
        self, seen: SeenPart, names: Sequence[str], against: Against, config: AlignmentConfig
    ) -> None:
        self._seen = seen
        self._names = names
        self._against = against
        self._lowest = config.lowest
        self.alignment = np.full(len(names), config.unaligned, np.float32)
        self.agreed = self.alignment.copy()
        self.bare, self.spilled = np.zeros((2, len(names)), np.float32)

    @property
    def blind(self) -> bool:
        """Whether depth shows too little of the object to tell alone how others lie over it."""
        return self._seen.blind

    def glances(self, rows: Rows) -> NDArray[np.float64]:
        """Scores (r,) of some of them at a glance. Errors: PriorError."""
        return self._seen.glances(self._of(rows))

    def tried(self, rows: Rows) -> NDArray[np.float64]:
        """Scores (r,) of some of them after the first few steps. Errors: PriorError."""
        return self._seen.first_scores(self._of(rows))

    def refine(self, rows: Rows) -> None:
        """Place some that were tried."""
        self._judge(rows, self._seen.scores(self._of(rows)))

    def finish(self, rows: Rows) -> None:
        """Place some once more that were refined."""
        self._judge(rows, self._seen.last_scores(self._of(rows)))

    def _judge(self, rows: Rows, scores: NDArray[np.float64]) -> None:
        bare, spilled = self._seen.silhouettes(self._of(rows))
        self.alignment[rows] = np.maximum(scores, self._lowest)
        self.agreed[rows] = np.maximum(scores - self._against(bare, spilled), self._lowest)
        self.bare[rows], self.spilled[rows] = bare, spilled

    def _of(self, rows: Rows) -> list[str]:
        return [self._names[row] for row in rows]
