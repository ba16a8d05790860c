"""Randomisation: the ranges, the draws, and what they do to the model."""

import dataclasses
import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError
from icub_jump_env.evaluation.episodes.rollout import make_env
from icub_jump_env.robot import icub
from icub_jump_env.robot.robot import load_robot
from icub_jump_env.simulation.disturbances import ground_rotation
from icub_jump_env.simulation.physics import Physics
from icub_jump_env.simulation.randomization import (
    RANDOMIZATIONS,
    Randomization,
    draw_disturbances,
    draw_world,
)
from icub_jump_env.simulation.variation import ModelVariation

ROBOT = load_robot()

FIELDS = [field.name for field in dataclasses.fields(Randomization)]
LINKS = 40
seeds = st.integers(0, 2**31)

DISTURBED = dataclasses.replace(
    RANDOMIZATIONS["hard"],
    lateral_slope=(-0.1, 0.1), push_direction=(-3.0, 3.0), takeoff_spin=(-5.0, 1.0),
    flight_push=(2.0, 6.0), flight_push_time=(0.0, 0.1), flight_push_direction=(-1.0, 0.0),
    floor_tilt=(-0.05, 0.1), floor_tilt_lateral=(0.02, 0.03), step=(0.0, 0.02),
    edge=(-0.03, 0.01), landing_push=(-20.0, 3.0), landing_push_time=(0.0, 2.0),
    landing_push_direction=(-2.0, 2.0),
)  # fmt: skip
"""Every range is wide."""


def draw(ranges, seed):
    world = draw_world(ranges, ROBOT, LINKS, np.random.default_rng(seed))
    return draw_disturbances(ranges, world, seed)


class TestRanges:
    def test_full_is_what_the_documents_say(self):
        full = RANDOMIZATIONS["full"]
        assert full.link_mass == (0.95, 1.05)
        assert full.payload_mass == (-0.5, 1.0)
        assert full.payload_offset == (0.0, 0.01)
        assert full.friction == (0.4, 1.0)
        assert full.strength == (0.85, 1.0)
        assert full.delay == (0, 2)
        assert full.joint_gain == (0.95, 1.05)
        assert full.damping == (0.5, 3.0)
        assert full.slope == full.encoder_bias == full.push == (0, 0)

    def test_hard_is_full_with_slope_bias_and_push(self):
        hard, full = RANDOMIZATIONS["hard"], RANDOMIZATIONS["full"]
        changed = {name for name in FIELDS if getattr(hard, name) != getattr(full, name)}
        assert changed == {"slope", "encoder_bias", "push"}
        np.testing.assert_allclose(np.degrees(hard.slope), [-1.5, 1.5])
        np.testing.assert_allclose(np.degrees(hard.encoder_bias), [-1.0, 1.0])
        assert hard.push == (-2.0, 2.0)

    def test_disturbed_is_hard_with_three_times_as_much_of_these(self):
        disturbed, hard = RANDOMIZATIONS["disturbed"], RANDOMIZATIONS["hard"]
        for name in FIELDS:
            factor = 3 if name in ("slope", "encoder_bias", "push") else 1
            np.testing.assert_allclose(
                getattr(disturbed, name), factor * np.array(getattr(hard, name))
            )

    def test_mild_reaches_half_as_far(self):
        none, mild, full = (RANDOMIZATIONS[name] for name in ("none", "mild", "full"))
        for name in FIELDS:
            ours, wide = np.array(getattr(mild, name)), np.array(getattr(full, name))
            np.testing.assert_allclose(
                ours - getattr(none, name)[0], (wide - getattr(none, name)[0]) / 2
            )

    def test_none_does_not_vary(self):
        assert not RANDOMIZATIONS["none"].varies
        assert all(RANDOMIZATIONS[name].varies for name in ("mild", "full", "hard"))

    @pytest.mark.parametrize(
        ("field", "value"),
        [
            ("friction", (0.0, 1.0)), ("friction", (1.0, 0.4)), ("friction", 0.5),
            ("strength", (0.5, 1.2)), ("delay", (0, 1.5)), ("delay", (-1, 2)),
            ("slope", (-1.5, 1.5)), ("push", (0.0, math.nan)), ("link_mass", "heavy"),
            ("step", (-0.01, 0.0)), ("edge", (0.0, 0.06)), ("floor_tilt", (0.3, 0.0)),
            ("floor_tilt_lateral", (0, 0.3)), ("lateral_slope", (-0.3, 0)),
            ("takeoff_spin", (0, 6)), ("flight_push", (0, 21)), ("flight_push_time", (-1, 0)),
            ("landing_push", 2.0), ("landing_push_time", (0, 5.1)), ("push_direction", (0, 4)),
            ("flight_push_direction", (0, 4)), ("landing_push_direction", (0, 4)),
        ],
    )  # fmt: skip
    def test_bad_ranges_are_refused(self, field, value):
        with pytest.raises(ConfigError) as refusal:
            Randomization(**{field: value})
        assert refusal.value.field == field

    @pytest.mark.parametrize("edge", [(0.0, 0.03), (-0.03, 0.0)])
    def test_an_edge_on_a_step_is_no_higher_than_either_may_be(self, edge):
        assert Randomization(step=(0.0, 0.02), edge=edge).blocks
        with pytest.raises(
            ConfigError, match=r"within \+/- 0.02 m on a step of 0.03 m"
        ) as refusal:
            Randomization(step=(0.0, 0.03), edge=edge)
        assert refusal.value.field == "edge"


