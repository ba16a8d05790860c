"""The phase machine."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from icub_jump_env.control.config import PhaseConfig
from icub_jump_env.control.phases import Phase, PhaseMachine
from icub_jump_env.errors import ConfigError
from icub_jump_env.robot.robot import load_robot

ROBOT = load_robot()

T = 0.43
WEIGHT = 324.0
DT = 0.005


def run(forces, start=0.0, **config):
    machine = PhaseMachine(PhaseConfig(**config))
    return [machine.update(start + i * DT, T, force) for i, force in enumerate(forces)]


def test_launch_ends_at_T_while_the_feet_still_carry_load():
    phases = run([WEIGHT] * 100)
    switch = phases.index(Phase.FLIGHT)
    assert switch * DT >= T > (switch - 1) * DT
    assert phases[-1] is Phase.FLIGHT


def test_launch_ends_at_lift_off_if_that_comes_first():
    phases = run([WEIGHT] * 10 + [0.0] * 5)
    assert phases[9] is Phase.LAUNCH
    assert phases[-1] is Phase.FLIGHT


@pytest.mark.parametrize("launch_end", ["time", "lift_off"])
@pytest.mark.parametrize("ticks", [1, 2, 3])
def test_so_many_unloaded_ticks_are_a_lift_off(ticks, launch_end):
    phases = run([WEIGHT] * 3 + [0.0] * 5, lift_off_ticks=ticks, launch_end=launch_end)
    assert phases.index(Phase.FLIGHT) == 3 + ticks - 1


def test_two_unloaded_ticks_are_a_lift_off_by_default():
    assert run([WEIGHT] * 3 + [0.0] * 5).index(Phase.FLIGHT) == 4


def test_a_launch_that_ends_at_lift_off_alone_goes_on_after_T():
    forces = [WEIGHT] * 150 + [0.0] * 3
    phases = run(forces, launch_end="lift_off")
    assert T < 150 * DT
    assert set(phases[:151]) == {Phase.LAUNCH}
    assert phases[151] is Phase.FLIGHT


@pytest.mark.parametrize(("force", "unloaded"), [(9.9, True), (10.1, False)])
def test_the_lift_off_force(force, unloaded):
    assert (Phase.FLIGHT in run([WEIGHT, force, force, force])) is unloaded


@pytest.mark.parametrize(("force", "landed"), [(29.9, False), (30.1, True)])
def test_the_touch_down_force(force, landed):
    assert (run([0.0] * 5 + [force])[-1] is Phase.LANDING) is landed


def test_a_single_unloaded_tick_is_chatter():
    assert set(run([WEIGHT] * 5 + [0.0] + [WEIGHT] * 5 + [0.0] + [WEIGHT] * 5)) == {Phase.LAUNCH}


def test_flight_cannot_end_before_a_lift_off():
    phases = run([WEIGHT] * 20, start=T)
    assert set(phases) == {Phase.FLIGHT}


def test_a_force_sensor_with_an_offset_does_not_hide_the_flight():
    machine = PhaseMachine(PhaseConfig())
    phases = [machine.update(T + i * DT, T, f) for i, f in enumerate([WEIGHT, 13, 13, 13, 500])]
    assert phases[3:] == [Phase.FLIGHT, Phase.LANDING]
    # In the launch it does not end the contact early.
    assert set(run([WEIGHT, 13, 13, 13])) == {Phase.LAUNCH}


def test_flight_ends_at_the_first_contact_after_lift_off():
    phases = run([WEIGHT] * 5 + [0.0] * 10 + [500.0])
    assert phases[-2:] == [Phase.FLIGHT, Phase.LANDING]


@given(st.lists(st.sampled_from([0.0, 5.0, 20.0, 100.0, 1000.0]), max_size=200))
def test_phases_only_move_forward(forces):
    phases = run(forces)
    assert phases == sorted(phases)


@pytest.mark.parametrize(
    "values", [{"lift_off": -1.0}, {"touch_down": 5.0}, {"lift_off_ticks": 0}, {"launch_end": "T"}]
)
def test_bad_thresholds_are_refused(values):
    with pytest.raises(ConfigError) as refusal:
        PhaseConfig(**values)
    assert refusal.value.field in values


def test_reset_starts_over():
    machine = PhaseMachine(PhaseConfig())
    for i in range(200):
        machine.update(i * DT, T, 0.0)
    machine.reset()
    assert machine.update(0.0, T, WEIGHT) is Phase.LAUNCH
    assert not machine.airborne
