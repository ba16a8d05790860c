"""The equations of the paper's controllers, one function each, and how costs become a QP."""
