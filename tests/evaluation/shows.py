"""The short jump, the clock and the screen that tests of the live view use."""

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.modes.view import FRAME

SHORT = JumpConfig.of(stand_time=0.1)


class Clock:
    """Stands still except while somebody sleeps."""

    def __init__(self):
        self.time = 100.0

    def __call__(self):
        return self.time

    def sleep(self, duration):
        assert 0.0 < duration <= FRAME
        self.time += duration


class ScriptedScreen:
    """Remembers what it is given; ``script`` maps what was shown so far to commands."""

    def __init__(self, script):
        self.script = script
        self.instants = []
        self.captions = []
        self.closed = False

    def show(self, data):
        self.instants.append(data.time)

    def refresh(self, caption):
        self.captions.append(caption)
        return self.script(self)

    def close(self):
        self.closed = True
