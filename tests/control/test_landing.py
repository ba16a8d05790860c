"""The landing that catches by feedback: its balance layer, and its commands."""

import copy
import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from standing import ROBOT, STANCE, N

from icub_jump_env.control import catching, landing
from icub_jump_env.control.catching import Catching, catch, lunge_momentum
from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.landing import FeedbackLanding, HoldLanding
from icub_jump_env.control.phases import Tick
from icub_jump_env.estimation.feet_fixed import FeetFixedEstimator
from icub_jump_env.estimation.readings import Readings
from icub_jump_env.planning.residual import N_AXES, ResidualFilter
from icub_jump_env.planning.scaled_curve import ScaledCurvePlan, plan_com_trajectory
from icub_jump_env.robot.kinematics import FeetFixedKinematics

DT = 0.005
PLAN = ScaledCurvePlan(plan_com_trajectory(0.04), ROBOT, STANCE)
NOTHING = np.zeros(N_AXES)
WEIGHT = 324.0
PITCH, ROLL = (
    [ROBOT.joint_names.index(f"{side}_ankle_{axis}") for side in "lr"]
    for axis in ("pitch", "roll")
)


class Stander:
    """A believed robot that stands in its landing posture, CoM over the middle of its soles."""

    def __init__(self):
        self.kinematics = FeetFixedKinematics(ROBOT)
        estimator = FeetFixedEstimator(self.kinematics)
        readings = Readings({"n": N}, joint_position=ROBOT.landing)
        self.state = copy.deepcopy(estimator.estimate(readings))
        self.state.foot_force = np.full(2, WEIGHT / 2)
        self.middle = self.state.sole_position.mean(axis=0)
        self.state.com[:2] = self.middle[:2]
        self.height = self.state.com[2]

    def catching(self):
        return Catching.of(self.kinematics, DT)

    def balance(self, catching=None, com=NOTHING, away=None):
        catching = self.catching() if catching is None else catching
        catch(
            self.kinematics.block,
            self.state.block,
            np.array(com),
            np.zeros(N) if away is None else away,
            self.kinematics.chest_up(),
            catching.block,
        )
        return catching


@pytest.fixture
def stander():
    return Stander()


FROM_ANKLE = ROBOT.sole.center_x
FARTHEST = Catching.of(FeetFixedKinematics(ROBOT), DT).farthest_cop


