"""A Ray cluster of two nodes, all on this machine."""

import contextlib
import os
from unittest.mock import patch

import pytest

from icub_jump_env.workers import THREADS


@contextlib.contextmanager
def two_nodes():
    """Its address, and what kills the second node; each has one processor.

    Their own environment asks for many threads.
    """
    ray = pytest.importorskip("ray")
    utils = pytest.importorskip("ray.cluster_utils")
    with patch.dict(os.environ, dict.fromkeys(THREADS, "7")):
        nodes = utils.Cluster(
            initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False}
        )
        second = nodes.add_node(num_cpus=1)
    try:
        yield nodes.address, lambda: nodes.remove_node(second, allow_graceful=False)
    finally:
        ray.shutdown()
        nodes.shutdown()
