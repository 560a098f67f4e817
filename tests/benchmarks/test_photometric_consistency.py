"""The benchmark of the rule that views must agree runs, and tells right pairs from wrong ones."""

from benchmarks.accuracy.photometric_consistency import Answerer, degraded_pairs, wrong_pairs
from tests.conftest import TINY_MODEL, shifted_pair
from tests.rigs import raw_rig


def test_right_pairs_keep_their_answers_and_wrong_ones_lose_them():
    answer = Answerer(str(TINY_MODEL))
    left, right = shifted_pair(240, 320, 9)
    shares = answer(left, right).shares()
    assert shares["valid_with"] > 0.9 * shares["valid_without"] > 0.5
    wrong = {name: answer(*pair).shares() for name, *pair in wrong_pairs(left, right)}
    assert wrong["twice the left"]["valid_with"] == wrong["both black"]["valid_with"] == 0
    assert max(found["valid_with"] for found in wrong.values()) < 0.1
    assert len([name for name, *_ in degraded_pairs(left, right)]) == 4


def test_one_camera_connected_twice_to_a_raw_rig_has_no_answer():
    left, _ = shifted_pair(480, 640, 9)
    found = Answerer(str(TINY_MODEL))(left, left, raw_rig().scaled(640, 480)).shares()
    assert found["valid_with"] == 0 < found["valid_without"]
