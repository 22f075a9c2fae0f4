import json

import numpy as np
import pytest

from brrp_cli.errors import RetrievalError
from brrp_cli.frames.frame import Frame
from brrp_cli.retrieval.base import unknown
from brrp_cli.retrieval.combined import BothRetriever
from brrp_cli.retrieval.table import TableRetriever

NAMES = ["apple", "bowl", "cup"]
GIVEN = {"1": {"bowl": 0.5, "cup": 0.25}, "-7": {}}


@pytest.fixture
def frame():
    pixels = np.zeros((2, 2), np.int64)
    return Frame(np.zeros((2, 2, 3), np.uint8), np.zeros((2, 2, 3), np.float32), pixels, np.eye(3))


def write(folder, name, text):
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def test_json_and_csv_say_the_same(tmp_path, frame):
    rows = "object,name,probability\n1,bowl,0.5\n1,cup,0.25\n-7,,\n"
    for path in (
        write(tmp_path, "p.json", json.dumps(GIVEN)),
        write(tmp_path, "p.csv", rows),
    ):
        retriever = TableRetriever(path, NAMES)
        np.testing.assert_array_equal(retriever.probabilities(frame, 1), [0, 0.5, 0.25])
        assert unknown(retriever.probabilities(frame, 1)) == 0.25
        assert unknown(retriever.probabilities(frame, -7)) == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "cannot be read"),
        ("[1]", "cannot be read"),
        ('{"mug": {"cup": 1}}', "cannot be read"),
        ('{"1": {"drill": 0.5}}', "does not hold"),
        ('{"1": {"cup": 0.8, "bowl": 0.4}}', "no probabilities"),
        ('{"1": {"cup": -0.1}}', "no probabilities"),
        ('{"1": {"cup": NaN}}', "no probabilities"),
        ('{"1": {"cup": "much"}}', "no probabilities"),
    ],
)
def test_what_cannot_be_used_is_told(tmp_path, text, message):
    path = write(tmp_path, "p.json", text)
    with pytest.raises(RetrievalError, match=message) as caught:
        TableRetriever(path, NAMES)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("file", "text", "words"),
    [
        ("p.json", None, "No such file"),
        ("p.json", "[1]", "no JSON object of ids"),
        ("p.json", '{"mug": {"cup": 1}}', "'mug' in place of an object's id, a whole number"),
        ("p.json", '{"1": 0.5}', 'object 1: 0.5 in place of {"NAME": probability}'),
        ("p.csv", "id,name,probability\n1,cup,0.5\n", "no column object; the columns are id, name"),
        ("p.csv", "", "no column object; the columns are none"),
        ("p.csv", "object,name,probability\n1,cup,much\n", "line 2: much in place of a probab"),
        ("p.csv", "object,name,probability\n1,cup\n", "line 2: nothing in place of a probab"),
        ("p.csv", "object,name,probability\n,cup,1\n", "'' in place of an object's id"),
    ],
)
def test_why_a_table_cannot_be_read_is_told_in_words(tmp_path, file, text, words):
    path = tmp_path / file if text is None else write(tmp_path, file, text)
    with pytest.raises(RetrievalError, match="cannot be read") as caught:
        TableRetriever(path, NAMES)
    assert words in caught.value.found and caught.value.fix
    assert "Error" not in caught.value.found and "Errno" not in caught.value.found


@pytest.mark.parametrize("file", ["p.json", "p.csv"])
def test_a_table_that_an_editor_marked_as_utf_8_is_read(tmp_path, frame, file):
    text = json.dumps(GIVEN) if file == "p.json" else "object,name,probability\n1,bowl,0.5\n"
    (tmp_path / file).write_text(text, encoding="utf-8-sig")
    assert TableRetriever(tmp_path / file, NAMES).probabilities(frame, 1)[1] == 0.5


def test_an_object_that_is_not_named_is_told(tmp_path, frame):
    retriever = TableRetriever(write(tmp_path, "p.json", json.dumps(GIVEN)), NAMES)
    with pytest.raises(RetrievalError, match="does not name an object") as caught:
        retriever.probabilities(frame, 5)
    assert '"5": {}' in str(caught.value)


def test_rounded_numbers_are_let_pass(tmp_path, frame):
    path = write(tmp_path, "p.json", '{"1": {"apple": 0.3334, "bowl": 0.3334, "cup": 0.3334}}')
    assert TableRetriever(path, NAMES).probabilities(frame, 1).sum() == pytest.approx(1)


def test_both_is_the_product_and_keeps_what_is_unknown(tmp_path, frame):
    def table(name, **given):
        return TableRetriever(write(tmp_path, name, json.dumps({"1": given})), NAMES)

    clip = table("clip.json", apple=0.2, bowl=0.8)
    looks = table("looks.json", apple=0.3, bowl=0.3, cup=0.2)
    both = BothRetriever(clip, looks).probabilities(frame, 1)
    np.testing.assert_allclose(both, [0.16, 0.64, 0])
    # Nothing is possible for both: the second one's answer stands.
    other = table("other.json", cup=0.7)
    np.testing.assert_array_equal(BothRetriever(clip, other).probabilities(frame, 1), [0, 0, 0.7])
