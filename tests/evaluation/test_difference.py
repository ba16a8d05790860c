"""Pairs of episodes, and how sure their difference is."""

import dataclasses
import math

import numpy as np
import pytest
from contenders import episode, outcomes
from scipy.stats import binom, multinomial

from icub_jump_env.evaluation.statistics.difference import (
    Difference,
    RateDifference,
    bootstrap_interval,
    holm_corrected,
    in_words,
    paired_interval,
)


class TestDifference:
    ours, theirs = outcomes("1111111100", rise=0.05), outcomes("0000000010", rise=0.047)

    def test_counts_and_mcnemar_by_hand(self):
        """8 won and 1 lost of 9: twice the chance of at most 1 head in 9 tosses."""
        found = Difference.of(self.ours, self.theirs)
        assert (found.won, found.lost) == (8, 1)
        assert found.p_value == pytest.approx(2 * (1 + 9) / 2**9)
        assert found.success == pytest.approx(0.7)
        assert found.rise == pytest.approx(0.003)

    def test_the_other_way_round_the_signs_turn(self):
        there, back = (
            Difference.of(*pair) for pair in ((self.ours, self.theirs), (self.theirs, self.ours))
        )
        assert (back.won, back.lost) == (there.lost, there.won)
        assert back.p_value == there.p_value
        assert (back.success, back.rise) == (-there.success, -there.rise)
        assert back.success_interval == pytest.approx([-b for b in there.success_interval[::-1]])

    @pytest.mark.parametrize(("won", "lost"), [(1, 0), (5, 5), (9, 2), (20, 3)])
    def test_mcnemar_against_the_binomial_distribution(self, won, lost):
        """Episodes that end alike do not count."""
        ours = outcomes("1" * won + "0" * lost + "11110000")
        theirs = outcomes("0" * won + "1" * lost + "11110000")
        expected = min(1.0, 2 * binom.cdf(min(won, lost), won + lost, 0.5))
        assert Difference.of(ours, theirs).p_value == pytest.approx(expected)

    def test_of_a_contender_against_itself(self):
        found = Difference.of(self.ours, self.ours)
        assert (found.won, found.lost, found.p_value) == (0, 0, 1.0)
        assert (found.success, found.rise) == (0.0, 0.0)
        assert found.rise_interval == (0.0, 0.0)
        assert found.success_interval == paired_interval(0, 0, 10)

    def test_pairs_count_not_groups(self):
        """Rises that scatter much more than they differ: the pairs show the difference."""
        heights = np.linspace(0.02, 0.08, 50)
        gains = 0.001 + 0.0005 * np.sin(np.arange(50))
        theirs = [episode(seed, flight_height=h) for seed, h in enumerate(heights)]
        ours = [episode(seed, flight_height=h) for seed, h in enumerate(heights + gains)]
        low, high = Difference.of(ours, theirs).rise_interval
        assert 0.0008 < low < gains.mean() < high < 0.0012

    def test_intervals_against_the_normal_distribution(self, rng):
        gains = rng.choice([-1, 0, 1], 400, p=[0.1, 0.6, 0.3])
        half = 1.96 * gains.std() / math.sqrt(400)
        expected = gains.mean() - half, gains.mean() + half
        assert bootstrap_interval(gains) == pytest.approx(expected, abs=0.1 * half)
        assert bootstrap_interval(gains) == bootstrap_interval(gains)

    def test_lists_of_different_length_are_no_pairs(self):
        with pytest.raises(ValueError, match="same seeds"):
            Difference.of(self.ours[:-1], self.theirs)

    def test_episodes_of_different_seeds_are_no_pairs(self):
        shifted = [dataclasses.replace(e, seed=e.seed + 1) for e in self.theirs]
        with pytest.raises(ValueError, match="same seeds"):
            Difference.of(self.ours, shifted)

    def test_in_words(self):
        line = str(Difference.of(self.ours, self.theirs))
        assert line.startswith("success +70.0 points (95 % interval +18.6 to +98.1; ")
        assert "won 8, lost 1, McNemar p = 0.039" in line
        assert line.endswith("rise +0.30 cm (+0.30 to +0.30), soles +0.00 cm (+0.00 to +0.00)")
        worse = str(Difference.of(outcomes("0" * 20), outcomes("1" * 20, rise=0.0412)))
        assert "success -100.0 points (95 % interval -100.0 to -76.0;" in worse
        assert "McNemar p < 0.001" in worse
        assert "rise -0.12 cm" in worse

    def test_of_a_single_pair_there_is_nothing_but_its_values(self):
        line = str(Difference.of(self.ours[:1], self.theirs[:1]))
        assert line == ("success +100.0 points, rise +0.30 cm, soles +0.00 cm (a single episode)")


