import numpy as np
import pytest

from brrp_cli.errors import RetrievalError
from brrp_cli.frames.frame import Frame
from brrp_cli.retrieval.base import top_k
from brrp_cli.retrieval.cached import RememberingRetriever
from brrp_cli.retrieval.given import TruthRetriever, UniformRetriever

NAMES = ["apple", "bowl", "cup", "mug"]


@pytest.fixture
def frame():
    pixels = np.zeros((2, 2), np.int64)
    return Frame(np.zeros((2, 2, 3), np.uint8), np.zeros((2, 2, 3), np.float32), pixels, np.eye(3))


def test_truth_has_seven_tenths_and_the_others_share_the_rest(frame):
    found = TruthRetriever(NAMES, {5: "cup"}).probabilities(frame, 5)
    np.testing.assert_allclose(found, [0.1, 0.1, 0.7, 0.1])
    assert top_k(found, NAMES, 1) == [("cup", pytest.approx(0.7))]
    np.testing.assert_array_equal(
        TruthRetriever(["cup"], {5: "cup"}).probabilities(frame, 5), [1.0]
    )


def test_truth_that_the_prior_does_not_hold_is_refused(frame):
    with pytest.raises(RetrievalError, match="not in the prior"):
        TruthRetriever(NAMES, {5: "drill"}).probabilities(frame, 5)


def test_uniform_prefers_nothing(frame):
    np.testing.assert_array_equal(UniformRetriever(NAMES).probabilities(frame, 1), [0.25] * 4)


def test_a_remembered_object_is_asked_for_once(frame):
    asked = []

    class Counting:
        name = "counting"

        def probabilities(self, frame, object_id):
            asked.append(object_id)
            return np.array([0.5, 0.5])

    retriever = RememberingRetriever(Counting())
    for object_id in (3, 3, 4, 3):
        np.testing.assert_array_equal(retriever.probabilities(frame, object_id), [0.5, 0.5])
    assert asked == [3, 4]
    assert retriever.name == "counting"
    assert set(retriever.answers) == set(retriever.seconds) == {3, 4}
