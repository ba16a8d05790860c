"""The short jump, the clock, the screen and the requests that tests of the live view use."""

import urllib.error
import urllib.parse
import urllib.request

from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.modes.view import FRAME

PATIENCE = 120.0
"""Longest wait (s) for a page or a program."""

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


def get(address, *files, headers=()):
    """Status and content of a page, or of files that it asks for with its cookie.

    Browsers take its name for this machine; not every resolver does.
    """
    url = urllib.parse.urlsplit(address)
    here = url._replace(netloc=f"127.0.0.1:{url.port}").geturl()
    headers = {"Host": url.netloc} | dict(headers)
    cookies = urllib.request.HTTPCookieProcessor()
    opener = urllib.request.build_opener(cookies)
    answers = []
    for place in (here, *(urllib.parse.urljoin(here, file) for file in files)):
        request = urllib.request.Request(place, headers=headers)
        try:
            with opener.open(request, timeout=PATIENCE) as answer:
                answers.append((answer.status, answer.read()))
        except urllib.error.HTTPError as refusal:
            with refusal:
                answers.append((refusal.status, refusal.read()))
    return answers if files else answers[0]
