"""What became of the stored objects that were laid over one seen object."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brrp_cli.config.retrieval import RetrievalConfig
from brrp_cli.retrieval.aligned import SeenPart
from brrp_cli.retrieval.score_fusion import against_silhouettes

Rows = NDArray[np.int64]


class PlacedObjects:
    """Stored objects (m,), and how well those that were placed agree with what is seen.

    alignment : (m,) scores; bare, spilled : (m,) shares of the mask (registration/silhouette.py);
    agreed : (m,) alignment scores less what the silhouettes say against them; wave : metres, by
    which depth errs over patches
    """

    def __init__(
        self, seen: SeenPart, names: Sequence[str], wave: float, config: RetrievalConfig
    ) -> None:
        self._seen = seen
        self._names = names
        self._wave = wave
        self._config = config
        self.alignment = np.full(len(names), config.alignment.unaligned, np.float32)
        self.agreed = self.alignment.copy()
        self.bare, self.spilled = np.zeros((2, len(names)), np.float32)

    def tried(self, rows: Rows) -> NDArray[np.float64]:
        """Scores (r,) of some of them after the first few steps. Errors: PriorError."""
        return self._seen.first_scores(self._of(rows))

    def refine(self, rows: Rows) -> None:
        """Place some that were tried."""
        self._judge(rows, self._seen.scores(self._of(rows)))

    def finish(self, rows: Rows) -> None:
        """Place some once more that were refined."""
        finest = self._config.alignment.finest
        self._judge(rows, self._seen.last_scores(self._of(rows), finest, self._against))

    def _judge(self, rows: Rows, scores: NDArray[np.float64]) -> None:
        lowest = self._config.alignment.lowest
        bare, spilled = self._seen.silhouettes(self._of(rows))
        self.alignment[rows] = np.maximum(scores, lowest)
        self.agreed[rows] = np.maximum(scores - self._against(bare, spilled), lowest)
        self.bare[rows], self.spilled[rows] = bare, spilled

    def _against(
        self, bare: NDArray[np.floating], spilled: NDArray[np.floating]
    ) -> NDArray[np.float64]:
        """What silhouettes say against placements, in alignment scores, as far as these count."""
        fusion = self._config.fusion
        against = against_silhouettes(bare, spilled, self._wave, fusion)
        return np.asarray(against / max(fusion.alignment, 1.0))

    def _of(self, rows: Rows) -> list[str]:
        return [self._names[row] for row in rows]
