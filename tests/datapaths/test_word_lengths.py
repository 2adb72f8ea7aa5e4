from dataclasses import dataclass

import pytest

from hdl.datapaths.word_lengths import shortest

WEIGHTS = {"a": 5.0, "b": 1.0, "c": 0.2}


@dataclass
class Candidate:
    bits: dict

    @property
    def cost(self):
        return sum(WEIGHTS[name] * n for name, n in self.bits.items())

    @property
    def error(self):
        return sum(2.0**-n for n in self.bits.values())


def search(budget, optimism=1.0, meets=None, fewest=None):
    return shortest(
        Candidate,
        [Candidate(dict.fromkeys(WEIGHTS, bits)) for bits in range(2, 21)],
        fewest or {},
        error=lambda candidate: candidate.error / optimism,
        limit=budget,
        meets=meets or (lambda candidate: candidate.error <= budget),
    )


def assert_least(found, budget):
    assert found.error <= budget
    for name, bits in found.bits.items():
        assert Candidate({**found.bits, name: bits - 1}).error > budget


@pytest.mark.parametrize("budget", [1e-5, 1e-3, 0.1, 3.0])
def test_no_bit_can_be_taken_any_more(budget):
    assert_least(search(budget), budget)


def test_the_dear_ones_are_the_short_ones():
    bits = search(1e-3).bits
    assert bits["a"] < bits["c"]


@pytest.mark.parametrize("optimism", [1.0, 2.0, 30.0])
def test_a_sample_that_misses_the_worst_pixels_is_made_up_for(optimism):
    assert_least(search(1e-3, optimism), 1e-3)


def test_none_goes_below_the_fewest():
    bits = search(3.0, fewest={"a": 4}).bits
    assert bits["a"] == 4
    assert bits["b"] < 4


def test_what_cannot_be_reached_is_none():
    assert search(1e-9) is None
    assert search(1e-3, meets=lambda candidate: False) is None


def test_bits_that_save_nothing_alone_go_together():
    # Bits in pairs.
    class Paired(Candidate):
        @property
        def cost(self):
            return self.bits["a"] // 2

    found = shortest(
        Paired,
        [Paired({"a": 20})],
        {},
        error=lambda candidate: candidate.error,
        limit=2.0**-7,
        meets=lambda candidate: True,
    )
    assert found.bits == {"a": 7}
