"""prototype"""
from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from icub_jump_env.control.catching import Catch
from icub_jump_env.control.command import JointCommand
from icub_jump_env.control.config import ContactConfig
from icub_jump_env.control.landing import FeedbackLanding
from icub_jump_env.control.phases import Phase, Tick
from icub_jump_env.control.tasks.com import ComAcceleration
from icub_jump_env.control.tasks.contact import ContactLimits, SmallWrenches
from icub_jump_env.control.tasks.feet import FeetAcceleration
from icub_jump_env.control.tasks.limits import AccelerationLimits, TorqueLimits
from icub_jump_env.control.tasks.momentum import MomentumRate
from icub_jump_env.control.tasks.motion import BaseMotion
from icub_jump_env.control.tasks.posture import PostureAcceleration
from icub_jump_env.control.tasks.smoothness import TorqueSmoothness
from icub_jump_env.control.tasks.stack import TaskQP
from icub_jump_env.robot.dynamics import FeetFixedDynamics, GRAVITY
from icub_jump_env.robot.frames import heading
from icub_jump_env.robot.icub import GRAVITY as G

Array = NDArray[np.float64]


@dataclass
class P:
    capture: float = 6.0
    lat: float = 4.0
    kz: float = 60.0
    dz: float = 14.0
    amax: float = 8.0
    com_w: float = 1e3
    mom_k: float = 8.0
    mom_w: float = 10.0
    mshare: float = 0.5
    pk: float = 5.0
    pd: float = 4.5
    pw: tuple = (1.0, 1.0, 0.3)
    feet_k: float = 30.0
    feet_w: float = 1000.0
    feet_hard: bool = False
    wr: float = 1e-3
    smooth: float = 1e-3
    mu: float = 0.4
    cop_margin: float = 0.003
    fmin: float = 5.0
    speed_h: float = 0.02
    lim_h: float = 0.06
    damp: float = 2.0
    leak: float = 20.0
    lift: float = 1.0
    mode: str = "torque"
    lead: float = 0.0
    lunge: float = 1.0
    slew: float = 30.0
    bridge: float = 0.04
    side: float = 0.0
    tors: float = 0.02
    lat_h: float = 1.0
    consistent: bool = True
    ankle: str = "qp"
    servo_ff: float = 1.0
    limp: float = 0.0


class SolesDamped(FeetAcceleration):
    speed = 0.0

    def __init__(self, kinematics, dynamics, gain, weight):
        super().__init__(kinematics, dynamics)
        self._gain, self.weight = gain, weight
        self.scale = 1.0

    def write(self, state, setpoint, rows, target):
        super().write(state, setpoint, rows, target)
        k = self._kinematics
        rel = k.J_feet @ state.joint_velocity
        rel[:3] += k.base_rotation[2] * self.speed
        target -= self._gain * rel
        rows *= self.scale
        target *= self.scale


