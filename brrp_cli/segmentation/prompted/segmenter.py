"""MobileSAM (Zhang et al. 2023) as ONNX: what fills a box.

The encoder takes RGB 0 to 255 (H, W, 3) whose longer side is 1024, and normalises and pads itself.
The decoder has the interface of Segment Anything's own export: a box is two points with the labels
2 and 3, in pixels of the resized image.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brrp_cli.dependencies import import_library
from brrp_cli.errors import MaskError
from brrp_cli.segmentation.prompted.onnx_session import Session

LONGER_SIDE = 1024
_PROMPT = {"point_coords", "point_labels", "mask_input", "has_mask_input", "orig_im_size"}


class Segmenter:
    """Encoder and decoder; the image is encoded once, and each box asked of it then."""

    def __init__(self, encoder: Path, decoder: Path) -> None:
        self._encoder = Session(
            encoder, "the segmenter's encoder", {"input_image"}, ["image_embeddings"]
        )
        self._decoder = Session(
            decoder,
            "the segmenter's decoder",
            {"image_embeddings", *_PROMPT},
            ["masks", "iou_predictions"],
        )

    def __call__(
        self, rgb: NDArray[np.uint8], boxes: NDArray[np.float64]
    ) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """Masks (n, H, W) of what fills each box (n, 4) and how sure the model is of each (n,).

        boxes : left, top, right, bottom, pixels of the image (H, W, 3). Errors: MaskError.
        """
        height, width = rgb.shape[:2]
        scale = LONGER_SIDE / max(height, width)
        (embedding,) = self._encoder({"input_image": _resized(rgb, scale)})
        masks = np.zeros((len(boxes), height, width), dtype=bool)
        sure = np.zeros(len(boxes))
        for i, box in enumerate(boxes):
            logits, quality = self._decoder(
                {
                    "image_embeddings": embedding,
                    "point_coords": (box * scale).reshape(1, 2, 2),
                    "point_labels": np.array([[2, 3]]),
                    "mask_input": np.zeros((1, 1, 256, 256)),
                    "has_mask_input": np.zeros(1),
                    "orig_im_size": np.array([height, width]),
                }
            )
            if logits.shape[-2:] != (height, width) or quality.size != logits.shape[1]:
                raise MaskError(
                    "The segmenter's output is not masks of the image",
                    where=self._decoder.path,
                    expected=(1, "M", height, width),
                    found=logits.shape,
                )
            best = int(np.argmax(quality))
            masks[i] = logits[0, best] > 0
            sure[i] = float(quality.reshape(-1)[best])
        return masks, sure


def _resized(rgb: NDArray[np.uint8], scale: float) -> NDArray[np.float32]:
    image = import_library("PIL.Image")
    height, width = (int(extent * scale + 0.5) for extent in rgb.shape[:2])
    resized = image.fromarray(rgb).resize((width, height), image.Resampling.BILINEAR)
    return np.asarray(resized, dtype=np.float32)
