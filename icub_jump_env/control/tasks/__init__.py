"""The equations of the paper's controllers, one class each, and how they become a QP."""
