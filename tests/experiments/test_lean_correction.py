"""The experiment on the correction of the lean."""

from rich.console import Console

from experiments import lean_correction
from experiments.lean_correction import LeanOptions, compare, tune


def text(table):
    console = Console(record=True, width=160)
    console.print(table)
    return console.export_text()


def test_each_gain_and_each_regime_has_its_row(monkeypatch):
    monkeypatch.setattr(lean_correction, "GAINS", (0.0, 7.5))
    regimes = {name: lean_correction.REGIMES[name] for name in ("full", "landing")}
    monkeypatch.setattr(lean_correction, "REGIMES", regimes)
    options, quiet = LeanOptions(episodes=1, env="ICubJump-v0"), Console(quiet=True)
    tuned = text(tune(options, quiet))
    assert "7.5" in tuned
    compared = text(compare(options, quiet))
    assert compared.count("full") == compared.count("landing") == 2
    assert compared.count("torque") == 2
