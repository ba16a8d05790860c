"""Pink: CoM, both soles and posture as weighted tasks, joint limits; DAQP."""

import sys
import warnings

import pink
import pinocchio as pin
from common import Launch, serve
from pink.tasks import ComTask, FrameTask, PostureTask

warnings.filterwarnings("ignore")  # of states at their limits, at each tick
launch = Launch(sys.argv[1], "velocity")
model = pin.buildModelFromUrdf(launch.urdf, pin.JointModelFreeFlyer())
configuration = pink.Configuration(model, model.createData(), launch.q[0])
com = ComTask(cost=200.0)
soles = [
    FrameTask(name, position_cost=100.0, orientation_cost=100.0) for name in ("l_sole", "r_sole")
]
posture = PostureTask(cost=0.1)
posture.set_target(launch.q[0])
tasks = [com, *soles, posture]


def tick(state: int) -> object:
    """As pink's examples: update, set targets, solve."""
    configuration.update(launch.q[state])
    for task in (com, *soles):
        task.set_target_from_configuration(configuration)
    com.target_com += launch.com_velocity[state] * launch.dt
    return pink.solve_ik(configuration, tasks, launch.dt, solver="daqp", safety_break=False)


serve({"pink": (launch, tick)})