class TestCatch:
    def test_at_rest_the_cop_is_below_the_com(self, stander):
        balance = stander.balance()
        np.testing.assert_allclose((balance.cop, balance.pull), 0.0, atol=1e-12)
        assert balance.momentum == pytest.approx(0.0, abs=1e-12)
        assert balance.lift == pytest.approx(0.0, abs=1e-12)

    @pytest.mark.parametrize("axis", [0, 1])
    @given(st.floats(-0.02, 0.02), st.floats(-0.05, 0.05))
    def test_the_cop_brings_the_capture_point_back_at_the_gain_asked_for(self, axis, x, v):
        """d xi / dt = omega (xi - p) = -K xi for the linear inverted pendulum."""
        stander = Stander()
        stander.state.com[axis] += x
        stander.state.com_velocity[axis] = v
        gain = (catching.CAPTURE_GAIN, catching.LATERAL_CAPTURE_GAIN)[axis]
        omega = math.sqrt(9.81 / stander.height)
        point = x + v / omega
        balance = stander.balance()
        cop = balance.cop[axis]
        if abs(cop) < FARTHEST[axis]:
            assert omega * (point - cop) == pytest.approx(-gain * point, abs=1e-9)
        else:
            assert cop == pytest.approx(math.copysign(FARTHEST[axis], point))
        assert balance.cop[1 - axis] == pytest.approx(0.0, abs=1e-12)

    @pytest.mark.parametrize("axis", [0, 1])
    def test_the_pull_accelerates_the_com_as_the_pendulum_does(self, stander, axis):
        """m a = F for a = omega^2 (x - p), per normal force m g."""
        stander.state.com[axis] += 0.005
        balance = stander.balance()
        omega = math.sqrt(9.81 / stander.height)
        assert 9.81 * balance.pull[axis] == pytest.approx(omega**2 * (0.005 - balance.cop[axis]))
        assert balance.pull[axis] < 0.0

    def test_a_turned_robot_is_caught_along_its_own_feet(self, stander):
        turn = pin.exp3(np.array([0.0, 0.0, 0.6]))
        stander.state.com[0] += 0.01
        stander.state.com_velocity[:] = [0.02, 0.01, 0.0]
        stander.state.angular_momentum[:] = [0.3, 0.2, 0.0]
        before = stander.balance()
        state = stander.state
        state.base_rotation = turn @ state.base_rotation
        for vector in (state.com, state.com_velocity, state.angular_momentum):
            vector[:] = turn @ vector
        state.sole_position = state.sole_position @ turn.T
        after = stander.balance()
        for field in ("cop", "pull", "momentum", "lift"):
            np.testing.assert_allclose(getattr(after, field), getattr(before, field), atol=1e-9)

    def test_on_a_slope_the_com_is_above_the_soles_along_gravity(self, stander):
        angle = 0.05  # uphill in +x: gravity pulls towards -x of the floor's frame
        stander.state.gravity = np.array([-math.sin(angle), 0.0, -math.cos(angle)])
        stander.state.com[0] += stander.height * math.tan(angle)
        np.testing.assert_allclose(stander.balance().cop, 0.0, atol=1e-12)

    def test_momentum_counts_as_speed_unless_it_is_the_lunge(self, stander):
        stander.state.angular_momentum[1] = 0.4
        forward = stander.balance().cop[0]
        stander.state.angular_momentum[1] = 0.0
        mass = stander.kinematics.mass
        stander.state.com_velocity[0] = catching.MOMENTUM_SHARE * 0.4 / (mass * stander.height)
        assert stander.balance().cop[0] == pytest.approx(forward)
        assert forward > 0.0
        lunging = stander.catching()
        lunging.rate = 2.0
        stander.state.com_velocity[0] = 0.0
        stander.state.angular_momentum[1] = 2.0 * lunge_momentum(ROBOT)
        cop = stander.balance(lunging).cop[0]
        # What is left is the lunge's own deceleration.
        omega = math.sqrt(9.81 / stander.height)
        slowing = (lunging.rate - 2.0) / DT
        assert slowing < 0.0
        assert cop == pytest.approx(
            -lunge_momentum(ROBOT) / (mass * stander.height * omega**2) * slowing
        )

    @pytest.mark.parametrize("direction", [1.0, -1.0])
    def test_a_lunge_helps_where_the_cop_is_not_enough(self, stander, direction):
        """Pitching forward, the body pushes the CoM backward; and no further than allowed."""
        stander.state.com[0] += direction * 0.09
        kept, lunge, rates = stander.catching(), 0.0, []
        per_joint = np.zeros(N)
        J = stander.kinematics.J_momentum[1]
        for _ in range(200):
            # A displacement with the momentum of the lunge so far.
            per_joint[12] = lunge * lunge_momentum(ROBOT) / J[12]
            balance = stander.balance(kept, away=per_joint)
            rates.append(balance.momentum / lunge_momentum(ROBOT))
            lunge += DT * rates[-1]
        assert rates[5] * direction > 0.5
        assert max(np.abs(rates)) <= catching.FASTEST_LUNGE + 1e-9
        assert 0.3 < direction * lunge <= catching.FARTHEST_LUNGE + 0.03
        assert abs(rates[-1]) < 0.3

    def test_a_chest_that_leans_far_does_not_lunge_on(self, stander):
        stander.state.com[0] += 0.09
        lean = math.radians(40.0)
        stander.state.base_rotation = (
            pin.exp3(np.array([0, lean, 0])) @ stander.state.base_rotation
        )
        assert stander.balance().momentum == 0.0

    def test_a_lunge_is_taken_back_as_far_as_the_cop_bears_it(self, stander):
        away = np.zeros(N)
        away[12] = 0.3 * lunge_momentum(ROBOT) / stander.kinematics.J_momentum[1, 12]
        assert stander.balance(away=away).momentum < 0.0
        stander.state.com[0] += 0.06  # the CoP is at its bound: a return would push forward
        assert stander.balance(away=away).momentum >= 0.0

    @pytest.mark.parametrize("way", [-1.0, 1.0])
    def test_sideways_the_loads_shift_where_the_soles_are_too_narrow(self, stander, way):
        """A CoM too far left wants load on the left: the right sole gives way, upwards."""
        y = 0.02 * way
        stander.state.com[1] += y
        omega = math.sqrt(9.81 / stander.height)
        shift = y * (1.0 + catching.LATERAL_CAPTURE_GAIN / omega) - FARTHEST[1] * way
        assert shift * way > 0.0
        balance = stander.balance()
        wanted = WEIGHT * shift / stander.state.sole_position[0, 1]
        assert balance.lift == pytest.approx(catching.LOAD_GAIN * wanted)
        pull = (y - FARTHEST[1] * way - shift) / stander.height
        assert balance.pull[1] == pytest.approx(pull)

    def test_a_foot_without_load_reaches_for_the_ground(self, stander):
        stander.state.foot_force = np.array([600.0, 0.0])
        assert stander.balance().lift == pytest.approx(-600.0 * catching.LOAD_GAIN)
        stander.state.foot_force = np.array([0.0, 1e5])
        assert stander.balance().lift == pytest.approx(catching.FASTEST_LIFT)

    def test_the_residual_moves_where_the_com_shall_be(self, stander):
        stander.state.com[:2] += [0.02, -0.01]
        balance = stander.balance(com=[0.02, -0.01, 0.0])
        np.testing.assert_allclose(balance.cop, [0.02, -0.01])
        assert balance.lift == pytest.approx(0.0, abs=1e-12)

    @pytest.mark.parametrize("way", [-1.0, 1.0])
    def test_the_cop_stays_within_the_soles_wherever_the_com_shall_be(self, stander, way):
        """Even where a residual asks for a CoM over the toes, and the capture point is beyond."""
        stander.state.com[:2] += [0.12 * way, 0.12 * way]
        balance = stander.balance(com=[0.06 * way, 0.06 * way, 0.0])
        np.testing.assert_allclose(balance.cop, FARTHEST * way)
        more = WEIGHT * catching.FARTHEST_SHIFT / stander.state.sole_position[0, 1]
        assert balance.lift == pytest.approx(catching.LOAD_GAIN * more * way)

    def test_the_next_landing_forgets(self, stander):
        used = stander.catching()
        stander.state.com[0] += 0.09
        for _ in range(5):
            stander.balance(used)
        stander.state.com[0] -= 0.09
        used.rate = 0.0
        stander.balance(used)
        assert used.block.tobytes() == stander.balance().block.tobytes()

    def test_a_lunge_moves_neither_com_nor_feet(self, stander):
        """The smallest such motion with pitch momentum alone, by its optimality conditions."""
        kinematics = stander.kinematics
        ease = ROBOT.per_joint("ease", (1.0, 1.0, 0.5)) ** 2
        constraints = np.vstack((kinematics.J_feet, kinematics.centroidal_map))
        wanted = np.eye(12)[10]
        multipliers = np.linalg.lstsq(constraints * ease @ constraints.T, wanted, rcond=1e-12)[0]
        lunge = ease * (constraints.T @ multipliers)
        np.testing.assert_allclose(constraints @ lunge, wanted, atol=1e-8)
        fastest = np.abs(lunge[: ROBOT.arms.start]).max()
        assert lunge_momentum(ROBOT) == pytest.approx(1.0 / fastest, rel=1e-6)


