"""From joint commands to joint torques: servo or torque loop, motor, friction."""
