"""What eval.py can do, a module each."""
