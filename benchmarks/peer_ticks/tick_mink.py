"""Mink: CoM, both soles and posture as weighted tasks, joint limits; DAQP."""

import sys
import warnings

import mink
import mujoco
import numpy as np
from common import Launch, serve

warnings.filterwarnings("ignore")  # of states at their limits, at each tick
launch = Launch(sys.argv[1], "velocity")
spec = mujoco.MjSpec.from_file(launch.urdf)
spec.compiler.fusestatic = False
spec.body("root_link").add_freejoint()
model = spec.compile()
where = [int(model.joint(name).qposadr[0]) for name in launch.joints]
states = np.zeros((len(launch.q), model.nq))
states[:, :3], states[:, 3], states[:, 4:7] = launch.q[:, :3], launch.q[:, 6], launch.q[:, 3:6]
states[:, where] = launch.q[:, 7:]
configuration = mink.Configuration(model)
configuration.update(states[0])
com = mink.ComTask(cost=200.0)
soles = [
    mink.FrameTask(name, "body", position_cost=100.0, orientation_cost=100.0)
    for name in ("l_sole", "r_sole")
]
posture = mink.PostureTask(model, cost=0.1)
posture.set_target_from_configuration(configuration)
tasks = [com, *soles, posture]
limits = [
    mink.ConfigurationLimit(model),
    mink.VelocityLimit(model, dict.fromkeys(launch.joints, 7.64)),
]


def tick(state: int) -> object:
    """As mink's examples: update, set targets, solve."""
    configuration.update(states[state])
    for task in (com, *soles):
        task.set_target_from_configuration(configuration)
    com.set_target(com.target_com + launch.com_velocity[state] * launch.dt)
    return mink.solve_ik(configuration, tasks, launch.dt, "daqp", damping=1e-6, limits=limits)


serve({"mink": (launch, tick)})
