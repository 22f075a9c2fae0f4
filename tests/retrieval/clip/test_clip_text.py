from pathlib import Path

import pytest
from small_clip import write_tokenizer

from brrp_cli.errors import RetrievalError
from brrp_cli.retrieval.clip.text import ClipTokenizer, prompt

START, END = 49406, 49407


@pytest.fixture(scope="module")
def tokenizer(xenova: Path) -> ClipTokenizer:
    return ClipTokenizer(xenova / "tokenizer.json")


@pytest.mark.parametrize(
    ("description", "expected"),
    [
        ("red cracker box", "a photo of a red cracker box"),
        ("a red cracker box", "a photo of a red cracker box"),
        ("An  Apple ", "a photo of an apple"),
        ("the lid of a skillet", "a photo of the lid of a skillet"),
        ("apple", "a photo of a apple"),
        ("antique vase", "a photo of a antique vase"),
    ],
)
def test_prompt_has_one_article(description: str, expected: str) -> None:
    assert prompt(description) == expected


@pytest.mark.parametrize("description", ["", "  ", "a"])
def test_an_empty_description_is_refused(description: str) -> None:
    with pytest.raises(RetrievalError, match="no description"):
        prompt(description)


def test_golden_tokens_of_the_published_example(tokenizer: ClipTokenizer) -> None:
    expected = [[START, 320, 1125, 539, 320, 2368, END]]
    assert tokenizer(["a photo of a cat"]).tolist() == expected
    assert tokenizer(["A PHOTO of a Cat"]).tolist() == expected


def test_shorter_texts_are_padded_after_the_end(tokenizer: ClipTokenizer) -> None:
    ids = tokenizer(["a b c", "a"])
    assert ids.tolist() == [[START, 320, 321, 322, END], [START, 320, END, 0, 0]]


def test_a_fixed_length_is_filled(tokenizer: ClipTokenizer) -> None:
    ids = tokenizer(["a cat"], 77)
    assert ids.shape == (1, 77)
    assert ids[0, :4].tolist() == [START, 320, 2368, END]
    assert not ids[0, 4:].any()


@pytest.mark.parametrize("length", [None, 77])
def test_a_long_text_keeps_the_end_token(tokenizer: ClipTokenizer, length: int | None) -> None:
    ids = tokenizer(["a " * 200], length)
    assert ids.tolist() == [[START, *[320] * 75, END]]


def test_just_75_words_lose_nothing(tokenizer: ClipTokenizer) -> None:
    assert tokenizer(["a " * 74 + "b"])[0, -2:].tolist() == [321, END]


def test_another_models_tokenizer_is_refused(tmp_path: Path) -> None:
    write_tokenizer(tmp_path / "tokenizer.json", start=0, end=2)
    with pytest.raises(RetrievalError, match="not CLIP's tokenizer"):
        ClipTokenizer(tmp_path / "tokenizer.json")


def test_a_broken_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "tokenizer.json").write_text('{"version":')
    with pytest.raises(RetrievalError, match=r"tokenizer\.json"):
        ClipTokenizer(tmp_path / "tokenizer.json")
