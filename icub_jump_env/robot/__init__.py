"""The iCub: facts, URDF, MuJoCo and Pinocchio models, kinematics of standing."""