class TestDraws:
    @given(seeds)
    def test_draws_stay_in_their_ranges(self, seed):
        ranges = DISTURBED
        world = draw(ranges, seed)
        for name in FIELDS:
            drawn = np.asarray(getattr(world, name))
            if name == "payload_offset":
                drawn = np.linalg.norm(drawn)
            if name == "encoder_bias":
                drawn = drawn[ROBOT.leg_pitch_joints]
            low, high = getattr(ranges, name)
            assert (drawn >= low).all()
            assert (drawn <= high).all()
        assert isinstance(world.delay, int)
        assert 0.0 <= world.push_time < 1.0
        unbiased = np.delete(world.encoder_bias, ROBOT.leg_pitch_joints)
        assert not unbiased.any()

    @given(seeds, st.sampled_from(FIELDS))
    def test_each_can_be_set_alone_and_draws_the_same_as_in_company(self, seed, name):
        alone = draw(Randomization(**{name: getattr(DISTURBED, name)}), seed)
        together, nominal = draw(DISTURBED, seed), draw(Randomization(), seed)
        for field in FIELDS:
            expected = together if field == name else nominal
            np.testing.assert_array_equal(getattr(alone, field), getattr(expected, field))

    def test_each_takes_the_same_share_of_any_range(self):
        """Also of a narrower one; no two draws are the same share."""
        shares = []
        for name in FIELDS[FIELDS.index("push") :]:
            low, high = getattr(DISTURBED, name)
            narrow = dataclasses.replace(DISTURBED, **{name: (low, (low + high) / 2)})
            drawn = getattr(draw(DISTURBED, 5), name) - low
            assert getattr(draw(narrow, 5), name) - low == pytest.approx(drawn / 2)
            shares.append(round(drawn / (high - low), 6))
        assert len(set(shares)) == len(shares)

    def test_disturbances_leave_the_other_draws_alone(self):
        """They come from the seed that the sensors have, but from a stream of their own."""
        states = []
        for ranges in (RANDOMIZATIONS["hard"], DISTURBED):
            env = make_env(JumpConfig.of(randomization=ranges, sensors="realistic"))
            _, info = env.reset(seed=3)
            old = [info["world"][name] for name in FIELDS[: FIELDS.index("lateral_slope")]]
            states.append((old, info["sensor_errors"], env.np_random.bit_generator.state))
        assert states[0] == states[1]

    def test_without_ranges_the_world_is_nominal(self):
        world = draw(Randomization(), 3)
        for values in (world.link_mass, world.strength, world.joint_gain, world.damping):
            assert (values == 1.0).all()
        assert world.friction == icub.FEET_FRICTION
        assert world.payload_mass == world.slope == world.push == world.sensor_noise == 0.0
        assert world.delay == 0
        assert not world.payload_offset.any()
        assert not world.encoder_bias.any()

    def test_biased_joints_are_the_leg_pitch_joints(self):
        world = draw(RANDOMIZATIONS["hard"], 0)
        biased = [ROBOT.joint_names[joint] for joint in np.flatnonzero(world.encoder_bias)]
        assert biased == [
            "l_hip_pitch", "l_knee", "l_ankle_pitch", "r_hip_pitch", "r_knee", "r_ankle_pitch",
        ]  # fmt: skip

    def test_delays_are_equally_likely(self):
        delays = [draw(RANDOMIZATIONS["full"], seed).delay for seed in range(600)]
        counts = np.bincount(delays)
        assert len(counts) == 3
        assert counts.min() > 160  # 200 expected, standard deviation 11.5

    def test_the_payload_lies_in_every_direction(self):
        offsets = np.array(
            [draw(RANDOMIZATIONS["full"], seed).payload_offset for seed in range(600)]
        )
        assert (np.abs(offsets.mean(axis=0)) < 0.001).all()
        assert np.ptp(offsets.std(axis=0)) < 0.0006

    def test_as_dict_is_plain_and_complete(self):
        values = draw(RANDOMIZATIONS["hard"], 1).as_dict()
        assert set(FIELDS) < set(values)
        assert json.loads(json.dumps(values))["friction"] == values["friction"]


@pytest.fixture
def physics():
    return Physics(ROBOT, 0.001)


def applied(physics, **changes):
    world = dataclasses.replace(
        draw_world(Randomization(), ROBOT, physics.model.nbody - 1, np.random.default_rng(0)),
        **changes,
    )
    variation = ModelVariation(physics.model, ROBOT)
    variation.apply(world, physics.model)
    return physics.model


