"""CoM reference: scaled trajectory (section III-A) and learned residual."""
