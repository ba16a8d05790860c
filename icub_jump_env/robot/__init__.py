"""The robot as a value, its URDF, MuJoCo and Pinocchio models, kinematics of standing."""
