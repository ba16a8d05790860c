"""The presets as Markdown tables, for docs/simulation.md.

``python -m icub_jump_env.simulation.tables actuators`` (or ``sensors``,
``randomization``) prints one.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Mapping
from typing import Any

from icub_jump_env.simulation.actuators.config import ACTUATORS
from icub_jump_env.simulation.randomization import RANDOMIZATIONS
from icub_jump_env.simulation.sensor_models import SENSORS

PRESETS: Mapping[str, Mapping[Any, Any]] = {
    "actuators": ACTUATORS,
    "sensors": SENSORS,
    "randomization": RANDOMIZATIONS,
}


def preset_table(kind: str) -> str:
    """One row per field, one column per preset."""
    presets = {name: _fields(preset) for name, preset in PRESETS[kind].items()}
    columns = list(presets)
    names = list(dict.fromkeys(name for fields in presets.values() for name in fields))
    rows = [f"| | {' | '.join(columns)} |", "|---" * (1 + len(columns)) + "|"]
    for name in names:
        cells = (presets[column].get(name, "") for column in columns)
        rows.append(f"| `{name}` | {' | '.join(cells)} |")
    return "\n".join(rows)


def _fields(preset: Any, prefix: str = "") -> dict[str, str]:
    """Values by dotted name, as words."""
    fields: dict[str, str] = {}
    for field in dataclasses.fields(preset):
        name, value = prefix + field.name, getattr(preset, field.name)
        if dataclasses.is_dataclass(value):
            fields |= _fields(value, name + ".")
        elif isinstance(value, tuple):
            fields[name] = " to ".join(_number(bound) for bound in value)
        else:
            fields[name] = value if isinstance(value, str) else _number(value)
    return fields


def _number(value: float) -> str:
    return f"{value:.4g}"


if __name__ == "__main__":
    print(preset_table(sys.argv[1]))
