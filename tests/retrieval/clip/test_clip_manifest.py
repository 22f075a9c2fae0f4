"""What the package says of the published files."""

import re

import pytest

from brrp_cli.errors import RetrievalError
from brrp_cli.retrieval.clip.manifest import PRECISIONS, known_pair, read_clip_manifest
from brrp_cli.retrieval.clip.manifest import refuse_mismatch as refuse
from brrp_cli.retrieval.clip.model_files import LAYOUTS

UNKNOWN = "0" * 64


@pytest.mark.parametrize("precision", PRECISIONS)
def test_each_precision_is_a_whole_layout_with_the_vision_model_last(precision: str) -> None:
    layout = LAYOUTS["Xenova/clip-vit-base-patch16"]
    files = read_clip_manifest().files[precision]
    place = PRECISIONS.index(precision)
    assert [file.path for file in files] == [
        layout["text"][place],
        layout["tokenizer"][0],
        layout["vision"][place],
    ]
    assert all(re.fullmatch("[0-9a-f]{64}", file.sha256) for file in files)


def test_the_address_is_of_one_revision() -> None:
    address = read_clip_manifest().address
    assert re.fullmatch(r"https://huggingface\.co/\S+/resolve/[0-9a-f]{40}", address)


def test_every_precision_of_one_training_belongs_together() -> None:
    manifest = read_clip_manifest()
    assert len(manifest.text) == len(manifest.vision) == 2
    assert all(known_pair(text, vision) for text in manifest.text for vision in manifest.vision)


def test_a_published_model_belongs_to_no_other() -> None:
    text = min(read_clip_manifest().text)
    vision = min(read_clip_manifest().vision)
    assert known_pair(UNKNOWN, vision) is False
    assert known_pair(text, UNKNOWN) is False
    assert known_pair(UNKNOWN, UNKNOWN) is None
    with pytest.raises(RetrievalError, match=r"expected: text model[\s\S]*found: +000000000000"):
        refuse(UNKNOWN, vision, text="a", vision="b")
    with pytest.raises(RetrievalError, match=r"expected: vision model[\s\S]*found: +000000000000"):
        refuse(text, UNKNOWN, text="a", vision="b")
    refuse(UNKNOWN, UNKNOWN, text="a", vision="b")
