"""Who jumps: the baseline or a policy, with the name that tables and logs give it."""

from __future__ import annotations

import functools
import hashlib
import inspect
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from safetensors.numpy import save

from icub_jump_env import policy
from icub_jump_env.config import JumpConfig
from icub_jump_env.errors import ConfigError, ICubJumpError, PolicyMismatchError, printable
from icub_jump_env.evaluation.report.provenance import code
from icub_jump_env.files import strict_json
from icub_jump_env.policy import Policy, PolicyCard, check_match, load_policy
from icub_jump_env.policy.saving import LoadedPolicy, SavedPolicy


@dataclass(frozen=True)
class Contender:
    """A policy and what it is called.

    Attributes:
        name: Its name in tables.
        policy: What acts.
        version: Tells policies written in the same Python file apart: change it with what they hold.
    """

    name: str
    policy: Policy
    version: str = ""

    @property
    def card(self) -> PolicyCard | None:
        """The card of a policy from a file; else None."""
        return self.policy.card if isinstance(self.policy, LoadedPolicy) else None

    @property
    def is_baseline(self) -> bool:
        """Whether it is the pure controller."""
        return type(self.policy) is type(policy.BASELINE)

    @property
    def identity(self) -> dict[str, str | None]:
        """For logs and JSON: name, and a hash.

        It is the hash of the card, in which that of the numbers is; without a card, of the version, of
        the file in which the policy is written, not of what this file imports, and of the numbers of
        a network or a replay.

        Raises:
            ConfigError: If a policy without a card is written in no file.
        """
        if self.is_baseline:
            return {"name": self.name, "sha256": None}
        if self.card is not None:
            known = strict_json(self.card.as_dict())
        else:
            written = self.policy
            while isinstance(written, functools.partial):
                written = written.func
            known = self.version + code(
                "policy", written if inspect.isroutine(written) else type(written)
            )
        if isinstance(self.policy, SavedPolicy):
            known += f"{self.policy} {hashlib.sha256(save(self.policy.tensors())).hexdigest()}"
        return {"name": self.name, "sha256": hashlib.sha256(known.encode()).hexdigest()}


BASELINE = Contender("baseline", policy.BASELINE)


def read_contenders(words: Sequence[str]) -> list[Contender]:
    """The contenders of a command line.

    Args:
        words: The word baseline, and policy files. A file is called by its stem, in
            printable characters; where several would be called the same, by the name of its
            folder as well.

    Raises:
        PolicyFileError: If a file is missing, damaged, or not a policy.
        ConfigError: If two of them are called the same even so.
    """
    called = Counter(Path(word).stem for word in words)
    contenders = []
    for word in words:
        if word == BASELINE.name:
            contenders.append(BASELINE)
            continue
        path = Path(word)
        loaded = load_policy(path)
        alone = called[path.stem] == 1
        name = path.stem if alone else f"{path.absolute().parent.name}-{path.stem}"
        contenders.append(Contender(printable(name), loaded))
    if len({contender.name for contender in contenders}) < len(contenders):
        raise ConfigError("compare", tuple(words), "policies of different names")
    return contenders


def check_contender(contender: Contender, config: JumpConfig) -> None:
    """Refuse a policy that was made for another jump.

    Raises:
        ICubJumpError: If it was; names the policy.
    """
    if contender.card is not None:
        try:
            check_match(contender.card, config)
        except PolicyMismatchError as error:
            raise ICubJumpError(f"{contender.name}: {error}") from error