class Falling:
    """A flight that ends at once."""

    def __init__(self, command=None, yielding=0.0):
        self.command = JointCommand() if command is None else command
        self.yielding = yielding
        self.went_on = []

    def go_on(self, time, residual_target):
        self.went_on.append(time)
        return Tick(self.command, None)


class Lander:
    """A landing on a robot whose joints follow the commands at once and whose base stands."""

    def __init__(self, yielding=0.0):
        self.stander = Stander()
        self.flight = Falling(JointCommand(np.zeros(N), ROBOT.landing + 0.001), yielding)
        self.residual = ResidualFilter(15.0)
        self.landing = FeedbackLanding(
            self.flight, self.residual, DT, self.stander.kinematics, "daqp"
        )
        self.landing.start(self.stander.state, PLAN, 2.0)

    def tick(self, time, target=NOTHING):
        return self.landing.tick(self.stander.state, 2.0 + time, target)

    def follow(self, duration, target=NOTHING):
        """Heights of the CoM over the feet, ankles as the others have them."""
        heights = []
        for k in range(round(duration / DT)):
            tick = self.tick(k * DT, target)
            assert not tick.report.failed
            s = self.stander.state.joint_position
            moved = np.where(np.isnan(tick.command.torque), tick.command.position, s)
            moved[PITCH] += DT * self.landing._terms.previous[PITCH]
            moved[ROLL] += DT * self.landing._terms.previous[ROLL]
            self.stander.state.joint_position = moved
            self.stander.kinematics.update(moved)
            heights.append(float(self.stander.kinematics.com[2]))
        return np.array(heights)


