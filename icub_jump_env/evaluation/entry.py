"""Options that say what jumps, of the commands that make something of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import tyro

from icub_jump_env.checks import store
from icub_jump_env.config import JumpConfig
from icub_jump_env.evaluation.cli import default_config, parse
from icub_jump_env.shortcuts import Shortcuts
from icub_jump_env.simulation.opengl import import_mujoco
from icub_jump_env.versions import EnvName

if TYPE_CHECKING:
    from icub_jump_env.evaluation.episodes.contender import Contender


@dataclass(frozen=True, kw_only=True)
class EntryOptions:
    """What jumps.

    Attributes:
        config: The jump; every field of the environment's configuration is a flag.
        shortcuts: Fields inside its groups; they end up there.
        env: Whose defaults hold: the paper's jump (v0), or the strongest settings (v1).
        policy: Let this policy act; the jump is set up as its card says.

    Raises:
        ConfigError: If a value is out of range.
    """

    config: Annotated[JumpConfig, tyro.conf.arg(name="")] = field(default_factory=JumpConfig)
    shortcuts: Annotated[Shortcuts, tyro.conf.arg(name="")] = field(default_factory=Shortcuts)
    env: EnvName = "ICubJump-v0"
    policy: Path | None = None

    def __post_init__(self) -> None:
        store(self, config=self.config.replace(**vars(self.shortcuts)), shortcuts=Shortcuts())

    def contender(self) -> Contender:
        """What acts.

        Raises:
            ICubJumpError: If the policy cannot be read, or was made for another jump.
        """
        from icub_jump_env.evaluation.episodes.contender import check_contender, read_contenders

        (contender,) = read_contenders([str(self.policy or "baseline")])
        check_contender(contender, self.config)
        return contender


Entry = TypeVar("Entry", bound=EntryOptions)


def parse_entry(kind: type[Entry], arguments: Sequence[str], **required: Any) -> Entry:
    """Parse a command line; on an error exit with one line.

    Args:
        kind: What to parse it into.
        arguments: The words of the command line.
        required: Fields without a default, as ``tyro.MISSING``.

    Raises:
        ConfigError: If a value is out of range.
    """
    options = parse(kind, arguments, kind(config=default_config(arguments), **required))
    import_mujoco()
    return options