class WrenchLanding(FeedbackLanding):
    def __init__(self, flight, residual, dt, kinematics, solver, p=None):
        super().__init__(flight, residual, dt, kinematics, solver)
        p = self.p = p or P()
        robot = kinematics.robot
        n = robot.n_joints
        self._dynamics = dyn = FeetFixedDynamics(kinematics)
        s = robot.sole
        m = p.cop_margin
        small = dataclasses.replace(
            robot, sole=dataclasses.replace(s, x_min=s.x_min + m, x_max=s.x_max - m, half_width=s.half_width - m - p.side)
        )
        contact = ContactConfig(friction=p.mu, minimum_force=p.fmin, torsional_friction=p.tors)
        self._torque = np.zeros(n)
        self._rate = np.zeros(n)
        self._damped = SolesDamped(kinematics, dyn, p.feet_k, p.feet_w)
        soft = [
            TorqueSmoothness(dyn, robot.per_joint("x", (p.smooth,) * 3), self._torque),
            ComAcceleration(dyn, 0.0, 0.0, p.com_w),
            MomentumRate(dyn, p.mom_k, p.mom_w),
        ]
        hard = [BaseMotion(dyn)]
        (hard if p.feet_hard else soft).append(self._damped)
        self._wqp = TaskQP(
            n + 12,
            costs=[
                PostureAcceleration(p.pk, p.pd, robot.per_joint("x", p.pw), n + 12),
                SmallWrenches(p.wr, n),
            ],
            soft=soft,
            hard=hard,
            limits=[
                AccelerationLimits(robot, p.speed_h, p.lim_h),
                TorqueLimits(dyn, robot),
                ContactLimits(contact, small),
            ],
            solver=solver,
        )
        self.x = np.zeros(n + 12)
        self.fails = self.ticks = 0
        self.log = []

    def start(self, state, plan, time):
        super().start(state, plan, time)
        self._torque[:] = 0.0
        self._rate[:] = state.joint_velocity
        self._last_momentum = 0.0
        self._fresh = True

    def tick(self, state, time, residual_target):
        p, k, sp, dt = self.p, self._kinematics, self.setpoint, self._dt
        if time - self._began < p.bridge:
            out = super().tick(state, time, residual_target)
            self._last_momentum = float(sp.angular_momentum[1])
            self._rate[:] = self._velocity
            return out
        self._residual.step(residual_target, dt)
        offset = self._residual.offset
        forward, height, rise = self._stand_at(time)
        g = state.gravity
        k.base_rotation[:] = pin.exp3(np.cross(g, [0.0, 0.0, -1.0])) @ state.base_rotation
        s, sd = state.joint_position, state.joint_velocity
        if p.lead:
            pass
        self._dynamics.update(s, sd)
        sp.com_position[:] = forward + offset[0], offset[1], height + offset[2]
        away = s - sp.posture
        away[self._ankles] = 0.0
        balance = self._catch.update(state, sp.com_position, away)
        sp.posture[self._ankles] = s[self._ankles] + sd[self._ankles] * 0.0
        goal = p.lunge * balance.pitch_momentum
        hrate = float(np.clip((goal - self._last_momentum) / dt, -p.slew, p.slew))
        self._last_momentum += hrate * dt
        sp.angular_momentum[1] = self._last_momentum
        sp.angular_momentum_rate[1] = hrate
        sp.com_acceleration[:] = self._com_acceleration(state, sp.com_position, balance, height, rise, time)
        sp.com_acceleration += GRAVITY - G * g
        self._damped.speed = p.lift * balance.lift
        if self._fresh:
            self._fresh = False
            self._wqp.pose(state, sp)
        solution, report = self._wqp.solve(state, sp)
        dyn = self._dynamics
        self.ticks += 1
        n = len(s)
        if report.failed:
            self.fails += 1
            self._torque *= 0.9
            acc = np.zeros(n)
        else:
            self.x[:] = solution.x
            acc = solution.x[:n]
            self._torque[:] = dyn.torque_rows @ solution.x + dyn.torque_bias
        rate = self._rate
        rate += dt * (acc + p.leak * (sd - rate))
        if p.mode == "torque":
            torque = self._torque + p.damp * (rate - sd)
            return Tick(JointCommand(torque=torque), report)
        # servo: positions integrated from accelerations, the torque as an offset of them
        robot = self._robot
        position = self._position
        position += dt * (rate + np.clip(s - position, -0.3, 0.3) * self.p.leak)
        position[self._ankles] = s[self._ankles]
        np.clip(position, self._lower, self._upper, out=position)
        torque = self._servoed.copy()
        a = self._ankles
        torque[a] = self._torque[a] + p.damp * (rate - sd)[a]
        return Tick(JointCommand(rate.copy(), position + p.servo_ff * self._torque / 1500.0, torque), report)

    def _com_acceleration(self, state, com, balance, height, rise, time):
        p, mass = self.p, self._kinematics.mass
        cos, sin = heading(state.base_rotation)
        x, y, z = (state.com - state.sole_position.mean(axis=0)).tolist()
        g = state.gravity
        h = max(0.2, z)
        w = math.sqrt(G / h)
        x, y = x - z * g[0] / g[2], y - z * g[1] / g[2]
        v, H = state.com_velocity, state.angular_momentum
        lever = p.mshare / (mass * h)
        ahead, left = cos * x + sin * y, cos * y - sin * x
        f, l = cos * com[0] + sin * com[1], cos * com[1] - sin * com[0]
        va = cos * v[0] + sin * v[1] + lever * (cos * H[1] - sin * H[0] - balance.pitch_momentum)
        vl = cos * v[1] - sin * v[0] - lever * (cos * H[0] + sin * H[1])
        pa = (ahead - f + va / w) * (1 + p.capture / w) + f
        pl = (left - l + vl / w) * (1 + p.lat / w) + l
        aa = float(np.clip(w * w * (ahead - pa), -p.amax, p.amax))
        if p.consistent:
            cop = balance.cop - self._robot.sole.center_x
            aa = w * w * (ahead - cop) - float(self.setpoint.angular_momentum_rate[1]) / (mass * h)
            self.cmd_cop = cop
        pl = l + float(np.clip(pl - l, -0.06, 0.06))
        al = w * w * (left - pl)
        az = p.kz * (height - self._kin_height()) + p.dz * (rise - v[2]) + self._rise_rate(time)
        return np.array([cos * aa - sin * al, sin * aa + cos * al, az])

    def _kin_height(self):
        return float(self._kinematics.com[2])

    def _rise_rate(self, time):
        since = time - self._began
        e = 1e-3
        return (self._height(since + e)[1] - self._height(since)[1]) / e


def install(env: Any, p: P | None = None) -> WrenchLanding:
    c = env._controller
    old = c._landing
    new = WrenchLanding(old._flight, old._residual, old._dt, old._kinematics, env.config.controller_config.solver, p)
    c._landing = new
    c._controllers[Phase.LANDING] = new
    return new
