"""What episodes say together, against each other, and against the paper."""