def landed(episode):
    return episode.jump["landed"]


class TestRateDifference:
    def test_counts_what_it_is_told_to_count(self):
        """Too low is no success, but it stands."""
        ours, theirs = outcomes("11110", landed=True), outcomes("00001", landed=False)
        found = RateDifference.of(ours, theirs, landed)
        assert (found.won, found.lost, found.pairs, found.gain) == (5, 0, 5, 1.0)
        assert found.p_value == pytest.approx(2 / 2**5)
        assert found.interval == paired_interval(5, 0, 5)

    @pytest.mark.parametrize(
        ("ours", "theirs", "sign"),
        [("1" * 20, "0" * 20, 1), ("0" * 20, "1" * 20, -1), ("10" * 10, "01" * 10, 0)],
    )
    def test_sign_is_the_side_of_zero_that_the_interval_lies_on(self, ours, theirs, sign):
        assert RateDifference.of(outcomes(ours), outcomes(theirs), landed).sign == sign

    def test_agrees_with_the_success_of_a_difference(self):
        ours, theirs = TestDifference.ours, TestDifference.theirs
        rate, whole = RateDifference.of(ours, theirs, landed), Difference.of(ours, theirs)
        assert (rate.won, rate.lost, rate.p_value) == (whole.won, whole.lost, whole.p_value)
        assert (rate.gain, rate.interval) == (whole.success, whole.success_interval)


class TestHolm:
    def differences(self, *p_values):
        found = Difference.of(TestDifference.ours, TestDifference.theirs)
        return [dataclasses.replace(found, p_value=p) for p in p_values]

    @pytest.mark.parametrize(
        ("p_values", "corrected"),
        [
            ((0.01, 0.04, 0.03, 0.005), (0.03, 0.06, 0.06, 0.02)),  # Wikipedia's example
            ((0.02, 0.01, 0.02), (0.04, 0.03, 0.04)),
            ((0.9, 0.4), (0.9, 0.8)),
            ((0.8, 0.7), (1.0, 1.0)),
        ],
    )
    def test_by_hand(self, p_values, corrected):
        found = holm_corrected(self.differences(*p_values))
        assert [d.p_value for d in found] == list(p_values)
        assert [d.corrected_p_value for d in found] == pytest.approx(corrected)

    def test_in_words(self):
        few, none = holm_corrected(self.differences(0.0001, 0.5))
        lines = in_words({"a against b": few, "a against c": none})
        assert "McNemar p < 0.001, corrected p < 0.001), rise" in lines[0]
        assert lines[1].startswith("a against c: success ")
        assert "McNemar p = 0.500, corrected p = 0.500), rise" in lines[1]
        assert lines[2:] == ["corrected p: Holm-corrected over 2 comparisons"]

    def test_one_alone_stays_as_it_is(self):
        (alone,) = holm_corrected(self.differences(0.03))
        assert alone.corrected_p_value is None
        assert len(in_words({"a against b": alone})) == 1


class TestPairedInterval:
    def test_by_hand(self):
        """8 won, 1 lost of 10: 7/12 +- z sqrt((10/12 - (7/12)^2) / 12)."""
        half = 1.959964 * math.sqrt((10 / 12 - (7 / 12) ** 2) / 12)
        expected = 7 / 12 - half, 7 / 12 + half
        assert paired_interval(8, 1, 10) == pytest.approx(expected, abs=1e-6)

    @pytest.mark.parametrize("pairs", [30, 100])
    @pytest.mark.parametrize(
        ("won", "lost"), [(0.01, 0.01), (0.1, 0.0), (0.15, 0.02), (0.3, 0.1), (0.5, 0.3)]
    )
    def test_covers_the_truth_as_often_as_it_says(self, pairs, won, lost):
        """Over all outcomes of a trial, each with its probability."""
        trial = multinomial(pairs, [won, lost, 1.0 - won - lost])
        covered = 0.0
        for w in range(pairs + 1):
            for v in range(pairs + 1 - w):
                low, high = paired_interval(w, v, pairs)
                if low <= won - lost <= high:
                    covered += trial.pmf([w, v, pairs - w - v])
        assert 0.93 < covered <= 1.0

    def test_is_not_sure_where_all_pairs_are_alike(self):
        low, high = paired_interval(0, 0, 100)
        assert -0.05 < low < 0.0 < high < 0.05
        assert high == -low

    @pytest.mark.parametrize(("won", "lost"), [(10, 0), (0, 10), (5, 5)])
    def test_stays_within_what_a_difference_can_be(self, won, lost):
        low, high = paired_interval(won, lost, 10)
        assert -1.0 <= low < high <= 1.0
