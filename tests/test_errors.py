"""What messages show of values: one printable line of bounded length, whatever the value."""

import pickle

import numpy as np
import pytest

from icub_jump_env.checks import check_count, check_number, check_numbers, check_range
from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError, ICubJumpError, PolicyFileError, PolicyMismatchError
from icub_jump_env.policy.fields import check_results
from icub_jump_env.simulation.actuators.config import ActuatorConfig
from icub_jump_env.simulation.actuators.motors import DCMotor, RatedMotor
from icub_jump_env.simulation.actuators.servo import ServoGains
from icub_jump_env.simulation.actuators.torque_loops import CurrentControl, TorqueFeedback
from icub_jump_env.simulation.sensor_models import SensorConfig, SensorError

HOSTILE = "red\x1b[31m\nnext\r\t\x07\u202eback\udcff"


class Raises:
    def __repr__(self):
        raise ZeroDivisionError


class Huge:
    def __repr__(self):
        return "x" * 10_000_000


class Hostile:
    def __repr__(self):
        return HOSTILE


def nested(levels):
    value = []
    for _ in range(levels):
        value = [value]
    return value


VALUES = {
    "raises": Raises(),
    "huge": Huge(),
    "hostile": Hostile(),
    "text": HOSTILE,
    "long text": "y" * 1_000_000,
    "long list": list(range(1_000_000)),
    "lists": [["z" * 1000] * 1000] * 1000,
    "keys": [{Raises(): Raises(), HOSTILE: Hostile()}],
    "array": np.zeros((300, 300)),
    "digits": 10**5000,
    "nested": nested(100_000),
    "a class called list": type("list", (), {})(),
}


def clean(message):
    return message.isprintable() and 0 < len(message) <= 2000


@pytest.mark.parametrize("value", VALUES.values(), ids=VALUES)
def test_any_value_gives_one_printable_line(value):
    for field in ("solver", "jump_height", "residual_scale", "sensors", "momentum_control"):
        with pytest.raises(ConfigError) as refusal:
            JumpConfig.of(**{field: value})
        message = str(refusal.value)
        assert clean(message)
        assert message.startswith(f"{field}=")
        assert " is not allowed: " in message
        assert refusal.value.value is value


def test_unknown_fields_with_any_name():
    for name in (HOSTILE, "n" * 100_000):
        with pytest.raises(ConfigError) as refusal:
            JumpConfig.of(**{name: 3})
        assert clean(str(refusal.value))
        assert "=3 is not allowed: no such field; the fields are robot" in str(refusal.value)


def test_short_values_are_shown_whole():
    command = tuple(f"policy-{number}" for number in range(20))
    assert str(ConfigError("a", command, "less")) == f"a={command!r} is not allowed: expected less"


@pytest.mark.parametrize(
    "error",
    [
        ICubJumpError(HOSTILE),
        PolicyFileError(HOSTILE, HOSTILE),
        PolicyMismatchError([(HOSTILE, Hostile(), Raises())] * 1000),
    ],
)
def test_every_error_is_clean_and_stays_so_in_another_process(error):
    assert clean(str(error))
    assert "\\x1b[31m" in str(error)
    if not isinstance(error, PolicyMismatchError):  # whose values here no process can send
        assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_results_nested_too_deep_are_refused():
    with pytest.raises(
        ConfigError, match=r"^results=\[.* is not allowed: expected values nested at most 32 deep$"
    ):
        check_results("results", nested(100_000))


def test_ranges_name_their_unit():
    for check, arguments, words in (
        (check_number, (9, 0.01, 0.15, "m"), "a number from 0.01 to 0.15 m"),
        (check_number, (9, 0.0, 1.0), "a number from 0 to 1"),
        (check_count, (9, 0, 3, "ticks"), "a whole number from 0 to 3 ticks"),
        (check_count, (-1, 0, None, "updates"), "a whole number from 0 updates"),
        (check_numbers, ([9], 2, 0.0, 1.0, "m"), "2 numbers from 0 to 1 m"),
        (check_range, ([0.5, 9], 0.0, 1.0, "kg"), "2 numbers from 0 to 1 kg"),
    ):
        with pytest.raises(ConfigError) as refusal:
            check("field", *arguments)
        assert refusal.value.allowed == words


@pytest.mark.parametrize(
    ("kind", "field", "unit"),
    [
        (ActuatorConfig, "friction", "of the effort limit"),
        (TorqueFeedback, "bandwidth", "Hz"),
        (TorqueFeedback, "delay", "s"),
        (CurrentControl, "bandwidth", "Hz"),
        (CurrentControl, "friction_compensation", "of the friction"),
        (CurrentControl, "torque_constant", "of the assumed one"),
        (RatedMotor, "speed_band", "of the speed limit"),
        (DCMotor, "current_limit", "of the largest current"),
        (DCMotor, "voltage_limit", "of the full voltage"),
        (DCMotor, "stall_torque", "effort limits"),
        (DCMotor, "no_load_speed", "speed limits"),
        (ServoGains, "stiffness", "Nm/rad"),
        (ServoGains, "damping", "Nm s/rad"),
        (SensorError, "noise", "units of the reading"),
        (SensorError, "drift", "units of the reading per s"),
        (SensorConfig, "force_gain", "of the force"),
        (SensorConfig, "delay", "control ticks"),
    ],
)
def test_models_name_the_unit_of_their_fields(kind, field, unit):
    with pytest.raises(ConfigError, match=rf"^{field}=-1 is .* number from \S+ to \S+ {unit}$"):
        kind(**{field: -1})
