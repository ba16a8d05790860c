"""The table's arithmetic."""

import math

import pytest

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.episodes.rollout import Episode
from icub_jump_env.evaluation.statistics.paper import comparison_rows, verdict
from icub_jump_env.metrics.jump import JumpMetrics


def episode(**jump):
    values = {
        "flight_height": 0.04, "sole_height": 0.05, "takeoff_velocity": 0.9,
        "takeoff_time": 0.43, "ballistic_height": 0.041, "flight_rotation": math.radians(0.5),
        "base_pitch_range": math.radians(4.0), "landed": True, "limit_violations": 0.0,
    }  # fmt: skip
    return Episode(0, 0.04, "stood", True, 3.0, JumpMetrics().as_dict() | values | jump)


def rows(ours, without):
    return {row.quantity: row for row in comparison_rows(JumpConfig(), ours, without)}


def test_units_and_differences():
    table = rows(
        [episode(flight_height=0.036)],
        [episode(flight_rotation=math.radians(-10), landed=False)],
    )
    height = table["flight height (CoM)"]
    assert (height.paper, height.ours) == pytest.approx((3.5, 3.6))
    assert height.difference == pytest.approx(0.1)
    assert table["base pitch in flight"].ours == pytest.approx(4.0)
    rotation = table["rotation in flight"]
    assert rotation.paper is None
    assert rotation.difference is None
    assert rotation.other == pytest.approx(-10.0)
    assert table["landed and stands"].paper is None  # it does not say
    assert table["landed and stands"].other == 0.0
    # Measured on the real robot, which is no simulation to compare ours with.
    assert table["ballistic height"].paper == pytest.approx(3.0)
    assert table["ballistic height"].difference is None


def test_of_several_jumps_medians_and_percentiles():
    ours = [episode(flight_height=0.01 * cm, landed=cm > 3) for cm in (4, 2, 3, 6, 5)]
    others = [episode(flight_height=0.01 * cm) for cm in (1, 9, 2)]
    table = rows(ours, others)
    height = table["flight height (CoM)"]
    assert (height.ours, height.other) == pytest.approx((4.0, 2.0))
    assert height.spread == pytest.approx((2.4, 5.6))
    assert height.difference == pytest.approx(0.5)
    assert height.cells == ("3.5", "4.00", "2.40 to 5.60", "+0.50", "2.00")
    landed = table["landed and stands"]
    assert (landed.ours, landed.other, landed.spread) == (60.0, 100.0, (60.0, 60.0))
    assert landed.cells == ("-", "60", "60", "-", "100")


def test_the_torque_controller_is_compared_with_the_papers_torque_controller():
    table = {
        r.quantity: r
        for r in comparison_rows(JumpConfig.of(controller="torque"), [episode()], [episode()])
    }
    assert table["flight height (CoM)"].paper == pytest.approx(1.6)
    assert table["sole height"].paper == pytest.approx(2.3)
    assert table["ballistic height"].paper is None  # the real robot did not jump with it


def test_no_difference_to_another_jump_than_the_papers():
    higher = JumpConfig.of(jump_height=0.05)
    assert all(r.difference is None for r in comparison_rows(higher, [episode()], [episode()]))


@pytest.mark.parametrize(("landed", "word"), [(True, "stands"), (False, "falls")])
def test_verdict_where_the_constraint_decides_nothing(landed, word):
    sentence = verdict(JumpConfig(), episode(landed=landed), episode(landed=landed))
    assert sentence == f"The robot {word} with the momentum constraint (3d) and without it."


@pytest.mark.parametrize(("controller", "equation"), [("velocity", "3d"), ("torque", "6d")])
@pytest.mark.parametrize(
    ("ours", "without", "words"),
    [(True, False, ("stands", "falls")), (False, True, ("falls", "stands"))],
)
def test_verdict(controller, equation, ours, without, words):
    arms = [episode(landed=landed) for landed in (ours, without)]
    config = JumpConfig.of(controller=controller)
    sentence = verdict(config, *arms)
    assert verdict(config.replace(momentum_control=False), *arms[::-1]) == sentence
    assert sentence == (
        f"With the momentum constraint ({equation}) the robot {words[0]}; "
        f"without it, it {words[1]}."
    )
