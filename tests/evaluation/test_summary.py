"""What episodes say together: rates, percentiles, failures, groups by command."""

import dataclasses
import math

import numpy as np
import pytest
from contenders import episode, outcomes
from scipy.stats import norm

from icub_jump_env.evaluation.episodes.failures import Failure
from icub_jump_env.evaluation.statistics.summary import Rate, Summary, by_command, command_labels


@pytest.mark.parametrize(("count", "total"), [(0, 10), (7, 10), (200, 200), (190, 200)])
def test_wilson_interval_against_its_definition(count, total):
    """The shares p with |p_observed - p| <= z sqrt(p (1 - p) / n)."""
    low, high = Rate(count, total).interval
    z, observed = norm.ppf(0.975), count / total
    for bound in (low, high):
        if 0.0 < bound < 1.0:
            assert (observed - bound) ** 2 == pytest.approx(z**2 * bound * (1 - bound) / total)
    assert low <= observed <= high


class TestSummary:
    @pytest.mark.parametrize(
        ("jumps", "landed", "outcome", "counts"),
        [
            (5, 5, "stood", True),
            (5, 4, "stood", False),
            (5, 4, "fell", False),
            # The second jump did not begin.
            (1, 1, "no take-off", False),
        ],
    )
    def test_a_series_has_landed_after_all_of_its_jumps(self, jumps, landed, outcome, counts):
        series = {"jumps": jumps, "landed": landed}
        last = dataclasses.replace(episode(0, landed=True), outcome=outcome, series=series)
        assert Summary.of([last]).landed.count == counts

    def test_rates_percentiles_and_failures(self):
        heights = np.linspace(0.03, 0.05, 21)
        episodes = [episode(seed, flight_height=h) for seed, h in enumerate(heights)]
        episodes[3] = episode(3, Failure.TOO_LOW, flight_height=heights[3], landed=True)
        episodes[8] = episode(8, Failure.FELL_BACKWARD, flight_height=heights[8])
        found = Summary.of(episodes)
        assert (found.landed.count, found.success.count) == (20, 19)
        assert found.percentiles["flight_height"] == pytest.approx((0.032, 0.04, 0.048))
        assert found.mean_rise == pytest.approx(0.04)
        assert found.failures == {Failure.TOO_LOW: (3,), Failure.FELL_BACKWARD: (8,)}
        assert Summary.of(episodes[::-1]) == found

    def test_undefined_metrics_are_left_out(self):
        episodes = [episode(0, flight_rotation=0.1), episode(1, Failure.NO_TAKEOFF)]
        found = Summary.of(episodes)
        assert found.percentiles["flight_rotation"] == pytest.approx((0.1, 0.1, 0.1))
        assert all(math.isnan(value) for value in found.percentiles["base_pitch_range"])

    def test_numbers(self):
        episodes = [
            episode(0, flight_height=0.04, flight_rotation=-0.1, landing_force=900.0, joint_work=90.0),
            episode(1, flight_height=0.05, flight_rotation=0.3, landing_force=1000.0, joint_work=80.0),
            episode(2, jump_height=0.05, flight_height=0.03, flight_rotation=0.2, landing_force=800.0, joint_work=100.0),
            episode(3, Failure.NO_TAKEOFF, jump_height=0.05, joint_work=10.0),
            episode(4, Failure.TOO_LOW, landed=True, flight_height=0.02, flight_rotation=-0.2, landing_force=700.0, joint_work=70.0),
        ]  # fmt: skip
        found = Summary.of(episodes)
        assert (found.success, found.landed) == (Rate(3, 5), Rate(4, 5))
        assert found.mean_rise == pytest.approx((4 + 5 + 3 + 0 + 2) / 500)
        assert found.mean_height_error == pytest.approx((0 + 1 + 2 + 5 + 2) / 500)
        # Without a flight there is neither a rotation nor a landing.
        assert found.median_rotation == pytest.approx(0.2)
        assert found.median("landing_force") == pytest.approx(850.0)
        assert found.median("joint_work") == pytest.approx(80.0)

    def test_without_a_flight_the_soles_rise_nowhere(self):
        episodes = [episode(0, sole_height=0.03), episode(1, Failure.NO_TAKEOFF)]
        assert Summary.of(episodes).mean_sole_height == pytest.approx(0.015)

    def test_where_nobody_flew(self):
        found = Summary.of([episode(0, Failure.NO_TAKEOFF)])
        assert math.isnan(found.median_rotation)
        assert math.isnan(found.median("landing_force"))
        assert found.mean_rise == 0.0

    def test_wilson_interval_by_hand(self):
        """For 8 of 10: (8 + z^2/2 +- z sqrt(8 * 2 / 10 + z^2/4)) / (10 + z^2)."""
        z2 = 1.959964**2
        middle, half = 8 + z2 / 2, math.sqrt(z2 * (1.6 + z2 / 4))
        expected = (middle - half) / (10 + z2), (middle + half) / (10 + z2)
        found = Summary.of(outcomes("1101111011")).as_dict()["success"]
        assert found["interval"] == pytest.approx(expected, abs=1e-6)
        assert (found["count"], found["total"]) == (8, 10)


class TestByCommand:
    @pytest.mark.parametrize("centimetres", range(1, 16))
    def test_a_whole_number_of_centimetres_begins_a_group(self, centimetres):
        """Also where rounding puts it a little below."""
        height = centimetres / 100
        for rounded in (height, math.nextafter(height, 0.0), math.nextafter(height, 1.0)):
            groups = by_command([episode(0, jump_height=rounded)])
            assert list(groups) == [(centimetres / 100, (centimetres + 1) / 100)]

    @pytest.mark.parametrize(
        ("height", "group"),
        [
            (0.05, (0.05, 0.06)),
            (0.15 - 0.1, (0.05, 0.06)),
            (0.0499, (0.04, 0.05)),
            (0.0599999, (0.05, 0.06)),
        ],
    )
    def test_between_the_edges(self, height, group):
        assert list(by_command([episode(0, jump_height=height)])) == [group]

    def test_every_episode_is_in_one_group_and_groups_ascend(self):
        heights = [0.072, 0.031, 0.05, 0.039, 0.055, 0.07]
        episodes = [episode(seed, jump_height=h) for seed, h in enumerate(heights)]
        groups = by_command(episodes)
        assert {key: [e.seed for e in group] for key, group in groups.items()} == {
            (0.03, 0.04): [1, 3], (0.05, 0.06): [2, 4], (0.07, 0.08): [0, 5],
        }  # fmt: skip
        assert list(groups) == sorted(groups)

    def test_labels_say_the_range_or_the_single_command(self):
        several = [episode(seed, jump_height=h) for seed, h in enumerate((0.072, 0.031))]
        assert list(command_labels(several).values()) == ["3 to 4 cm", "7 to 8 cm"]
        assert list(command_labels(several[:1]).values()) == ["7.2 cm"]


def test_a_single_episode_has_no_rate():
    assert [str(Rate(count, 1)) for count in (0, 1)] == ["no", "yes"]
    assert Rate(1, 1).bounds == "-"
