"""``python -m icub_jump_env`` is ``icub-jump``."""

from icub_jump_env.cli import main

if __name__ == "__main__":
    main()