POSE = np.concatenate(([0.1, 0.2, 0.7, 1, 0, 0, 0], ROBOT.crouch))


def inertia_about_com(physics):
    physics.reset(POSE)
    xx, yy, zz, xy, xz, yz = physics.data.crb[1][:6]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


class TestModel:
    def test_the_nominal_world_changes_nothing(self, physics):
        before = {
            name: getattr(physics.model, name).copy()
            for name in ("body_mass", "body_inertia", "body_ipos", "dof_damping", "geom_friction",
                         "body_subtreemass", "dof_invweight0")
        }  # fmt: skip
        model = applied(physics)
        for name, values in before.items():
            np.testing.assert_array_equal(getattr(model, name), values, err_msg=name)

    def test_worlds_do_not_add_up(self, physics):
        rng, variation = np.random.default_rng(1), ModelVariation(physics.model, ROBOT)
        worlds = [
            draw_world(RANDOMIZATIONS["hard"], ROBOT, physics.model.nbody - 1, rng) for _ in "ab"
        ]
        variation.apply(worlds[0], physics.model)
        once = physics.model.body_inertia.copy(), physics.model.body_ipos.copy()
        variation.apply(worlds[1], physics.model)
        variation.apply(worlds[0], physics.model)
        np.testing.assert_array_equal(physics.model.body_inertia, once[0])
        np.testing.assert_array_equal(physics.model.body_ipos, once[1])

    def test_link_masses_scale_mass_and_inertia(self, physics):
        mass = physics.model.body_subtreemass[0]
        inertia = inertia_about_com(physics)
        applied(physics, link_mass=np.full(physics.model.nbody - 1, 1.1))
        assert physics.model.body_subtreemass[0] == pytest.approx(1.1 * mass)
        np.testing.assert_allclose(inertia_about_com(physics), 1.1 * inertia, rtol=1e-9)

    @pytest.mark.parametrize("mass", [-0.5, 1.0])
    def test_the_payload_is_a_point_mass(self, physics, mass):
        """Total mass, CoM and inertia against the textbook formula."""
        inertia = inertia_about_com(physics)
        chest = physics.data.body(ROBOT.chest_link)
        offset = np.array([0.005, -0.008, 0.003])
        point = chest.xipos + chest.xmat.reshape(3, 3) @ offset
        old, com = physics.model.body_subtreemass[1], physics.data.subtree_com[1].copy()
        applied(physics, payload_mass=mass, payload_offset=offset)
        new_inertia = inertia_about_com(physics)
        new_com = (old * com + mass * point) / (old + mass)
        assert physics.model.body_subtreemass[1] == pytest.approx(old + mass)
        np.testing.assert_allclose(physics.data.subtree_com[1], new_com, atol=1e-12)

        def steiner(m, d):
            return m * (d @ d * np.eye(3) - np.outer(d, d))

        expected = inertia + steiner(old, com - new_com) + steiner(mass, point - new_com)
        np.testing.assert_allclose(new_inertia, expected, atol=1e-9)

    def test_friction_is_that_of_the_contact(self, physics):
        """MuJoCo takes the larger of the two geoms' frictions."""
        for friction in (0.4, 1.0):
            model = applied(physics, friction=friction)
            physics.reset(np.concatenate(([0, 0, 0.45, 0, 0, 0, 1], ROBOT.crouch)))
            soles = {model.geom(f"{side}_sole_contact").id for side in "lr"}
            for _ in range(300):
                physics.step()
                pairs = [c for c in physics.data.contact if soles & set(c.geom)]
                if pairs:
                    break
            assert pairs
            assert all(c.friction[0] == pytest.approx(friction) for c in pairs)

    def test_a_slope_tilts_gravity_and_keeps_its_size(self, physics):
        model = applied(physics, slope=math.radians(1.5))
        assert np.linalg.norm(model.opt.gravity) == pytest.approx(icub.GRAVITY)
        # Uphill is forward: a ball would roll backward.
        assert model.opt.gravity[0] == pytest.approx(-icub.GRAVITY * math.sin(math.radians(1.5)))

    def test_slopes_and_tilts_are_the_same_turn(self, physics):
        """Gravity turns with the one, the floor with the other."""
        slope, lateral = 0.05, -0.08
        down = applied(physics, slope=slope, lateral_slope=lateral).opt.gravity / icub.GRAVITY
        np.testing.assert_allclose(
            ground_rotation(slope, lateral).apply(down), [0, 0, -1], atol=1e-12
        )
        assert down[0] == pytest.approx(-math.sin(slope))
        assert math.atan2(down[1], -down[2]) == pytest.approx(-lateral)

    def test_damping_of_the_joints_alone(self, physics):
        nominal = physics.model.dof_damping.copy()
        model = applied(physics, damping=np.full(ROBOT.n_joints, 2.0))
        np.testing.assert_array_equal(model.dof_damping[:6], nominal[:6])
        np.testing.assert_allclose(model.dof_damping[6:], 2 * nominal[6:])
