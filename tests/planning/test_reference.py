"""The set point in the world: a plan from where the robot stands, plus the residual."""

import numpy as np
import pytest

from icub_jump_env.planning.plan import Setpoint
from icub_jump_env.planning.reference import Reference
from icub_jump_env.planning.residual import N_AXES, ResidualFilter
from icub_jump_env.robot.statics import Stance

START = np.array([0.02, 0.001, 0.39])
ADDED = {
    "com_position": "offset",
    "com_velocity": "velocity",
    "com_acceleration": "acceleration",
    "angular_momentum": "offset",
    "angular_momentum_rate": "velocity",
}


class Moving:
    """A plan of which every part moves, each entry at a rate of its own."""

    duration, displacement, landing_posture = 0.4, 0.1, np.zeros(5)
    stance = Stance(np.zeros(5), np.zeros(12), np.zeros(5))

    def __init__(self):
        self._setpoint = Setpoint.at_rest(np.zeros(5))

    def sample(self, time):
        for count, part in enumerate(parts(self._setpoint).values(), start=1):
            part[:] = count + time * np.arange(1, len(part) + 1)
        return self._setpoint


@pytest.fixture
def reference():
    made = Reference(ResidualFilter(15.0))
    made.start(Moving(), START)
    return made


def parts(setpoint):
    return {name: getattr(setpoint, name) for name in setpoint.block.dtype.names}


@pytest.mark.parametrize("time", [0.0, 0.3])
def test_it_is_the_plan_from_the_start_plus_the_residual(reference, time):
    residual = reference.residual
    residual.step(np.array([0.03, -0.01, 0.02, 0.4, -0.5]), 0.1)
    reference.update(time)
    for name, planned in parts(Moving().sample(time)).items():
        expected = planned
        if name in ADDED:
            of_com, of_momentum = np.split(getattr(residual, ADDED[name]), [3])
            expected = planned + (of_com if "com" in name else [*of_momentum, 0.0])
        if name == "com_position":
            expected = expected + START
        np.testing.assert_allclose(parts(reference.setpoint)[name], expected, rtol=1e-15)
    assert residual.velocity.all()


def test_start_forgets_the_residual_and_the_plan_before(reference):
    reference.residual.step(np.ones(N_AXES), 0.1)
    reference.update(0.2)
    reference.start(Moving(), 2 * START)
    residual = reference.residual
    for part in (residual.offset, residual.velocity, residual.acceleration):
        assert not part.any()
    planned = Moving().sample(0.0)
    np.testing.assert_allclose(reference.setpoint.com_position, 2 * START + planned.com_position)
    np.testing.assert_array_equal(reference.setpoint.com_velocity, planned.com_velocity)


def test_the_start_is_where_the_robot_was_and_not_where_it_is():
    """Estimates are buffers that go on to change."""
    com, made = START.copy(), Reference(ResidualFilter(15.0))
    made.start(Moving(), com)
    before = made.setpoint.com_position.copy()
    com += 1.0
    made.update(0.0)
    np.testing.assert_array_equal(made.setpoint.com_position, before)
