"""Nothing is judged on episodes that chose it."""

import itertools

from agents.checkpoints import segment_seeds
from agents.options import TrainOptions
from agents.training import MOST_CHECKPOINTS
from experiments import seeds
from experiments.evidence import ABLATION_SEEDS, HEADLINE_SEEDS


def test_tuning_selection_test_and_training_share_no_episode():
    jobs = TrainOptions().jobs
    training = {
        seed
        for run in {*HEADLINE_SEEDS, *ABLATION_SEEDS}
        for number in range(MOST_CHECKPOINTS)
        for seed in segment_seeds(run, number, jobs)
    }
    held_out = (
        seeds.TEST, seeds.FELT_TEST, seeds.REACTING_TEST, seeds.PLANNER_TEST, seeds.FORESIGHT_TEST,
        *seeds.LANDING_TEST.values(),
    )  # fmt: skip
    uses = [
        set(seeds.TUNING),
        set(seeds.FELT_TUNING),
        *map(set, held_out),
        set(seeds.SELECTION),
        training,
    ]
    for one, other in itertools.combinations(uses, 2):
        assert not one & other