class TestFeedbackLanding:
    def test_ankles_are_torque_controlled_and_carry_the_cop(self):
        lander = Lander()
        lander.stander.state.foot_force = np.array([200.0, 100.0])
        lander.stander.state.com[0] += landing.STAND_AHEAD
        command = lander.tick(0.0).command
        driven = ~np.isnan(command.torque)
        assert sorted(np.flatnonzero(driven)) == sorted(PITCH + ROLL)
        np.testing.assert_allclose(
            command.torque[PITCH],
            np.array([200.0, 100.0]) * (FROM_ANKLE + landing.STAND_AHEAD),
            atol=0.7,
        )
        np.testing.assert_allclose(command.torque[ROLL], 0.0, atol=0.7)

    def test_ankles_are_damped_around_what_the_qp_asked_for(self):
        lander = Lander()
        still = lander.tick(0.0).command.torque
        lander = Lander()
        lander.stander.state.joint_velocity[PITCH[0]] = 1.0
        moving = lander.tick(0.0).command.torque
        assert moving[PITCH[0]] - still[PITCH[0]] == pytest.approx(-landing.ANKLE_DAMPING)
        assert moving[PITCH[1]] == pytest.approx(still[PITCH[1]])

    def test_the_switch_is_continuous(self):
        """The first position is that of the flight's last command, moved by one tick."""
        lander = Lander(yielding=0.8)
        command = lander.tick(0.0).command
        servoed = np.isnan(command.torque)
        step = np.abs(command.position - lander.flight.command.position)[servoed]
        assert step.max() < DT * 1.1 * np.abs(command.velocity).max() + 1e-3

    def test_the_com_goes_on_sinking_is_braked_and_rises_again(self):
        heights = Lander(yielding=0.6).follow(1.2)
        first = (heights[2] - heights[1]) / DT
        assert first == pytest.approx(-0.6, abs=0.15)
        depth = heights[0] - heights.min()
        assert depth == pytest.approx(0.06, abs=0.01)
        assert heights.argmin() * DT == pytest.approx(0.2, abs=0.08)
        assert heights[-1] == pytest.approx(0.475, abs=0.004)
        assert np.abs(np.diff(heights, 2)).max() / DT**2 < 60.0

    def test_it_does_not_sink_below_the_crouch(self):
        lander = Lander(yielding=1.0)
        lander.landing._touch_height = landing.LOWEST + 0.01
        lander.stander.kinematics.com[2] = landing.LOWEST + 0.01
        lander.landing.start(lander.stander.state, PLAN, 2.0)
        assert lander.landing._depth == pytest.approx(0.01)

    def test_legs_that_did_not_give_way_do_not_begin_to(self):
        heights = Lander().follow(0.6)
        assert np.abs(heights - heights[0]).max() < 0.004

    def test_a_residual_moves_the_com_that_it_stands_over(self):
        lander = Lander()
        for k in range(200):
            lander.tick(k * DT, np.array([0.02, 0.0, 0.01, 0.0, 0.0]))
        np.testing.assert_allclose(
            lander.landing.setpoint.com_position[:2], [landing.STAND_AHEAD + 0.02, 0.0], atol=1e-5
        )
        height = lander.landing.setpoint.com_position[2]
        assert height == pytest.approx(lander.landing._stand_height + 0.01, abs=1e-5)

    def test_the_filter_keeps_its_state_through_touch_down(self):
        lander = Lander()
        lander.residual.step(np.array([0.02, 0.0, 0.0, 0.0, 0.0]), 0.1)
        offset = lander.residual.offset.copy()
        lander.landing.start(lander.stander.state, PLAN, 2.0)
        np.testing.assert_array_equal(lander.residual.offset, offset)

    def test_commands_stay_within_the_limits(self):
        lander = Lander(yielding=1.0)
        lander.stander.state.com[0] += 0.1
        lander.stander.state.com_velocity[0] = 1.0
        for k in range(300):
            command = lander.tick(k * DT).command
            assert (np.abs(command.velocity) <= ROBOT.velocity_limit).all()
            assert (command.position >= ROBOT.lower_position).all()
            assert (command.position <= ROBOT.upper_position).all()

    def test_a_qp_without_a_solution_slows_down_and_is_told(self):
        lander = Lander(yielding=0.8)
        before = lander.tick(0.0).command.velocity
        lander.stander.kinematics.J_com[0, 3] = np.nan
        tick = lander.tick(DT)
        assert tick.report.failed
        np.testing.assert_allclose(tick.command.velocity, 0.8 * before)


def test_holding_lets_the_flight_go_on():
    flight = Falling(JointCommand(np.ones(N)))
    hold = HoldLanding(flight)
    hold.start(None, PLAN, 1.0)
    assert hold.tick(None, 1.25, NOTHING).command is flight.command
    assert flight.went_on == [1.25]
