"""Methods take turns, and what the one before has left in the caches does not count."""

import numpy as np

from benchmarks.turns import answers_in_turns
from endosdk.evaluation.methods import Answer


def test_every_method_answers_each_pair_twice_and_the_second_answer_counts():
    asked = []

    def method(name):
        def answer(sample):
            asked.append((name, sample))
            return Answer(np.zeros((1, 1), np.float32), milliseconds=len(asked))

        return answer

    found = answers_in_turns({"a": method("a"), "b": method("b")}, ["first", "second"])
    assert [(name, sample, answer.milliseconds) for name, sample, answer in found] == [
        ("a", "first", 2),
        ("b", "first", 4),
        ("a", "second", 6),
        ("b", "second", 8),
    ]
    assert asked[::2] == asked[1::2] == [("a", "first"), ("b", "first"), ("a", "second"), ("b", "second")]
